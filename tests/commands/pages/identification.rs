//! `hexad identify --page`: the page shows the numbers of the text and of `--json`.

use hexad::control::controller::Output;
use hexad::control::sensing::localization::PlatformState;
use hexad::control::signals::inputs::{Input, Measurement};
use hexad::control::signals::state::State;
use hexad::messages::CycleMessage;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::forward_kinematics::Tracker;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::random::Random;
use hexad::model::rigid::{Acceleration, Motion, Pose, Twist};
use hexad::model::task::TaskState;
use hexad::model::transmission::Transmission;
use hexad::recording::RunInfo;
use hexad::recording::file::RecordingFile;
use serde_json::Value;

use super::super::{Folder, has};
use super::widths::fits_every_width;
use hexad_support::browser::Browser;
use hexad_support::identified::{Series, drawn};

const PERIOD_NS: u64 = 1_000_000;
const CYCLES: u64 = 12_000;
/// Sway of each leg about home \[m\] and its angular frequency, where the first one only vibrates.
const SWAY: [(f64, f64); 6] =
    [(1e-6, 157.0), (0.03, 1.3), (-0.03, 1.6), (0.04, 1.9), (0.03, 2.2), (-0.04, 2.5)];

/// Writes a recording of a motion. The forces act on a machine that is not what its file says, whose Coulomb friction changes by
/// `drift` in a second.
fn write(folder: &Folder, cycles: u64, drift: f64, motion: &mut dyn FnMut(f64) -> Motion) {
    let config = folder.config();
    let mut truth = drawn(&config.machine, &mut Random::new(7));
    let coulomb = truth.actuator.coulomb_friction_n;
    let info =
        RunInfo { name: config.name.clone(), configuration: config.text.clone(), ..RunInfo::default() };
    let mut file = RecordingFile::create(&folder.path("motion.mcap"), &info, None).unwrap();
    for number in 1..=cycles {
        let release_ns = 1_000_000_000 + number * PERIOD_NS;
        let motion = motion(1e-9 * (number * PERIOD_NS) as f64);
        let share = 1.0 + drift * 1e-9 * (number * PERIOD_NS) as f64;
        truth.actuator.coulomb_friction_n = coulomb.map(|force| share * force);
        let forces = inverse_dynamics::<Exact>(&truth, &motion).unwrap();
        let (pose, length_m) = (motion.pose, leg_lengths(&config.machine, &motion.pose));
        let platform =
            PlatformState { pose, twist: motion.twist, condition: 1.0, time_to_singularity_s: f64::INFINITY };
        let output = Output {
            state: State::Active,
            command_n: Transmission::of_motion(&truth, &motion).commands(&forces),
            platform: Some(platform),
            reference: Some(motion),
            ..Output::default()
        };
        let measurement = Some(Measurement { time_ns: release_ns, length_m, ..Measurement::default() });
        let input = Input { release_ns, measurement, ..Input::default() };
        let cycle = CycleMessage { cycle: number, due_ns: release_ns, ..CycleMessage::new(&input, &output) };
        file.write_cycle(&cycle).unwrap();
    }
    file.finish().unwrap();
}

/// Identifies from one recording. Returns the text, the JSON, and what the page shows if there is a browser.
fn identified(folder: &Folder) -> (String, Value, Option<Value>) {
    let (page, (_, text, _)) =
        (folder.path("page.html"), folder.run("identify @/motion.mcap --page @/page.html"));
    has(&text, &[&format!("page with charts: {}", page.display())]);
    let (_, json, _) = folder.run("identify @/motion.mcap --json");
    let shown = Browser::find().map(|browser| {
        browser.run(&page, concat!(include_str!("is_drawn.js"), include_str!("identification.js")))
    });
    (text, serde_json::from_str(&json).unwrap(), shown)
}

/// Words of each line.
fn lines(text: &str) -> Vec<Vec<&str>> {
    text.lines().map(|line| line.split_whitespace().collect()).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap_or(f64::NAN)).collect()
}

/// Cells of a table without its head.
fn rows(value: &Value) -> Vec<Vec<String>> {
    serde_json::from_value::<Vec<Vec<String>>>(value.clone()).unwrap().split_off(1)
}

/// The page must draw the residuals whose RMS the JSON states, and show its words.
fn check_residuals(json: &Value, text: &str, shown: &Value) {
    for (drawn, stated) in shown["rms"].as_array().unwrap().iter().zip(["before", "after"]) {
        for (leg, (drawn, stated)) in numbers(drawn).iter().zip(json[stated].as_array().unwrap()).enumerate()
        {
            let stated = stated[0].as_f64().unwrap_or(f64::NAN);
            let is_equal = (drawn / stated - 1.0).abs() < 1e-3 || drawn.is_nan() && stated.is_nan();
            assert!(is_equal, "leg {}: {drawn} N drawn, {stated} N stated", leg + 1);
        }
    }
    assert!(shown["difference"].as_f64().unwrap() < 1e-4, "curves of forces and residuals differ: {shown}");
    for row in rows(&shown["residuals"]) {
        let (correlation, cells) = row.split_last().unwrap();
        assert!(lines(text).iter().any(|line| line == cells), "{cells:?} must be in the text:\n{text}");
        let leg: usize = row[0].parse().unwrap();
        let stated = json["correlation"][leg - 1].as_f64().unwrap_or(0.0);
        assert_eq!(*correlation, format!("{stated:.2}"));
    }
}

#[test]
#[ignore = "second tier: needs Chromium"]
fn the_page_of_an_identification_shows_the_numbers_of_the_text() {
    let folder = Folder::new("");
    let file = folder.config().machine;
    let series = Series::new(&file, 1.0, &mut Random::new(3));
    write(&folder, CYCLES, 0.0, &mut |t| series.at(&file, t).motion());
    folder.write("page.html", "an older page");
    let (text, json, shown) = identified(&folder);
    assert!(folder.read("page.html").len() < 400_000);
    let Some(shown) = shown else { return };
    fits_every_width(&folder.path("page.html"), "[]");
    assert_eq!([&shown["error"], &shown["drawn"]], [&Value::Null, &Value::from(vec![true; 8])]);
    check_residuals(&json, &text, &shown);
    let legs = json["legs"].as_array().unwrap();
    let of_legs = (0..4).flat_map(|quantity| legs.iter().map(move |rows| &rows[quantity]));
    let stated: Vec<_> = json["quantities"].as_array().unwrap().iter().chain(of_legs).collect();
    let (cells, marks) = (rows(&shown["parameters"]), numbers(&shown["marks"]));
    assert_eq!((cells.len(), marks.len()), (18 + 24, stated.len()));
    let limit: f64 = shown["parameters"][0][1].as_str().unwrap().rsplit('+').next().unwrap().parse().unwrap();
    for ((row, stated), mark) in cells.iter().zip(&stated).zip(marks) {
        let number = |key: &str| stated[key].as_f64().unwrap();
        let change = (number("value") - number("file")) / number("expected");
        assert!(
            (limit * mark - change).abs() < 0.02 * limit && mark.abs() <= 1.0,
            "{row:?}: {mark} {change}"
        );
        // The text has legs in columns.
        let [_, _, _, value, deviation, _] = &row[..] else { panic!("{row:?}") };
        assert!(text.contains(value.as_str()) && text.contains(deviation.as_str()), "{row:?}\n{text}");
        let shown_by = if stated["is_shown"] == true { "the motion" } else { "the file" };
        assert_eq!(row.last().unwrap(), shown_by, "{row:?}");
    }
    let unknown = stated.iter().filter(|row| row["is_shown"] == false).count();
    assert!(unknown > 0 && shown["hollow"].as_u64() == Some(unknown as u64), "{unknown} {shown}");
}

/// A leg that stands has no force to compare: no curve, and words in place of numbers.
#[test]
#[ignore = "second tier: needs Chromium"]
fn a_leg_that_stands_has_no_residual() {
    let folder = Folder::new("");
    let file = folder.config().machine;
    let home: Pose = TaskState::at_rest(file.home).motion().pose;
    let at_home = leg_lengths(&file, &home);
    let mut tracker = Tracker::new(&file, home);
    write(&folder, CYCLES, 0.0, &mut |t| {
        let length = |leg: usize| {
            let (amplitude, frequency) = SWAY[leg];
            at_home[leg] + amplitude * (frequency * t).sin()
        };
        tracker.find(&file, &core::array::from_fn(length));
        Motion { pose: *tracker.pose(), twist: Twist::default(), acceleration: Acceleration::default() }
    });
    let (text, json, shown) = identified(&folder);
    assert_eq!(json["before"][0], serde_json::json!([null, null]));
    assert!(lines(&text).contains(&vec!["1", "stands", "stands", "stands", "stands"]), "{text}");
    let Some(shown) = shown else { return };
    let mut drawn = vec![true; 8];
    drawn[0] = false;
    assert_eq!([&shown["error"], &shown["drawn"]], [&Value::Null, &Value::from(drawn)]);
    check_residuals(&json, &text, &shown);
}

/// A file of which the residuals say that the model does not hold is written only with `--force`, and says so itself.
#[test]
fn what_the_residuals_refuse_is_written_with_force_alone() {
    let folder = Folder::new("");
    let file = folder.config().machine;
    let series = Series::new(&file, 1.0, &mut Random::new(3));
    write(&folder, 2 * CYCLES, 0.05, &mut |t| series.at(&file, t).motion());
    let (code, message) = folder.execute("identify @/motion.mcap --json --output @/new.toml").unwrap_err();
    assert_eq!(code, 1);
    has(
        &message,
        &[
            "/new.toml: not written, because",
            "most likely friction that changes with time: warm the drives up",
            "--force",
        ],
    );
    assert!(!folder.path("new.toml").exists());
    folder.execute("identify @/motion.mcap --json --output @/new.toml --force").unwrap();
    let new = folder.read("new.toml");
    assert!(new.starts_with("# WARNING (hexad identify --force): "), "{new}");
    folder.execute("check --config @/new.toml").unwrap();
}
