//! `hexad workspace` as it is used.

use super::*;

fn config(name: &str) -> String {
    format!("{}/config/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn workspace(name: &str, output: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    command.args(["workspace", "--config", &config(name), "--output"]).arg(output).args(more);
    command.env_remove("HEXAD_LOG").output().unwrap()
}

pub(super) fn said(name: &str, output: &Path, more: &[&str]) -> String {
    let ended = workspace(name, output, more);
    let errors = String::from_utf8(ended.stderr).unwrap();
    assert_eq!((ended.status.code(), errors.as_str()), (Some(0), ""), "no terminal, no bar");
    String::from_utf8(ended.stdout).unwrap()
}

#[test]
fn maps_tables_and_numbers_are_written() {
    let folder = TempDir::new().unwrap();
    let text = said("motion_base", folder.path(), &["--resolution", "21", "--acceleration-m-s2", "2"]);
    for words in [
        "motion_base: forces from rest under 2.00 m/s2 and 9.40 rad/s2",
        "\nx-y ",
        "\nx-z ",
        "\nalpha-beta ",
        "\nball at home's orientation",
        "\nball, turned up to 10.0 deg about any axis",
        "\nbox, times the one below",
    ] {
        assert!(text.contains(words), "{words:?} must be in\n{text}");
    }
    assert_eq!(text.matches("written: ").count(), 6, "{text}");
    for line in text.lines().filter(|line| !line.starts_with("written")) {
        assert!(line.chars().count() <= 120, "{line}");
    }
    let machine = deployed("motion_base").machine;
    let judged = PoseEvaluator::new(&machine, AccelerationDemand { linear_m_s2: 2.0, angular_rad_s2: 9.4 });
    for plane in ["x-y", "x-z", "alpha-beta"] {
        let svg = fs::read_to_string(folder.path().join(plane).with_extension("svg")).unwrap();
        for words in ["stroke margin [mm]", "condition", "payload [kg]", "home", "prefers-color-scheme"] {
            assert!(svg.contains(words), "{words:?} must be in {plane}");
        }
        let table = Table::read(&folder.path().join(plane).with_extension("csv"));
        assert_eq!(table.rows.len(), 21 * 21);
        let mut in_reach = 0;
        for row in 0..table.rows.len() {
            let x = table.coordinates(row, "");
            let quality = judged.quality(&TaskState { x, ..TaskState::default() }.motion().pose);
            for (column, value) in [
                ("in_reach", f64::from(u8::from(quality.within_reach()))),
                ("stroke_margin", quality.stroke_margin_m),
                ("determinant", quality.determinant),
                ("condition", quality.condition),
                ("worst_force", quality.worst_force_n),
                ("payload", quality.payload_kg),
            ] {
                assert_eq!(table.number(row, column), value, "{column} in row {row} of {plane}");
            }
            in_reach += u32::from(quality.within_reach());
        }
        // The grid is laid around what is in reach.
        assert!(in_reach > 21 * 21 / 5, "{in_reach} poses of {plane}");
        for edge in [0, 20, 21 * 20, 21 * 21 - 1] {
            assert_eq!(table.number(edge, "in_reach"), 0.0, "corner {edge} of {plane}");
        }
    }
}

#[test]
fn the_same_twice_whatever_the_number_of_processors() {
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let texts = [("1", &folders[0]), ("3", &folders[1])].map(|(threads, folder)| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        command.args(["workspace", "--config", &config("fried2008"), "--resolution", "31", "--output"]);
        let ended = command.arg(folder.path()).env("RAYON_NUM_THREADS", threads).output().unwrap();
        let text = String::from_utf8(ended.stdout).unwrap();
        text.lines().filter(|line| !line.starts_with("written")).map(String::from).collect::<Vec<_>>()
    });
    assert!(texts[0] == texts[1] && texts[0].len() > 10, "{texts:?}");
    for file in ["y-z.csv", "y-x.csv", "beta-gamma.csv", "y-z.svg", "y-x.svg", "beta-gamma.svg"] {
        let [a, b] = [&folders[0], &folders[1]].map(|folder| fs::read(folder.path().join(file)).unwrap());
        assert!(a == b, "{file}");
    }
}

#[test]
fn what_is_asked_for_wrongly_is_refused() {
    let folder = TempDir::new().unwrap();
    let refused = |more: &[&str], words: &[&str]| {
        let ended = workspace("motion_base", folder.path(), more);
        let message = String::from_utf8(ended.stderr).unwrap();
        assert_eq!((ended.status.code(), ended.stdout.len()), (Some(2), 0), "{more:?}: {message}");
        for word in words {
            assert!(message.contains(word), "{more:?}: {word:?} must be in\n{message}");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{more:?} must write nothing");
    };
    refused(&["--plane", "x-x"], &["'x-x'", "--plane <PLANE>", "two different ones of alpha, beta"]);
    for resolution in ["10", "1002", "-3", "many"] {
        refused(&["--resolution", resolution], &[&format!("'{resolution}'"), "an integer in [11, 1001]"]);
    }
    for flag in ["--acceleration-m-s2", "--angular-acceleration-rad-s2"] {
        for value in ["-1", "NaN", "inf"] {
            refused(&[flag, value], &[flag, &format!("'{value}'"), "must be in [0, 1000000]"]);
        }
    }
    refused(&["--turn", "91deg"], &["'91deg'", "must be in [0deg, 90deg]"]);
    refused(&["--turn", "10"], &["has no unit: say 10deg or 10rad"]);
    refused(&["--through", "0,0,1m"], &["'0,0,1m'", "must be 6 values, as in 0,0,5deg,0,0,1.25m"]);
    refused(&["--through", "0,0,0,0,0,1.9"], &["1.9 has no unit: say 1.9mm or 1.9m"]);
    let through = "--through [0.0, 0.0, 0.0, 0.0, 0.0, 1.9] [rad, m]: must be a pose";
    refused(&["--through", "0,0,0,0,0,1.9m"], &[through, "too long"]);
    refused(&["--through", "0,0,0,0,0,-1250mm"], &["across a singular pose"]);
    refused(&["--through", "0,0,0,0,0,2e4um"], &["the condition is beyond 86.0"]);
    let file = folder.path().with_extension("file");
    fs::write(&file, "").unwrap();
    let ended = workspace("motion_base", &file, &["--resolution", "11"]);
    let message = String::from_utf8(ended.stderr).unwrap();
    fs::remove_file(&file).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{message}");
    assert!(message.contains(&file.display().to_string()), "{message}");
}
