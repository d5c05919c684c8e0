//! Wake-up latency, at several rates, of a thread that is set up and waits like the daemon's real-time
//! thread.
//!
//! Between two wake-ups the thread computes nothing, and no I/O thread runs. So this is the latency that the
//! host adds to any loop.

use core::time::Duration;
use std::io;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::{Builder, scope};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::files::HostFiles;
use crate::commands::progress::millisecond_bar;
use hexad_client::messages::Times;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::clock::{Grid, Monotonic};
use hexad_client::realtime::cyclic::{ReleaseMode, Timing};
use hexad_client::realtime::stop_request::Stop;
use hexad_client::realtime::usage::ThreadUsage;
use hexad_client::realtime::waiter::Waiter;
use hexad_daemon::start::prepare_loop;
use hexad_daemon::time_histogram::TimeHistogram;
use hexad_daemon::{nanoseconds, timing};
use hexad_machine::config::deployment::{Deployment, Realtime};

/// Rates measured in addition to the configured one, for slow and fast drives.
const RATES_HZ: [f64; 5] = [250.0, 1000.0, 4000.0, 10_000.0, 20_000.0];

/// Duration for the configured rate and release mode, as a multiple of the duration for each other one.
const CONFIGURED_WEIGHT: f64 = 4.0;

/// Interval between two updates of the progress bar.
const BAR_INTERVAL: Duration = Duration::from_millis(100);

/// Unit of `/proc/stat` \[ms\]: `USER_HZ` is 100 on every Linux in use.
const TICK_MS: u64 = 10;

/// Release mode that the doctor measures for a configured one. Without the drives it cannot measure a release
/// by their messages, so it measures the sleep instead.
pub fn measured_mode(configured: ReleaseMode) -> ReleaseMode {
    if configured == ReleaseMode::Hybrid { ReleaseMode::Hybrid } else { ReleaseMode::Sleep }
}

/// Measured wake-up latency at one rate and release mode.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Latency {
    pub rate_hz: f64,
    pub release: ReleaseMode,
    /// Time from a release until the thread runs.
    pub wakeup_ns: Times,
    /// Delay beyond which a wake-up counts as late.
    pub late_wakeup_ns: u64,
    pub late_wakeups: u64,
    /// Releases that had passed when the thread woke for the previous one.
    pub missed: u64,
    /// Final spin before a release; 0 for sleep.
    pub lead_ns: u64,
    /// Time that the host of a virtual machine took during the measurement, from the thread's processor or
    /// from all.
    pub stolen_ms: Option<u64>,
    pub thread: ThreadUsage,
}

impl Latency {
    /// Whether this is the latency at a rate and release mode.
    pub fn is_of(&self, rate_hz: f64, release: ReleaseMode) -> bool {
        (self.rate_hz, self.release) == (rate_hz, release)
    }

    /// Time from one release to the next.
    pub fn period_ns(&self) -> f64 {
        1e9 / self.rate_hz
    }
}

/// A rate and release mode to measure.
#[derive(Clone, Debug)]
struct Plan {
    /// The configured deployment, with this rate and release mode.
    deployment: Deployment,
    seconds: f64,
}

/// Measures all rates within `seconds`. `None` if stopped before the end.
pub fn measure_all(
    host: &HostFiles,
    deployment: &Deployment,
    seconds: f64,
    stop: &Stop,
) -> io::Result<Option<Vec<Latency>>> {
    let (bar, start) = (millisecond_bar(seconds), Instant::now());
    let mut all = vec![];
    let cpu = deployment.realtime.cpu;
    for plan in plans(deployment, seconds) {
        let Realtime { rate_hz, release, .. } = &plan.deployment.realtime;
        bar.set_message(format!("{rate_hz} Hz, {}", release.name()));
        let before = stolen_ms(host, cpu);
        let update_bar = || bar.set_position(start.elapsed().as_millis() as u64);
        let mut latency = measure(&plan, update_bar, stop)?;
        latency.stolen_ms = stolen_ms(host, cpu).zip(before).map(|(after, before)| after - before);
        all.push(latency);
    }
    bar.finish_and_clear();
    Ok((!stop.is_requested()).then_some(all))
}

fn plans(deployment: &Deployment, seconds: f64) -> Vec<Plan> {
    let configured = &deployment.realtime;
    let mut rates = RATES_HZ.to_vec();
    if !rates.contains(&configured.rate_hz) {
        rates.push(configured.rate_hz);
        rates.sort_by(f64::total_cmp);
    }
    let whole = CONFIGURED_WEIGHT + 2.0 * rates.len() as f64 - 1.0;
    let plan = |rate_hz: f64| {
        [ReleaseMode::Sleep, ReleaseMode::Hybrid].map(|release| {
            let is_configured = rate_hz == configured.rate_hz && release == measured_mode(configured.release);
            Plan {
                deployment: Deployment {
                    realtime: Realtime { release, ..at(configured, rate_hz) },
                    ..deployment.clone()
                },
                seconds: seconds / whole * if is_configured { CONFIGURED_WEIGHT } else { 1.0 },
            }
        })
    };
    rates.into_iter().flat_map(plan).collect()
}

/// The configured section at another rate. Durations that are bounded by half a period are adapted.
fn at(configured: &Realtime, rate_hz: f64) -> Realtime {
    let half_s = 0.5 / rate_hz;
    Realtime {
        rate_hz,
        max_lead_s: configured.max_lead_s.min(half_s),
        late_wakeup_s: configured.late_wakeup_s.min(half_s),
        ..configured.clone()
    }
}

/// Measures in a separate thread, and calls `update_bar` meanwhile.
fn measure(plan: &Plan, update_bar: impl Fn(), stop: &Stop) -> io::Result<Latency> {
    scope(|threads| {
        let (done, result) = channel();
        Builder::new().name("hexad-doctor".into()).spawn_scoped(threads, move || {
            // Fails only while the process ends.
            let _ = done.send(measure_here(plan, stop));
        })?;
        loop {
            match result.recv_timeout(BAR_INTERVAL) {
                Ok(latency) => return Ok(latency),
                Err(RecvTimeoutError::Timeout) => update_bar(),
                Err(RecvTimeoutError::Disconnected) => return Err(io::Error::other("the thread has died")),
            }
        }
    })
}

fn measure_here(plan: &Plan, stop: &Stop) -> Latency {
    let Plan { deployment, seconds } = plan;
    let mut histogram = TimeHistogram::default();
    // Its shortfalls were printed before, because all threads of this process have the same.
    prepare_loop(&deployment.realtime, || {
        histogram.record(monotonic_ns());
        histogram.clear();
    });
    let Timing { period_ns, phase_ns, late_wakeup_ns, .. } = timing(deployment);
    let max_lead_ns = timing(deployment).spin_ns();
    let (grid, mut waiter) = (Grid::new(period_ns, phase_ns), Waiter::new(max_lead_ns));
    let (mut late_wakeups, mut missed) = (0, 0);
    let at_start = ThreadUsage::of_this_thread();
    let mut release_ns = grid.next_after(monotonic_ns());
    let end_ns = release_ns + nanoseconds(*seconds);
    while release_ns < end_ns && !stop.is_requested() {
        let woke_ns = waiter.until(&mut Monotonic, release_ns);
        let wakeup_ns = woke_ns.saturating_sub(release_ns);
        histogram.record(wakeup_ns);
        late_wakeups += u64::from(wakeup_ns > late_wakeup_ns);
        let next_ns = grid.next_after(woke_ns);
        // A pause beyond the end counts only up to the end.
        missed += (next_ns.min(end_ns) - release_ns).div_ceil(period_ns) - 1;
        release_ns = next_ns;
    }
    Latency {
        rate_hz: deployment.realtime.rate_hz,
        release: deployment.realtime.release,
        wakeup_ns: histogram.times(),
        late_wakeup_ns,
        late_wakeups,
        missed,
        lead_ns: waiter.lead_ns(),
        stolen_ms: None,
        thread: ThreadUsage::of_this_thread().since(&at_start),
    }
}

/// Processor time that the host of a virtual machine took since boot; `None` if the kernel does not count it.
fn stolen_ms(host: &HostFiles, cpu: Option<usize>) -> Option<u64> {
    let name = cpu.map_or_else(|| "cpu".into(), |cpu| format!("cpu{cpu}"));
    let stat = host.text("proc/stat").ok()?;
    let line = stat.lines().find(|line| line.split(' ').next() == Some(&name))?;
    // user, nice, system, idle, iowait, irq, softirq, steal
    let ticks: u64 = line.split_whitespace().nth(8)?.parse().ok()?;
    Some(ticks * TICK_MS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::files::sample::host;
    use hexad_machine::config::Config;

    fn configured(section: &str) -> Deployment {
        let text = format!("{}\n[realtime]\n{section}", include_str!("../../../config/fried2008.toml"));
        Config::parse(&text, "test").unwrap().deployment
    }

    #[test]
    fn the_configured_rate_gets_the_most_time_and_all_stay_within() {
        for (section, rates) in [("", 5), ("rate_hz = 500\nrelease = \"hybrid\"", 6)] {
            let configured = configured(section);
            let plans = plans(&configured, 10.0);
            assert_eq!(plans.len(), 2 * rates);
            let total: f64 = plans.iter().map(|plan| plan.seconds).sum();
            assert!((total - 10.0).abs() < 1e-9, "{total}");
            let most = plans.iter().max_by(|a, b| a.seconds.total_cmp(&b.seconds)).unwrap();
            assert_eq!(most.deployment, configured);
            for Plan { deployment: Deployment { realtime, .. }, .. } in &plans {
                let half_s = 0.5 * realtime.period_s();
                assert!(realtime.max_lead_s <= half_s && realtime.late_wakeup_s <= half_s, "{realtime:?}");
            }
        }
    }

    #[test]
    fn every_release_is_either_woken_for_or_missed() {
        for release in ["sleep", "hybrid"] {
            let deployment = configured(&format!("rate_hz = 4000\nrelease = \"{release}\""));
            let plan = Plan { deployment, seconds: 0.1 };
            let latency = measure(&plan, || (), &Stop::default()).unwrap();
            assert_eq!(latency.wakeup_ns.count + latency.missed, 400, "{latency:?}");
            assert_eq!(latency.lead_ns > 0, release == "hybrid", "{latency:?}");
            assert_eq!(latency.thread.allocations, 0, "{latency:?}");
        }
    }

    #[test]
    fn stolen_time_is_that_of_the_processor() {
        let host = host(&[("proc/stat", "cpu  1 2 3 4 5 6 7 88 9\ncpu0 1 2 3 4 5 6 7 8 9\ncpu10 1 2 3 4")]);
        assert_eq!(stolen_ms(&host.files, None), Some(880));
        assert_eq!(stolen_ms(&host.files, Some(0)), Some(80));
        assert_eq!(stolen_ms(&host.files, Some(10)), None);
        assert_eq!(stolen_ms(&host.files, Some(1)), None);
    }
}
