//! `release = "external"`: the measured message is the clock.

use std::collections::HashSet;
use std::thread;
use std::time::Duration;

use hexad::config::Config;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::daemon::report::Report;
use hexad::messages::Bus;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use hexad::plant::simulator::Simulator;
use hexad::realtime::clock::{Grid, sleep_until};
use hexad::realtime::setup::scheduling;
use serde_json::json;

use crate::support::children::HANG;
use crate::support::machine::{Machine, PATIENT, PERIOD_NS, TIMEOUT_NS};
use crate::support::peer::Controlled;
use crate::support::recorder::{Recorder, Recording};
use crate::support::socket::Client;
use crate::support::steps::{Step, steps};
use crate::support::trio::{let_pass, start_daemon, valid_after};
use crate::support::{operator, peer};

fn external(test: &str) -> Machine {
    Machine::with(test, &format!("[realtime]\nrelease = \"external\"\n{PATIENT}"))
}

#[test]
#[ignore = "second tier: measures, so it runs alone"]
// Its daemon polls: on two processors it leaves others little.
#[apply(alone)]
fn a_cycle_per_message_and_silence_is_noticed() {
    let machine = external("external");
    let recorder = Recorder::start(&machine.name);
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(machine);
    let_pass(Duration::from_millis(500));

    let lost_ns = monotonic_ns();
    plant.signal("STOP");
    daemon.says("fault: measurement lost");
    plant.signal("CONT");
    operator::clear_and_engage(&machine);
    let (_, again_ns) = let_pass(Duration::from_millis(200));
    recorder.until("control is taken again", |recording| {
        recording.forces.last().filter(|force| valid_after(force, again_ns)).map(drop)
    });

    // More messages come in than the daemon has places for.
    daemon.hold();
    let (from_ns, to_ns) = let_pass(Duration::from_millis(50));
    daemon.signal("CONT");
    let_pass(Duration::from_millis(200));
    daemon.stops();
    plant.stops();

    let recording = recorder.finish();
    let report = Report::read(&machine.path("report.json")).expect("the report");
    let steps = steps(&recording);
    every_message_is_counted(&recording, &steps);
    let held: u64 = steps
        .iter()
        .filter(|step| (from_ns..).contains(&step.after.release_ns))
        .map(|step| step.skipped)
        .sum();
    println!("daemon held for {} us: {held} messages skipped", (to_ns - from_ns) / 1000);
    assert!(held > 0, "more messages than places, and none was skipped");
    let mut lost: Vec<_> = report.faults.iter().map(|fault| (fault.number, fault.name.as_str())).collect();
    // A busy host may hold the driver for as long once more.
    lost.dedup();
    assert_eq!(lost, [(DiagnosticCode::MeasurementLost as u32, DiagnosticCode::MeasurementLost.name())]);
    let typical_m = typical_error_m(&recording, lost_ns);
    println!("typically {typical_m:.1e} m from the setpoint");
    assert!((1e-12..50e-6).contains(&typical_m), "{typical_m} m");
    let (waits, messages) =
        (report.rt_thread.voluntary_switches, report.cycles + report.deadline_misses.skipped);
    assert!(waits <= messages, "more than a wait per message: {waits} for {messages}");
}

/// Median along the axis of the motion: while the host holds somebody the platform drifts, rightly.
fn typical_error_m(recording: &Recording, until_ns: u64) -> f64 {
    let tracked =
        |status: &&StatusMessage| status.header.time_ns < until_ns && status.state == State::Active as u32;
    let mut errors: Vec<_> =
        recording.statuses.iter().filter(tracked).map(|status| status.position_error_m[0].abs()).collect();
    errors.sort_unstable_by(f64::total_cmp);
    errors[errors.len() / 2]
}

/// A cycle for a message is computed for the instant of that message. Between two of them, the messages that
/// came are the cycles that ran plus those counted as skipped. A cycle without a message comes when there was
/// none for the timeout, and says so.
fn every_message_is_counted(recording: &Recording, steps: &[Step]) {
    let measured_ns: Vec<_> = recording.measured.iter().map(|measured| measured.header.time_ns).collect();
    let known: HashSet<_> = measured_ns.iter().copied().collect();
    let until = |instant_ns: u64| measured_ns.partition_point(|time_ns| *time_ns <= instant_ns) as u64;
    let mut silent = 0;
    for step in steps {
        let [before_ns, after_ns] = [step.before.release_ns, step.after.release_ns];
        if known.contains(&after_ns) {
            // What came in a silence is counted from its last message on.
            let before_ns = if known.contains(&before_ns) { before_ns } else { continue };
            assert_eq!(
                step.cycles + step.skipped,
                until(after_ns) - until(before_ns),
                "messages came: {step:#?}"
            );
        } else {
            silent += 1;
            assert_eq!((step.cycles, step.skipped), (1, 0), "{step:#?}");
            assert_eq!(
                (step.after.valid, step.after.diagnostic_code),
                (0, DiagnosticCode::MeasurementLost as u32),
                "{step:#?}"
            );
            assert!(after_ns - before_ns >= TIMEOUT_NS, "{step:#?}");
        }
    }
    println!("{} steps, {silent} cycles without a message", steps.len());
    assert!(silent >= 1 && steps.len() > 500, "{silent} of {}", steps.len());
}

/// When the clock of the drives began: it has nothing to do with ours.
const BEGINS_NS: u64 = 7_000_000;

/// Time between two requests \[ns\].
const ASKING_INTERVAL_NS: u64 = 20_000_000;

/// Cycles under control before the stamps stand still, and for which the driver goes on after it.
const CYCLES: usize = 1000;
const CYCLES_AFTER: usize = 1000;

/// A driver and a source whose stamps stand still: all ages stay zero, and forces would be valid for ever.
#[test]
#[ignore = "second tier: measures, so it runs alone"]
// Its daemon polls: on two processors it leaves others little.
#[apply(alone)]
fn stamps_that_stand_still_end_control() {
    let machine = external("frozen-stamps");
    let daemon = start_daemon(&machine);
    daemon.says("running");
    let (name, client) = (machine.name.clone(), Client::connect(&daemon));
    let config = Config::load(&machine.file).expect("the machine file");
    // In a thread of its own, whose priority ends with it.
    let valid =
        thread::spawn(move || drive_with_frozen_stamps(&name, &config, client)).join().expect("the driver");
    println!("{valid} valid forces after the stamps stood still");
    daemon
        .says("fault: time stamps do not advance with the clock: deviation of the clock of the stamps -0.4");
    let bound = (TIMEOUT_NS / PERIOD_NS) as usize;
    assert!(valid > bound / 2 && valid < 2 * bound, "{valid} valid forces");
    daemon.stops();
}

/// Number of valid forces after the stamps stood still.
fn drive_with_frozen_stamps(name: &str, config: &Config, mut operator: Client) -> usize {
    // Or a busy machine makes it late.
    let _ = scheduling::fifo_priority(1);
    let plant = &config.deployment.plant;
    let mut simulator = Simulator::new(&config.machine, plant.brake_deceleration_m_s2, plant.step_s);
    let bus = Bus::join(name).expect("to join");
    let mut measured = bus.publisher::<MeasuredMessage>().expect("to publish");
    let mut setpoints = bus.publisher::<SetpointMessage>().expect("to publish");
    let mut forces = bus.subscriber::<ForceMessage>(8).expect("to subscribe");
    let (began_ns, grid) = (monotonic_ns(), Grid::new(PERIOD_NS, 0));
    let (mut tick_ns, mut time_ns, mut force) = (began_ns, BEGINS_NS, None);
    let (mut under_control, mut after, mut valid_after, mut asked_ns) = (0, 0, 0, 0);
    while after < CYCLES_AFTER {
        assert!(monotonic_ns() < began_ns + HANG.as_nanos() as u64, "{under_control} cycles under control");
        let next_ns = grid.next_after(monotonic_ns());
        sleep_until(next_ns);
        simulator.advance((next_ns - tick_ns) as f64 * 1e-9, force.as_ref());
        tick_ns = next_ns;
        if under_control < CYCLES {
            time_ns = BEGINS_NS + tick_ns - began_ns;
        } else {
            after += 1;
        }
        let length_m = simulator.leg_motion().length_m;
        setpoints.publish(time_ns, peer::setpoint(time_ns)).expect("to send");
        measured.publish(time_ns, MeasuredMessage { length_m, ..Default::default() }).expect("to send");
        let Some(message) = forces.receive_latest() else { continue };
        let is_valid = message.valid == 1;
        force = is_valid.then_some(message.force_n);
        under_control += usize::from(is_valid);
        valid_after += usize::from(is_valid && after > 0);
        // The host may have held somebody.
        let is_fault = message.state == State::Fault as u32;
        let is_ready = message.diagnostic_code == DiagnosticCode::ReadyToEngage as u32;
        if (is_fault && after == 0 || is_ready) && tick_ns > asked_ns + ASKING_INTERVAL_NS {
            operator.request(if is_fault { "clear" } else { "engage" }, &json!({}));
            asked_ns = tick_ns;
        }
    }
    valid_after
}
