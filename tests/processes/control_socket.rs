//! The control socket: its protocol, its users, and the status.

use std::fs;
use std::io::BufReader;
use std::process::Command;

use serde_json::{Value, json};

use crate::support::children::{Ended, Hexad};
use crate::support::disturbance::{line_of, python};
use crate::support::machine::{Machine, PATIENT};
use crate::support::nobody::{AS_NOBODY, cannot, wrapped};
use crate::support::operator::{does, own_name};
use crate::support::peer::Controlled;
use crate::support::socket::{Client, path_of, state, status};
use crate::support::trio::{Trio, start_daemon};
use hexad_support::certificate::Certificate;
use hexad_support::not_run::lacking;

#[test]
#[apply(beside_others)]
fn every_line_has_its_answer() {
    let Controlled { peer: _peer, daemon, plant, machine: _machine } =
        Controlled::start(Machine::patient("lines"));
    let mut client = Client::connect(&daemon);
    for (line, words) in [
        ("hello\n", "no request: expected value"),
        (
            "{\"version\": 2, \"request\": \"engage\"}\n",
            "version 2 of the protocol; this daemon has version 1",
        ),
        (
            "{\"version\": 1, \"request\": \"dance\"}\n",
            "unknown request \"dance\"; must be one of status, record, reload, goto, hold, jog, confirm_legs, ride_start, ride_end, engage, clear, park, stop, off, estop",
        ),
        ("{\"version\": 1, \"request\": \"engage\", \"wiat\": true}\n", "unknown field `wiat`"),
        ("{\"version\": 1, \"request\": \"record\"}\n", "record needs an open file"),
        (
            "{\"version\": 1, \"request\": \"park\", \"cycle_ns\": 7}\n",
            "cycle_ns names a cycle in simulated time",
        ),
    ] {
        client.send(line);
        let answer = client.answer();
        assert_eq!(answer["result"], "invalid");
        assert!(answer["text"].as_str().is_some_and(|text| text.contains(words)), "{answer}");
    }
    for (key, words) in
        [("geometry_sha1", "another name or other joints"), ("remote", "confirmed on this host")]
    {
        let answer = client.ask("confirm_legs", &json!({key: "elsewhere", "legs": [1, 2, 3, 4, 5, 6]}));
        assert_eq!(answer["result"], "refused");
        assert!(answer["text"].as_str().is_some_and(|text| text.contains(words)), "{answer}");
    }
    // Nothing of that stopped it. Several lines at once, and one in pieces.
    client.send(
        "{\"version\": 1, \"request\": \"status\"}\n{\"version\": 1, \"request\": \"clear\"}\n{\"version\": 1, ",
    );
    let is = |answer: &Value, result: &str, key: &str, value: Value| {
        let found = answer.pointer(key).unwrap_or(&Value::Null);
        assert_eq!((&answer["result"], found), (&result.into(), &value), "{answer}");
    };
    is(&client.answer(), "done", "/state", "active".into());
    is(&client.answer(), "refused", "/diagnostic/code", 9.into());
    client.send("\"request\": \"stop\", \"wait\": true}\n");
    is(&client.answer(), "done", "/state", "standby".into());
    // A later line replaces one that waits.
    let ready = json!({"wait": true, "until_ready": true});
    is(&client.ask("engage", &ready), "done", "/state", "active".into());
    is(&client.ask("estop", &json!({})), "done", "/diagnostic/code", 110.into());
    let answer = client.ask("engage", &ready);
    is(&answer, "refused", "/diagnostic/code", 9.into());
    assert_eq!(answer["text"], "not possible in state fault (emergency stop); hexad clear first");
    client.send(&"x".repeat(5000));
    assert_eq!(client.answer()["text"], "the line is too long");
    assert!(client.is_closed());
    daemon.says(&format!("request: estop user={} process={}", own_name(), std::process::id()));
    let path = path_of(&daemon);
    daemon.stops();
    assert!(!path.exists(), "the socket goes with its daemon");
    plant.stops();
}

/// The guide shows a panel in Python; it is what it says.
#[test]
#[ignore = "second tier: needs Python"]
#[apply(beside_others)]
fn the_panel_of_the_guide_works() {
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
    assert_eq!(state(&machine), "standby");
    daemon.stops();
    plant.stops();
}

/// Runs `hexad REQUEST` as the user nobody.
fn as_nobody(machine: &Machine, request: &str) -> Ended {
    let mut command = wrapped(machine, &[AS_NOBODY]);
    command.args([request, "--config"]).arg(&machine.file);
    Hexad::spawn(machine, request, command).ends()
}

#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn another_user_is_told_who_may_and_a_group_opens_it() {
    if cannot(&[AS_NOBODY]) {
        return;
    }
    for (section, may) in
        [("", false), ("[operator]\ngroup = \"nogroup\"", true), ("[operator]\nmode = \"0666\"", true)]
    {
        let machine = Machine::with("users", &format!("{PATIENT}\n{section}"));
        let daemon = start_daemon(&machine);
        daemon.says("running");
        let ended = as_nobody(&machine, "estop");
        if may {
            assert_eq!(ended.succeeds().trim_end(), "fault", "{section}");
            daemon.says("request: estop user=nobody process=");
        } else {
            let words = format!("hexad: this user may not send requests for {} (", machine.name);
            let said = ended.fails(2, "root may; operator.group in the machine file names another group");
            let status = as_nobody(&machine, "status").fails(2, &words);
            assert!(said.starts_with(&words) && status.starts_with(&words), "{said}{status}");
            assert!(!daemon.words().contains("nobody"));
        }
        daemon.stops();
    }
}

#[test]
#[apply(beside_others)]
fn status_shows_what_the_daemon_knows() {
    let trio = Trio::in_motion("status");
    let answer = status(&trio.machine);
    assert_eq!((&answer["state"], &answer["result"]), (&json!("active"), &json!("done")));
    let report = &answer["status"];
    assert_eq!(
        (&report["timing"]["rate_hz"], report["legs"].as_array().map(Vec::len)),
        (&json!(1000.0), Some(6))
    );
    assert_eq!(report["stroke_m"], json!([0.85, 1.6]));
    for (source, process) in
        [("setpoint", trio.setpoints.as_ref().expect("a player")), ("measured", &trio.plant)]
    {
        let sources = report["sources"].as_array().expect("sources");
        let found = sources.iter().find(|found| found["topic"] == source).expect(source);
        let process = json!([{"process_id": process.id(), "command": "hexad", "user": own_name(), "is_ignored": false}]);
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
    let stdout = trio.machine.hexad::<&str>("status", &[]).succeeds();
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
#[ignore = "second tier: needs Python"]
#[apply(beside_others)]
fn certificate_hostile_connections_leave_nothing() {
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
    daemon.stops();
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
#[apply(beside_others)]
fn a_daemon_that_may_not_open_enough_files_says_so() {
    let machine = Machine::patient("few-files");
    let start = |limits: &str| {
        let program = env!("CARGO_BIN_EXE_hexad");
        let mut shell = Command::new("sh");
        shell.args([
            "-c",
            &format!("ulimit {limits}; exec '{program}' run --config '{}'", machine.file.display()),
        ]);
        Hexad::spawn(&machine, "run", shell)
    };
    start("-n 32").ends().fails(2, "RLIMIT_NOFILE is 32; LimitNOFILE=512");
    let daemon = start("-Sn 32");
    daemon.says("running");
    daemon.stops();
}
