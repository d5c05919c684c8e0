//! The control socket: its protocol, its users, and the status.

use std::fs;
use std::io::BufReader;
use std::process::Command;

use serde_json::{Value, json};

use crate::common::certificate::Certificate;
use crate::common::not_run::lacking;
use crate::support::children::{Ended, HANG, Hexad, run};
use crate::support::disturbance::{line_of, python};
use crate::support::machine::{Machine, PATIENT};
use crate::support::nobody::{AS_NOBODY, cannot, wrapped};
use crate::support::operator::does;
use crate::support::peer::Controlled;
use crate::support::socket::{Client, path_of, status};
use crate::support::trio::{Trio, start_daemon};
use crate::support::turns;

fn request(name: &str, more: Value) -> String {
    let mut line = json!({"version": 1, "request": name});
    for (key, value) in more.as_object().expect("keys") {
        line[key] = value.clone();
    }
    format!("{line}\n")
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn every_line_has_its_answer() {
    let _turn = turns::beside_others();
    let Controlled { peer: _peer, daemon, plant, machine: _machine } =
        Controlled::start(Machine::patient("lines"));
    let mut client = Client::connect(&daemon);
    for (line, words) in [
        ("hello\n".to_owned(), "no request: expected value"),
        (
            "{\"version\": 2, \"request\": \"estop\"}\n".into(),
            "version 2 of the protocol; this daemon has version 1",
        ),
        (
            request("dance", json!({})),
            "unknown request \"dance\"; must be one of status, record, reload, goto, hold, jog, engage, clear, park, stop, off, estop",
        ),
        (request("estop", json!({"wiat": true})), "unknown field `wiat`"),
    ] {
        client.send(&line);
        let answer = client.answer();
        assert_eq!(answer["result"], "invalid");
        assert!(answer["text"].as_str().is_some_and(|text| text.contains(words)), "{answer}");
    }
    // Nothing of that stopped it. Several lines at once, and one in pieces.
    client.send(&(request("status", json!({})) + &request("clear", json!({})) + "{\"version\": 1, "));
    let (first, second) = (client.answer(), client.answer());
    assert_eq!((first["request"].as_str(), first["state"].as_str()), (Some("status"), Some("active")));
    assert_eq!(
        (second["result"].as_str(), second["diagnostic"]["code"].as_u64()),
        (Some("refused"), Some(9))
    );
    client.send("\"request\": \"stop\", \"wait\": true}\n");
    let answer = client.answer();
    assert_eq!(
        (answer["result"].as_str(), answer["state"].as_str()),
        (Some("done"), Some("standby")),
        "{answer}"
    );
    // A later line replaces one that waits.
    client.send(&request("engage", json!({"wait": true, "until_ready": true})));
    let answer = client.answer();
    assert_eq!(
        (answer["result"].as_str(), answer["state"].as_str()),
        (Some("done"), Some("active")),
        "{answer}"
    );
    client.send(&request("estop", json!({})));
    let answer = client.answer();
    assert_eq!(
        (answer["result"].as_str(), answer["diagnostic"]["code"].as_u64()),
        (Some("done"), Some(110)),
        "{answer}"
    );
    client.send(&request("engage", json!({"wait": true, "until_ready": true})));
    let answer = client.answer();
    assert_eq!(
        (answer["result"].as_str(), answer["diagnostic"]["code"].as_u64()),
        (Some("refused"), Some(9)),
        "{answer}"
    );
    assert_eq!(answer["text"], "not possible in state fault (emergency stop); hexad clear first");
    client.send(&"x".repeat(5000));
    assert_eq!(client.answer()["text"], "the line is too long");
    assert!(client.is_closed());
    daemon.says(&format!("request: estop user=root process={}", std::process::id()));
    let path = path_of(&daemon);
    daemon.stops_on("TERM", HANG);
    assert!(!path.exists(), "the socket goes with its daemon");
    plant.stops_on("TERM", HANG);
}

/// The guide shows a panel in Python; it is what it says.
#[test]
fn the_panel_of_the_guide_works() {
    let _turn = turns::beside_others();
    let guide = include_str!("../../docs/operator.md");
    let (_, rest) = guide.split_once("```python\n").expect("an example");
    let (panel, _) = rest.split_once("```").expect("its end");
    assert!(panel.lines().count() <= 10, "{panel}");
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(Machine::patient("panel"));
    let panel = panel.replace("/run/hexad/fried2008.sock", &path_of(&daemon).display().to_string());
    let ended = Command::new("python3").args(["-c", &panel]).output();
    let Ok(ended) = ended else { return lacking("python3") };
    let said = String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success() && said.contains("done standby"), "{said}");
    assert_eq!(status(&machine)["state"], "standby");
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
}

/// Runs `hexad REQUEST` as the user nobody.
fn as_nobody(machine: &Machine, request: &str) -> Ended {
    let mut command = wrapped(machine, &[AS_NOBODY]);
    command.args([request, "--config"]).arg(&machine.file);
    Hexad::spawn(machine, request, command).ends_within(HANG)
}

#[test]
fn another_user_is_told_who_may_and_a_group_opens_it() {
    if cannot(&[AS_NOBODY]) {
        return;
    }
    let _turn = turns::beside_others();
    for (section, may) in
        [("", false), ("[operator]\ngroup = \"nogroup\"", true), ("[operator]\nmode = \"0666\"", true)]
    {
        let machine = Machine::with("users", &format!("{PATIENT}\n{section}"));
        let daemon = start_daemon(&machine);
        daemon.says("running");
        let Ended { status, stdout, stderr } = as_nobody(&machine, "estop");
        if may {
            assert_eq!((status.code(), stdout.trim_end()), (Some(0), "fault"), "{section}: {stderr}");
            daemon.says("request: estop user=nobody process=");
        } else {
            let words = format!("hexad: this user may not send requests for {} (", machine.name);
            assert!(status.code() == Some(2) && stderr.starts_with(&words), "{stderr}");
            assert!(
                stderr.contains("root may; operator.group in the machine file names another group"),
                "{stderr}"
            );
            let Ended { status, stderr, .. } = as_nobody(&machine, "status");
            assert!(status.code() == Some(2) && stderr.starts_with(&words), "{stderr}");
            assert!(!daemon.words().contains("nobody"));
        }
        daemon.stops_on("TERM", HANG);
    }
}

#[test]
fn status_shows_what_the_daemon_knows() {
    let _turn = turns::beside_others();
    let trio = Trio::in_motion("status");
    let answer = status(&trio.machine);
    assert_eq!((&answer["state"], &answer["result"]), (&json!("active"), &json!("done")));
    let report = &answer["status"];
    assert_eq!(
        (&report["timing"]["rate_hz"], report["legs"].as_array().map(Vec::len)),
        (&json!(1000.0), Some(6))
    );
    assert_eq!(report["stroke_m"], json!([0.85, 1.6]));
    for (source, process) in [("setpoint", &trio.setpoints), ("measured", &trio.plant)] {
        let sources = report["sources"].as_array().expect("sources");
        let found = sources.iter().find(|found| found["topic"] == source).expect(source);
        let process =
            json!([{"process_id": process.id(), "command": "hexad", "user": "root", "is_ignored": false}]);
        assert_eq!(found["processes"], process, "{source}");
        assert!(found["age_s"].as_f64().is_some_and(|age_s| age_s < 1.0), "{found}");
    }
    let number = |name: &str, axis: usize| report[name][axis].as_f64().expect("a number");
    for axis in 0..6 {
        let error = if axis < 3 {
            number("orientation_error_rad", axis)
        } else {
            number("position_error_m", axis - 3)
        };
        assert!(
            error.abs() < 1e-3 && (number("pose", axis) - number("setpoint", axis)).abs() < 0.05,
            "{report}"
        );
    }
    let forces = report["legs"].as_array().expect("legs").iter().map(|leg| leg["force_n"].as_f64());
    assert!(forces.flatten().all(|force| force != 0.0 && force.abs() <= 500.0), "{report}");
    let file = trio.machine.file.display().to_string();
    let Ended { stdout, .. } = run(&trio.machine, &["status", "--config", &file]);
    println!("{stdout}");
    assert!(
        stdout.lines().count() <= 24 && stdout.lines().all(|line| line.chars().count() <= 80),
        "{stdout}"
    );
    assert!(stdout.contains("   ACTIVE") && stdout.contains("no diagnostic"), "{stdout}");
    trio.finish();
}

/// Path of the socket, and number of connections, which nobody honest would make: lines with more files than the daemon receives,
/// lines that do not end, are too long, no text, or unknown, answers that nobody reads, and none of all that.
const HOSTILE: &str = r#"
import array, socket, sys
status = b'{"version": 1, "request": "status"}\n'
files = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0] * 60))]
lines = [status, b'{"version": 1, "requ', b"x" * 5000, b"\xff\n", b'{"version": 1, "request": "x"}\n', status * 40, b""]
for k in range(int(sys.argv[2])):
    link = socket.socket(socket.AF_UNIX)
    link.connect(sys.argv[1])
    try:
        link.sendmsg([lines[k % 7]], files if k // 7 % 2 else [])
        if k // 14 % 3 == 0:
            link.settimeout(0.01)
            link.recv(100)
    except OSError:
        pass
print("sent")
"#;

#[test]
fn certificate_hostile_connections_leave_nothing() {
    let _turn = turns::beside_others();
    let certificate = Certificate::new("hostile connections", 1_000, 100_000);
    let machine = Machine::patient("files");
    let daemon = start_daemon(&machine);
    let hostile = |count: u64| {
        let mut sender =
            python(&["/usr/bin/env"], HOSTILE, &[path_of(&daemon).as_ref(), count.to_string().as_ref()]);
        assert_eq!(line_of(&mut BufReader::new(sender.stdout.take().expect("a pipe"))), "sent");
        assert!(sender.wait().expect("its end").success());
        does(&machine, "estop", &[], &["fault"]);
        certificate.advance(count);
    };
    // The most that are open at once, and their buffers.
    hostile(certificate.total() / 10);
    let before @ [files, threads, kilobytes] = resources(daemon.id());
    hostile(certificate.total() * 9 / 10);
    let after = resources(daemon.id());
    assert!(after[0] <= files && after[1] == threads && after[2] <= kilobytes + 256, "{before:?}, {after:?}");
    daemon.stops_on("TERM", HANG);
    certificate.finish(format!("files, threads, kB: {before:?} before, {after:?} after"));
}

/// Open files, threads, and memory of a process \[kB\].
fn resources(process_id: u32) -> [usize; 3] {
    let of = |folder: &str| fs::read_dir(format!("/proc/{process_id}/{folder}")).expect("its files").count();
    let status = fs::read_to_string(format!("/proc/{process_id}/status")).expect("its status");
    let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    let kilobytes = memory.split_whitespace().next().and_then(|number| number.parse().ok());
    [of("fd"), of("task"), kilobytes.expect("a number")]
}

#[test]
fn a_daemon_that_may_not_open_enough_files_says_so() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("few-files");
    let start = |limits: &str| {
        let program = env!("CARGO_BIN_EXE_hexad");
        let mut shell = Command::new("sh");
        shell.args([
            "-c",
            &format!("ulimit {limits}; exec {program} run --config {}", machine.file.display()),
        ]);
        Hexad::spawn(&machine, "run", shell)
    };
    let Ended { status, stderr, .. } = start("-n 32").ends_within(HANG);
    assert_ne!(status.code(), Some(0));
    assert!(stderr.contains("RLIMIT_NOFILE is 32; LimitNOFILE=512"), "{stderr}");
    let daemon = start("-Sn 32");
    daemon.says("running");
    daemon.stops_on("TERM", HANG);
}
