//! The bridge with real ROS 2: rclpy over Fast DDS, from PyPI, on another host. Needs root, `ip`, PyPI once, and Python 3.11.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, reason = "tests")]

#[path = "../../src/ros_messages.rs"]
#[allow(dead_code, reason = "only the types are needed")]
mod ros_messages;
mod type_hashes;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::thread::sleep;
use std::time::Duration;

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

/// One loop at a time: they are real-time.
static ALONE: Mutex<()> = Mutex::new(());

/// Python with rclpy, or why there is none.
fn rclpy() -> Result<PathBuf, String> {
    let requirements = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/rclpy/requirements.txt");
    python::named_environment("rclpy", &["--require-hashes", "-r", requirements].map(Into::into))
}

/// Hosts with daemon, simulated hardware and bridge of a machine, and a way to start nodes.
struct Cell {
    hosts: Hosts,
    python: PathBuf,
}

impl Cell {
    /// A cell, unless the test cannot run here. `sections` are of the machine file.
    fn open(test: &str, sections: &str) -> Option<Self> {
        Self::open_at(100, test, sections)
    }

    /// The same with another rate of the messages to ROS 2.
    fn open_at(rate_hz: u32, test: &str, sections: &str) -> Option<Self> {
        let parts = Hosts::new(&format!("ros2-{test}"))
            .map_err(|why| format!("network namespaces (root, ip): {why}"));
        let parts = parts.and_then(|hosts| Ok(Self { hosts, python: rclpy()? }));
        let mut cell = match parts {
            Ok(cell) => cell,
            Err(why) => {
                not_run::lacking(&why);
                return None;
            }
        };
        let hosts = &mut cell.hosts;
        let machine =
            fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/motion_base.toml"))
                .unwrap();
        let machine = machine.replace("\"motion_base\"", &format!("\"{}\"", hosts.machine()));
        // The processors are shared with nodes and tests: pauses of the host are no subject here.
        let timeouts = "\n[timeouts]\nsetpoint_ms = 400\nmeasured_ms = 50\nallow_unstable_age = true\n";
        fs::write(hosts.path("m.toml"), machine + timeouts + sections).unwrap();
        let network = format!(
            "name = \"{}\"\n[ros2]\ntrusted_network = true\ninterface = \"net0\"\nsetpoints = [\"pose\", \"trajectory\"]\n\
             rate_hz = {rate_hz}\nrequests = [\"engage\", \"clear\", \"stop\", \"estop\"]\n",
            hosts.machine()
        );
        fs::write(hosts.path("m-network.toml"), network).unwrap();
        hosts.start("daemon", hosts.hexad("run --config m.toml"));
        hosts.start("plant", hosts.hexad("plant --config m.toml"));
        let bridge = Path::new(env!("CARGO_BIN_EXE_hexad-ros2"));
        hosts.start("bridge", hosts.command(Host::Machine, bridge, "m-network.toml m.toml"));
        hosts.wait_for("bridge", "the bridge is open");
        Some(cell)
    }

    /// Starts a node that runs a function of `panel.py`, above ordinary processes of a busy host.
    fn start_node(&mut self, host: Host, function: &'static str) {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/rclpy/panel.py");
        let arguments = format!("-f 20 {} {script} {function}", self.python.join("bin/python").display());
        let mut command = self.hosts.command(host, Path::new("chrt"), &arguments);
        command.env("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").env("ROS_LOG_DIR", self.hosts.path("ros"));
        self.hosts.start(function, command);
    }

    /// Starts a node, and waits until it has printed a text, without a fault. False if the host pauses too long for that.
    fn reaches(&mut self, function: &'static str, text: &str) -> bool {
        let watchdog = Watchdog::start();
        self.start_node(Host::Remote, function);
        while !self.hosts.log(function).contains(text) && self.hosts.is_running(function) {
            sleep(Duration::from_millis(20));
        }
        let has_fault = self.hosts.log("daemon").contains("ERROR fault");
        if self.hosts.log(function).contains(text) && !has_fault {
            return true;
        }
        let gap = watchdog.largest();
        assert!(gap > MAX_STALL, "{gap:?}\n{}", self.hosts.ends());
        not_run::not_run(&format!("the host pauses processes for {gap:?}"));
        false
    }
}

const LIMIT: &str = "[setpoint]\non_violation = \"limit\"\n";

#[test]
fn rclpy_reads_the_state_and_moves_the_platform_with_poses() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut cell) = Cell::open("poses", LIMIT) else { return };
    cell.start_node(Host::UntrustedDaemon, "stranger");
    if !cell.reaches("poses", "end of poses") {
        return;
    }
    cell.hosts.wait_for("stranger", "end of stranger");
    // The daemon names the remote side.
    let log = cell.hosts.log("daemon");
    let request = log.lines().find(|line| line.contains("request: stop")).unwrap();
    assert!(request.contains("remote=\"/panel ("), "{request}");
}

#[test]
fn readers_of_each_kind_take_every_message() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut cell) = Cell::open_at(50, "readers", "") else { return };
    if !cell.reaches("readers", "end of readers") {
        return;
    }
    eprintln!("{}", cell.hosts.log("readers"));
    // The library has lines of its own about each reader.
    assert_eq!(cell.hosts.log("bridge").lines().count(), 1, "{}", cell.hosts.log("bridge"));
}

#[test]
fn the_bridge_does_not_wait_for_a_stopped_reader() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut cell) = Cell::open_at(1000, "stopped", "") else { return };
    if cell.reaches("stops_itself", "reads") {
        cell.reaches("others_read", "end of others_read");
    }
}

#[test]
fn the_first_request_of_a_new_client_does_not_wait_for_a_heartbeat() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut cell) = Cell::open("first", "") else { return };
    // New processes with new clients: DDS discovers each of them while its request arrives.
    for _ in 0..5 {
        if !cell.reaches("new_clients", "end of new_clients") {
            return;
        }
    }
}

#[test]
fn a_killed_bridge_is_a_lost_source() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    // What the state chart says of a source that ends in motion (docs/operator.md).
    for (function, sections, ended) in [("trajectory", "", "code=100"), ("disturbances", LIMIT, "code=11")] {
        let Some(mut cell) = Cell::open("killed", sections) else { return };
        if !cell.reaches(function, "moving") {
            return;
        }
        if function == "disturbances" {
            check_rejections(&cell.hosts);
        }
        cell.hosts.kill("bridge");
        cell.hosts.wait_for("daemon", ended);
    }
}

/// Each disturbance is named, at most once a second.
fn check_rejections(hosts: &Hosts) {
    let log = hosts.log("bridge");
    for words in
        ["not finite", "later than the stream", "another source is followed", "messages arrive in a second"]
    {
        let lines = log.lines().filter(|line| line.contains(words)).count();
        // Each lasts 2.5 to 3 s.
        assert!((1..=4).contains(&lines), "{words}: {lines} lines\n{log}");
    }
}

#[test]
fn without_a_trusted_network_it_does_not_begin() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("m-network.toml");
    fs::write(&file, "name = \"m\"\n[ros2]\ninterface = \"lo\"\n").unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_hexad-ros2"));
    let ended = command.arg(&file).arg("m.toml").output().unwrap();
    let text = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.code() == Some(2) && text.contains("DDS has no identity of sources"), "{text}");
}
