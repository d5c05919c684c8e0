//! The bridge with a client of another author: `eclipse-zenoh` from PyPI, on another host, with mutual TLS. Needs root, `ip`,
//! `openssl`, and PyPI once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, reason = "tests")]

mod certificates;
mod control;
mod enemies;
mod fleet;
mod loss;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad_support::hosts::{Host, Hosts};
use hexad_support::stalls::Watchdog;
use hexad_support::{not_run, python};

/// Not a test, but the role in which tests start this program.
#[test]
#[ignore = "not a test, but the process that tests start"]
fn hexad_process() {
    hexad_support::hexad_process::play_role();
}

/// Pauses of the host up to this length are no reason to fail: measurements may be 50 ms old.
const MAX_STALL: Duration = Duration::from_millis(20);

/// Longest wait for a client.
const PATIENCE: Duration = Duration::from_secs(90);

/// One loop at a time: they are real-time.
static ALONE: Mutex<()> = Mutex::new(());

const BRIDGE: &str = env!("CARGO_BIN_EXE_hexad-zenoh");

/// Sections of machine files. The processors are shared with clients and tests: pauses of the host are no subject here.
const TIMEOUTS: &str = "\n[timeouts]\nsetpoint_ms = 400\nmeasured_ms = 50\nallow_unstable_age = true\n";
const LIMIT: &str = "[setpoint]\non_violation = \"limit\"\non_return = \"hold\"\n";

/// What the clients may do.
const CLIENTS: &str = "[zenoh.client.studio]\nsetpoints = true\nmotions = true\nrequests = [\"engage\", \"clear\"]\n\
                       [zenoh.client.panel]\n";

/// Endpoints of the machine's host for the other hosts.
const CABLE: &str = "quic/10.77.1.1:7447?mixed_rel=1";
const LOSSY: &str = "quic/10.78.0.1:7447?mixed_rel=1";

/// Hosts with daemon, simulated hardware and bridge of a machine, and a way to start clients.
struct Cell {
    hosts: Hosts,
    python: PathBuf,
    _alone: MutexGuard<'static, ()>,
}

/// Hosts with the certificates of an authority, or why there are none.
fn hosts_with_certificates(test: &str) -> Result<Hosts, String> {
    let hosts = Hosts::new(&format!("zenoh-{test}"));
    let hosts = hosts.map_err(|why| format!("network namespaces (root, ip): {why}"))?;
    let folder = hosts.path("");
    for authority in ["ca", "other_ca"] {
        certificates::authority(&folder, authority)?;
    }
    for name in ["bridge", "studio", "panel", "stranger"] {
        certificates::certificate(&folder, "ca", name, name)?;
    }
    certificates::certificate(&folder, "other_ca", "studio", "forged")?;
    Ok(hosts)
}

/// Text of a machine file with a name and a deadline for setpoints.
fn machine_file(name: &str) -> String {
    let text =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/motion_base.toml")).unwrap();
    text.replace("\"motion_base\"", &format!("\"{name}\"")) + TIMEOUTS + LIMIT
}

/// Text of a network file.
fn network_file(machine: &str, endpoint: &str) -> String {
    format!(
        "name = \"{machine}\"\n[zenoh]\nlisten = [\"{endpoint}\"]\nidentity = {{ ca = \"ca.pem\", certificate = \"bridge.pem\", key = \
         \"bridge.key\" }}\n{CLIENTS}"
    )
}

impl Cell {
    /// A cell, unless the test cannot run here.
    fn open(test: &str) -> Option<Self> {
        let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let requirements = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/network/requirements.txt");
        let parts = hosts_with_certificates(test).and_then(|hosts| {
            let arguments = ["--require-hashes", "-r", requirements].map(Into::into);
            Ok(Self { hosts, python: python::named_environment("eclipse-zenoh", &arguments)?, _alone })
        });
        parts.map_err(|why| not_run::lacking(&why)).ok()
    }

    /// Starts the machine, and the bridge at an endpoint.
    fn start(&mut self, endpoint: &str) {
        let hosts = &mut self.hosts;
        fs::write(hosts.path("m.toml"), machine_file(&hosts.machine())).unwrap();
        fs::write(hosts.path("m-network.toml"), network_file(&hosts.machine(), endpoint)).unwrap();
        hosts.start("daemon", hosts.hexad("run --config m.toml"));
        hosts.start("plant", hosts.hexad("plant --config m.toml"));
        hosts.wait_for("daemon", "standby");
        hosts.start("bridge", hosts.command(Host::Machine, Path::new(BRIDGE), "run m-network.toml m.toml"));
        hosts.wait_for("bridge", "the bridge is open");
    }

    /// Starts a function of `client.py` above ordinary processes of a busy host. `who` is the name, and the file of the certificate.
    fn start_client(&mut self, function: &'static str, endpoint: &str, who: &str) {
        self.start_client_with("-f 20", function, endpoint, who);
    }

    /// The same with a scheduling policy, as arguments of `chrt`.
    fn start_client_with(&mut self, policy: &str, function: &'static str, endpoint: &str, who: &str) {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/network/client.py");
        let (python, machine) = (self.python.join("bin/python"), self.hosts.machine());
        let arguments =
            format!("{policy} {} {script} {function} {machine} {endpoint} {who}", python.display());
        let command = self.hosts.command(Host::Remote, Path::new("chrt"), &arguments);
        self.hosts.start(function, command);
    }

    /// Waits until a client has printed a text, without a fault. False if the host pauses too long for that.
    fn reaches(&mut self, client: &'static str, text: &str) -> bool {
        let (watchdog, began) = (Watchdog::start(), Instant::now());
        while !self.hosts.log(client).contains(text) && self.hosts.is_running(client) {
            assert!(began.elapsed() < PATIENCE, "{text:?} of {client}\n{}", self.hosts.ends());
            sleep(Duration::from_millis(20));
        }
        let has_fault = self.hosts.log("daemon").contains("ERROR fault");
        if self.hosts.log(client).contains(text) && !has_fault {
            return true;
        }
        let gap = watchdog.largest();
        assert!(gap > MAX_STALL, "{gap:?}\n{}", self.hosts.ends());
        eprintln!("{}", self.hosts.ends());
        not_run::not_run(&format!("the host pauses processes for {gap:?}"));
        false
    }

    /// Lines of the bridge that contain a text.
    fn bridge_lines(&self, text: &str) -> usize {
        self.hosts.log("bridge").lines().filter(|line| line.contains(text)).count()
    }
}
