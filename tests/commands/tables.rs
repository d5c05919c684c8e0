//! Files of numbers as spreadsheets and scripts write them: units, semicolons, decimal commas, poses alone, standard input.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::process::{Command, Stdio};

use hexad::commands::r#move::trajectory::Trajectory;
use hexad::commands::orientation::OrientationFormat;
use hexad::config::coordinates::Coordinates;
use hexad::motion::minimum_jerk::rise;
use hexad::text::csv_table::{legs, trajectory_columns};
use hexad_support::data;

use super::{Folder, largest_difference, numbers, table};

/// x of the home pose \[m\], how far the platform moves along it, and how long \[s\].
pub const HOME: f64 = 1.1;
const WAY: f64 = 0.05;
pub const SECONDS: f64 = 1.5;

/// t, X, X', X'' of a minimum-jerk move along x, so many times as far and as long, by rows so far apart that what is between them matters.
pub fn moves(larger: f64) -> Vec<Vec<f64>> {
    let row = |k: u32| {
        let s = rise(SECONDS * f64::from(k) / 10.0, SECONDS);
        let mut row = vec![0.0; 19];
        (row[0], row[4]) = (larger * SECONDS * f64::from(k) / 10.0, HOME + larger * WAY * s.value_share);
        (row[10], row[16]) = (WAY * s.rate_per_s, WAY * s.accel_per_s2 / larger);
        row
    };
    (0..=10).map(row).collect()
}

/// The same move by poses alone.
pub fn poses(header: &str, separator: char, time_factor: f64, is_comma_decimal: bool) -> String {
    let mut text = format!("{header}\n");
    for k in 0..=30 {
        let t = SECONDS * f64::from(k) / 30.0;
        let x_mm = 1e3 * (HOME + WAY * rise(t, SECONDS).value_share);
        let row = [t * time_factor, x_mm, 0.0, 0.0, 0.0, 0.0, 0.0].map(|number| {
            let text = format!("{number}");
            if is_comma_decimal { text.replace('.', ",") } else { text }
        });
        writeln!(text, "{}", row.join(&separator.to_string())).unwrap();
    }
    text
}

const GERMAN: &str = "t_ms;x_mm;y_mm;z_mm;alpha_deg;beta_deg;gamma_deg";

fn trajectory(folder: &Folder, text: &str) -> Trajectory {
    folder.write("t.csv", text);
    let (config, frames) = (folder.config(), Coordinates::default());
    Trajectory::from_file(&config, &frames, &folder.path("t.csv"), None, OrientationFormat::OF_X).unwrap()
}

/// Between the rows too, and with derivatives that are computed: 1.875 times as fast as its mean.
#[test]
fn a_file_is_the_motion_that_it_was_made_from() {
    let folder = Folder::new("");
    for (text, tolerance) in
        [(table(&trajectory_columns().join(","), moves(1.0)), 1e-3), (poses(GERMAN, ';', 1e3, true), 1e-4)]
    {
        let read = trajectory(&folder, &text);
        assert!((read.duration() - SECONDS).abs() < 1e-9);
        for t in (0..=1500).map(|k| 1e-3 * f64::from(k)) {
            let (state, s) = (read.at(t), rise(t, SECONDS));
            assert!((state.x[3] - HOME - WAY * s.value_share).abs() < tolerance * WAY, "{t}: {state:?}");
            assert!(
                (state.xd[3] - WAY * s.rate_per_s).abs() < 0.01 * 1.875 * WAY / SECONDS,
                "{t}: {state:?}"
            );
            assert!([0, 1, 2, 4, 5].iter().all(|axis| state.x[*axis] == 0.0), "{t}: {state:?}");
        }
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn the_file_of_an_excitation_holds_the_motion_that_would_be_played() {
    let folder = Folder::new("");
    folder.execute("excite @M --periods 2 --amplitude 0.3 --output @/made.csv").unwrap();
    let excitation = Trajectory::excitation(&folder.config(), 2, 0.3, 0).unwrap();
    let read = trajectory(&folder, &folder.read("made.csv"));
    assert_eq!(read.duration(), excitation.duration());
    for k in 0..3400 {
        let t = 0.01 * f64::from(k) + 0.0037;
        let (a, b) = (read.at(t), excitation.at(t));
        assert!((a.x - b.x).amax() < 1e-10 && (a.xd - b.xd).amax() < 1e-8, "{t}: {a:?} {b:?}");
        assert!((a.xdd - b.xdd).amax() < 1e-6, "{t}: {a:?} {b:?}");
    }
}

#[test]
fn tables_go_through_pipes() {
    let folder = Folder::new("");
    let piped = |command: &str, input: &str, first: &str| {
        folder.write("input", input);
        let mut process = Command::new(env!("CARGO_BIN_EXE_hexad"));
        process.args(folder.arguments(&format!("{command} @M --input - --output -")));
        let input = Stdio::from(File::open(folder.path("input")).unwrap());
        let ended = process.current_dir(folder.path(".")).stdin(input).output().unwrap();
        let text = String::from_utf8(ended.stdout).unwrap();
        assert!(ended.status.success() && text.starts_with(first), "{command}: {text}");
        text
    };
    let inverse = |text: &str| piped("inverse-dynamics", text, "t,force_1,");
    let reference = inverse(&poses("t,x_mm,y,z,alpha,beta,gamma", ',', 1.0, false));
    assert_eq!(reference.lines().count(), 1 + 31, "{reference}");
    for (separator, is_comma_decimal) in [(';', true), ('\t', false), (',', false)] {
        let header = GERMAN.replace(';', &separator.to_string());
        let text = inverse(&poses(&header, separator, 1e3, is_comma_decimal));
        let worst = largest_difference(&numbers(&text), &numbers(&reference));
        assert!(worst < 1e-9, "{header}: {worst}");
    }
    // The lengths of one are the input of the other.
    piped("forward-kinematics", &reference, "t,alpha,beta,gamma,x,");
    assert!(!folder.path("-").exists(), "a file called -");
}

/// Columns of a table by name, each as text.
fn columns(text: &str) -> BTreeMap<&str, Vec<&str>> {
    let mut lines = text.lines().map(|line| line.split(','));
    let header = lines.next().unwrap();
    let rows: Vec<Vec<_>> = lines.map(Iterator::collect).collect();
    header.enumerate().map(|(k, name)| (name, rows.iter().map(|row| row[k]).collect())).collect()
}

/// The command line that makes a table of a recording: 180 cycles of 1 ms of a machine without frames. Frames are in the machine file,
/// as on the day after a run.
fn convert(options: &str) -> String {
    format!("convert {} --csv @/run.csv{options}", data("hexad-2026-11-25", "mcap").display())
}

fn converted(folder: &Folder, options: &str) -> String {
    folder.execute(&convert(options)).unwrap();
    folder.read("run.csv")
}

#[test]
fn a_part_of_a_recording_has_the_numbers_of_the_whole() {
    let folder = Folder::new("");
    let whole = converted(&folder, "");
    assert!(converted(&folder, " --every 1") == whole);
    let (all, lengths) = (columns(&whole), legs("measured_length").join(","));
    for (options, header, step) in [
        (" --every 50 --columns state,t", "t,state".into(), 50),
        (" --every 50ms --columns t,condition", "t,condition".into(), 50),
        (
            " --every 1us --columns measured_rates_valid,measured_length,t",
            format!("t,{lengths},measured_rates_valid"),
            1,
        ),
        (" --columns target_x,t --every 100", "t,target_x".into(), 100),
    ] {
        let text = converted(&folder, options);
        assert_eq!(text.lines().next(), Some(&*header), "{options}");
        for (name, part) in columns(&text) {
            let rows = 180_usize.div_ceil(step);
            let expected =
                all.get(name).map_or(vec!["NaN"; rows], |all| all.iter().step_by(step).copied().collect());
            assert_eq!(part, expected, "{options}: {name}");
        }
    }
    let message = folder.says(&convert(" --every 10ms"));
    assert!(message.ends_with("run.csv: 18 rows of 180 cycles\n"), "{message}");
    fs::remove_file(folder.path("run.csv")).unwrap();
    let words =
        ["lenght: no such column or group, probably measured_length", "target: no cycle", " has cycle, t, "];
    folder.refuses(&convert(" --columns t,lenght,target"), &words);
    folder.refuses(&convert(" --tool tip"), &["no tool frame \"tip\""]);
    assert!(!folder.path("run.csv").exists());
}

#[test]
fn a_recording_is_shown_in_the_coordinates_of_a_tool() {
    let folder = Folder::new(include_str!("frames.toml"));
    let frames = " --tool tip --work table --config @/machine.toml";
    let [whole, si, text] =
        ["", frames, &format!("{frames} --units nm,arcsec")].map(|options| converted(&folder, options));
    let [all, si, found] = [&whole, &si, &text].map(|text| columns(text));
    assert!(all.iter().all(|(name, numbers)| found[name] == *numbers), "every other column stays");
    let number = |name: &str, row: usize| found[name][row].parse::<f64>().unwrap();
    for row in [50, 170] {
        for group in ["reference", "estimated"] {
            // The second coordinate of the tip, 0.3 m along x of the platform; the axes of the table are those of the base.
            let [alpha, beta, gamma, y, t] =
                ["alpha", "beta", "gamma", "y", "t"].map(|name| number(&format!("{group}_{name}"), row));
            let y = y + 0.3 * (alpha.cos() * gamma.sin() + alpha.sin() * beta.sin() * gamma.cos());
            for (name, expected) in [("y_nm", 1e9 * y), ("beta_arcsec", 3600.0 * beta.to_degrees()), ("t", t)]
            {
                let shown = number(&format!("tool_{group}_{name}"), row);
                assert!((shown - expected).abs() < 1e-3, "{row} {group} {name}: {shown} {expected}");
            }
            let y_m: f64 = si[&*format!("tool_{group}_y")][row].parse().unwrap();
            assert!((y - y_m).abs() < 1e-12, "{y} {y_m}");
        }
    }
    assert_eq!((found["tool_reference_x_nm"][0], found["reference_x"][0]), ("NaN", "NaN"));
}
