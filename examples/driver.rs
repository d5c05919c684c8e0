//! A minimal driver: publishes measured leg lengths, applies forces, brakes when no valid force arrives.
//!
//!     cargo run --example driver --no-default-features --features client -- fried2008
//!
//! Its hardware is a stand-in: the legs of `config/fried2008.toml` hold their home lengths, whatever the force. A real driver
//! replaces it and the sleep, which should be an absolute timer at the rate of the drives.

use std::env;
use std::thread::sleep;
use std::time::Duration;

use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, ForceMessage, MeasuredMessage, PortError};

const PERIOD: Duration = Duration::from_millis(1);

/// Brakes close when the last valid force is older than this \[ns\].
const WATCHDOG_NS: u64 = 20_000_000;

/// Legs that hold their lengths, and the forces \[N\] on them; `None` while the brakes are closed.
#[derive(Default)]
struct Hardware {
    force: Option<[f64; 6]>,
}

impl Hardware {
    fn lengths(&self) -> [f64; 6] {
        [1.2033; 6]
    }

    fn set(&mut self, force: Option<[f64; 6]>) {
        match (self.force.is_some(), force) {
            (false, Some(force)) => println!("brakes open, forces {force:.1?} N"),
            (true, None) => println!("brakes closed"),
            _ => {}
        }
        self.force = force;
    }
}

fn main() -> Result<(), PortError> {
    let machine = env::args().nth(1).unwrap_or("fried2008".into());
    let bus = Bus::join(&machine)?;
    let mut forces = bus.subscriber::<ForceMessage>(8)?;
    let mut measured = bus.publisher::<MeasuredMessage>()?;
    let (mut hardware, mut last_valid_ns) = (Hardware::default(), 0);
    loop {
        let measurement = MeasuredMessage { length_m: hardware.lengths(), ..Default::default() };
        measured.publish(monotonic_ns(), measurement)?;
        sleep(PERIOD);
        let now_ns = monotonic_ns();
        if let Some(message) = forces.receive_latest() {
            let may_be_applied = message.may_be_applied(now_ns, WATCHDOG_NS);
            hardware.set(may_be_applied.then_some(message.force_n));
            if may_be_applied {
                last_valid_ns = message.header.time_ns;
            }
        }
        if now_ns - last_valid_ns > WATCHDOG_NS {
            hardware.set(None);
        }
    }
}
