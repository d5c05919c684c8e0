//! Files of numbers as spreadsheets and scripts write them: units, semicolons, decimal commas, poses alone, standard input.

use std::fmt::Write as _;
use std::fs::File;
use std::process::{Command, Stdio};

use hexad::commands::r#move::trajectory::Trajectory;
use hexad::commands::orientation::OrientationFormat;
use hexad::config::coordinates::Coordinates;
use hexad::motion::minimum_jerk::rise;
use hexad::text::csv_table::trajectory_columns;

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
        (row[0], row[4]) = (larger * SECONDS * f64::from(k) / 10.0, HOME + larger * WAY * s.value);
        (row[10], row[16]) = (WAY * s.rate, WAY * s.accel / larger);
        row
    };
    (0..=10).map(row).collect()
}

/// The same move by poses alone.
pub fn poses(header: &str, separator: char, time_factor: f64, is_comma_decimal: bool) -> String {
    let mut text = format!("{header}\n");
    for k in 0..=30 {
        let t = SECONDS * f64::from(k) / 30.0;
        let x_mm = 1e3 * (HOME + WAY * rise(t, SECONDS).value);
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
            assert!((state.x[3] - HOME - WAY * s.value).abs() < tolerance * WAY, "{t}: {state:?}");
            assert!((state.xd[3] - WAY * s.rate).abs() < 0.01 * 1.875 * WAY / SECONDS, "{t}: {state:?}");
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
