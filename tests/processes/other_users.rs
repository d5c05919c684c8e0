//! Stop requests reach the right machine, whatever other users of the host have made; each on a host of its own.

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use crate::support::children::{Ended, Hexad};
use crate::support::host::{Host, MALLORY, NOGROUP, OPERATOR, SERVICE};
use crate::support::machine::Machine;

/// The machine file there.
const FILE: &str = "/run/test/machine.toml";
const STOPPED: &str = "fault: emergency stop";

/// Listens like a daemon of the machines whose names are given, with a record of itself, and answers every line, or none.
const IMPOSTOR: &str = r#"
import os, socket, sys, threading
answer, *names = sys.argv[1:]
folder = f"/tmp/hexad-{os.getuid()}"
os.makedirs(folder, exist_ok=True)
os.chmod(folder, 0o755)
start = open(f"/proc/{os.getpid()}/stat").read().rsplit(")", 1)[1].split()[19]
def serve(link):
    for line in link.makefile("rb"):
        open(f"/run/test/impostor", "ab").write(line)
        if answer != "none":
            link.sendall(b'{"version": 1, "result": "%s", "request": "estop", "state": "fault", "text": "", "diagnostic": '
                b'{"code": 0, "name": "", "value": null, "bound": null, "index": 0, "text": ""}}\n' % answer.encode())
def listen(name):
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(f"{folder}/{name}.sock")
    os.chmod(f"{folder}/{name}.sock", 0o666)
    listener.listen(100)
    with open(f"{folder}/{name}.daemon", "w") as record:
        record.write(f"{os.getpid()}\n{start}\n\n")
    while True:
        threading.Thread(target=serve, args=listener.accept()[:1], daemon=True).start()
for name in names:
    threading.Thread(target=listen, args=(name,), daemon=True).start()
threading.Event().wait()
"#;

fn impostor(host: &Host, answer: &str, names: &[&str]) -> Hexad {
    let mut command = host.program(MALLORY, &[], "python3");
    command.args(["-c", IMPOSTOR, answer]).args(names);
    let mut impostor = host.spawn("impostor", command);
    while !names.iter().all(|name| host.path(&format!("/tmp/hexad-{MALLORY}/{name}.daemon")).exists()) {
        impostor.must_run();
        sleep(Duration::from_millis(5));
    }
    impostor
}

fn host(test: &str, sections: &str) -> Option<Host> {
    Host::start(Machine::with(test, &format!("{}\n{sections}", crate::support::machine::PATIENT)))
}

fn says(ended: &Ended, code: i32, stdout: &str, stderr: &str) {
    let found = (ended.status.code(), ended.stdout.trim_end());
    assert_eq!(found, (Some(code), stdout), "{}", ended.stderr);
    assert!(ended.stderr.contains(stderr), "{stderr:?} must be in {}", ended.stderr);
}

/// Another user's answer never counts: neither beside the operator's own daemon, nor alone, nor for root.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn another_users_answer_does_not_count() {
    let Some(host) = host("impostor", "") else { return };
    let name = host.machine().name.clone();
    let mut impostor = impostor(&host, "done", &[&name]);
    for request in ["estop", "stop", "off"] {
        let reached = if request == "estop" { "fault" } else { "off" };
        for (user, words) in [
            (OPERATOR, "only daemons of the service, of root and of this user count"),
            (0, "Run it as that user"),
        ] {
            let alone = host.run(user, &[], &[request, FILE]);
            says(&alone, 1, "", words);
            assert!(
                alone.stderr.contains(&format!("of user {MALLORY} at /tmp/hexad-{MALLORY}/{name}.sock")),
                "{}",
                alone.stderr
            );
            let daemon = host.daemon(user, &[], None);
            let beside = host.run(user, &[], &[request, FILE]);
            says(&beside, 0, reached, &format!("the daemon of user {MALLORY} at"));
            if request == "estop" {
                daemon.says(STOPPED);
            }
            daemon.stops();
        }
    }
    assert!(
        fs::read_to_string(host.machine().path("impostor")).unwrap().contains("estop"),
        "it was asked, too"
    );
    impostor.must_run();
}

/// The service and the operator's practice daemon have the same name: both stop, and the service's answer counts.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn the_service_is_stopped_beside_a_practice_daemon() {
    let Some(host) = host("practice", "[operator]\nmode = \"0666\"") else { return };
    let name = host.machine().name.clone();
    host.does(&format!("mkdir -m 755 /run/hexad && chown {SERVICE}:{SERVICE} /run/hexad"));
    // In the other order the second one refuses to start.
    let practice = host.daemon(OPERATOR, &[], None);
    let service = host.daemon(SERVICE, &[], None);
    let ended = host.run(OPERATOR, &[], &["estop", FILE]);
    says(
        &ended,
        0,
        "fault",
        &format!("the daemon of {OPERATOR} at /tmp/hexad-{OPERATOR}/{name}.sock: fault"),
    );
    service.says(STOPPED);
    practice.says(STOPPED);
    // A service that does not answer is not stopped, whatever the practice daemon says.
    service.hold();
    let ended = host.run(OPERATOR, &[], &["estop", FILE]);
    says(&ended, 1, "", "cannot be signalled");
    service.signal("CONT");
    service.stops();
    practice.stops();
}

/// Only a daemon that counts is signalled: whoever handles no SIGUSR1 dies of it.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn nobody_else_is_signalled() {
    let Some(host) = host("signalled", "") else { return };
    let name = host.machine().name.clone();
    let mut impostor = impostor(&host, "none", &[&name]);
    for request in ["estop", "stop", "off"] {
        says(&host.run(0, &[], &[request, FILE]), 1, "", "it does not answer");
    }
    impostor.must_run();
}

#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn one_lock_whatever_the_environment_and_other_users_have_made() {
    let Some(host) = host("lock", "") else { return };
    // Another user has taken the names, and gives one back later.
    host.does(&format!(
        "for end in '' -1 -2; do mkdir /tmp/hexad-{OPERATOR}$end; done; chown -R {MALLORY} /tmp/hexad-*"
    ));
    host.does("mkdir -m 777 /run/a /run/b");
    let start = |folder: &str| {
        let mut command = host.hexad(OPERATOR, &[], &["run", "/run/test/machine.toml"]);
        command.env("XDG_RUNTIME_DIR", folder);
        host.spawn("run", command)
    };
    let daemon = start("/run/a");
    daemon.says("running");
    let refused = |folder| {
        let Ended { status, stderr, .. } = start(folder).ends();
        assert!(status.code() == Some(1) && stderr.contains("another daemon does"), "{stderr}");
    };
    refused("/run/b");
    host.does(&format!("rmdir /tmp/hexad-{OPERATOR}"));
    refused("/run/a");
    says(&host.run(OPERATOR, &[], &["estop", FILE]), 0, "fault", "");
    daemon.says(STOPPED);
    daemon.stops();
}

/// Processes of the daemon are not seen from the operator's container.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn an_operator_in_another_container_reaches_the_daemon() {
    let Some(host) = host("container", "") else { return };
    let daemon = host.daemon(OPERATOR, &[], None);
    let isolated = |request: &str| {
        let mut command = host.program(0, &[], "unshare");
        let user = OPERATOR.to_string();
        command.args([
            "--pid",
            "--fork",
            "--mount-proc",
            "setpriv",
            "--reuid",
            &user,
            "--regid",
            &user,
            "--clear-groups",
        ]);
        command.args(["/run/test/hexad", request, FILE]);
        host.spawn(request, command).ends()
    };
    let status = isolated("status");
    assert!(
        status.status.code() == Some(0) && status.stdout.contains("OFF"),
        "{}{}",
        status.stdout,
        status.stderr
    );
    says(&isolated("estop"), 0, "fault", "");
    daemon.says(STOPPED);
    says(&isolated("clear"), 0, "off", "");
    daemon.stops();
}

/// Reading is a right of its own, and who has none is not told that nothing runs.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn a_reader_sees_the_status_and_sends_nothing() {
    let Some(host) = host("reader", "[operator]\nread_group = \"nogroup\"") else { return };
    let name = host.machine().name.clone();
    host.does(&format!("mkdir -m 755 /run/hexad && chown {SERVICE}:{SERVICE} /run/hexad"));
    let service = host.daemon(SERVICE, &[NOGROUP], None);
    let [outsider, reader] = [&[][..], &[NOGROUP]].map(|groups| {
        let status = host.run(MALLORY, groups, &["status"]);
        assert_eq!(status.status.code(), Some(0), "{}", status.stderr);
        status.stdout.lines().find(|line| line.starts_with(&name)).expect("its line").to_owned()
    });
    assert!(outsider.contains(" unknown "), "{outsider}");
    assert!(reader.contains(" off ") && reader.contains(" 1000 Hz "), "{reader}");
    let forbidden = format!("this user may not send requests for {name}");
    says(&host.run(MALLORY, &[], &["status", &name]), 2, "", &forbidden);
    for request in ["estop", "clear"] {
        says(&host.run(MALLORY, &[NOGROUP], &[request, FILE]), 2, "", &forbidden);
    }
    let status = host.run(MALLORY, &[NOGROUP], &["status", &name]);
    assert!(status.stdout.contains("OFF"), "{}", status.stderr);
    says(&host.run(MALLORY, &[NOGROUP], &["view", "/run/test/machine.toml"]), 2, "", "runs as user");
    // Not by hand either.
    let mut command = host.program(MALLORY, &[NOGROUP], "python3");
    command.args(["-c", ESTOP_BY_HAND]).arg(format!("/run/hexad/{name}.read"));
    let answer = host.spawn("by-hand", command).ends();
    assert!(answer.stdout.contains("this socket is for reading"), "{}{}", answer.stdout, answer.stderr);
    assert!(!service.words().contains(STOPPED));
    service.stops();
    assert!(!host.path(&format!("/run/hexad/{name}.read")).exists());
}

const ESTOP_BY_HAND: &str = r#"
import socket, sys
link = socket.socket(socket.AF_UNIX)
link.connect(sys.argv[1])
link.sendall(b'{"version": 1, "request": "estop"}\n')
print(link.makefile().readline())
"#;

/// As systemd-logind does it when the last session of a user ends.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn shared_memory_that_is_deleted_under_a_daemon_is_named_with_the_remedy() {
    let Some(host) = host("deleted", "") else { return };
    let name = host.machine().name.clone();
    let daemon = host.daemon(OPERATOR, &[], None);
    let warnings =
        |status: &Ended| status.stdout.contains("warning: ") && status.stdout.contains("RemoveIPC=no");
    assert!(!warnings(&host.run(OPERATOR, &[], &["status", &name])));
    host.does("rm /dev/shm/*");
    daemon.says("were deleted while it was in use");
    assert!(warnings(&host.run(OPERATOR, &[], &["status", &name])));
    let plant = host.run(OPERATOR, &[], &["plant", "/run/test/machine.toml"]);
    assert!(plant.status.code() == Some(2) && plant.stderr.contains("RemoveIPC=no"), "{}", plant.stderr);
    // It still stops.
    says(&host.run(OPERATOR, &[], &["estop", FILE]), 0, "fault", "");
    daemon.stops();
}

#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn shared_memory_that_may_not_be_written_is_named() {
    let Some(host) = host("unwritable", "") else { return };
    host.does("chmod 755 /dev/shm");
    let ended = host.run(OPERATOR, &[], &["run", "/run/test/machine.toml"]);
    says(&ended, 1, "", "cannot write in /dev/shm: Permission denied");
}

/// Nobody types a name in an emergency.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn without_a_name_what_runs_is_stopped() {
    let Some(host) = host("nameless", "") else { return };
    let ask = |arguments: &[&str]| host.run(OPERATOR, &[], arguments);
    for request in ["estop", "stop", "off"] {
        says(&ask(&[request]), 2, "", "no daemon runs on this host");
    }
    let name = host.machine().name.clone();
    // Neither another user's impostor nor a machine of which this user is no operator is one of them.
    let mut impostor = impostor(&host, "done", &[&name, "zebra"]);
    let foreign = host.daemon(0, &[], Some("foreign"));
    let first = host.daemon(OPERATOR, &[], Some("a-machine"));
    for (request, state) in [("stop", "off"), ("off", "off")] {
        says(&ask(&[request]), 0, state, "");
    }
    says(&ask(&["estop"]), 0, "a-machine: fault", "foreign: this user may not send requests for foreign");
    first.says(STOPPED);
    says(&ask(&["clear", "a-machine"]), 0, "off", "");
    let second = host.daemon(OPERATOR, &[], Some("b-machine"));
    for request in ["stop", "off"] {
        says(&ask(&[request]), 2, "", "several machines run: a-machine, b-machine; name one, or give --all");
        says(&ask(&[request, "b-machine"]), 0, "off", "");
        says(&ask(&[request, "--all"]), 0, "a-machine: off\nb-machine: off", "");
    }
    says(&ask(&["estop"]), 0, "a-machine: fault\nb-machine: fault", "");
    second.says(STOPPED);
    assert!(!foreign.words().contains(STOPPED));
    impostor.must_run();
    for daemon in [foreign, first, second] {
        daemon.stops();
    }
}
