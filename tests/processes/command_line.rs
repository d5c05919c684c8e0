//! What is typed wrong is refused in one message, with exit code 2, before anything starts.

use std::ffi::OsStr;
use std::fs::File;
use std::path::Path;
use std::process::Stdio;

use hexad::control::signals::diagnostic::DiagnosticCode;

use crate::support::children::{Ended, HANG, hexad, run};
use crate::support::machine::Machine;
use crate::support::trio::start_daemon;

/// Runs a command line that must be refused with these words; nothing goes to standard output.
fn refused(arguments: &[&str], words: &[&str]) {
    let machine = Machine::patient("command-line");
    let file = machine.file.display().to_string();
    let arguments: Vec<_> =
        arguments.iter().map(|word| if *word == "FILE" { &file } else { *word }).collect();
    let ended = run(&machine, &arguments);
    assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {}", ended.stderr);
    assert_eq!(ended.stdout, "", "{arguments:?}");
    for word in words {
        assert!(ended.stderr.contains(word), "{arguments:?}: {word:?} must be in\n{}", ended.stderr);
    }
    let errors = ended.stderr.matches("error: ").count() + ended.stderr.matches("hexad: ").count();
    assert_eq!(errors, 1, "{arguments:?} must give one message:\n{}", ended.stderr);
}

#[test]
fn what_is_typed_wrong_is_refused() {
    refused(&["frobnicate"], &["unrecognized subcommand 'frobnicate'", "Usage: hexad [OPTIONS] <COMMAND>"]);
    for command in ["run", "plant", "check"] {
        refused(&[command], &["required arguments were not provided", "--config <FILE>"]);
    }
    refused(&["move", "--motion", "sines"], &["required arguments were not provided", "--config <FILE>"]);
    refused(&["move", "--config", "FILE"], &["--motion <MOTION>|--trajectory <FILE>"]);
    refused(
        &["move", "--config", "FILE", "--motion", "sines", "--trajectory", "t.csv"],
        &["'--motion <MOTION>' cannot be used with '--trajectory <FILE>'"],
    );
    refused(
        &["move", "--config", "FILE", "--trajectory", "t.csv", "--seconds", "3"],
        &["cannot be used with", "--seconds <SECONDS>"],
    );
    refused(
        &["move", "--config", "FILE", "--motion", "sines", "--group", "reference"],
        &["cannot be used with", "--group <GROUP>"],
    );
    refused(&["move", "--config", "FILE", "--motion", "waltz"], &["'waltz'", "sines"]);
    refused(&["run", "--config", "FILE", "--fast"], &["unexpected argument '--fast'"]);
    refused(&["check", "FILE", "--config", "FILE"], &["'[MACHINE]' cannot be used with '--config <FILE>'"]);
    refused(&["status", "--watch"], &["<MACHINE|--config <FILE>>"]);
}

/// As an argument it is the same as as an option.
#[test]
fn a_machine_file_is_an_argument_too() {
    let machine = Machine::patient("argument");
    let file = machine.file.to_str().expect("a plain name");
    let said = |arguments: &[&str]| {
        let Ended { status, stdout, stderr } = run(&machine, arguments);
        (status.code(), stdout, stderr)
    };
    let by_option = said(&["check", "--config", file]);
    assert_eq!(by_option.0, Some(0), "{}", by_option.2);
    assert_eq!(said(&["check", file]), by_option);
    for command in ["status", "estop"] {
        assert_eq!(said(&[command, file]), said(&[command, "--config", file]), "{command}");
    }
    // What is after it is its own.
    assert_eq!(said(&["move", file, "--motion", "waltz"]).0, Some(2));
}

#[test]
fn bad_durations_are_refused_with_their_bound() {
    for seconds in ["0", "0.09", "86401", "1e300", "inf", "NaN", "-1"] {
        for command in ["move", "demo"] {
            let option = format!("--seconds={seconds}");
            let arguments = [command, "--config", "FILE", "--motion", "sines", &option];
            refused(
                &arguments,
                &["--seconds <SECONDS>", &format!("'{seconds}'"), "must be in [0.1, 86400] s"],
            );
        }
    }
    refused(
        &["move", "--config", "FILE", "--motion", "sines", "--seconds", "soon"],
        &["'soon'", "--seconds <SECONDS>", "must be a number"],
    );
}

#[test]
fn machine_files_that_cannot_be_read_are_named() {
    let machine = Machine::patient("unreadable");
    let absent = machine.path("absent.toml").display().to_string();
    let folder = machine.folder().display().to_string();
    let binary = machine.path("binary.toml").display().to_string();
    std::fs::write(&binary, [0xff, 0xfe, 0x00, 0x80]).expect("a file");
    for (path, why) in [(&absent, "No such file"), (&folder, "Is a directory"), (&binary, "UTF-8")] {
        for command in [&["run"] as &[_], &["plant"], &["check"], &["demo"], &["move", "--motion", "sines"]] {
            let arguments: Vec<&str> = command.iter().copied().chain(["--config", path]).collect();
            refused(&arguments, &[path, why]);
        }
    }
}

#[test]
fn a_machine_file_with_mistakes_is_refused_with_all_of_them() {
    let machine = Machine::with("mistakes", "[timeouts]\nsetpoint_ms = 0.5\nmeasured_s = 1\n");
    let ended = run::<&OsStr>(&machine, &["run".as_ref(), "--config".as_ref(), machine.file.as_ref()]);
    assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
    for words in [
        &machine.file.display().to_string(),
        "timeouts.setpoint_ms = 0.5: must be greater than 1",
        "measured_s",
    ] {
        assert!(ended.stderr.contains(words), "{words:?} must be in\n{}", ended.stderr);
    }
}

#[test]
fn check_shows_a_good_machine() {
    let machine = Machine::patient("check");
    let ended = run::<&OsStr>(&machine, &["check".as_ref(), "--config".as_ref(), machine.file.as_ref()]);
    assert_eq!((ended.status.code(), ended.stderr.as_str()), (Some(0), ""));
    for words in [&format!("{}: valid", machine.name), "length", "force", "6 is best", "gain margin"] {
        assert!(ended.stdout.contains(words), "{words:?} must be in\n{}", ended.stdout);
    }
    assert_eq!(ended.stdout.matches(" deg\n").count(), 6, "a line for each leg:\n{}", ended.stdout);
}

#[test]
fn check_draws_the_machine_or_says_why_not() {
    let machine = Machine::patient("drawn");
    let check = |drawing: &Path| {
        let [check, config, option] = ["check", "--config", "--drawing"].map(AsRef::as_ref);
        run::<&OsStr>(&machine, &[check, config, machine.file.as_ref(), option, drawing.as_ref()])
    };
    let drawing = machine.path("machine.svg");
    let ended = check(&drawing);
    assert_eq!((ended.status.code(), ended.stderr.as_str()), (Some(0), ""));
    let svg = std::fs::read_to_string(&drawing).expect("a drawing");
    for words in ["from above", "from the side", "in perspective", "x [m]", "y [m]", "z [m]"] {
        assert!(svg.contains(words), "{words:?} must be in {}", drawing.display());
    }
    let ended = check(&machine.path("missing/machine.svg"));
    assert_eq!(ended.status.code(), Some(1));
    assert!(ended.stderr.contains("missing/machine.svg"), "{}", ended.stderr);
}

/// As of `hexad check | head -1`; and what could not be written is no success.
#[test]
fn who_has_read_enough_is_no_failure_and_a_full_disk_is_one() {
    let mut child = hexad().arg("faults").stdout(Stdio::piped()).spawn().expect("a process");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("its end").code(), Some(0));
    let full = File::options().write(true).open("/dev/full").expect("a full disk");
    let ended = hexad().arg("faults").stdout(full).output().expect("a process");
    assert_eq!(ended.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ended.stderr).contains("standard output: No space left"), "{ended:?}");
}

/// `hexad check` tells it too, but who runs a daemon may not have asked.
#[test]
fn a_daemon_says_that_its_loop_is_bold() {
    let machine = Machine::with(
        "bold",
        "[control]\nmode = \"feedforward_joint_pd\"\nposition_bandwidth_hz = 28.724\nposition_damping_ratio = 3.0\ndisturbance_m_s2_per_sqrt_s = 500.0\n",
    );
    let daemon = start_daemon(&machine);
    daemon.says("WARN control.position_bandwidth_hz = 28.724: legs loop: with 2.10 periods of delay it is stable with");
    daemon.says("running");
    daemon.stops_on("TERM", HANG);
}

#[test]
fn a_diagnostic_is_explained_by_its_number() {
    let machine = Machine::patient("faults");
    let ended = run(&machine, &["faults", "125"]);
    let words = ended.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    let expected = "125 sensor frozen The readings of a leg stayed the same to the last bit while its reference moved. \
                    Forces are disabled and the brakes close at once; fault until cleared. To do: check the encoder of this leg and \
                    the driver";
    assert_eq!((ended.status.code(), words.as_str()), (Some(0), expected));
    for number in ["0", "99", "-1", "x"] {
        let ended = run(&machine, &["faults", "--", number]);
        assert_eq!(ended.status.code(), Some(2), "{number}: {}", ended.stdout);
        assert!(ended.stderr.contains("must be the number of a diagnostic"), "{number}: {}", ended.stderr);
    }
    let json = |arguments: &[&str]| -> Vec<serde_json::Value> {
        serde_json::from_str(&run(&machine, arguments).stdout).expect("JSON")
    };
    let all = json(&["faults", "--json"]);
    assert_eq!(all.len() + 1, DiagnosticCode::ALL.len());
    for entry in &all {
        for text in ["name", "cause", "reaction", "remedy"] {
            assert!(entry[text].as_str().is_some_and(|text| !text.trim().is_empty()), "{text}: {entry}");
        }
    }
    let one = json(&["faults", "125", "--json"]);
    assert!(one.len() == 1 && all.contains(&one[0]) && one[0]["reaction"] == "brake", "{one:?}");
}

/// As after `cargo install`, which installs nothing but the program.
#[test]
fn manual_pages_and_completions_are_written_by_the_program() {
    let machine = Machine::patient("manuals");
    let folder = machine.path("manuals");
    let ended = run(&machine, &["manuals", folder.to_str().expect("a plain name")]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    let help = run(&machine, &["--help"]).stdout;
    let commands: Vec<_> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  ")?.split_once(' ').filter(|(name, _)| !name.is_empty()))
        .map(|(name, _)| name)
        .filter(|name| *name != "help")
        .collect();
    assert!(commands.len() > 30 && !commands.contains(&"manuals"), "{commands:?}");
    for command in commands {
        let page = std::fs::read_to_string(folder.join(format!("man/hexad-{command}.1")));
        assert!(page.is_ok_and(|page| page.contains(".SH NAME")), "{command}");
    }
    for shell in ["hexad.bash", "_hexad", "hexad.fish"] {
        let text = std::fs::read_to_string(folder.join("completions").join(shell)).expect(shell);
        assert!(text.contains("inverse-dynamics"), "{shell}");
    }
}
