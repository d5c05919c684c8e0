//! Wake-up latency: a thread set up as the daemon's, waiting as the daemon waits, at several rates.
//!
//! Nothing is computed between two wake-ups, and no io thread runs beside it: this is the latency that the
//! host adds to any loop.

use core::time::Duration;
use std::io;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::{Builder, scope};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use super::files::HostFiles;
use crate::config::deployment::{Deployment, Realtime};
use crate::daemon::start::prepare_loop;
use crate::daemon::time_histogram::TimeHistogram;
use crate::daemon::{nanoseconds, timing};
use crate::messages::Times;
use crate::messages::clock::monotonic_ns;
use crate::realtime::clock::{Grid, Monotonic};
use crate::realtime::cyclic::{ReleaseMode, Timing};
use crate::realtime::stop_request::Stop;
use crate::realtime::usage::ThreadUsage;
use crate::realtime::waiter::Waiter;

/// Measured beside the configured one, from slow drives to fast ones.
const RATES_HZ: [f64; 5] = [250.0, 1000.0, 4000.0, 10_000.0, 20_000.0];

/// What is configured gets so many times the time of anything else.
const WEIGHT: f64 = 4.0;

/// How often the bar moves.
const BAR: Duration = Duration::from_millis(100);

/// Unit of `/proc/stat`: `USER_HZ` is 100 on every Linux that matters \[ms\].
const TICK_MS: u64 = 10;

/// How a release is waited for. One that a message gives cannot be measured without the drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Waiting {
    Sleep,
    Hybrid,
}

impl Waiting {
    /// As in the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sleep => "sleep",
            Self::Hybrid => "hybrid",
        }
    }
}

impl From<ReleaseMode> for Waiting {
    fn from(release: ReleaseMode) -> Self {
        if release == ReleaseMode::Hybrid { Self::Hybrid } else { Self::Sleep }
    }
}

/// One rate and way of waiting, measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Latency {
    pub rate_hz: f64,
    pub release: Waiting,
    /// From a release to the thread running.
    pub wakeup_ns: Times,
    /// Wake-ups later than this are late.
    pub late_wakeup_ns: u64,
    pub late_wakeups: u64,
    /// Releases that had passed when the one before them was woken for.
    pub missed: u64,
    /// What was spun before a release in the end; 0 for sleep.
    pub lead_ns: u64,
    /// What the host of a virtual machine took meanwhile, of the thread's processor or of all.
    pub stolen_ms: Option<u64>,
    pub thread: ThreadUsage,
}

impl Latency {
    /// Whether it is of this rate and way of waiting.
    pub fn is(&self, rate_hz: f64, release: Waiting) -> bool {
        (self.rate_hz, self.release) == (rate_hz, release)
    }

    /// Distance of two releases.
    pub fn period_ns(&self) -> f64 {
        1e9 / self.rate_hz
    }
}

/// One rate and way of waiting, to be measured.
#[derive(Clone, Debug)]
struct Plan {
    /// As configured, at this rate and with this release.
    deployment: Deployment,
    waiting: Waiting,
    seconds: f64,
}

/// Measures all rates within `seconds`; `None` if stopped before the end.
pub fn measure_all(
    host: &HostFiles,
    deployment: &Deployment,
    seconds: f64,
    stop: &Stop,
) -> io::Result<Option<Vec<Latency>>> {
    let style = ProgressStyle::with_template("{bar:40} {elapsed} {msg}");
    let bar = ProgressBar::new((seconds * 1e3) as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let start = Instant::now();
    let mut all = vec![];
    let cpu = deployment.realtime.cpu;
    for plan in plans(deployment, seconds) {
        bar.set_message(format!("{} Hz, {}", plan.deployment.realtime.rate_hz, plan.waiting.name()));
        let before = stolen_ms(host, cpu);
        let moved = || bar.set_position(start.elapsed().as_millis() as u64);
        let mut latency = measure(&plan, moved, stop)?;
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
    let whole = WEIGHT + 2.0 * rates.len() as f64 - 1.0;
    let each = [(ReleaseMode::Sleep, Waiting::Sleep), (ReleaseMode::Hybrid, Waiting::Hybrid)];
    let plan = |rate_hz: f64| {
        each.map(|(release, waiting)| {
            let asked = rate_hz == configured.rate_hz && waiting == configured.release.into();
            Plan {
                deployment: Deployment {
                    realtime: Realtime { release, ..at(configured, rate_hz) },
                    ..deployment.clone()
                },
                waiting,
                seconds: seconds / whole * if asked { WEIGHT } else { 1.0 },
            }
        })
    };
    rates.into_iter().flat_map(plan).collect()
}

/// The same at another rate: what is bounded by half a period stays so.
fn at(configured: &Realtime, rate_hz: f64) -> Realtime {
    let half_s = 0.5 / rate_hz;
    Realtime {
        rate_hz,
        max_lead_s: configured.max_lead_s.min(half_s),
        late_wakeup_s: configured.late_wakeup_s.min(half_s),
        ..configured.clone()
    }
}

/// Measures on a thread of its own; `moved` is called now and then meanwhile.
fn measure(plan: &Plan, moved: impl Fn(), stop: &Stop) -> io::Result<Latency> {
    scope(|threads| {
        let (done, result) = channel();
        Builder::new().name("hexad-doctor".into()).spawn_scoped(threads, move || {
            // Nobody listens only if the process is going down.
            let _ = done.send(measure_here(plan, stop));
        })?;
        loop {
            match result.recv_timeout(BAR) {
                Ok(latency) => return Ok(latency),
                Err(RecvTimeoutError::Timeout) => moved(),
                Err(RecvTimeoutError::Disconnected) => return Err(io::Error::other("the thread has died")),
            }
        }
    })
}

fn measure_here(plan: &Plan, stop: &Stop) -> Latency {
    let Plan { deployment, waiting, seconds } = plan;
    let mut histogram = TimeHistogram::default();
    // What it lacks has been told before: every thread of this process lacks the same.
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
        // A pause over the end does not count beyond it.
        missed += (next_ns.min(end_ns) - release_ns).div_ceil(period_ns) - 1;
        release_ns = next_ns;
    }
    Latency {
        rate_hz: deployment.realtime.rate_hz,
        release: *waiting,
        wakeup_ns: histogram.times(),
        late_wakeup_ns,
        late_wakeups,
        missed,
        lead_ns: waiter.lead_ns(),
        stolen_ms: None,
        thread: ThreadUsage::of_this_thread().since(&at_start),
    }
}

/// Since boot; `None` if it is not told.
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
    use crate::config::Config;

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
            let plan = Plan { waiting: deployment.realtime.release.into(), deployment, seconds: 0.1 };
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
