//! Processes that are killed or stopped in motion: what becomes of the drives, and how far the legs still move.

use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, MeasuredMessage, Subscriber};

use super::network::Network;
use super::{ALONE, not_run, simulated};
use hexad_support::stalls::Watchdog;

/// Rate of the fastest leg at a failure, at least \[m/s\].
const MIN_RATE_M_S: f64 = 0.15;
/// Deceleration of the simulated brakes \[m/s^2\].
const BRAKES_M_S2: f64 = 9.81;
/// Watchdog of the drives, and longest age of a force; with two periods \[s\].
const MAX_AGE_S: f64 = 0.022;
/// `drive_enabled` of six enabled drives.
const ALL_DRIVES: u32 = 0x3f;
/// Allowance for the acceleration of the motion \[m\].
const TOLERANCE_M: f64 = 1.5e-3;

/// Failures: process, signal, and the state of the drives that follows.
const ROWS: [(&str, i32, &str); 4] = [
    ("run", libc::SIGSTOP, "al_status=20 drive=Fault is_brake_open=false"),
    ("run", libc::SIGKILL, "al_status=20 drive=Fault is_brake_open=false"),
    ("daemon", libc::SIGSTOP, "al_status=8 drive=QuickStop is_brake_open=false"),
    ("daemon", libc::SIGKILL, "al_status=8 drive=QuickStop is_brake_open=false"),
];

/// The next measurement of the driver.
fn next(measured: &mut Subscriber<MeasuredMessage>) -> MeasuredMessage {
    let began = Instant::now();
    loop {
        if let Some(message) = measured.receive_latest() {
            return message;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "the driver publishes nothing");
        sleep(Duration::from_micros(200));
    }
}

/// Largest difference of the lengths of a leg \[m\].
fn difference_m(a: &MeasuredMessage, b: &MeasuredMessage) -> f64 {
    a.length_m.iter().zip(b.length_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Largest way of a leg after a failure \[m\]. Time that the host took away counts as if the leg had gone on.
fn bound_m(rate_m_s: f64, host_s: f64) -> f64 {
    rate_m_s * (MAX_AGE_S + host_s) + rate_m_s * rate_m_s / (2.0 * BRAKES_M_S2) + TOLERANCE_M
}

/// Sends a signal in fast motion; the last measurement before, and the rate of the fastest leg \[m/s\]. `None` if control
/// ends without it.
fn signal_in_motion(
    network: &mut Network,
    measured: &mut Subscriber<MeasuredMessage>,
    (process, signal): (&str, i32),
) -> Option<(MeasuredMessage, f64)> {
    network.start("move", network.hexad("move --config m.toml --motion sines --seconds 60 --engage"));
    let began = Instant::now();
    while !network.log("move").contains("in control: moving") {
        if !network.is_running("move") || began.elapsed() > Duration::from_secs(30) {
            return None;
        }
        sleep(Duration::from_millis(20));
    }
    sleep(Duration::from_secs(2));
    let mut before = next(measured);
    while before.drive_enabled == ALL_DRIVES {
        let now = next(measured);
        let interval_s = now.header.time_ns.saturating_sub(before.header.time_ns) as f64 * 1e-9;
        let rate_m_s = difference_m(&now, &before) / interval_s;
        if rate_m_s > MIN_RATE_M_S && interval_s < 0.01 {
            network.signal(process, signal);
            return Some((now, rate_m_s));
        }
        before = now;
    }
    None
}

/// The platform stands at home again, ready for a motion; again if the host delays frames meanwhile.
fn recover(network: &mut Network) {
    network.signal("move", libc::SIGKILL);
    let is_home = |network: &Network| {
        network.output(network.hexad("clear --config m.toml"));
        sleep(Duration::from_secs(1));
        network.hexad("goto --config m.toml --home --engage").output().unwrap().status.success()
    };
    assert!((0..3).any(|_| is_home(network)), "{}", network.ends());
}

#[test]
fn processes_that_are_killed_or_stopped_in_motion() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut network) = simulated("failures", "") else { return };
    // A busy host delays single frames; that is not the failure under test.
    let drives = fs::read_to_string(network.path("d.toml")).unwrap();
    fs::write(network.path("d.toml"), format!("lost_frames = 10\n{drives}")).unwrap();
    network.start("daemon", network.hexad("run m.toml"));
    network.start("run", network.driver("run d.toml m.toml"));
    network.wait_for("run", "six drives in OP", 1);
    let mut measured = Bus::join(network.machine()).unwrap().subscriber(8).unwrap();
    for (process, signal, state) in ROWS {
        let count = |network: &Network, text: &str| network.log("simulate").matches(text).count();
        let watchdog = Watchdog::start();
        let mut stops = 0;
        let signalled = (0..3).find_map(|attempt| {
            if attempt > 0 {
                recover(&mut network);
            }
            stops = count(&network, state);
            signal_in_motion(&mut network, &mut measured, (process, signal))
        });
        let Some((before, rate_m_s)) = signalled else {
            let pause = watchdog.largest();
            let is_host = network.log("run").contains("row are lost") || pause > Duration::from_millis(1);
            assert!(is_host, "{pause:?}\n{}", network.ends());
            return not_run::not_run("the host delays the frames of a loop of 1 kHz, three times in a row");
        };
        let delay_s = monotonic_ns().saturating_sub(before.header.time_ns) as f64 * 1e-9;
        network.wait_for("simulate", state, stops + 6);
        if process == "run" {
            network.wait_for("daemon", "code=101", 1);
        }
        let pause_s = watchdog.largest().as_secs_f64();
        let enabled = count(&network, "drive=OperationEnabled");
        // A process that continues, or is started again, does not move the platform: an operator has to engage it.
        match (process, signal) {
            (_, libc::SIGSTOP) => network.signal(process, libc::SIGCONT),
            ("run", _) => {
                network.start("run", network.driver("run d.toml m.toml"));
                network.wait_for("run", "leg 6 has the fault 0x7500", 1);
            }
            _ => network.start("daemon", network.hexad("run m.toml")),
        }
        sleep(Duration::from_secs(2));
        let way_m = difference_m(&next(&mut measured), &before);
        let bound_m = bound_m(rate_m_s, delay_s + 2.0 * pause_s);
        println!(
            "{process}, signal {signal}: {:.1} mm at {rate_m_s:.2} m/s, at most {:.1} mm; delay {:.1} ms, pause {:.1} ms",
            way_m * 1e3,
            bound_m * 1e3,
            delay_s * 1e3,
            pause_s * 1e3
        );
        assert!(
            way_m < bound_m,
            "{process}, signal {signal}: {way_m} m, at most {bound_m} m\n{}",
            network.ends()
        );
        assert_eq!(count(&network, "drive=OperationEnabled"), enabled, "{process}, signal {signal}");
        recover(&mut network);
    }
    network.signal("run", libc::SIGINT);
    // Also while the daemon was killed and another came.
    network.wait_for("run", "allocations=0", 1);
}
