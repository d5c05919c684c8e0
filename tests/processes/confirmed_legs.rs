//! `hexad confirm-legs`: legs that are exchanged as a whole, lengths and drives, are found by who looks, and the daemon keeps it.

use std::fs;
use std::path::Path;

use hexad::config::Config;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::task::pose_of;

use crate::support::children::{Hexad, hexad};
use crate::support::machine::{Machine, patient};
use crate::support::operator::does;
use crate::support::recorder::{Recorder, Recording};
use crate::support::socket::status;

/// A leg whose length differs by more from that at home has moved \[m\].
const MOVED_M: f64 = 2.5e-3;

/// The legs that moved, one after the other, by the true pose: what a person sees.
fn seen(recording: &Recording, config: &Config) -> Vec<usize> {
    let lengths = |x: &[f64; 6]| leg_lengths(&config.machine, &pose_of(x));
    let home = lengths(&config.machine.home);
    let mut legs = vec![];
    for measured in &recording.measured {
        let now = lengths(&measured.x);
        let changes = (1..).zip(now.iter().zip(&home)).map(|(leg, (now, home))| (leg, (now - home).abs()));
        legs.extend(changes.filter(|(_, change)| *change > MOVED_M).map(|(leg, _)| leg));
    }
    legs.dedup();
    legs
}

fn warnings(machine: &Machine) -> String {
    status(machine)["status"]["warnings"].to_string()
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn exchanged_legs_are_found_by_who_looks_and_the_daemon_keeps_it() {
    let machine = Machine::patient("exchanged");
    let text = include_str!("../../config/motion_base.toml");
    let text = text.replace("\"motion_base\"", &format!("{:?}", machine.name));
    fs::write(&machine.file, patient(&text)).unwrap();
    // Home is symmetric, so nothing else shows the exchange.
    let mut parts: Vec<&str> = text.split("[[leg]]").collect();
    parts.swap(1, 2);
    let exchanged = machine.path("exchanged.toml");
    fs::write(&exchanged, patient(&parts.join("[[leg]]"))).unwrap();
    let (config, state) = (Config::load(&machine.file).unwrap(), machine.path("state"));
    fs::create_dir(&state).unwrap();
    let daemon = || Hexad::start(&machine, "run", &["--state".as_ref(), state.as_os_str()]);
    let plant = |file: &Path| {
        let mut command = hexad();
        command.arg("plant").arg("--config").arg(file);
        Hexad::spawn(&machine, "plant", command)
    };
    let confirm = |answers| machine.hexad("confirm-legs", &["--engage", "--answers", answers]);

    let (controlled, wrong) = (daemon(), plant(&exchanged));
    controlled.says("standby: no setpoint");
    machine.hexad::<&str>("confirm-legs", &[]).fails(2, "must be a terminal, or give --answers");
    machine.hexad("confirm-legs", &["--answers", "1,2,3,4,5,6"]).fails(1, "is not under control");
    assert!(warnings(&machine).contains("nobody has confirmed that each leg"), "{}", warnings(&machine));
    let recorder = Recorder::start(&machine.name);
    confirm("2,1,3,4,5,6").fails(1, "legs 1 and 2 are exchanged, lengths and drives: exchange the cables");
    assert_eq!(seen(&recorder.finish(), &config), [2, 1, 3, 4, 5, 6]);
    controlled.says("WARN nobody has confirmed that each leg");
    assert!(warnings(&machine).contains("[2, 1, 3, 4, 5, 6] were seen to move"), "{}", warnings(&machine));
    does(&machine, "stop", &[], &["standby"]);
    wrong.stops();

    let right = plant(&machine.file);
    right.says("plant at rest");
    let recorder = Recorder::start(&machine.name);
    let said = confirm("1,2,3,4,5,6").succeeds();
    assert_eq!(seen(&recorder.finish(), &config), [1, 2, 3, 4, 5, 6]);
    assert!(said.contains("leg 1 is the one at base joint x 1.989, y -0.209, z 0.000 m\n"), "{said}");
    assert!(said.contains("each leg is the one of its number (kept in /"), "{said}");
    assert_eq!(warnings(&machine), "[]");
    controlled.stops();
    let controlled = daemon();
    controlled.says("standby: no setpoint");
    assert_eq!(warnings(&machine), "[]", "it outlives the daemon");
    controlled.stops();
    right.stops();
}
