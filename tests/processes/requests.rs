//! `hexad engage | stop | park | clear | off | estop`: carried out, or refused with the reason.

use hexad::messages::SetpointMessage;
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::request_word::number;

use crate::support::background::publish;
use crate::support::children::Hexad;
use crate::support::machine::Machine;
use crate::support::operator::{clear, does, engage, is_refused};
use crate::support::recorder::{Recorder, Recording};
use crate::support::rules;
use crate::support::trio::{Trio, start_daemon, start_plant};

/// The player that the last request has ended is followed by another one, under control and in motion.
fn moves_again(trio: &mut Trio) {
    trio.replay();
    engage(&trio.machine);
    trio.moves_after(monotonic_ns());
}

#[test]
#[apply(beside_others)]
fn each_request_does_what_it_says() {
    let mut trio = Trio::in_motion("requests");
    let machine = &trio.machine;
    does(machine, "engage", &[], &["active"]);
    is_refused(machine, "clear", &[], "clear was refused: not possible in state active\n");
    does(machine, "stop", &[], &["standby"]);
    trio.stands();
    moves_again(&mut trio);
    let machine = &trio.machine;
    does(machine, "park", &[], &["off"]);
    trio.daemon.says("off: requested by the operator");
    let at_home = |recording: &Recording| {
        let measured = recording.measured.last().filter(|measured| rules::stands(measured))?;
        ((measured.x[3] - 1.1).abs() < 1e-3).then_some(())
    };
    trio.recorder.until("the platform stands at home", at_home);
    moves_again(&mut trio);
    let machine = &trio.machine;
    does(machine, "off", &[], &["off"]);
    trio.stands();
    does(machine, "stop", &[], &["off"]);
    does(machine, "clear", &[], &["off", "standby"]);
    does(machine, "park", &[], &["off"]);
    moves_again(&mut trio);
    let machine = &trio.machine;
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
    moves_again(&mut trio);
    trio.finish();
}

#[test]
#[apply(beside_others)]
fn what_is_refused_is_refused_with_the_reason() {
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
    let mut far = SetpointMessage::default();
    far.x[3] = 1.11;
    let offered = publish(&machine, far);
    daemon.says("standby: setpoint too far from the platform");
    let words = "engage was refused: setpoint too far from the platform: the difference between setpoint and platform is 5 times \
         the tolerance control.engage_*; start the setpoints where the platform stands, or set setpoint.approach = true (under control engage \
         is enough): the platform then moves to them (10.000 mm and 0.000 mrad away)";
    is_refused(&machine, "engage", &[], words);
    let waits = Hexad::start(&machine, "engage", &["--wait"]);
    let asked = |recording: &Recording| {
        recording.requests.iter().filter(|asked| number(**asked) == 1).nth(9).map(drop)
    };
    recorder.until("it asks again and again", asked);
    waits.signal("INT");
    let stderr = waits.ends().fails(1, "hexad: waiting: setpoint too far from the platform: ");
    assert!(stderr.ends_with("\nhexad: interrupted\n") && stderr.lines().count() == 2, "{stderr}");
    // Who stops a platform stops also those who wait to move it.
    let waits = Hexad::start(&machine, "engage", &["--wait"]);
    waits.says("waiting: setpoint too far");
    does(&machine, "stop", &[], &["standby"]);
    waits.ends().fails(
        1,
        ": a stop came after it was asked for, or the daemon began anew; ask again if it is still wanted\n",
    );
    drop(offered);
    daemon.stops();
    plant.stops();
    let recording = recorder.finish();
    rules::hold(&recording);
    assert!(recording.forces.iter().all(|force| force.valid == 0), "nobody was allowed to engage");
}
