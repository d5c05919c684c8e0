//! What is typed wrong, and files that are not understood: refused in one message, with exit code 2, before anything starts.

use hexad::text::csv_table::{in_group, pose_columns, trajectory_columns};

use super::tables::{HOME, SECONDS, moves, poses};
use super::{Folder, has, table};

const ABSENT: &str = "required arguments were not provided";
const TOOL: &str = "[[frame]]\nname = \"tip\"\nkind = \"tool\"\npose = [0.0, 0.0, 0.0, 0.3, 0.0, 0.0]\n";

#[test]
fn what_is_typed_wrong_is_refused() {
    let folder = Folder::new(TOOL);
    folder.write("T.csv", "alpha,beta,gamma,x,y,z\n0,0,0,1.1,0,0\n");
    for (line, words) in [
        ("frobnicate", ["unrecognized subcommand 'frobnicate'", "Usage: hexad [OPTIONS] <COMMAND>"]),
        ("run", [ABSENT, "--config <FILE>"]),
        ("plant", [ABSENT, "--config <FILE>"]),
        ("check", [ABSENT, "--config <FILE>"]),
        ("move --motion sines", [ABSENT, "--config <FILE>"]),
        ("move @M", [ABSENT, "--motion <MOTION>|--trajectory <FILE>"]),
        ("move @M --motion sines --trajectory t.csv", ["'--motion <MOTION>'", "with '--trajectory <FILE>'"]),
        ("move @M --trajectory t.csv --seconds 3", ["cannot be used with", "--seconds <SECONDS>"]),
        ("move @M --motion sines --group reference", ["cannot be used with", "--group <GROUP>"]),
        ("move @M --motion circle --rotation zyx", ["cannot be used with", "--rotation <ORDER>"]),
        ("move @M --trajectory t.csv --rotation zxz", ["'zxz'", "xyz, xzy, yxz, yzx, zxy, zyx, quaternion]"]),
        ("move @M --motion waltz", ["'waltz'", "sines"]),
        ("move @/machine.toml --motion waltz", ["'waltz'", "sines"]),
        ("move @M --motion sines --seconds soon", ["'soon' for '--seconds <SECONDS>'", "must be a number"]),
        ("run @M --fast", ["unexpected argument '--fast'", ""]),
        ("check @/machine.toml @M", ["'[MACHINE]' cannot be used with '--config <FILE>'", ""]),
        ("status --watch", ["<MACHINE|--config <FILE>>", ""]),
        ("faults -- 0", ["must be the number of a diagnostic", ""]),
        ("faults -- 99", ["must be the number of a diagnostic", ""]),
        ("faults -- -1", ["must be the number of a diagnostic", ""]),
        ("faults -- x", ["must be the number of a diagnostic", ""]),
        ("goto @M", ["no target: give coordinates", ""]),
        ("goto @M --x 5", ["invalid value '5' for '--x <LENGTH>'", "has no unit: say 5mm or 5m"]),
        ("goto @M --alpha -0.1", ["has no unit: say -0.1deg or -0.1rad", ""]),
        ("goto @M --gamma 5mm", ["must be an angle in rad, mrad, urad, deg, arcmin, arcsec", ""]),
        ("goto @M --home --speed 0", ["must be in [0.01, 1]", ""]),
        ("goto @M --home --speed 200%", ["must be in [1, 100] %", ""]),
        ("goto @M --home --speed fast", ["must be a number", ""]),
        ("goto @M --tool tap --x 1m --dry-run", ["no tool frame \"tap\", must be one of: tip;", ""]),
        ("goto @M --table @/T.csv", [ABSENT, "--output <FILE>"]),
        ("goto @M --table @/T.csv --output o.csv --x 1mm", ["cannot be used with", "--x <LENGTH>"]),
        ("goto @M --table @/T.csv --output - --resume", ["--output must be a regular file", ""]),
        ("goto @M --table @/T.csv --output /dev/null --resume", ["--output must be a regular file", ""]),
        ("goto @M --table @/machine.toml --output o.csv", ["missing columns alpha, beta, gamma", ""]),
        ("goto @M --x 1mm --resume", [ABSENT, "--table <FILE>"]),
        (
            "goto @M --home --units nm",
            ["must be a unit of length (m, mm, um, nm) and one of angle (rad,", ""],
        ),
        ("status --units nm,arcsec", ["--units: name the machine", ""]),
        ("status @M --units nm,arcsec --json", ["cannot be used with", "--json"]),
        ("convert @/run.mcap --csv @/run.csv --units nm,deg", ["--tool <NAME>|--work <NAME>", ""]),
        ("convert @/run.mcap --csv @/run.csv --every 0", ["must be a number of cycles, at least 1,", ""]),
        ("convert @/run.mcap --csv @/run.csv --every 1.5", ["as 10 or 10ms", ""]),
        ("move @M --udp 127.0.0.1:4123 --tool tip", ["must go with --trajectory", ""]),
    ] {
        folder.refuses(line, &words);
    }
    for seconds in ["0", "0.09", "86401", "1e300", "inf", "NaN", "-1"] {
        for command in ["move @M", "demo"] {
            let line = format!("{command} --motion sines --seconds={seconds}");
            let words = ["--seconds <SECONDS>", &format!("'{seconds}'"), "must be in [0.1, 86400] s"];
            folder.refuses(&line, &words);
        }
    }
}

/// Of the process: the code, one message, and nothing on standard output. What these commands find they find after they have set up
/// their signals, which a process does once.
#[test]
fn a_process_that_is_refused_has_code_2_and_says_why() {
    let folder = Folder::new("");
    folder.write(
        "mistakes.toml",
        folder.read("machine.toml") + "[timeouts]\nsetpoint_ms = 0.5\nmeasured_s = 1\n",
    );
    folder.write("limit.toml", folder.read("machine.toml") + "[setpoint]\non_violation = \"limit\"\n");
    const LIMIT: &str = "move --config @/limit.toml --udp";
    let mistakes = folder.path("mistakes.toml").display().to_string();
    for (line, words) in [
        ("frobnicate".into(), vec!["error: unrecognized subcommand"]),
        ("demo --config @/absent.toml".into(), vec!["/absent.toml: could not be read: No such file"]),
        (
            "run --config @/mistakes.toml".into(),
            vec![&*mistakes, "setpoint_ms = 0.5: must be greater than 1", "measured_s"],
        ),
        ("doctor --cpu 1000".into(), vec!["hexad: no binding to CPU 1000: it is not online"]),
        ("jog @M".into(), vec!["must be a terminal"]),
        ("move @M --udp 127.0.0.1:4123 --format simtools".into(), vec!["setpoint.on_violation = \"limit\""]),
        (format!("{LIMIT} 127.0.0.1:4123"), vec!["needs --format"]),
        (format!("{LIMIT} 127.0.0.1:4123 --format none"), vec!["no such file; the formats with a name are"]),
        (format!("{LIMIT} 0.0.0.0:4123 --format simtools"), vec!["must be the address of one interface"]),
        (format!("{LIMIT} 192.0.2.1:4123 --format simtools"), vec!["with --from"]),
        (format!("{LIMIT} 127.0.0.1:4123 --format simtools --boarding 0,0,0,9m,0,0"), vec!["workspace"]),
        ("record @M --output @/none.mcap".into(), vec!["no daemon runs for commands-"]),
    ] {
        let (code, output, errors) = folder.run(&line);
        assert_eq!((code, &*output), (Some(2), ""), "{line}: {errors}");
        assert_eq!(
            errors.matches("error: ").count() + errors.matches("hexad: ").count(),
            1,
            "{line}: {errors}"
        );
        has(&errors, &words);
    }
    assert!(!folder.path("none.mcap").exists());
    let bad = "timeouts.measured_ms = 200: must be at most ";
    folder.write("machine.toml", folder.read("machine.toml") + "[timeouts]\nmeasured_ms = 200.0\n");
    folder.write(
        "weak.toml",
        folder
            .read("mistakes.toml")
            .split("[timeouts]")
            .next()
            .unwrap()
            .replace("max_force_n = 500.0", "max_force_n = 15.7"),
    );
    // Each leg holds 15.99 N at home.
    let weak = "/weak.toml:28: actuator.max_force_n = 15.7: must be at least 18 to hold the platform: leg ";
    for command in ["check", "run", "demo"] {
        for (file, words) in [("machine", [bad, ""]), ("weak", [weak, "15.98"])] {
            let (code, _, errors) = folder.run(&format!("{command} --config @/{file}.toml"));
            assert_eq!(code, Some(2), "{command} {file}: {errors}");
            has(&errors, &words);
        }
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn trajectories_are_refused_by_file_and_value() {
    let columns = trajectory_columns().join(",");
    let (good, last) = (moves(1.0), moves(1.0).len() - 1);
    let changed = |row: usize, column: usize, value: f64| {
        let mut rows = good.clone();
        rows[row][column] = value;
        table(&columns, rows)
    };
    let without = |column: &str| table(&columns, good.clone()).replacen(column, &format!("not_{column}"), 1);
    let (quaternions, rates) = ("t,qw,qx,qy,qz,x,y,z", columns.split_once("x,y,z").unwrap().1);
    let zeros = ",0".repeat(12);
    let groups = ["estimated", "reference"].map(|group| in_group(group, &pose_columns()).join(","));
    let setpoints = in_group("setpoint", &pose_columns()).join(",");
    let nan = "NaN,NaN,NaN,NaN,NaN,NaN,NaN\n";
    // Of the first rows the message has one line.
    const SHORT: usize = 9;
    let cases = [
        ("", changed(0, 10, 0.25), &["first row", "0.25", "at rest"][..]),
        ("", changed(last, 7, -0.125), &["last row", "0.125", "at rest"]),
        ("", changed(0, 16, 0.75), &["first row", "0.75", "at rest"]),
        ("", changed(3, 0, 0.1), &["t = 0.1", "must increase"]),
        ("", changed(1, 0, 0.0), &["t = 0.0 after t = 0.0", "must increase"]),
        ("", without("y_rate"), &["line 1", "missing columns y_rate"]),
        ("", without("t,"), &["line 1", "missing columns t"]),
        (
            "",
            changed(0, 4, 1.0).replacen(",1.0,", ",one,", 1),
            &["line 2", "x = \"one\"", "must be a number"],
        ),
        ("", changed(2, 4, f64::INFINITY), &["line 4", "x = inf", "must be finite"]),
        (
            "quaternion",
            format!("{quaternions}\n0,1,0,0,0,1.1,0,0\n1,1,1,0,0,1.1,0,0\n"),
            &["line 3: norm of qw, qx, qy, qz = 1.414: must be 1"],
        ),
        (
            "quaternion",
            format!("{quaternions}{rates}\n0,1,0,0,0,1.1,0,0{zeros}\n"),
            &["line 2: rates and accelerations beside a quaternion: leave them out"],
        ),
        (
            "xyz",
            format!("{quaternions}\n0,1,0,0,0,1.1,0,0\n"),
            &["missing columns alpha, beta, gamma", "--rotation names another order or quaternions"],
        ),
        // alpha = 90 deg first, then gamma: in X, beta is 90 deg.
        (
            "zxy",
            format!("{columns}\n0,1.5707963267948966,0,1.5707963267948966,1.1,0,0{zeros}\n"),
            &["alpha and gamma of X have no rates at beta = +-90 deg"],
        ),
        (
            "",
            format!("{}\n0{}\n", groups.join(","), ",0".repeat(13)),
            &["line 1: columns of several groups: --group must name one of reference, estimated"],
        ),
        (
            "measured",
            format!("{}\n0{}\n", groups[0], ",0".repeat(6)),
            &["line 1: missing column measured_t: groups with all columns: estimated"],
        ),
        (
            "",
            format!("{setpoints}\n0{zero}\n{nan}{nan}1{zero}\n", zero = ",0".repeat(6)),
            &["line 3: no setpoint up to line 5: must be without a gap"],
        ),
        (
            "",
            poses("t,x_mm,y,z,alpha,beta,gamma", ',', 1.0, true),
            &["with decimal commas the fields must be separated by semicolons"],
        ),
        (
            "",
            poses("t,x_cm,y,z,alpha,beta,gamma", ',', 1.0, false),
            &["missing columns x (x_cm: its units are m, mm, um, nm)"],
        ),
        (
            "",
            poses("t;x;y;z;alpha;beta;x_mm", ';', 1.0, false),
            &["column x appears 2 times: must appear once"],
        ),
        (
            "",
            poses("t_ms,x_mm,y,z,alpha,beta,gamma", ',', 1.0, false),
            &["beyond a limit of velocity, acceleration or jerk"],
        ),
    ];
    for (number, (options, text, words)) in cases.into_iter().enumerate() {
        let folder = Folder::new("");
        folder.write("t.csv", text);
        let option = match options {
            "" => "",
            "measured" => " --group ",
            _ => " --rotation ",
        };
        let message = folder.refuses(&format!("move @M --trajectory @/t.csv{option}{options}"), words);
        assert!(message.starts_with(&format!("{}: ", folder.path("t.csv").display())), "{message}");
        assert!(number >= SHORT || message.lines().count() == 1, "{message}");
    }
}

/// What the daemon would refuse in motion is told by the row on the way to which it would.
#[test]
fn what_the_daemon_would_refuse_is_told_before_it_begins() {
    let envelope = "[envelope]\nvelocity = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]\nacceleration = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]\n\
                    pose_min = [-0.1, -0.1, -0.1, -0.1, -0.1, -0.1]\npose_max = [0.1, 0.1, 0.1, 0.04, 0.1, 0.1]";
    // The move is fastest in the middle, which is line 7, strongest at a fifth of the time. With
    // too much jerk the reference falls behind, until it is too far away. Last: ten times as far in ten times the time.
    for (sections, larger, words) in [
        (
            "[limits]\nvelocity_m_s = 0.06",
            1.0,
            &["line 7", ": velocity: ", "is 1.0", " times the limit in [limits]"][..],
        ),
        (
            "[limits]\nacceleration_m_s2 = 0.12",
            1.0,
            &["line 4", ": acceleration: ", "is 1.0", " times the limit"],
        ),
        (
            "[limits]\njerk_m_s3 = 0.5",
            1.0,
            &["line 7", "setpoint beyond the limits", "is 1.0", " times the tolerance control.engage_*"],
        ),
        (
            envelope,
            1.0,
            &["line 9", "coordinate 1.14", " of axis 4 is outside [envelope], whose bound is 1.14"],
        ),
        ("", 10.0, &["line 10", "beyond the stroke of a leg", " m of leg ", "whose bound is "]),
    ] {
        let folder = Folder::new(sections);
        folder.write("t.csv", table(&trajectory_columns().join(","), moves(larger)));
        let message = folder.refuses("move @M --trajectory @/t.csv", &[]);
        let first = message.lines().next().unwrap();
        assert!(first.starts_with(&format!("{}: ", folder.path("t.csv").display())), "{first}");
        has(first, words);
        assert_eq!(first.contains("on_violation"), words.contains(&"setpoint beyond the limits"), "{first}");
        // Nothing is advised that is set.
        folder
            .write("machine.toml", folder.read("machine.toml") + "\n[setpoint]\non_violation = \"limit\"\n");
        let message = folder.refuses("move @M --trajectory @/t.csv", words);
        assert!(!message.contains("on_violation"), "{message}");
    }
    assert!((SECONDS, HOME) == (1.5, 1.1), "the lines above are of this motion");
}
