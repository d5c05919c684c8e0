//! `hexad doctor`: facts about this host for a hard real-time loop, its wake-up latency, and the rates that
//! it allows.
//!
//! The doctor requests the daemon's rights, and measures a thread that is set up and waits like the daemon's.

use std::path::{Path, PathBuf};
use std::{io, thread};

use clap::Args;
use serde::{Deserialize, Serialize};

use self::facts::permissions::RefusedRights;
use self::facts::{Assessment, Fact};
use self::files::HostFiles;
use self::latency::measured_mode;
use self::text::TextStyle;
use self::verdict::{Feasibility, HostConditions, RateVerdict, assess};
use super::arguments::{DEFAULT_CONFIG, DEFAULT_CONFIG_NAME, OptionalMachineFile, duration};
use super::failure::Failure;
use hexad_client::realtime::clock_cost::ClockCost;
use hexad_client::realtime::cyclic::ReleaseMode;
use hexad_client::realtime::setup::idle::PmQosRequest;
use hexad_client::realtime::setup::permissions::Permissions;
use hexad_client::realtime::setup::refusals::SetupStep;
use hexad_client::realtime::setup::{idle, memory};
use hexad_client::realtime::stop_request::Stop;
use hexad_daemon::nanoseconds;
use hexad_daemon::start::prepare_loop;
use hexad_machine::config::Config;
use hexad_machine::config::deployment::{Deployment, Realtime, Scheduler};
use hexad_machine::text::files::{FileError, print, print_json, write_json};

pub mod facts;
mod files;
pub mod latency;
mod running;
mod text;
pub mod verdict;

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
const SCHEMA: u32 = 2;

#[derive(Debug, Args)]
pub struct DoctorArguments {
    #[command(flatten)]
    machine: OptionalMachineFile,
    /// CPU of the real-time thread, instead of the configured one
    #[arg(long)]
    cpu: Option<usize>,
    /// Length of the measurement, all rates together [s]
    #[arg(long, default_value_t = 10.0, value_parser = duration, allow_negative_numbers = true)]
    seconds: f64,
    /// Write a JSON report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print the report as JSON instead of the text
    #[arg(long)]
    json: bool,
    /// Measure although a controller runs on the same CPUs, and delay it
    #[arg(long)]
    disturb: bool,
}

impl DoctorArguments {
    pub fn execute(self) -> Result<(), Failure> {
        run(&self, &Stop::on_signals()?)
    }
}

/// Diagnosis of a host: the JSON of `--report` and `--json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Diagnosis {
    #[serde(default)]
    pub schema: u32,
    pub name: String,
    /// Configured rate, and the release mode measured for it.
    pub rate_hz: f64,
    pub release: ReleaseMode,
    /// CPU of the real-time thread; `None` if the scheduler decides.
    pub cpu: Option<usize>,
    /// Length of the measurement.
    pub seconds: f64,
    pub facts: Vec<Fact>,
    pub rates: Vec<RateVerdict>,
    /// Verdict on the configured rate; `None` if a controller on the CPU prevented the measurement.
    pub verdict: Option<Feasibility>,
}

/// Examines the host, measures, and prints facts and verdicts.
fn run(doctor: &DoctorArguments, stop: &Stop) -> Result<(), Failure> {
    let config = match doctor.machine.path() {
        Some(path) => Config::load(path)?,
        None => Config::parse(DEFAULT_CONFIG, DEFAULT_CONFIG_NAME)?,
    };
    let permissions = Permissions::of_this_process();
    let realtime = &with_cpu(&config.deployment.realtime, doctor.cpu, &permissions)?;
    let deployment = Deployment { realtime: realtime.clone(), ..config.deployment };
    let (refused, _idle_bound) = request_rights(realtime)?;
    let host = &HostFiles::under(Path::new("/"));
    let facts = facts::all(host, realtime, &permissions, &refused, &ClockCost::measure());
    let style = TextStyle::of_stdout();
    if !doctor.json {
        print(style.facts(&config.name, realtime, &facts))?;
    }

    let (rate_hz, release) = (realtime.rate_hz, measured_mode(realtime.release));
    let (schema, name, cpu) = (SCHEMA, config.name, realtime.cpu);
    let mut diagnosis =
        Diagnosis { schema, name, rate_hz, release, cpu, seconds: 0.0, facts, rates: vec![], verdict: None };
    let controller = running::controllers(host, realtime.cpu).first().copied();
    if let Some(process) = controller.filter(|_| !doctor.disturb) {
        show(doctor, &style, &diagnosis)?;
        return Err(Failure::before_start(format_args!(
            "not measured: it would delay the controller of process {process}; stop that, choose another --cpu, or add --disturb"
        )));
    }
    let latencies = latency::measure_all(host, &deployment, doctor.seconds, stop).map_err(no_thread)?;
    let latencies = latencies.ok_or_else(|| Failure::after_start("stopped by a signal"))?;
    let is_bad = |fact: &&Fact| fact.assessment == Assessment::Bad;
    let conditions = HostConditions {
        longest_hold_ns: nanoseconds(deployment.timeouts.measured_s),
        bad: diagnosis.facts.iter().filter(is_bad).map(|fact| fact.name.clone()).collect(),
        refusal: refusal(realtime, &refused),
    };
    diagnosis.seconds = doctor.seconds;
    diagnosis.rates = latencies.into_iter().map(|latency| assess(latency, &conditions)).collect();
    let configured = diagnosis.rates.iter().find(|rate| rate.latency.is_of(rate_hz, release));
    let verdict = configured.map_or(Feasibility::Impossible, |rate| rate.verdict);
    diagnosis.verdict = Some(verdict);
    show(doctor, &style, &diagnosis)?;
    match verdict {
        Feasibility::Good | Feasibility::Marginal => Ok(()),
        Feasibility::Impossible => {
            let release = release.name();
            Err(Failure::after_start(format_args!("{rate_hz} Hz by {release} is not possible on this host")))
        }
    }
}

/// Prints the rates as text, or the whole diagnosis as JSON, and writes the report.
fn show(doctor: &DoctorArguments, style: &TextStyle, diagnosis: &Diagnosis) -> Result<(), FileError> {
    if doctor.json {
        print_json(diagnosis)?;
    } else {
        print(style.rates(diagnosis))?;
    }
    let Some(path) = &doctor.report else { return Ok(()) };
    write_json(path, diagnosis)?;
    if doctor.json { Ok(()) } else { print(format_args!("report  {}\n", path.display())) }
}

/// The configured section, with the CPU of the command line if given.
fn with_cpu(
    configured: &Realtime,
    cpu: Option<usize>,
    permissions: &Permissions,
) -> Result<Realtime, Failure> {
    let Some(cpu) = cpu else { return Ok(configured.clone()) };
    if configured.scheduler == Scheduler::Deadline {
        return Err(Failure::before_start(
            "--cpu must not be given with realtime.scheduler = \"deadline\" (Linux places such threads itself)",
        ));
    }
    match permissions.refusal_of(&SetupStep::Cpu(cpu)) {
        Some(shortfall) => Err(Failure::before_start(shortfall)),
        None => Ok(Realtime { cpu: Some(cpu), ..configured.clone() }),
    }
}

fn no_thread(error: io::Error) -> Failure {
    Failure::before_start(format_args!("cannot start a thread: {error}"))
}

/// Requests all rights that the daemon requests. The rights of a thread are requested on a separate thread, which then
/// ends. Rights of the process last until it ends, or until the result is dropped.
fn request_rights(realtime: &Realtime) -> Result<(RefusedRights, Option<PmQosRequest>), Failure> {
    let thread = thread::scope(|threads| {
        let thread = thread::Builder::new().spawn_scoped(threads, || prepare_loop(realtime, || ()))?;
        thread.join().map_err(|_| io::Error::other("it has died"))
    })
    .map_err(no_thread)?;
    let (idle_bound, refused_bound) = match idle::limit_wakeup_latency(realtime.cpu_dma_latency_us) {
        Ok(bound) => (Some(bound), None),
        Err(shortfall) => (None, Some(shortfall)),
    };
    let locked_memory = if realtime.lock_memory { memory::lock_all().err() } else { None };
    Ok((RefusedRights { thread, idle_bound: refused_bound, locked_memory }, idle_bound))
}

/// Reason why the daemon would not start.
fn refusal(realtime: &Realtime, refused: &RefusedRights) -> Option<String> {
    let refused: Vec<_> = refused.all().map(|shortfall| shortfall.what.as_str()).collect();
    (realtime.require_realtime && !refused.is_empty()).then(|| {
        format!("the daemon would not start: realtime.require_realtime, and no {}", refused.join(", no "))
    })
}
