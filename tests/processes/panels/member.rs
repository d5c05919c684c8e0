//! The example of a panel, as a member of the group who is not the user of the daemon.

use std::io::Write;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::children::HANG;
use crate::support::host::{Host, MALLORY, NOGROUP, SERVICE};
use crate::support::machine::{Machine, PATIENT};

/// Beside the example, the commands of the same user.
#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn a_member_of_the_group_moves_the_platform_and_nobody_else_does() {
    let sections = format!("{PATIENT}\n[operator]\ngroup = \"nogroup\"\n");
    let Some(host) = Host::start(Machine::with("member", &sections)) else { return };
    const FILE: &str = "/run/test/machine.toml";
    let name = host.machine().name.clone();
    host.does(&format!("mkdir -m 755 /run/hexad && chown {SERVICE}:{SERVICE} /run/hexad"));
    let service = host.daemon(SERVICE, &[NOGROUP], None);
    let plant = host.spawn("plant", host.hexad(SERVICE, &[], &["plant", FILE]));
    service.says("standby: no setpoint");
    let forbidden = host.run(MALLORY, &[], &["goto", FILE, "--home", "--engage"]);
    let words = format!("this user may not send requests for {name}");
    assert!(forbidden.status.code() == Some(2) && forbidden.stderr.contains(&words), "{}", forbidden.stderr);
    let panel = |groups: &[u32]| {
        std::fs::copy("examples/panel.py", host.machine().path("panel.py")).expect("the example");
        let mut command = host.program(MALLORY, groups, "python3");
        command.args(["/run/test/panel.py", &format!("/run/hexad/{name}.sock")]).stdin(Stdio::piped());
        host.spawn("panel", command)
    };
    let refused = panel(&[]).ends();
    assert!(refused.stderr.contains("PermissionError"), "{}", refused.stderr);
    let moved = host.run(MALLORY, &[NOGROUP], &["goto", FILE, "--home", "--engage"]);
    assert!(moved.status.code() == Some(0) && moved.stdout.contains("in position"), "{}", moved.stderr);
    let mut member = panel(&[NOGROUP]);
    let mut keys = member.input();
    let mut says = |line: &str, words: &str| {
        writeln!(keys, "{line}").expect("a line");
        let began = Instant::now();
        while !member.printed().contains(words) {
            assert!(began.elapsed() < HANG, "{words:?} must be in {}", member.printed());
            sleep(Duration::from_millis(5));
        }
    };
    let z = || {
        let shown = host.run(MALLORY, &[NOGROUP], &["status", &name, "--json"]);
        let shown: Value = serde_json::from_str(&shown.stdout).expect("JSON");
        shown["status"]["pose"][5].as_f64().expect("a pose")
    };
    let until = |words: &str, is_there: &dyn Fn(f64) -> bool| {
        let began = Instant::now();
        while !is_there(z()) {
            assert!(began.elapsed() < HANG, "{words}: {}", z());
        }
    };
    says("goto 5", "not understood");
    says("jog z_m_s=0.02", "");
    until("a jog", &|z| z > 0.005);
    says("", "done active");
    says("hold", "the platform stands under control");
    let stands = z();
    says("step z_m=0.01", "accepted active 0.");
    until("a step", &|z| (z - stands - 0.01).abs() < 1e-4);
    says("stop", "done standby");
    drop(keys);
    assert!(member.ends().status.success());
    service.stops();
    plant.stops();
}
