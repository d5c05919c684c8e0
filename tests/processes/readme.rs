//! The driver of the README, as it stands there, connects a machine.

use std::sync::Mutex;
use std::time::Duration;
use std::{fs, thread};

use hexad::config::Config;
use hexad::control::signals::state::State;
use hexad::messages::StatusMessage;
use hexad::model::LEGS;
use hexad::plant::simulator::Simulator;
use hexad::realtime::clock::{Grid, sleep_until};
use hexad::realtime::setup::scheduling;

use crate::support::machine::{Machine, PERIOD_NS};
use crate::support::recorder::Recorder;
use crate::support::trio::{let_pass, start_daemon};
use crate::support::{operator, peer};

include!("support/driver.in");

/// What the driver drives: it takes functions, which know nothing of a test.
static MACHINE: Mutex<Option<Driven>> = Mutex::new(None);

struct Driven {
    simulator: Simulator,
    force: Option<[f64; LEGS]>,
    tick_ns: u64,
    ends: bool,
}

fn with_machine<T>(act: impl FnOnce(&mut Driven) -> T) -> T {
    act(MACHINE.lock().expect("no panic while it was held").as_mut().expect("set before the driver starts"))
}

/// Waits for the drives' next cycle.
fn lengths() -> [f64; LEGS] {
    while with_machine(|machine| machine.ends) {
        thread::park();
    }
    let tick_ns = with_machine(|machine| machine.tick_ns);
    sleep_until(tick_ns);
    with_machine(|machine| {
        let next_ns = Grid::new(PERIOD_NS, 0).next_after(monotonic_ns());
        machine.simulator.advance((next_ns - tick_ns) as f64 * 1e-9, machine.force.as_ref());
        machine.tick_ns = next_ns;
        machine.simulator.leg_motion().length_m
    })
}

fn push(force: [f64; LEGS]) {
    with_machine(|machine| machine.force = Some(force));
}

fn brake() {
    with_machine(|machine| machine.force = None);
}

#[test]
#[apply(beside_others)]
fn the_driver_of_the_readme_connects_a_machine() {
    let driver = include_str!("support/driver.in");
    assert!(
        include_str!("../../README.md").contains(&format!("```rust\n{driver}```")),
        "the README has another driver"
    );

    // The machine that it names.
    let mut machine = Machine::patient("readme");
    let text = fs::read_to_string(&machine.file).expect("the machine file");
    fs::write(&machine.file, text.replace(&machine.name, "fried2008")).expect("a machine file");
    machine.name = "fried2008".into();
    let config = Config::load(&machine.file).expect("the machine file");

    let plant = &config.deployment.plant;
    let simulator = Simulator::new(&config.machine, plant.brake_deceleration_m_s2, plant.step_s);
    let tick_ns = Grid::new(PERIOD_NS, 0).next_after(monotonic_ns());
    *MACHINE.lock().expect("not yet used") = Some(Driven { simulator, force: None, tick_ns, ends: false });
    let driver = thread::spawn(|| {
        let _ = scheduling::fifo_priority(1);
        drive(lengths, push, brake)
    });

    let daemon = start_daemon(&machine);
    let peer = peer::start(&machine);
    let recorder = Recorder::start(&machine.name);
    operator::engage(&machine);
    let_pass(Duration::from_millis(500));
    operator::does(&machine, "stop", &[], &["standby"]);
    daemon.stops();
    drop(peer);
    // It waits for its drives from now on.
    with_machine(|machine| machine.ends = true);
    assert!(!driver.is_finished(), "the driver ended: {:?}", driver.join());

    let active = |status: &&StatusMessage| status.state == State::Active as u32;
    let statuses = recorder.finish().statuses;
    let mut off: Vec<_> =
        statuses.iter().filter(active).map(|status| status.position_error_m[0].abs()).collect();
    off.sort_unstable_by(f64::total_cmp);
    println!("{} cycles under control, typically {:.1e} m off", off.len(), off[off.len() / 2]);
    assert!(off.len() > 100 && (1e-12..50e-6).contains(&off[off.len() / 2]));
}
