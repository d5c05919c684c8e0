//! `hexad doctor`: what this host offers to a hard real-time loop, how late it wakes a thread, and which
//! rates that allows.
//!
//! The rights are asked for as the daemon asks for them, and the thread that is measured is set up and waits
//! as the daemon's.

use std::path::{Path, PathBuf};
use std::{io, thread};

use serde::{Deserialize, Serialize};

use self::facts::permissions::Refused;
use self::facts::{Fact, Rating};
use self::files::HostFiles;
use self::latency::{Latency, Waiting};
use self::text::Layout;
use self::verdict::{Circumstances, Judgement, Verdict, judge};
use crate::config::deployment::{Deployment, Realtime, Scheduler};

use super::demo::DEFAULT_MACHINE;
use crate::config::{Config, ConfigError};
use crate::daemon::nanoseconds;
use crate::daemon::start::prepare_loop;
use crate::output::files::{FileError, print, write_whole};
use crate::realtime::clock_cost::ClockCost;
use crate::realtime::setup::idle::PmQosRequest;
use crate::realtime::setup::permissions::Permissions;
use crate::realtime::setup::refusals::SetupStep;
use crate::realtime::setup::{Shortfall, idle, memory};
use crate::realtime::stop_request::Stop;

pub mod facts;
mod files;
pub mod latency;
mod running;
mod text;
pub mod verdict;

/// What to look at.
#[derive(Clone, Debug)]
pub struct Doctor {
    pub config: Option<PathBuf>,
    /// Of the real-time thread, instead of the configured one.
    pub cpu: Option<usize>,
    /// Length of the measurement.
    pub seconds: f64,
    pub report: Option<PathBuf>,
    /// Whether to measure where a controller runs.
    pub disturb: bool,
}

/// Explanation there is no diagnosis, or a bad one.
#[derive(Debug, thiserror::Error)]
pub enum DoctorError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error("{0}")]
    Cpu(Shortfall),
    #[error(
        "--cpu must not be given with realtime.scheduler = \"deadline\" (Linux places such threads itself)"
    )]
    Placed,
    #[error(
        "not measured: it would delay the controller of process {0}; stop that, choose another --cpu, or say --disturb"
    )]
    Running(u32),
    #[error("cannot start a thread: {0}")]
    Thread(#[from] io::Error),
    #[error("stopped by a signal")]
    Interrupted,
    #[error(transparent)]
    Report(#[from] FileError),
    #[error("{0} is not possible on this host")]
    Impossible(String),
}

/// Everything found: what `--report` writes as JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Diagnosis {
    pub name: String,
    /// The rate that is asked for, and how its releases are waited for.
    pub rate_hz: f64,
    pub release: Waiting,
    /// Of the real-time thread; `None` if the scheduler decides.
    pub cpu: Option<usize>,
    /// Length of the measurement.
    pub seconds: f64,
    pub facts: Vec<Fact>,
    pub rates: Vec<Rate>,
    /// On what is asked for.
    pub verdict: Judgement,
}

/// One rate and way of waiting, judged.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Rate {
    #[serde(flatten)]
    pub latency: Latency,
    pub verdict: Judgement,
    pub why: Vec<String>,
}

/// Looks, measures, judges and prints.
pub fn run(doctor: &Doctor, stop: &Stop) -> Result<(), DoctorError> {
    let config = load(doctor.config.as_deref())?;
    let permissions = Permissions::of_this_process();
    let realtime = &asked(&config.deployment.realtime, doctor.cpu, &permissions)?;
    let deployment = Deployment { realtime: realtime.clone(), ..config.deployment };
    let (refused, _shallow_sleep) = prepare(realtime)?;
    let host = &HostFiles::under(Path::new("/"));
    let facts = facts::all(host, realtime, &permissions, &refused, &ClockCost::measure());
    let layout = Layout::of_stdout();
    print(layout.facts(&config.name, realtime, &facts))?;

    let controller = running::controllers(host, realtime.cpu).first().copied();
    if let Some(process) = controller.filter(|_| !doctor.disturb) {
        return Err(DoctorError::Running(process));
    }
    let latencies =
        latency::measure_all(host, &deployment, doctor.seconds, stop)?.ok_or(DoctorError::Interrupted)?;
    let bad = facts.iter().filter(|fact| fact.rating == Rating::Bad).map(|fact| fact.name.clone()).collect();
    let longest_hold_ns = nanoseconds(deployment.timeouts.measured_s);
    let circumstances = Circumstances { longest_hold_ns, bad, refusal: refusal(realtime, &refused) };
    let rates = judged(latencies, &circumstances);
    let (rate_hz, release) = (realtime.rate_hz, Waiting::from(realtime.release));
    let asked = rates.iter().find(|rate| rate.latency.is(rate_hz, release));
    let verdict = asked.map_or(Judgement::Impossible, |rate| rate.verdict);
    let Doctor { seconds, .. } = *doctor;
    let diagnosis =
        Diagnosis { name: config.name, rate_hz, release, cpu: realtime.cpu, seconds, facts, rates, verdict };
    print(layout.rates(&diagnosis))?;
    if let Some(path) = &doctor.report {
        diagnosis.write(path)?;
        print(format_args!("report  {}\n", path.display()))?;
    }
    match verdict {
        Judgement::Good | Judgement::Marginal => Ok(()),
        Judgement::Impossible => Err(DoctorError::Impossible(format!("{rate_hz} Hz by {}", release.name()))),
    }
}

fn load(path: Option<&Path>) -> Result<Config, ConfigError> {
    path.map_or_else(|| Config::parse(DEFAULT_MACHINE, "fried2008.toml"), Config::load)
}

/// What is configured, on this processor if one is given.
fn asked(
    configured: &Realtime,
    cpu: Option<usize>,
    permissions: &Permissions,
) -> Result<Realtime, DoctorError> {
    let Some(cpu) = cpu else { return Ok(configured.clone()) };
    if configured.scheduler == Scheduler::Deadline {
        return Err(DoctorError::Placed);
    }
    match permissions.refusal_of(&SetupStep::Cpu(cpu)) {
        Some(shortfall) => Err(DoctorError::Cpu(shortfall)),
        None => Ok(Realtime { cpu: Some(cpu), ..configured.clone() }),
    }
}

/// Asks for everything that the daemon asks for, on a thread that then ends. What the process was granted
/// holds until it ends, or the result is dropped.
fn prepare(realtime: &Realtime) -> Result<(Refused, Option<PmQosRequest>), DoctorError> {
    let probe = thread::scope(|threads| {
        let thread = thread::Builder::new().spawn_scoped(threads, || prepare_loop(realtime, || ()))?;
        thread.join().map_err(|_| io::Error::other("it has died"))
    })?;
    let shallow_sleep = idle::limit_wakeup_latency(realtime.cpu_dma_latency_us);
    let locked_memory = if realtime.lock_memory { memory::lock_all().err() } else { None };
    let refused =
        Refused { thread: probe, shallow_sleep: shallow_sleep.as_ref().err().cloned(), locked_memory };
    Ok((refused, shallow_sleep.ok()))
}

/// Explanation the daemon would not start.
fn refusal(realtime: &Realtime, refused: &Refused) -> Option<String> {
    let lacking: Vec<_> = refused.all().map(|shortfall| shortfall.what.as_str()).collect();
    (realtime.require_realtime && !lacking.is_empty()).then(|| {
        format!("the daemon would not start: realtime.require_realtime, and no {}", lacking.join(", no "))
    })
}

fn judged(latencies: Vec<Latency>, circumstances: &Circumstances) -> Vec<Rate> {
    let judged = |latency| {
        let Verdict { judgement, why } = judge(&latency, circumstances);
        Rate { latency, verdict: judgement, why }
    };
    latencies.into_iter().map(judged).collect()
}

impl Diagnosis {
    /// Writes JSON.
    fn write(&self, path: &Path) -> Result<(), FileError> {
        let json = serde_json::to_vec_pretty(self).map_err(|error| FileError::on(path)(error.into()))?;
        write_whole(path, &json)
    }
}
