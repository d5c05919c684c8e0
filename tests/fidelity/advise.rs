//! `hexad advise` as it is used.

use super::scenes::{camera, moog};
use super::*;

fn advise(config: &Path, trajectory: Option<&Path>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    command.arg("advise").arg("--config").arg(config).env_remove("HEXAD_LOG");
    if let Some(path) = trajectory {
        command.arg("--trajectory").arg(path);
    }
    command.output().unwrap()
}

fn said(config: &Path, trajectory: Option<&Path>) -> String {
    let output = advise(config, trajectory);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), errors.as_str()), (Some(0), ""));
    let text = String::from_utf8(output.stdout).unwrap();
    for line in text.lines() {
        assert!(line.chars().count() <= 100, "wider than a terminal: {line}");
    }
    text
}

/// A machine of the tests with more sections.
fn with(folder: &TempDir, name: &str, sections: &str) -> PathBuf {
    let file = folder.path().join(name).with_extension("toml");
    let machine = fs::read_to_string(data(name, "toml")).unwrap();
    fs::write(&file, format!("{machine}\n{sections}\n")).unwrap();
    file
}

fn section(limits: &EnvelopeBounds) -> String {
    let EnvelopeBounds { pose_min, pose_max, velocity, acceleration } = limits;
    format!(
        "[envelope]\npose_min = {pose_min:?}\npose_max = {pose_max:?}\nvelocity = {velocity:?}\n\
         acceleration = {acceleration:?}\n"
    )
}

fn recommended(text: &str) -> &str {
    let (_, rest) = text.split_once("recommended: fidelity = \"").unwrap();
    rest.split_once('"').unwrap().0
}

/// Columns 1 to 7 of a row: mean, RMS, max \[N\], the same \[%\], time \[ns\].
fn row(text: &str, fidelity: &str) -> [f64; 7] {
    let line = text.lines().find(|line| line.starts_with(fidelity)).unwrap();
    let numbers: Vec<f64> = line.split_whitespace().skip(1).take(7).map(|x| x.parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

#[test]
fn a_telescope_and_a_motion_base_need_different_models() {
    let folder = TempDir::new().unwrap();
    let slow = said(&with(&folder, "telescope", &section(&camera())), None);
    let fast = said(&with(&folder, "motion_base", &section(&moog())), None);
    assert_eq!(recommended(&slow), "no-velocity");
    assert_eq!(recommended(&fast), "exact");
    // A user sees why.
    let [.., share, _] = row(&slow, "no-velocity");
    assert!(share < 0.001, "{slow}");
    assert!(slow.contains("velocity terms and spin costs 0.00549 N, 8.12e-5 %: the largest found"), "{slow}");
    assert!(slow.contains("leaving out extent of the legs would cost 0.739 %"), "{slow}");
    let [.., share, _] = row(&fast, "no-velocity");
    assert!((2.0..5.0).contains(&share), "{fast}");
    assert!(fast.contains("leaving out spin of the legs would cost 0.2"), "{fast}");
    assert!(fast.contains("outside the actuators' stroke"), "{fast}");
    for text in [&slow, &fast] {
        let times =
            ["gravity", "massless-legs", "no-velocity", "exact"].map(|fidelity| row(text, fidelity)[6]);
        assert!(times.iter().all(|ns| *ns > 0.0), "{times:?}");
        assert_eq!(row(text, "exact")[..6], [0.0; 6]);
    }
}

#[test]
fn the_tolerance_decides() {
    let folder = TempDir::new().unwrap();
    let choices = ["1e-9", "0.0001", "0.001", "0.01", "0.1", "1"].map(|tolerance| {
        let sections = format!("[control]\nfidelity_tolerance = {tolerance}\n");
        let text = said(&with(&folder, "fried2008", &sections), None);
        let mentioned = text.contains("gravity alone is within the tolerance too");
        assert_eq!(mentioned, tolerance == "1", "{text}");
        recommended(&text).to_string()
    });
    assert_eq!(choices, ["exact", "rigid-legs", "rigid-legs", "no-velocity", "lumped-legs", "massless-legs"]);
}

/// The vectors have forces without spin by another program: what the fidelity must be off by.
#[test]
fn a_trajectory_is_judged_by_its_rows() {
    for name in ["fried2008", "motion_base", "telescope"] {
        let text = said(&data(name, "toml"), Some(&data(name, "csv")));
        let table = Table::read(&data(name, "csv"));
        let (mut sum, mut squares, mut max, mut peak, mut count) = (0.0, 0.0, 0.0_f64, 0.0_f64, 0.0);
        let mut judged = 0;
        let actuator = machine(name).actuator;
        let stroke = actuator.min_length_m..=actuator.max_length_m;
        for k in 0..table.rows.len() {
            if !table.legs(k, "length").iter().all(|length| stroke.contains(length)) {
                continue;
            }
            judged += 1;
            for (exact, rigid) in table.legs(k, "force").iter().zip(table.legs(k, "force_no_spin")) {
                let error = (exact - rigid).abs();
                (sum, squares, count) = (sum + error, squares + error * error, count + 1.0);
                (max, peak) = (max.max(error), peak.max(exact.abs()));
            }
        }
        let expected: [f64; 3] = [sum / count, (squares / count).sqrt(), max];
        let [mean, rms, most, mean_share, rms_share, share, _] = row(&text, "rigid-legs");
        for (found, expected) in [mean, rms, most].into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 0.006, "{name}: {found} N for {expected} N\n{text}");
        }
        for (found, expected) in [mean_share, rms_share, share].into_iter().zip(expected) {
            let expected = 100.0 * expected / peak;
            assert!((found / expected - 1.0).abs() < 0.006, "{name}: {found} % for {expected} %\n{text}");
        }
        assert!(text.contains(&format!("\n{judged} motions\n")), "{text}");
    }
}

#[test]
fn rows_out_of_reach_are_passed_over_and_nothing_but_them_is_refused() {
    let folder = TempDir::new().unwrap();
    let text = fs::read_to_string(data("fried2008", "csv")).unwrap();
    let mut lines: Vec<_> = text.lines().map(String::from).collect();
    let column = lines[0].split(',').position(|name| name == "x").unwrap();
    let mut put_away = |range: core::ops::Range<usize>| {
        for line in &mut lines[range] {
            let mut fields: Vec<_> = line.split(',').collect();
            fields[column] = "9.0";
            *line = fields.join(",");
        }
        let file = folder.path().join("away.csv");
        fs::write(&file, lines.join("\n") + "\n").unwrap();
        file
    };
    let config = data("fried2008", "toml");
    let some = said(&config, Some(&put_away(1..31)));
    assert!(some.contains("170 motions\npassed over: 30 motions outside the actuators' stroke\n"), "{some}");
    let none = advise(&config, Some(&put_away(1..201)));
    let message = String::from_utf8(none.stderr).unwrap();
    assert_eq!(none.status.code(), Some(2), "{message}");
    let words = "no row can be evaluated: 200 are outside the actuators' stroke, 0 at singular poses";
    assert!(message.contains(words), "{message}");
    let absent = advise(&config, Some(Path::new("absent.csv")));
    assert_eq!(absent.status.code(), Some(2));
}
