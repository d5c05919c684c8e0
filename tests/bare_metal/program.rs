//! A program with hexad-core without its feature `std` and nothing else: no standard library, no allocator, no C library.
//!
//! It is linked, never run. Whatever hexad needs beyond `core` is a name that the linker does not find, or a crate
//! that does not build for the target:
//!
//! ```sh
//! rustup target add thumbv7em-none-eabihf
//! cargo build --manifest-path tests/bare_metal/Cargo.toml --target thumbv7em-none-eabihf
//! ```
//!
//! Not with `--release`: what is linked is the same, and without lanes and floating point of 64 bits in hardware the
//! optimizer takes minutes.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use hexad_core::control::controller::{Controller, Output};
use hexad_core::control::parameters::Parameters;
use hexad_core::control::signals::inputs::Input;
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;
use hexad_core::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use hexad_core::plant::simulator::Simulator;

/// Where the processor would begin. A function whose address is used is linked with all that it calls.
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    black_box(Controller::new as fn(&Machine, Parameters) -> Controller);
    black_box(Controller::step as fn(&mut Controller, &Input) -> Output);
    black_box(Simulator::advance as fn(&mut Simulator, f64, Option<&[f64; LEGS]>));
    black_box(fit as fn(&Machine, BuiltInMotion, f64) -> FittedMotion);
    black_box(FittedMotion::at as fn(&FittedMotion, f64) -> _);
    stop()
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    stop()
}

fn stop() -> ! {
    loop {
        core::hint::spin_loop();
    }
}
