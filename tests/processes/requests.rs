//! `hexad engage | stop | park | clear | off | estop`: carried out, or refused with the reason.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::{Request, State};
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, CommandMessage, SetpointMessage};

use crate::support::children::{Ended, HANG, Hexad};
use crate::support::machine::{Machine, PATIENT, PERIOD_NS};
use crate::support::operator::{ask, clear, does, engage, is_refused};
use crate::support::recorder::{Recorder, Recording};
use crate::support::trio::{Trio, start_daemon, start_plant};
use crate::support::witness::Witness;
use crate::support::{peer, rules, turns};

/// Limits with which the daemon's own motions take one to three seconds: time to do something during them.
const SLOW: &str = "[limits]\nacceleration_m_s2 = 0.05\njerk_m_s3 = 0.2\nautonomous_scale = 1.0\n";

/// Valid forces that may still be sent after a request: of the cycle that runs, of the one after it if its
/// inputs had been read, and one that waits to be sent.
const IN_FLIGHT: usize = 3;

/// A busy machine can be late for a motion that takes half a second; not each time.
const ATTEMPTS: usize = 5;

#[test]
fn each_request_does_what_it_says() {
    let _turn = turns::beside_others();
    let mut trio = Trio::in_motion("requests");
    let machine = &trio.machine;
    does(machine, "engage", &[], &["active"]);
    is_refused(machine, "clear", &[], "clear was refused: not possible in state active\n");
    does(machine, "stop", &[], &["standby"]);
    trio.stands();
    trio.replay();
    let machine = &trio.machine;
    engage(machine);
    trio.moves_after(monotonic_ns());
    does(machine, "park", &[], &["off"]);
    trio.daemon.says("off: requested by the operator");
    let at_home = |recording: &Recording| {
        let measured = recording.measured.last().filter(|measured| rules::stands(measured))?;
        ((measured.x[3] - 1.1).abs() < 1e-3).then_some(())
    };
    trio.recorder.until("the platform stands at home", at_home);
    trio.replay();
    let machine = &trio.machine;
    engage(machine);
    trio.moves_after(monotonic_ns());
    does(machine, "off", &[], &["off"]);
    trio.stands();
    does(machine, "stop", &[], &["off"]);
    does(machine, "clear", &[], &["off", "standby"]);
    does(machine, "park", &[], &["off"]);
    trio.replay();
    let machine = &trio.machine;
    engage(machine);
    trio.moves_after(monotonic_ns());
    does(machine, "estop", &[], &["fault"]);
    trio.stands();
    for (request, words) in [
        ("engage", "engage was refused: not possible in state fault (emergency stop); hexad clear first"),
        ("park", "park was refused: not possible in state fault (emergency stop); hexad clear first"),
        ("stop", "stop was not completed: the daemon is in fault: emergency stop; clear when it is safe"),
    ] {
        is_refused(machine, request, &[], words);
    }
    for request in ["estop", "off"] {
        does(machine, request, &[], &["fault"]);
    }
    clear(machine);
    trio.replay();
    let machine = &trio.machine;
    engage(machine);
    trio.moves_after(monotonic_ns());
    trio.finish();
}

#[test]
fn what_is_refused_is_refused_with_the_reason() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("refused");
    let recorder = Recorder::start(&machine.name);
    let daemon = start_daemon(&machine);
    daemon.says("off: no measurement");
    for request in ["engage", "park"] {
        let words = format!("{request} was refused: no measurement; start the driver or the plant");
        is_refused(&machine, request, &[], &words);
    }
    let plant = start_plant(&machine);
    daemon.says("standby: no setpoint");
    is_refused(
        &machine,
        "engage",
        &[],
        "engage was refused: no setpoint; start a setpoint source, then engage",
    );
    let words =
        "engage was not completed within 0.5 s: the daemon is in standby: no setpoint; start a setpoint";
    is_refused(&machine, "engage", &["--wait", "--within", "0.5"], words);
    let offered = Offered::start(&machine, 0.01);
    daemon.says("standby: setpoint too far from the platform");
    let words = "engage was refused: setpoint too far from the platform: the difference between setpoint and platform is 5 times \
         the tolerance control.engage_*; start the setpoints where the platform stands, or set setpoint.approach = true (under control engage \
         is enough): the platform then moves to them (10.000 mm and 0.000 mrad away)";
    is_refused(&machine, "engage", &[], words);
    let waits = Hexad::start(&machine, "engage", &["--wait"]);
    let asked =
        |recording: &Recording| recording.commands.iter().filter(|asked| asked.request == 1).nth(9).map(drop);
    recorder.until("it asks again and again", asked);
    waits.signal("INT");
    let Ended { status, stderr, .. } = waits.ends_within(HANG);
    let said = "hexad: waiting: setpoint too far from the platform: ";
    assert!(status.code() == Some(1) && stderr.starts_with(said), "{stderr}");
    assert!(stderr.ends_with("\nhexad: interrupted\n") && stderr.lines().count() == 2, "{stderr}");
    // Who stops a platform stops also those who wait to move it.
    let waits = Hexad::start(&machine, "engage", &["--wait"]);
    waits.says("waiting: setpoint too far");
    does(&machine, "stop", &[], &["standby"]);
    let Ended { status, stderr, .. } = waits.ends_within(HANG);
    assert!(status.code() == Some(1) && stderr.ends_with(": a later request has replaced it\n"), "{stderr}");
    drop(offered);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    assert!(recording.forces.iter().all(|force| force.valid == 0), "nobody was allowed to engage");
}

#[test]
fn without_a_daemon_it_says_so() {
    let machine = Machine::patient("no-daemon");
    for request in Request::ALL {
        let Ended { status, stdout, stderr } = ask(&machine, request.name(), &[]);
        assert_eq!((status.code(), stdout.as_str()), (Some(2), ""), "{}: {stderr}", request.name());
        assert!(stderr.contains(&format!("no daemon runs for {}: ", machine.name)), "{stderr}");
    }
}

#[test]
fn estop_takes_the_force_from_every_state() {
    let _turn = turns::beside_others();
    let machine = Machine::with("estop", &format!("{SLOW}{PATIENT}"));
    let recorder = Recorder::start(&machine.name);
    let witness = Witness::start();
    let daemon = start_daemon(&machine);
    daemon.says("off: no measurement");
    let ends = |state: State, begin: &[&str]| {
        let hit = (0..ATTEMPTS).any(|_| estop_in(&machine, &recorder, witness.as_ref(), state, begin));
        assert!(hit, "not once in {ATTEMPTS} attempts was it in time for {}", state.name());
    };
    ends(State::Off, &[]);
    let plant = start_plant(&machine);
    let _peer = peer::start(&machine);
    daemon.says("standby: ready to engage");
    ends(State::Standby, &[]);
    ends(State::Engaging, &["engage"]);
    ends(State::Active, &["engage"]);
    ends(State::Stopping, &["engage", "stop"]);
    ends(State::Parking, &["engage", "park"]);
    ends(State::Fault, &["estop"]);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    rules::hold(&recorder.finish());
}

/// Asks for one thing after the other, waits for a state during the last, and stops there; true if it was
/// still in that state. Afterwards the fault is cleared.
fn estop_in(
    machine: &Machine,
    recorder: &Recorder,
    witness: Option<&Witness>,
    state: State,
    requests: &[&str],
) -> bool {
    let from_ns = monotonic_ns();
    let begun = requests.split_last().map(|(last, first)| {
        first.iter().for_each(|_| engage(machine));
        Hexad::start(machine, last, if *last == "engage" { &["--wait"] as &[&str] } else { &[] })
    });
    recorder.until(state.name(), |recording| {
        let since = recording.forces.iter().rev().take_while(|force| force.header.time_ns > from_ns);
        since.into_iter().find(|force| force.state == state as u32).map(drop)
    });
    let asked_ns = monotonic_ns();
    does(machine, "estop", &[], &["fault"]);
    // The answer may be here before the request is recorded, and the one before it is not meant.
    let stopped_ns = recorder.until("the emergency stop is recorded, and a fault after it", |recording| {
        let is_it = |command: &&CommandMessage| command.request == Request::Estop as u32;
        let stopped_ns = recording.commands.iter().rfind(is_it)?.header.time_ns;
        let last = recording.forces.last().filter(|force| force.header.time_ns > stopped_ns)?;
        (stopped_ns >= asked_ns && last.state == State::Fault as u32).then_some(stopped_ns)
    });
    let recording = recorder.so_far();
    let first = recording.forces.partition_point(|force| force.header.time_ns < asked_ns);
    let after = recording.forces[first..].iter().filter(|force| force.header.time_ns > stopped_ns);
    let valid = after.filter(|force| force.valid == 1).count();
    let last = recording.forces.last().expect("forces");
    let paused_ns = witness.map_or(0, |witness| witness.paused_ns(stopped_ns, last.header.time_ns));
    let allowed = IN_FLIGHT + paused_ns.div_ceil(PERIOD_NS) as usize;
    assert!(valid <= allowed, "{valid} valid forces after the request, the host paused for {paused_ns} ns");
    assert_eq!(
        (last.valid, last.state, last.diagnostic_code),
        (0, State::Fault as u32, DiagnosticCode::EmergencyStop as u32)
    );
    let faults = recording.forces[first..]
        .iter()
        .position(|force| force.diagnostic_code == last.diagnostic_code)
        .expect("a fault");
    let before = recording.forces[(first + faults).saturating_sub(1)];
    drop(recording);
    if let Some(begun) = begun.filter(|_| before.state == state as u32 && state.has_control()) {
        let Ended { status, stderr, .. } = begun.ends_within(HANG);
        let told = state == State::Active
            || status.code() == Some(1)
                && stderr.contains("is in fault: emergency stop; clear when it is safe");
        assert!(told, "{}: {stderr}", state.name());
    }
    clear(machine);
    before.state == state as u32
}

/// A setpoint source that stands so far from home along x \[m\].
struct Offered {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Offered {
    fn start(machine: &Machine, away_m: f64) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let thread = {
            let (stop, name) = (stop.clone(), machine.name.clone());
            spawn(move || {
                let bus = Bus::join(&name).expect("to join");
                let mut setpoints = bus.publisher::<SetpointMessage>().expect("to publish");
                let mut message = SetpointMessage::default();
                message.x[3] = 1.1 + away_m;
                while !stop.load(Ordering::Relaxed) {
                    setpoints.publish(monotonic_ns(), message).expect("to send");
                    sleep(Duration::from_millis(1));
                }
            })
        };
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Offered {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
