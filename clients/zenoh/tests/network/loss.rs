//! A link that delays, reorders and loses packets, cuts of it, and steps of the source's clock.

use std::f64::consts::PI;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, SetpointMessage, StatusMessage, Subscriber};
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use nalgebra::{DMatrix, DVector};

use crate::{CABLE, Cell, LOSSY, MAX_STALL};
use hexad_support::hosts::Host;
use hexad_support::not_run::not_run;
use hexad_support::stalls::Watchdog;

/// `timeouts.setpoint_ms`, by which a setpoint may be later than the others, and the largest delay of the link.
const TIMEOUT_MS: f64 = 400.0;
const LARGEST_DELAY_MS: f64 = 30.0;

/// Age of setpoints that the source's end of the connection has held up, as QUIC does after losses: two more than are lost in a
/// row by chance. From 0.1 s before until 0.4 s after the last one the motion shows the connection, not the machine \[ms\].
const HELD_UP_MS: f64 = LARGEST_DELAY_MS + 20.0;

/// Height of home, amplitude and frequency of the motion of `client.py`.
const HOME_Z: f64 = 1.25;
const OMEGA: f64 = 2.0 * PI * 0.5;

/// Starts a link of 20 +- 10 ms that loses 5 % of the packets.
fn start_lossy_link(cell: &mut Cell) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/network/lossy_link.py");
    let [here, there] = [Host::Machine, Host::Remote].map(|host| cell.hosts.namespace(host));
    let mut command = Command::new("chrt");
    command.args([
        "-f",
        "25",
        "python3",
        script,
        &here,
        "10.78.0.1",
        &there,
        "10.78.0.2",
        "20",
        "10",
        "0.05",
    ]);
    cell.hosts.start("link", command);
    cell.hosts.wait_for("link", "ready");
}

fn signal_link(cell: &mut Cell, signal: &str) {
    let process = cell.hosts.process_id("link").to_string();
    assert!(Command::new("kill").args(["-s", signal, &process]).status().unwrap().success());
}

/// What the machine has followed and how it has moved, observed in its shared memory.
struct Observer {
    statuses: Subscriber<StatusMessage>,
    setpoints: Subscriber<SetpointMessage>,
    /// Time \[s\], height.
    heights: Vec<[f64; 2]>,
    /// Heights while the source was back, away from the platform.
    held: Vec<f64>,
    /// Arrivals of setpoints that the source's connection has held up \[s\].
    held_up: Vec<f64>,
    /// Largest age of a setpoint that the machine has received \[ms\].
    largest_age_ms: f64,
    /// Instant at which the motion began \[ns\].
    began_ns: u64,
}

impl Observer {
    fn new(machine: &str, began_ns: u64) -> Self {
        let bus = Bus::join(machine).unwrap();
        let (statuses, setpoints) = (bus.subscriber(256).unwrap(), bus.subscriber(256).unwrap());
        Self {
            statuses,
            setpoints,
            heights: vec![],
            held: vec![],
            held_up: vec![],
            largest_age_ms: 0.0,
            began_ns,
        }
    }

    fn observe(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            sleep(Duration::from_millis(2));
            while let Some(status) = self.statuses.receive() {
                self.heights.push([status.header.time_ns as f64 * 1e-9, status.x[5]]);
                if status.diagnostic.code == DiagnosticCode::SetpointTooFar as u32 {
                    self.held.push(status.x[5]);
                }
            }
            while let Some(setpoint) = self.setpoints.receive() {
                // The angle gamma is the true time of the source since the beginning \[1e-9 s\], on the clock of all hosts here.
                let now_ns = monotonic_ns();
                let age_ms = 1e-6 * (now_ns - self.began_ns) as f64 - setpoint.x[2] * 1e12;
                if age_ms > HELD_UP_MS {
                    self.held_up.push(now_ns as f64 * 1e-9);
                }
                self.largest_age_ms = self.largest_age_ms.max(age_ms);
            }
        }
    }

    /// Share of the time in which the connection held nothing up; in it, amplitude of the sine in the motion, RMS and largest
    /// distance from it \[mm\].
    fn distance_from_sine(&self) -> [f64; 4] {
        let is_held_up = |time| self.held_up.iter().any(|at| (at - 0.1..at + 0.4).contains(&time));
        let even: Vec<_> = self.heights.iter().filter(|height| !is_held_up(height[0])).collect();
        let rows = even.len();
        let phase = |k: usize| OMEGA * (even[k][0] - even[0][0]);
        let basis = DMatrix::from_fn(rows, 3, |k, column| [1.0, phase(k).sin(), phase(k).cos()][column]);
        let heights = DVector::from_fn(rows, |k, _| 1e3 * (even[k][1] - HOME_Z));
        let fit = basis.clone().svd(true, true).solve(&heights, 1e-12).unwrap();
        let distance = heights - basis * &fit;
        [
            rows as f64 / self.heights.len() as f64,
            fit[1].hypot(fit[2]),
            distance.norm() / (rows as f64).sqrt(),
            distance.amax(),
        ]
    }
}

#[test]
fn poses_over_a_lossy_link_are_followed_and_late_ones_never() {
    let Some(mut cell) = Cell::open("loss") else { return };
    start_lossy_link(&mut cell);
    cell.start(LOSSY);
    cell.start_client("follows", LOSSY, "studio");
    if !cell.reaches("follows", "began") {
        return;
    }
    let log = cell.hosts.log("follows");
    let began_ns = log.lines().find_map(|line| line.strip_prefix("began ")).unwrap().parse().unwrap();
    let mut observer = Observer::new(&cell.hosts.machine(), began_ns);
    let watchdog = Watchdog::start();
    observer.observe(Duration::from_secs(3));
    // The host can spoil one of them.
    let is_near = (0..3).any(|_| {
        observer.heights.clear();
        observer.observe(Duration::from_secs(12));
        let [share, amplitude, rms, largest] = observer.distance_from_sine();
        eprintln!(
            "20 +- 10 ms, 5 % loss: for {share:.2} of the time amplitude {amplitude:.2} mm, RMS {rms:.3} mm, largest {largest:.3} mm"
        );
         share > 0.5 && (49.0..51.0).contains(&amplitude) && rms < 0.15
    });
    assert_eq!(cell.bridge_lines("has ended"), 0, "lost\n{}", cell.hosts.ends());
    let gap = watchdog.largest();
    assert!(is_near || gap > MAX_STALL, "{gap:?}\n{}", cell.hosts.ends());
    if !is_near {
        not_run(&format!("the host pauses processes for {gap:?}"));
    }
    let mut has_waited = false;
    for (cut, seconds) in [1, 5, 2, 3].into_iter().enumerate() {
        // The source may be where the platform stands when it is back, but not each time.
        if cut >= 2 && has_waited {
            break;
        }

        signal_link(&mut cell, "USR1");
        observer.observe(Duration::from_secs(seconds));
        let ended = cell.bridge_lines("has ended");
        assert!(ended > 0, "{}", cell.hosts.ends());
        signal_link(&mut cell, "USR2");
        let mended = Instant::now();
        while cell.bridge_lines("follows the source") <= ended {
            assert!(mended.elapsed() < Duration::from_secs(30), "{}", cell.hosts.ends());
            observer.observe(Duration::from_millis(100));
        }
        eprintln!("after a cut of {seconds} s the source is heard again after {:.1?}", mended.elapsed());
        observer.observe(Duration::from_secs(3));
        // `setpoint.on_return`: it waits where it stands until the source comes by.
        let held = observer.held.split_off(0);
        let [low, high] = [f64::min, f64::max].map(|of| held.iter().copied().reduce(of).unwrap_or_default());
        assert!(high - low < 1e-4, "{} statuses: {low} to {high}", held.len());
        has_waited |= !held.is_empty();
    }
    assert!(has_waited, "{}", cell.hosts.ends());
    let age_ms = observer.largest_age_ms;
    eprintln!("oldest setpoint that was followed: {age_ms:.1} ms");
    assert!(age_ms < TIMEOUT_MS + LARGEST_DELAY_MS + 50.0, "{age_ms}");
}

#[test]
fn a_clock_that_is_set_back_is_followed_in_another_life_only() {
    let Some(mut cell) = Cell::open("steps") else { return };
    cell.start(CABLE);
    cell.start_client("steps", CABLE, "studio");
    if !cell.reaches("steps", "set forwards") {
        return;
    }
    assert_eq!(cell.bridge_lines("has ended"), 0, "{}", cell.hosts.ends());
    if !cell.reaches("steps", "set back") {
        return;
    }
    assert_eq!(cell.bridge_lines("has ended"), 1, "{}", cell.hosts.ends());
    assert!(cell.bridge_lines("it is later than the stream") > 0, "{}", cell.hosts.ends());
    if cell.reaches("steps", "another life") {
        assert_eq!(cell.bridge_lines("follows the source"), 2, "{}", cell.hosts.ends());
    }
}
