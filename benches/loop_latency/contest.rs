//! One round of one contestant.

use std::fs;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use hexad::control::signals::state::Request;
use hexad::daemon::report::Report;
use hexad::operator::Order;
use hexad::operator::requests::{carry_out, status};

use super::Failure;
use super::distribution::Distribution;
use super::results::Row;
use super::rig::{PRIORITY, Process, Release, Rig};
use super::subscriber::Subscriber;
use super::tools::steal_ms;

/// Who takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contestant {
    Cyclictest,
    Hexad(Release),
}

impl Contestant {
    pub const ALL: [Self; 3] = [Self::Cyclictest, Self::Hexad(Release::Sleep), Self::Hexad(Release::Hybrid)];

    pub fn name(self) -> &'static str {
        match self {
            Self::Cyclictest => "cyclictest",
            Self::Hexad(Release::Sleep) => "hexad sleep",
            Self::Hexad(Release::Hybrid) => "hexad hybrid",
        }
    }
}

/// What a round showed.
#[derive(Clone, Debug, Default)]
pub struct Round {
    pub wakeup: Distribution,
    /// Of the daemon only.
    pub compute: Distribution,
    pub end_to_end: Distribution,
    pub overruns: u64,
    /// Cycles that the log thread was too late to take in: they are in no distribution.
    pub unrecorded: u64,
    /// Release to seen by a subscriber, where there was one.
    pub visible: Distribution,
    pub steal_ms: u64,
}

/// cyclictest's histogram ends here, and with it what can be told apart \[ns\].
pub const HISTOGRAM_NS: u64 = 1_000_000;

/// The daemon has to be in control within this time, or something is wrong.
const START: Duration = Duration::from_secs(10);

/// Engages every daemon and waits until it is in control. Returns how many cycles each had run by then.
pub fn until_active(daemons: &mut [Process]) -> Result<Vec<u64>, Failure> {
    let order = Order { is_patient: true, ..Order::new(Request::Engage, START) };
    let engage = |(number, daemon): (usize, &mut Process)| {
        let machine = Rig::machine_name(number);
        let engaged = carry_out(&machine, &order, &|| false, |_| ());
        daemon.must_run()?;
        engaged?;
        Ok(status(&machine)?.status.map_or(0, |status| status.timing.cycles))
    };
    daemons.iter_mut().enumerate().map(engage).collect()
}

/// Runs the contestant of a row for so long.
pub fn round(rig: &Rig, row: &Row, seconds: f64) -> Result<Round, Failure> {
    let before_ms = steal_ms(rig.processors.contestant);
    let mut round = match row.contestant {
        Contestant::Cyclictest => cyclictest(rig, row.rate_hz, seconds)?,
        Contestant::Hexad(release) => hexad(rig, release, row, seconds)?,
    };
    round.steal_ms = steal_ms(rig.processors.contestant) - before_ms;
    Ok(round)
}

fn cyclictest(rig: &Rig, rate_hz: u32, seconds: f64) -> Result<Round, Failure> {
    let period_us = 1_000_000 / rate_hz;
    let json = rig.path("cyclictest.json");
    let cycles = (f64::from(rate_hz) * seconds) as u64;
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--nsecs", "--mlockall", "--threads=1", "--policy=fifo"]).args([
        format!("--json={}", json.display()),
        format!("--histogram={HISTOGRAM_NS}"),
        format!("--affinity={}", rig.processors.contestant),
        format!("--priority={PRIORITY}"),
        format!("--interval={period_us}"),
        format!("--loops={cycles}"),
        // The daemon's grid: half a period after the multiples of the period.
        format!("--secaligned={}", period_us / 2),
    ]);
    Process::start(rig, &mut command)?.finish()?;
    let wakeup = read_json(&fs::read_to_string(json)?).ok_or("cyclictest's JSON is not as expected")?;
    Ok(Round { wakeup, ..Round::default() })
}

fn read_json(text: &str) -> Option<Distribution> {
    let json: serde_json::Value = serde_json::from_str(text).ok()?;
    let thread = json.get("thread")?.get("0")?;
    let counts = thread.get("histogram")?.as_object()?.iter();
    let mut wakeup: Distribution =
        counts.map(|(ns, count)| Some((ns.parse().ok()?, count.as_u64()?))).collect::<Option<_>>()?;
    // What is beyond the histogram is only counted, but for the latest.
    let beyond = thread.get("cycles")?.as_u64()?.saturating_sub(wakeup.count());
    if beyond > 0 {
        wakeup.add(HISTOGRAM_NS, beyond - 1);
        wakeup.add(thread.get("max")?.as_u64()?, 1);
    }
    Some(wakeup)
}

fn hexad(rig: &Rig, release: Release, row: &Row, seconds: f64) -> Result<Round, Failure> {
    let mut daemons = [start_daemon(rig, 0, row.rate_hz, release)?];
    until_active(&mut daemons)?;
    // It leaves the processor that it polls on no time for the start of a daemon.
    let subscriber = row.seen.then(|| Subscriber::start(rig)).transpose()?;
    sleep(Duration::from_secs_f64(seconds));
    let visible = subscriber.map_or_else(|| Ok(Distribution::default()), Subscriber::finish)?;
    let [mut daemon] = daemons;
    daemon.stop()?;
    Ok(Round { visible, ..read_daemon(rig, 0)? })
}

/// Starts the daemon of a machine.
pub fn start_daemon(rig: &Rig, number: usize, rate_hz: u32, release: Release) -> Result<Process, Failure> {
    let config = rig.write_config(number, rate_hz, release)?;
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    command.env("HEXAD_LOG", "warn").arg("run").arg("--config").arg(config);
    command.arg("--report").arg(rig.path(&format!("report-{number}.json")));
    command.arg("--histogram").arg(rig.path(&format!("histogram-{number}.csv")));
    Process::start(rig, &mut command)
}

/// What the daemon of a machine has written at its end.
pub fn read_daemon(rig: &Rig, number: usize) -> Result<Round, Failure> {
    let report = Report::read(&rig.path(&format!("report-{number}.json")))?;
    let mut round = Round { overruns: report.deadline_misses.overrun, ..Round::default() };
    let mut csv = csv::Reader::from_path(rig.path(&format!("histogram-{number}.csv")))?;
    for record in csv.deserialize() {
        let (time, ns, count): (String, u64, u64) = record?;
        match time.as_str() {
            "wakeup" => round.wakeup.add(ns, count),
            "compute" => round.compute.add(ns, count),
            "end_to_end" => round.end_to_end.add(ns, count),
            _ => {}
        }
    }
    round.unrecorded = report.cycles.saturating_sub(round.wakeup.count());
    // It was in control before the round began, and loses control only with a fault.
    if !report.faults.is_empty() {
        return Err(format!("the daemon lost control: {:?}", report.faults).into());
    }
    Ok(round)
}
