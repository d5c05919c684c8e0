//! The daemon is held (SIGSTOP) for known times at 1 kHz, under each answer to an overrun.
//!
//! The host holds it too, whenever it likes. So what must hold, holds of every step from one published cycle
//! to the next, whoever held the daemon; and what a hold alone does is asked of one of several holds.

use std::collections::HashSet;
use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::daemon::report::Report;
use hexad::messages::ForceMessage;

use crate::support::machine::{Machine, PATIENT, PERIOD_NS, TIMEOUT_NS};
use crate::support::peer::Controlled;
use crate::support::recorder::{Recorder, Recording};
use crate::support::steps::{Step, steps};
use crate::support::trio::{let_pass, start_daemon};
use crate::support::{operator, rules};

/// Shorter than every timeout, longer than what is caught up.
const HOLD: Duration = Duration::from_millis(30);
const HOLDS: usize = 8;
const BETWEEN: Duration = Duration::from_millis(100);

/// From a signal sent to all threads stopped, and on the other side from the last point to the wake-up.
const SLACK_POINTS: u64 = 3;

/// `realtime.max_catch_up`.
const MOST: u64 = 4;

/// The daemon is held from the first instant to the second, at the least.
type Hold = (u64, u64);

/// More than enough to have 0.1 s without one.
const MOST_MISSES: usize = 50;

/// A busy machine can keep the test itself from ending a hold before the timeouts; not each time.
const ATTEMPTS: usize = 3;

fn held(keys: &str) -> (Vec<Hold>, Recording, Report) {
    for _ in 0..ATTEMPTS {
        let (holds, recording, report) = attempt(keys);
        let silence_ns = |step: &Step| step.after.header.time_ns - step.before.release_ns;
        let longest_ns = steps(&recording).iter().map(silence_ns).max().expect("steps");
        if longest_ns < TIMEOUT_NS / 4 * 3 {
            return (holds, recording, report);
        }
        println!("{keys}: held for {} us, again", longest_ns / 1000);
    }
    panic!("held for too long in each of {ATTEMPTS} attempts");
}

fn attempt(keys: &str) -> (Vec<Hold>, Recording, Report) {
    let machine =
        Machine::with("overruns", &format!("[realtime]\nlate_wakeup_us = 500.0\n{keys}\n{PATIENT}"));
    let recorder = Recorder::start(&machine.name);
    let daemon = start_daemon(&machine);
    let Controlled { peer: _peer, mut daemon, plant, machine } = Controlled::ready(machine, daemon);
    let mut holds = vec![];
    for _ in 0..HOLDS {
        in_control(&machine);
        let_pass(BETWEEN);
        daemon.hold();
        holds.push(let_pass(HOLD));
        daemon.signal("CONT");
    }
    let (_, end_ns) = let_pass(BETWEEN);
    recorder.until("the daemon goes on", |recording| {
        recording.forces.last().filter(|force| force.header.time_ns > end_ns).map(drop)
    });
    daemon.must_run();
    daemon.stops();
    plant.stops();
    let recording = recorder.finish();
    rules::hold(&recording);
    (holds, recording, Report::read(&machine.path("report.json")).expect("the report"))
}

/// Engages, and out of a fault too: where a miss is one, the host can cause it at any time.
fn in_control(machine: &Machine) {
    let refused = |_: &usize| {
        let ended = operator::ask(machine, "engage", &["--wait"]);
        assert!(
            ended.status.success() || ended.stderr.contains(DiagnosticCode::DeadlineMissed.name()),
            "{}",
            ended.stderr
        );
        !ended.status.success()
    };
    for _ in (0..MOST_MISSES).take_while(refused) {
        // It may still be coming to rest.
        while !operator::ask(machine, "clear", &[]).status.success() {}
    }
}

/// The steps that have to do with a hold: from the last cycle before it to the end of the burst that may
/// follow.
fn of_a_hold<'s>(steps: &'s [Step], hold: &Hold) -> &'s [Step] {
    let (from_ns, to_ns) = *hold;
    let until = |instant_ns: u64| steps.partition_point(|step| step.after.header.time_ns < instant_ns);
    let woken_ns = steps[until(to_ns)].after.header.time_ns;
    &steps[until(from_ns)..=until(woken_ns + 3 * PERIOD_NS)]
}

fn sum(steps: &[Step], count: impl Fn(&Step) -> u64) -> u64 {
    steps.iter().map(count).sum()
}

/// Points that passed in a hold for sure.
fn points_in(hold: &Hold) -> u64 {
    ((hold.1 - hold.0) / PERIOD_NS).saturating_sub(SLACK_POINTS)
}

/// Every cycle that was not in time has one reason, counted once: it was late to wake or the one before it
/// computed too long. A cycle that is caught up has the reason of the one it follows at once, which may be in
/// the step before: woken just less than five points late, a cycle ends after the fifth, and it is skipped next.
fn every_miss_has_its_reason(steps: &[Step]) {
    let mut reason = false;
    for step in steps {
        reason = step.late + step.overruns >= 1 || (step.caught_up > 0 && reason);
        assert!(step.late <= step.cycles, "a wake-up is late once: {step:#?}");
        assert!(step.skipped == 0 || reason, "skipped for no reason: {step:#?}");
    }
}

#[test]
#[apply(beside_others)]
fn skip_counts_every_point_and_never_bursts() {
    let (holds, recording, report) = held("on_overrun = \"skip\"");
    let steps = steps(&recording);
    every_miss_has_its_reason(&steps);
    for step in steps.iter().filter(|step| step.cycles == 1) {
        assert_eq!(
            step.skipped + 1,
            (step.after.release_ns - step.before.release_ns) / PERIOD_NS,
            "{step:#?}"
        );
    }
    for hold in &holds {
        let of = of_a_hold(&steps, hold);
        let [skipped, late] = [sum(of, |step| step.skipped), sum(of, |step| step.late + step.overruns)];
        println!("skip: held for {} us, {skipped} skipped, {late} late", (hold.1 - hold.0) / 1000);
        assert!(skipped >= points_in(hold) && late >= 1, "{hold:?}: {of:#?}");
    }
    let once = |hold| {
        matches!(
            of_a_hold(&steps, hold).iter().find(|step| step.skipped >= points_in(hold)),
            Some(Step { cycles: 1, late: 1, overruns: 0, .. })
        )
    };
    assert!(holds.iter().any(once), "a hold is one late wake-up: {steps:#?}");
    assert_eq!((report.deadline_misses.caught_up, report.faults.len()), (0, 0), "{report:#?}");
}

#[test]
#[apply(beside_others)]
fn catch_up_runs_at_most_so_many_at_once() {
    let (holds, recording, report) = held(&format!("on_overrun = \"catch_up\"\nmax_catch_up = {MOST}"));
    let steps = steps(&recording);
    every_miss_has_its_reason(&steps);
    let counted: Vec<_> = holds
        .iter()
        .map(|hold| {
            let of = of_a_hold(&steps, hold);
            let [skipped, late, caught_up] = [
                sum(of, |step| step.skipped),
                sum(of, |step| step.late + step.overruns),
                sum(of, |step| step.caught_up),
            ];
            println!(
                "catch_up: held for {} us, {skipped} skipped, {caught_up} caught up",
                (hold.1 - hold.0) / 1000
            );
            assert!(caught_up >= MOST, "as many as it may: {of:#?}");
            assert!(skipped + MOST >= points_in(hold), "the others are skipped: {of:#?}");
            (late, caught_up)
        })
        .collect();
    assert!(counted.contains(&(1, MOST)), "late or overrun, and caught up, of each hold: {counted:?}");
    assert!(report.faults.is_empty(), "{:#?}", report.faults);
}

#[test]
#[apply(beside_others)]
fn fault_stops_from_the_cycle_after_a_miss_on_and_from_no_other() {
    let (holds, recording, report) = held("on_overrun = \"fault\"");
    let missed = DiagnosticCode::DeadlineMissed;
    let steps = steps(&recording);
    every_miss_has_its_reason(&steps);
    let stops = |step: &Step| {
        let now = State::from_number(step.after.state).expect("a state");
        now == State::Stopping && step.after.diagnostic_code == missed as u32
    };
    let followed = [State::Engaging as u32, State::Active as u32];
    let mut stopped = HashSet::new();
    for step in steps.iter().filter(|step| step.cycles == 1 && followed.contains(&step.before.state)) {
        assert_eq!(stops(step), step.skipped > 0, "it stops exactly where points were missed: {step:#?}");
        stopped.extend(stops(step).then_some(step.number));
    }
    println!("fault: {} holds, stops in cycles {stopped:?}", holds.len());
    assert!(!stopped.is_empty(), "no step was seen whole");
    for step in steps.iter().filter(|step| step.cycles == 1 && step.before.state == State::Stopping as u32) {
        let then = State::from_number(step.after.state).expect("a state");
        let asked = step.before.diagnostic_code == DiagnosticCode::OperatorRequest as u32;
        let latched =
            [State::Stopping, State::Fault].contains(&then) && step.after.diagnostic_code == missed as u32;
        assert!(asked || latched, "under control to rest, then a fault: {step:#?}");
    }
    assert!(report.faults.len() >= HOLDS - 1, "one for each hold: {:#?}", report.faults);
    for fault in &report.faults {
        assert_eq!((fault.number, fault.name.as_str()), (109, missed.name()), "{fault:#?}");
    }
    let state = |force: &ForceMessage| State::from_number(force.state);
    let mut whole = 0;
    for [hold, next] in holds.windows(2).map(|pair| [pair[0], pair[1]]) {
        let [from, to] =
            [hold.0, next.0].map(|ns| recording.forces.partition_point(|force| force.header.time_ns < ns));
        // The host may have caused a miss of its own just before: then there is nothing to stop.
        if from == 0 || state(&recording.forces[from - 1]) != Some(State::Active) {
            continue;
        }
        let states: Vec<_> = recording.forces[from..to].iter().map(state).collect();
        // Stopping at rest and engaging on the setpoint may last a single cycle.
        for state in [State::Fault, State::Active] {
            assert!(states.contains(&Some(state)), "{} after {hold:?}", state.name());
        }
        whole += 1;
    }
    assert!(whole > 0, "each hold found it stopped");
}
