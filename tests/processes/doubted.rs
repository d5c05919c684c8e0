//! What a driver does not believe: forces that are damaged, old, of the future, or out of order never move the
//! platform and never keep the brakes open, and the plant says what it passed over.

use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::config::Config;
use hexad::messages::{Bus, MeasuredMessage, Message};
use hexad::model::LEGS;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::task::TaskState;

use crate::support::children::{HANG, Hexad};
use crate::support::forged::{Change, Forger};
use crate::support::machine::Machine;
use crate::support::trio::start_plant;

const PERIOD: Duration = Duration::from_millis(1);

const OPEN: &str = "valid force: brakes open";
const CLOSING: &str = "forces stopped arriving: brakes closing";

/// More than any clock has to do with now \[ns\].
const LONG_NS: u64 = 10_000_000_000;

/// What is wrong, and what the plant says about it.
const WRONG: [(Change, &str); 9] = [
    (|message| message.checksum ^= 1, "with a wrong checksum, or of a publisher that begins in the future"),
    (
        |message| message.force_n[3] += 1e-9,
        "with a wrong checksum, or of a publisher that begins in the future",
    ),
    // A damaged number of the source must not outrank those of good messages.
    (
        |message| message.header.epoch = u64::MAX,
        "with a wrong checksum, or of a publisher that begins in the future",
    ),
    (
        |message| resealed(message, |message| message.header.epoch = u64::MAX),
        "with a wrong checksum, or of a publisher that begins in the future",
    ),
    (
        |message| resealed(message, |message| message.header.schema -= 1),
        "of another schema: build all participants alike",
    ),
    (
        |message| resealed(message, |message| message.header.time_ns -= LONG_NS),
        "older than plant.force_timeout_ms",
    ),
    (|message| resealed(message, |message| message.header.time_ns += LONG_NS), "from the future"),
    (|message| resealed(message, |message| message.header.sequence = 1), "received before, or unreadable"),
    (|message| resealed(message, |message| message.header.epoch -= 1), "of an older daemon"),
];

fn resealed(message: &mut hexad::messages::ForceMessage, change: Change) {
    change(message);
    message.seal();
}

#[test]
#[apply(beside_others)]
fn a_driver_goes_by_good_messages_only() {
    let machine = Machine::patient("doubted");
    let plant = start_plant(&machine);
    plant.says("plant at rest");
    let bus = Bus::join(&machine.name).expect("to join");
    let mut forger = Forger::new(&bus, holding(&machine));
    send_until(&mut forger, |_| {}, &plant, OPEN, 1);
    for (number, (wrong, words)) in (1..).zip(WRONG) {
        send_until(&mut forger, wrong, &plant, CLOSING, number);
        assert!(plant.words().contains(&format!("rejected: a force {words}")), "{words}: {}", plant.words());
        send_until(&mut forger, |_| {}, &plant, OPEN, number + 1);
    }
    // One among good ones does no harm.
    for (wrong, _) in WRONG {
        (0..9).for_each(|_| send(&mut forger, |_| {}));
        send(&mut forger, wrong);
    }
    let words = plant.stops();
    assert_eq!(words.matches(CLOSING).count(), WRONG.len(), "{words}");
    for (_, reason) in WRONG {
        assert!(words.contains(&format!("rejected in total: forces {reason}")), "{reason}: {words}");
        assert_eq!(words.matches(&format!("rejected: a force {reason}")).count(), 1, "{reason}: {words}");
    }
}

/// Closed brakes before the first force; then all drives enabled, all brakes open, and the force that was sent.
#[test]
#[apply(beside_others)]
fn a_plant_reports_its_drives() {
    let machine = Machine::patient("reporting");
    let plant = start_plant(&machine);
    plant.says("plant at rest");
    let bus = Bus::join(&machine.name).expect("to join");
    let mut measured = bus.subscriber::<MeasuredMessage>(8).expect("a subscriber");
    let mut reports = |force_n: [f64; LEGS], drive_enabled: u32, brake_open: u32| {
        let began = Instant::now();
        let mut forger = Forger::new(&bus, force_n);
        loop {
            if drive_enabled != 0 {
                send(&mut forger, |_| {});
            }
            let Some(message) = measured.receive_latest() else { continue };
            let status =
                (message.drive_valid, message.drive_fault, message.drive_enabled, message.brake_open);
            if (status, message.force_n) == ((15, 0, drive_enabled, brake_open), force_n) {
                return;
            }
            assert!(began.elapsed() < HANG, "{status:?}, {:?}", message.force_n);
        }
    };
    reports([0.0; LEGS], 0, 0);
    reports(holding(&machine), 0b11_1111, 0b11_1111);
    plant.stops();
}

/// What holds the platform up at home.
fn holding(machine: &Machine) -> [f64; 6] {
    let machine = Config::load(&machine.file).expect("the machine file").machine;
    inverse_dynamics::<Exact>(&machine, &TaskState::at_rest(machine.home).motion()).expect("a regular pose")
}

fn send(forger: &mut Forger, change: Change) {
    forger.send(change);
    sleep(PERIOD);
}

/// Sends one message after the other until the plant has said this so many times.
fn send_until(forger: &mut Forger, change: Change, plant: &Hexad, words: &str, times: usize) {
    let began = Instant::now();
    while plant.words().matches(words).count() < times {
        assert!(began.elapsed() < HANG, "{words:?}, {times} times: {}", plant.words());
        send(forger, change);
    }
}
