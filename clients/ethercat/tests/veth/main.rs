//! The commands over a veth pair, with the real daemon and with SOEM. Needs root and `ip`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, reason = "tests")]

mod failures;
mod network;

use std::sync::Mutex;
use std::thread::sleep;
use std::time::{Duration, Instant};
use std::{env, fs};

use hexad_ethercat::brake_test::holding_forces;
use hexad_machine::config::Config;
use hexad_support::stalls::Watchdog;
use hexad_support::{not_run, python};
use network::Network;

const DRIVES: &str = include_str!("../data/motion_base-drives.toml");

/// Not a test, but the role in which tests start this program.
#[test]
#[ignore = "not a test, but the process that tests start"]
fn hexad_process() {
    hexad_support::hexad_process::play_role();
}

/// Within this time what has ended is let go.
const SETTLING: Duration = Duration::from_secs(5);

/// One loop at a time: they are real-time.
static ALONE: Mutex<()> = Mutex::new(());

/// A network with the files of a machine of its own, and the simulated drives at one end of its cable.
fn simulated(test: &str, options: &str) -> Option<Network> {
    let mut network = match Network::new(test) {
        Ok(network) => network,
        Err(why) => {
            not_run::lacking(&format!("a network namespace (root, ip): {why}"));
            return None;
        }
    };
    let machine =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/motion_base.toml")).unwrap();
    let name = format!("\"{}\"", network.machine());
    let sections = "\n[realtime]\nrelease = \"external\"\n[drive]\ndelay_us = 1000.0\n";
    fs::write(network.path("m.toml"), machine.replace("\"motion_base\"", &name) + sections).unwrap();
    fs::write(network.path("d.toml"), DRIVES.replace("\"motion_base\"", &name)).unwrap();
    network.start("simulate", network.driver(&format!("simulate d.toml m.toml --interface ec1{options}")));
    network.wait_for("simulate", "switched on", 1);
    Some(network)
}

/// Whether the platform plays a motion to its end without a fault; after one it stands ready again.
fn plays(network: &mut Network, motion: &str, seconds: u32) -> bool {
    let faults = |network: &Network| network.log("daemon").matches("ERROR fault").count();
    let before = faults(network);
    let motion = format!("move --config m.toml --motion {motion} --seconds {seconds} --engage");
    network.start("move", network.hexad(&motion));
    while network.is_running("move") && faults(network) == before {
        sleep(Duration::from_millis(50));
    }
    let has_fault = faults(network) > before;
    if has_fault {
        network.signal("move", libc::SIGKILL);
        network.output(network.hexad("clear --config m.toml"));
        sleep(Duration::from_secs(1));
        // The host can spoil this one, too; the next motion begins wherever the platform stands.
        let _ = network.hexad("goto --config m.toml --home --engage").output();
    }
    !has_fault
}

#[test]
fn the_daemon_drives_the_platform_over_the_bus() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut network) = simulated("run", "") else { return };
    assert!(network.output(network.driver("check d.toml --machine m.toml")).contains("no error"));
    network.start("daemon", network.hexad("run m.toml"));
    network.start("run", network.driver("run d.toml m.toml"));
    network.wait_for("run", "six drives in OP", 1);
    let watchdog = Watchdog::start();
    let seconds = if env::var_os("HEXAD_LONG").is_some() { 300 } else { 3 };
    let mut resources: Vec<[[usize; 4]; 2]> = vec![];
    for motion in ["sines", "minimum-jerk"] {
        let played = (0..3).any(|_| plays(&mut network, motion, seconds));
        if !played {
            let run = network.log("run");
            // No cable loses frames here: it is the host that delays them.
            let gap = watchdog.largest();
            let is_host = run.contains("in a row are lost") || gap > Duration::from_millis(1);
            assert!(is_host, "{gap:?}\n{}", network.ends());
            return not_run::not_run(
                "the host pauses the processes of a loop of 1 kHz too long, three times in a row",
            );
        }
        // The ports of a player that has ended are closed when the daemon next looks.
        let used = || ["daemon", "run"].map(|name| network.resources(name));
        let counts = |used: [[usize; 4]; 2]| used.map(|[counts @ .., _]| counts);
        let began = Instant::now();
        while resources.first().is_some_and(|first| counts(*first) != counts(used()))
            && began.elapsed() < SETTLING
        {
            sleep(Duration::from_millis(100));
        }
        sleep(if resources.is_empty() { SETTLING } else { Duration::ZERO });
        resources.push(used());
    }
    for ([before @ .., kb_before], [after @ .., kb_after]) in resources[0].iter().zip(&resources[1]) {
        println!("threads, descriptors, shared memory: {before:?}, {after:?}; {kb_before} kB, {kb_after} kB");
        assert_eq!(before, after, "threads, descriptors, files of shared memory");
        assert!(kb_after - kb_before.min(kb_after) < 1024, "{kb_before} kB, then {kb_after} kB");
    }
}

#[test]
fn brakes_are_tested_at_the_start() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let machine =
        Config::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/motion_base.toml").as_ref());
    let machine = machine.unwrap().machine;
    let load_n = holding_forces(&machine, machine.home_pose()).unwrap().into_iter().fold(0.0, f64::max);
    let hold = "[drive]
sdo = [{ index = 0x60fe, sub = 2, bytes = 4, value = 0 }, { index = 0x60fe, sub = 1, bytes = 4, value = 0 }]
brake_hold = [{ index = 0x60fe, sub = 1, bytes = 4, value = 1 }, { index = 0x60fe, sub = 2, bytes = 4, value = 1 }]
";
    for (brake_n, exit_codes, words) in
        [(1.05 * load_n, [1, 2], "its closed brake slips by"), (1.2 * load_n, [0, 0], "six drives in OP")]
    {
        let Some(mut network) = simulated("brakes", &format!(" --brake-n {brake_n}")) else { return };
        let drives = fs::read_to_string(network.path("d.toml")).unwrap().replace("[drive]\n", hold);
        let drives = format!("lost_frames = 10\n{drives}");
        fs::write(network.path("d.toml"), drives).unwrap();
        for (command, exit_code) in ["brakes", "run"].into_iter().zip(exit_codes) {
            // Frames that the host delays end the test as well.
            let is_complete = (0..3).any(|_| {
                network.start(command, network.driver(&format!("{command} d.toml m.toml")));
                while network.is_running(command) && !network.log(command).contains("six drives in OP") {
                    sleep(Duration::from_millis(20));
                }
                let log = network.log(command);
                !log.contains("in a row are lost") && !log.contains("has the fault 0x7500: reset it")
            });
            if !is_complete {
                return not_run::not_run(
                    "the host delays the frames of a loop of 1 kHz, three times in a row",
                );
            }
            if network.is_running(command) {
                network.signal(command, libc::SIGINT);
            }
            assert_eq!(network.exit_code(command), Some(exit_code), "{}", network.ends());
        }
        assert!(network.log("run").contains(words), "{}", network.ends());
        assert!(!network.log("simulate").contains("is_brake_open=true"), "{}", network.ends());
    }
}

#[test]
fn commands_that_use_the_bus_for_a_moment() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(network) = simulated("jog", " --uncoupled") else { return };
    let output = |arguments: &str| network.output(network.driver(arguments));
    let refused = |arguments: &str| {
        let ended = network.driver(arguments).output().unwrap();
        assert!(!ended.status.success(), "{arguments}");
        String::from_utf8_lossy(&ended.stderr).into_owned()
    };
    assert!(output("scan ec0").contains("serial = 106"));
    assert_eq!(output("read d.toml 3 0x6076:0").trim(), "0x6076:0 = 24000 (0x5dc0)");
    output("write d.toml 3 0x605a:0 6");
    assert_eq!(output("read d.toml 3 0x605a").trim(), "0x605a:0 = 6 (0x6)");
    assert!(refused("jog d.toml 3").contains("confirm with --unloaded"));
    let file = fs::read_to_string(network.path("d.toml")).unwrap();
    fs::write(network.path("d.toml"), file.replace("jogged_serial = 103\n", "")).unwrap();
    assert!(refused("check d.toml").contains("leg 3: its direction was not checked"));
    let text = output("jog d.toml 3 --unloaded");
    assert!(text.contains("mm longer; look whether it is"), "{text}");
    output("check d.toml");
    // Another offset is written with the serial number of the drive.
    output("zero d.toml 3 --length-m 1.75");
    let file = fs::read_to_string(network.path("d.toml")).unwrap();
    let leg = file.split("[[leg]]").nth(3).unwrap();
    assert!(leg.contains("serial = 103") && leg.contains("offset_m = "), "{leg}");
    output("reset d.toml");
    assert!(refused("scan ec7").contains("interface ec7 does not exist"));
    assert!(refused("scan lo").contains("no carrier"), "lo is down");
    let mut busy = network.driver("simulate d.toml m.toml --interface ec1");
    let text = String::from_utf8_lossy(&busy.output().unwrap().stderr).into_owned();
    assert!(text.contains("another hexad-ethercat uses ec1"), "{text}");
}

#[test]
fn commands_that_move_or_measure_refuse_drives_without_serial_numbers() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut network) = simulated("serials", " --uncoupled") else { return };
    let file = fs::read_to_string(network.path("d.toml")).unwrap();
    let file =
        (101..=106).fold(file, |file, serial| file.replace(&format!("serial = {serial}"), "serial = 0"));
    fs::write(network.path("d.toml"), &file).unwrap();
    network.start("simulate", network.driver("simulate d.toml m.toml --interface ec1 --uncoupled"));
    network.wait_for("simulate", "switched on", 1);
    for arguments in
        ["check d.toml", "zero d.toml 1 --length-m 1.7", "jog d.toml 1 --unloaded", "run d.toml m.toml"]
    {
        let ended = network.driver(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&ended.stderr);
        assert!(!ended.status.success() && text.contains("leg 1: its drive has no serial number"), "{text}");
    }
    assert_eq!(fs::read_to_string(network.path("d.toml")).unwrap(), file);
    let accepted =
        file.replace("[drive]", "[drive]\nidentity = \"position\"").replace("jogged_serial = 0\n", "");
    fs::write(network.path("d.toml"), accepted).unwrap();
    network.output(network.driver("jog d.toml 1 --unloaded"));
    assert!(
        network.output(network.driver("zero d.toml 1 --length-m 1.7")).contains("of no serial number (0)")
    );
    assert!(fs::read_to_string(network.path("d.toml")).unwrap().contains("jogged_position = 1"));
}

#[test]
fn soem_brings_the_drives_to_op() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let environment = match python::environment(&["pysoem==1.1.13".into()]) {
        Ok(environment) => environment,
        Err(why) => return not_run::lacking(&why),
    };
    let Some(network) = simulated("soem", "") else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/veth/soem.py");
    let text = network.output(network.command(&environment.join("bin/python"), &format!("{script} ec0")));
    assert!(text.contains("working counter 18 of 18 enabled 6"), "{text}");
}
