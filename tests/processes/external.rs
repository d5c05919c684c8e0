//! `release = "external"`: the measured message is the clock.

use std::collections::HashSet;
use std::thread;
use std::time::{Duration, Instant};

use hexad::commands::in_step::Operator;
use hexad::config::Config;
use hexad::control::diagnostic::DiagnosticCode;
use hexad::control::state::{Request, State};
use hexad::daemon::report::Report;
use hexad::messages::Bus;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use hexad::plant::simulator::Simulator;
use hexad::realtime::setup::scheduling;

use crate::support::children::HANG;
use crate::support::machine::{Machine, PATIENT, PERIOD_NS, TIMEOUT_NS};
use crate::support::peer::Controlled;
use crate::support::recorder::{Recorder, Recording};
use crate::support::steps::{Step, steps};
use crate::support::trio::{let_pass, start_daemon, valid_after};
use crate::support::{operator, peer, turns};

fn external(test: &str) -> Machine {
    Machine::with(test, &format!("[realtime]\nrelease = \"external\"\n{PATIENT}"))
}

#[test]
fn a_cycle_per_message_and_silence_is_noticed() {
    let _turn = turns::beside_others();
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
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);

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
    let lost: Vec<_> = report.faults.iter().map(|fault| (fault.number, fault.name.as_str())).collect();
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

/// Cycles of the lock-step, at 1 kHz of simulated time.
const CYCLES: usize = 4000;

/// When simulated time begins: it has nothing to do with ours.
const BEGINS_NS: u64 = 7_000_000;

/// A simulator that waits for each force and then goes on at once: simulated time runs as fast as the
/// daemon answers, and nothing is missed.
#[test]
fn in_lock_step_simulated_time_is_faster_than_real_time() {
    let _turn = turns::alone();
    // In a thread of its own, whose priority ends with it.
    thread::spawn(lock_step).join().expect("the simulator");
}

fn lock_step() {
    // Or a busy machine makes it late, and with it simulated time.
    let _ = scheduling::fifo_priority(1);
    let machine = external("lock-step");
    let daemon = start_daemon(&machine);
    daemon.says("running");
    let config = Config::load(&machine.file).expect("the machine file");
    let plant = &config.deployment.plant;
    let mut simulator = Simulator::new(&config.machine, plant.brake_deceleration_m_s2, plant.step_s);
    let bus = Bus::join(&machine.name).expect("to join");
    let mut measured = bus.publisher::<MeasuredMessage>().expect("to publish");
    let mut setpoints = bus.publisher::<SetpointMessage>().expect("to publish");
    let mut forces = bus.subscriber::<ForceMessage>(8).expect("to subscribe");
    let mut operator = Operator::new(&bus).expect("to ask");
    let mut took = vec![];
    let mut under_control = 0;
    let began = Instant::now();
    for time_ns in (BEGINS_NS..).step_by(PERIOD_NS as usize) {
        let asked = Instant::now();
        let legs = simulator.leg_motion();
        let message = MeasuredMessage {
            length_m: legs.length,
            length_rate_m_s: legs.rate,
            rates_valid: 1,
            ..MeasuredMessage::default()
        };
        setpoints.publish(time_ns, peer::setpoint(time_ns)).expect("to send");
        measured.publish(time_ns, message).expect("to send");
        let force = loop {
            match forces.receive_latest().filter(|force| force.release_ns == time_ns) {
                Some(force) => break force,
                None => std::hint::spin_loop(),
            }
            assert!(asked.elapsed() < HANG, "no force for {time_ns}");
        };
        simulator.advance(PERIOD_NS as f64 * 1e-9, (force.valid == 1).then_some(&force.force_n));
        under_control += usize::from(force.valid == 1);
        took.push(asked.elapsed());
        match (took.len() < CYCLES, force.valid) {
            (true, 0) if force.diagnostic_code == DiagnosticCode::ReadyToEngage as u32 => {
                operator.send(Request::Engage).expect("to send");
            }
            (false, 0) => break,
            (false, _) => operator.send(Request::Stop).expect("to send"),
            _ => {}
        }
    }
    let speed = took.len() as f64 * PERIOD_NS as f64 * 1e-9 / began.elapsed().as_secs_f64();
    daemon.stops_on("TERM", HANG);
    let report = Report::read(&machine.path("report.json")).expect("the report");
    took.sort_unstable();
    let median = took[CYCLES / 2];
    println!(
        "lock-step: {speed:.1} times real time, median {median:?}; {:?}; {:?}",
        report.tracking, report.end_to_end_ns
    );
    // More only before the first message, should that be late.
    assert!(report.cycles >= CYCLES as u64 && report.deadline_misses.skipped == 0, "{report:#?}");
    assert!(
        report.faults.is_empty() && under_control > CYCLES - 20,
        "under control in {under_control} cycles: {report:#?}"
    );
    let tracking = &report.tracking;
    assert!((1e-9..50e-6).contains(&tracking.position_rms_m), "{tracking:#?}");
    assert!(median < Duration::from_nanos(PERIOD_NS), "slower than real time: {median:?} for a cycle");
}
