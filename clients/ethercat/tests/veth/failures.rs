//! Processes that are killed or stopped in motion: what becomes of the drives, and how far the legs still move.

use std::thread::sleep;
use std::time::Duration;

use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, MeasuredMessage, Subscriber};

use super::network::Network;
use super::stalls::Watchdog;
use super::{ALONE, simulated};

/// Rate of the fastest leg at a failure, at least \[m/s\].
const MIN_RATE_M_S: f64 = 0.15;
/// Deceleration of the simulated brakes \[m/s^2\].
const BRAKES_M_S2: f64 = 9.81;
/// Watchdog of the drives, and longest age of a force; with two periods \[s\].
const MAX_AGE_S: f64 = 0.022;
const MOVE: &str = "move --config m.toml --motion sines --seconds 60 --engage";

/// Failures: process, signal, and the state of the drives that follows.
const ROWS: [(&str, i32, &str); 4] = [
    ("run", libc::SIGSTOP, "al_status=20 drive=Fault is_brake_open=false"),
    ("run", libc::SIGKILL, "al_status=20 drive=Fault is_brake_open=false"),
    ("daemon", libc::SIGSTOP, "al_status=8 drive=QuickStop is_brake_open=false"),
    ("daemon", libc::SIGKILL, "al_status=8 drive=QuickStop is_brake_open=false"),
];

/// The next measurement of the driver.
fn next(measured: &mut Subscriber<MeasuredMessage>) -> MeasuredMessage {
    loop {
        if let Some(message) = measured.receive_latest() {
            return message;
        }
        sleep(Duration::from_micros(200));
    }
}

/// Largest difference of the lengths of a leg \[m\].
fn difference_m(a: &MeasuredMessage, b: &MeasuredMessage) -> f64 {
    a.length_m.iter().zip(b.length_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Sends a signal in fast motion; the last measurement before, and the rate of the fastest leg \[m/s\].
fn signal_in_motion(
    network: &mut Network,
    measured: &mut Subscriber<MeasuredMessage>,
    (process, signal): (&str, i32),
) -> (MeasuredMessage, f64) {
    let mut before = next(measured);
    loop {
        let now = next(measured);
        let interval_s = now.header.time_ns.saturating_sub(before.header.time_ns) as f64 * 1e-9;
        let rate_m_s = difference_m(&now, &before) / interval_s;
        if rate_m_s > MIN_RATE_M_S && interval_s < 0.01 {
            network.signal(process, signal);
            return (now, rate_m_s);
        }
        before = now;
    }
}

#[test]
fn processes_that_are_killed_or_stopped_in_motion() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let Some(mut network) = simulated("failures", "") else { return };
    network.start("daemon", network.hexad("run m.toml"));
    network.start("run", network.driver("run d.toml m.toml"));
    network.wait_for("run", "six drives in OP", 1);
    let mut measured = Bus::join(network.machine()).unwrap().subscriber(8).unwrap();
    for (process, signal, state) in ROWS {
        network.start("move", network.hexad(MOVE));
        network.wait_for("move", "in control: moving", 1);
        sleep(Duration::from_secs(2));
        let count = |network: &Network, text: &str| network.log("simulate").matches(text).count();
        let stops = count(&network, state);
        let watchdog = Watchdog::start();
        let (before, rate_m_s) = signal_in_motion(&mut network, &mut measured, (process, signal));
        let delay_s = monotonic_ns().saturating_sub(before.header.time_ns) as f64 * 1e-9;
        network.wait_for("simulate", state, stops + 6);
        let pause_s = watchdog.largest().as_secs_f64();
        let enabled = count(&network, "drive=OperationEnabled");
        // A process that continues, or is started again, does not move the platform: an operator has to engage it.
        match (process, signal) {
            (_, libc::SIGSTOP) => network.signal(process, libc::SIGCONT),
            ("run", _) => network.start("run", network.driver("run d.toml m.toml")),
            _ => network.start("daemon", network.hexad("run m.toml")),
        }
        sleep(Duration::from_secs(2));
        let way_m = difference_m(&next(&mut measured), &before);
        // What the host took away counts as if the leg had gone on.
        let bound_m = rate_m_s * (MAX_AGE_S + delay_s + 2.0 * pause_s)
            + rate_m_s * rate_m_s / (2.0 * BRAKES_M_S2)
            + 1e-3;
        println!(
            "{process}, signal {signal}: {:.1} mm at {rate_m_s:.2} m/s, at most {:.1} mm; delay {:.1} ms, pause {:.1} ms",
            way_m * 1e3,
            bound_m * 1e3,
            delay_s * 1e3,
            pause_s * 1e3
        );
        assert!(way_m < bound_m, "{process}, signal {signal}: {way_m} m, at most {bound_m} m");
        assert_eq!(count(&network, "drive=OperationEnabled"), enabled, "{process}, signal {signal}");
        network.signal("move", libc::SIGKILL);
        network.output(network.hexad("clear --config m.toml"));
        sleep(Duration::from_secs(1));
        network.output(network.hexad("goto --config m.toml --home --engage"));
    }
    network.signal("run", libc::SIGINT);
    network.wait_for("run", "the driver ends", 1);
}
