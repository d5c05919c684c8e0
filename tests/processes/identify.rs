//! The steps of `docs/identification.md`, as a user types them, in lock-step with a platform that is not what its file says.

use std::fs;
use std::path::Path;

use hexad::config::Config;

use crate::support::children::{HANG, Hexad, hexad};
use crate::support::machine::Machine;
use crate::support::turns;

const GUIDE: &str = include_str!("../../docs/identification.md");
const LOCKSTEP: &str = "[realtime]\nrelease = \"lockstep\"\n[limits]\npayload_change_kg = inf\n\
                        [plant.sensor]\nlength_noise_m = 1e-6\n";
/// Fewer than the guide's six, to save time.
const PERIODS: &str = "2";
/// The known weight, as in the guide.
const WEIGHT: &str = "[plant.build]\npayload_kg = 0.5\npayload_position_m = [0.0, 0.0, 0.1]\n";

/// What the platform has in place of these lines of its file.
const TRUTH: [(&str, &str); 2] = [
    ("mass_kg = 3.0", "mass_kg = 2.5"),
    (
        "max_force_n = 500.0",
        "max_force_n = 500.0\nviscous_friction_n_s_m = [11, 9, 12, 10, 8, 13]\ncoulomb_friction_n = 1.5\n\
         load_friction = 0.02\nforce_scale = [0.97, 1.0, 1.03, 0.99, 1.02, 1.01]",
    ),
];

/// A command that the guide shows.
fn shown(line: &str) -> &str {
    assert!(GUIDE.contains(&format!("\n   {line}\n")), "the guide must show: {line}");
    line
}

/// A command of the guide, with names of this test in place of the guide's.
fn typed(machine: &Machine, line: &str) -> std::process::Command {
    let mut command = hexad();
    command.current_dir(machine.folder());
    for word in line.split_whitespace().skip(1) {
        match word.strip_suffix("/*.mcap") {
            Some(folder) => {
                command.args(fs::read_dir(machine.path(folder)).unwrap().map(|entry| entry.unwrap().path()))
            }
            None => command.arg(if word == "F" { machine.file.to_str().unwrap() } else { word }),
        };
    }
    command
}

/// Daemon and platform while a setpoint source plays its motion.
fn session(machine: &Machine, platform: &Path, run: &str, sources: &[&str]) {
    let daemon = Hexad::spawn(machine, "run", typed(machine, run));
    let mut plant = hexad();
    plant.args(["plant", "--config"]).arg(platform);
    let plant = Hexad::spawn(machine, "plant", plant);
    for source in sources {
        let mut source = typed(machine, source);
        if source.get_args().any(|argument| argument == "excite") {
            source.args(["--periods", PERIODS]);
        }
        let ended = Hexad::spawn(machine, "source", source).ends_within(4 * HANG);
        assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    }
    let log = daemon.stops_on("TERM", HANG).stderr;
    assert!(!log.contains("fault"), "{log}");
    plant.stops_on("TERM", HANG);
}

#[test]
fn a_new_machine_is_identified_as_the_guide_says() {
    let _turn = turns::beside_others();
    let machine = Machine::with("identify", LOCKSTEP);
    let mut truth = fs::read_to_string(&machine.file).unwrap();
    for (stated, true_value) in TRUTH {
        assert!(truth.contains(stated), "{stated}");
        truth = truth.replacen(stated, true_value, 1);
    }
    let [platform, with_weight] = ["truth.toml", "with_weight.toml"].map(|name| machine.path(name));
    fs::write(&platform, &truth).unwrap();
    fs::write(&with_weight, format!("{truth}\n{WEIGHT}")).unwrap();
    let excite = shown("hexad excite --config F --engage");
    session(&machine, &platform, shown("hexad run --config F --record empty"), &[excite]);
    session(&machine, &with_weight, shown("hexad run --config F --record loaded"), &[excite]);
    let circle = shown("hexad move --config F --motion circle --engage");
    session(&machine, &platform, shown("hexad run --config F --record other"), &[circle]);
    let line = shown(
        "hexad identify empty/*.mcap --loaded loaded/*.mcap --known-mass 0.5 --at 0,0,0.1m --validate other/*.mcap --output NEW.toml",
    );
    let before = fs::read(&machine.file).unwrap();
    let ended = Hexad::spawn(&machine, "identify", typed(&machine, line)).ends_within(HANG);
    println!("{}", ended.stdout);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    for words in ["platform with six rods", "delay of the drives, from release to force", "NEW.toml: written"]
    {
        assert!(ended.stdout.contains(words), "{words}");
    }
    assert_eq!(fs::read(&machine.file).unwrap(), before, "the file in force stays");
    let check = shown("hexad check --config NEW.toml");
    assert_eq!(
        Hexad::spawn(&machine, "check", typed(&machine, check)).ends_within(HANG).status.code(),
        Some(0)
    );

    let [found, truth] =
        [machine.path("NEW.toml"), platform].map(|path| Config::load(&path).unwrap().machine);
    let mass = |machine: &hexad::model::machine::Machine| machine.platform.mass + 6.0 * machine.rod.mass;
    assert!((mass(&found) / mass(&truth) - 1.0).abs() < 2e-3, "{}", mass(&found));
    for leg in 0..6 {
        let [a, b] = [&found, &truth].map(|machine| &machine.actuator);
        assert!((a.force_scale[leg] / b.force_scale[leg] - 1.0).abs() < 2e-3, "{:?}", a.force_scale);
        assert!((a.viscous_friction[leg] - b.viscous_friction[leg]).abs() < 0.5, "{:?}", a.viscous_friction);
        assert!((a.coulomb_friction[leg] - b.coulomb_friction[leg]).abs() < 0.1, "{:?}", a.coulomb_friction);
    }

    // A file that exists is kept, with one clear error.
    let again = Hexad::spawn(&machine, "again", typed(&machine, line)).ends_within(HANG);
    assert_eq!(again.status.code(), Some(2), "{}", again.stderr);
    assert!(
        again.stderr.contains("NEW.toml exists already; name another file with --output"),
        "{}",
        again.stderr
    );
}

/// Machines whose drives differ from their files: the mirror has dry friction, the motion base friction, dead time and lag. Last:
/// share of the default friction uncertainty that an identified file has at most; stiction is half of the mirror's friction.
const UNSTATED: [(&str, &str, &str, f64); 2] = [
    ("mirror_unknown_friction", include_str!("../data/mirror_unknown_friction.toml"), "", 0.8),
    (
        "motion_base",
        include_str!("../data/motion_base.toml"),
        "[plant.drive]\ndead_time_us = 1500.0\nbandwidth_hz = 100.0\n[plant.friction]\ncoulomb_n = 100.0\n",
        0.5,
    ),
];

/// From the first motion, with the file of a data sheet, to an identified file: no fault before and after, and tighter monitors.
#[test]
fn a_first_motion_leads_to_an_identified_file() {
    let _turn = turns::beside_others();
    for (name, text, plant, share) in UNSTATED {
        let machine = Machine::with("first", "");
        let text = text.replace(&format!("name = \"{name}\""), &format!("name = \"{}\"", machine.name));
        fs::write(&machine.file, format!("{text}\n[realtime]\nrelease = \"lockstep\"\n")).unwrap();
        let platform = machine.path("truth.toml");
        fs::write(&platform, format!("{text}\n{plant}\n[realtime]\nrelease = \"lockstep\"\n")).unwrap();
        let motions = ["minimum-jerk", "circle"]
            .map(|motion| format!("hexad move --config F --motion {motion} --engage"));
        let motions = motions.each_ref().map(String::as_str);
        session(&machine, &platform, "hexad run --config F --record first", &motions[..1]);
        session(
            &machine,
            &platform,
            "hexad run --config F --record empty",
            &["hexad excite --config F --engage"],
        );
        let line = "hexad identify first/*.mcap empty/*.mcap --output NEW.toml";
        let ended = Hexad::spawn(&machine, "identify", typed(&machine, line)).ends_within(HANG);
        println!("{}", ended.stdout);
        assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
        let [before, after] = ["machine.toml", "NEW.toml"]
            .map(|file| Config::load(&machine.path(file)).unwrap().machine.actuator.friction_uncertainty);
        assert!(after < share * before, "{name}: friction uncertainty {before} N, then {after} N");
        fs::rename(machine.path("NEW.toml"), &machine.file).unwrap();
        session(&machine, &platform, "hexad run --config F --record identified", &motions);
    }
}
