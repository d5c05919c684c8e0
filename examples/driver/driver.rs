//! A driver to copy: measures, publishes, applies forces, brakes when none may be applied.
//!
//!     cargo run --example driver -- fried2008
//!
//! Replace `fake_drive.rs` by your drives, and the sleep by an absolute timer at their rate. The rest is what every driver has
//! to do: the stamp of the instant of sampling, a watchdog, drives that report that they are ready, brakes closed at every end.
//! Run it below the daemon's priorities, 80 and 79: `chrt -f 70 target/release/examples/driver`.

mod fake_drive;

use std::env;
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

use fake_drive::{ALL_LEGS, FakeDrive};
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, ForceMessage, MeasuredMessage};

const PERIOD_NS: u64 = 1_000_000;

/// Brakes close when the newest force is older than this \[ns\].
const WATCHDOG_NS: u64 = 20_000_000;

/// Bits of `drive_valid`: all four fields are filled in.
const ALL_FIELDS: u32 = 0xf;

static IS_ENDING: AtomicBool = AtomicBool::new(false);

/// What the drives measure and report.
fn measurement(drive: &FakeDrive) -> MeasuredMessage {
    MeasuredMessage {
        length_m: drive.length_m,
        force_n: drive.force_n,
        drive_valid: ALL_FIELDS,
        drive_enabled: if drive.is_enabled { ALL_LEGS } else { 0 },
        brake_open: if drive.brake_is_open() { ALL_LEGS } else { 0 },
        ..MeasuredMessage::default()
    }
}

fn sleep_until(instant_ns: u64) {
    sleep(Duration::from_nanos(instant_ns.saturating_sub(monotonic_ns())));
}

fn main() -> Result<(), Box<dyn Error>> {
    let machine = env::args().nth(1).unwrap_or("fried2008".into());
    ctrlc::set_handler(|| IS_ENDING.store(true, Ordering::Relaxed))?;
    let bus = Bus::join(&machine)?;
    let mut forces = bus.subscriber::<ForceMessage>(8)?;
    let mut measured = bus.publisher::<MeasuredMessage>()?;
    let (mut drive, mut newest, mut was_open) = (FakeDrive::default(), ForceMessage::default(), false);
    let mut tick_ns = monotonic_ns();
    let mut sampled_ns = tick_ns;
    while !IS_ENDING.load(Ordering::Relaxed) {
        tick_ns += PERIOD_NS;
        sleep_until(tick_ns);
        let now_ns = monotonic_ns();
        drive.advance((now_ns - sampled_ns) as f64 * 1e-9);
        sampled_ns = now_ns;
        measured.publish(sampled_ns, measurement(&drive))?;
        // Without new messages the newest becomes too old: this is the watchdog.
        newest = forces.receive_latest().unwrap_or(newest);
        let is_open = newest.may_be_applied(monotonic_ns(), WATCHDOG_NS);
        if is_open {
            drive.apply(newest.force_n);
        } else {
            drive.brake();
        }
        if is_open != was_open {
            println!("brakes {}", if is_open { "open" } else { "closed" });
        }
        was_open = is_open;
        if now_ns > tick_ns + PERIOD_NS {
            // After a pause of the host: no burst of periods that are past.
            tick_ns = now_ns;
        }
    }
    drive.brake();
    println!("brakes closed, the driver ends");
    Ok(())
}
