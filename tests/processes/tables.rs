//! Files of numbers as spreadsheets and scripts write them: units, semicolons, decimal commas, poses alone, standard input.

use std::fmt::Write as _;
use std::fs::{self, File};

use hexad::motion::minimum_jerk::rise;

use crate::support::children::{Ended, HANG, Hexad, hexad, run};
use crate::support::machine::Machine;
use crate::support::operator;
use crate::support::recorder::Recorder;
use crate::support::rules;
use crate::support::trio::{start_daemon, start_plant};
use crate::support::turns;

/// x of the home pose \[m\], how far the platform moves along it, and how long.
const HOME: f64 = 1.1;
const WAY: f64 = 0.05;
const SECONDS: f64 = 1.5;

/// A minimum-jerk move along x, by poses alone.
fn poses(header: &str, separator: char, time_factor: f64, is_comma_decimal: bool) -> String {
    let mut text = format!("{header}\n");
    for k in 0..=30 {
        let t = SECONDS * f64::from(k) / 30.0;
        let x_mm = 1e3 * (HOME + WAY * rise(t, SECONDS).value);
        let row = [t * time_factor, x_mm, 0.0, 0.0, 0.0, 0.0, 0.0].map(|number| {
            let text = format!("{number}");
            if is_comma_decimal { text.replace('.', ",") } else { text }
        });
        writeln!(text, "{}", row.join(&separator.to_string())).expect("a string takes all");
    }
    text
}

/// `hexad COMMAND` with a file as standard input, to its end.
fn with_input(machine: &Machine, input: &str, arguments: &[&str]) -> Ended {
    let file = machine.path("input");
    fs::write(&file, input).expect("a file");
    let mut command = hexad();
    command.args(arguments).stdin(File::open(&file).expect("the same file"));
    Hexad::spawn(machine, "hexad", command).ends_within(HANG)
}

const GERMAN: &str = "t_ms;x_mm;y_mm;z_mm;alpha_deg;beta_deg;gamma_deg";

#[test]
fn poses_of_a_spreadsheet_move_the_platform() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("spreadsheet");
    let file = machine.path("rise.csv");
    fs::write(&file, poses(GERMAN, ';', 1e3, true)).expect("a trajectory");
    let recorder = Recorder::start(&machine.name);
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    let setpoints = Hexad::start(&machine, "move", &["--trajectory".as_ref(), file.as_os_str()]);
    operator::engage(&machine);
    let ended = setpoints.ends_within(HANG);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    daemon.says("standby: setpoint source ended at rest");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    rules::hold(&recording);
    let last = recording.measured.last().expect("measurements");
    assert!((last.x[3] - (HOME + WAY)).abs() < 1e-3 && rules::stands(last), "{:?}", last.x);
    // The derivatives are those of the move: 1.875 times as fast as its mean.
    let fastest = recording.setpoints.iter().map(|message| message.x_rate[3]).fold(0.0, f64::max);
    assert!((fastest / (1.875 * WAY / SECONDS) - 1.0).abs() < 0.01, "{fastest} m/s");
}

#[test]
fn tables_go_through_pipes() {
    let machine = Machine::patient("pipes");
    let config = machine.file.display().to_string();
    let inverse = ["inverse-dynamics", "--config", &config, "--input", "-", "--output", "-"];
    let reference = with_input(&machine, &poses("t,x_mm,y,z,alpha,beta,gamma", ',', 1.0, false), &inverse);
    assert_eq!(reference.status.code(), Some(0), "{}", reference.stderr);
    assert_eq!(reference.stdout.lines().count(), 1 + 31, "{}", reference.stdout);
    assert!(reference.stdout.starts_with("t,force_1,"), "{}", reference.stdout);
    for (header, separator, is_comma_decimal) in [
        (GERMAN, ';', true),
        (&*GERMAN.replace(';', "\t"), '\t', false),
        (&*GERMAN.replace(';', ","), ',', false),
    ] {
        let text = poses(header, separator, 1e3, is_comma_decimal);
        let ended = with_input(&machine, &text, &inverse);
        assert_eq!(ended.status.code(), Some(0), "{header}: {}", ended.stderr);
        let numbers = |text: &str| -> Vec<f64> {
            text.lines()
                .skip(1)
                .flat_map(|line| line.split(','))
                .map(|x| x.parse().expect("a number"))
                .collect()
        };
        let (found, expected) = (numbers(&ended.stdout), numbers(&reference.stdout));
        assert_eq!(found.len(), expected.len());
        let worst =
            found.iter().zip(&expected).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{header}: {worst}");
    }
    // The lengths of one are the input of the other.
    let forward = ["forward-kinematics", "--config", &config, "--input", "-", "--output", "-"];
    let ended = with_input(&machine, &reference.stdout, &forward);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    assert!(ended.stdout.starts_with("t,alpha,beta,gamma,x,"), "{}", ended.stdout);
    assert!(!machine.folder().join("-").exists() && !std::path::Path::new("-").exists(), "a file called -");
}

#[test]
fn what_is_not_understood_is_refused_with_the_cure() {
    let machine = Machine::patient("cures");
    let config = machine.file.display().to_string();
    let decimal_commas = poses("t,x_mm,y,z,alpha,beta,gamma", ',', 1.0, true);
    for (text, words) in [
        (decimal_commas, "with decimal commas the fields must be separated by semicolons"),
        (
            poses("t,x_cm,y,z,alpha,beta,gamma", ',', 1.0, false),
            "missing columns x (x_cm: its units are m, mm, um, nm)",
        ),
        (poses("t;x;y;z;alpha;beta;x_mm", ';', 1.0, false), "column x appears 2 times: must appear once"),
        (
            poses("t_ms,x_mm,y,z,alpha,beta,gamma", ',', 1.0, false),
            "beyond a limit of velocity, acceleration or jerk",
        ),
    ] {
        let file = machine.path("refused.csv");
        fs::write(&file, text).expect("a file");
        let ended =
            run(&machine, &["move", "--config", &config, "--trajectory", &file.display().to_string()]);
        assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains(words), "{words}: {}", ended.stderr);
    }
}
