//! `hexad demo`: daemon, plant and setpoint source as real processes, from rest at home through a motion
//! and back to rest.

use core::time::Duration;
use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{env, fs, io, process, thread};

use indicatif::{ProgressBar, ProgressStyle};

use self::children::Process;
use self::recording::{Recorder, Recording};
use self::summary::Summary;
use super::operate::Operator;
use crate::config::text::text_of;
use crate::config::{Config, ConfigError};
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::{Request, State};
use crate::daemon::report::Report;
use crate::messages::PortError;
use crate::output::files::{FileError, print, write_whole};
use crate::output::svg::ChartError;
use crate::realtime::stop_request::Stop;

pub mod children;
mod pictures;
mod recording;
mod summary;

/// The machine of a demonstration without `--config`.
pub const DEFAULT_MACHINE: &str = include_str!("../../../config/fried2008.toml");

/// How often the topics are emptied: a fraction of what they can hold at 20 kHz.
const POLL: Duration = Duration::from_millis(3);

/// Timeouts of a demonstration \[ms\]: four times the longest pause seen on a busy virtual machine.
const PATIENCE_MS: f64 = 200.0;

/// Seconds for processes to start and for the approach, beyond the motion itself, before something is
/// wrong.
const GRACE_S: f64 = 20.0;

/// Typical seconds from start to end beyond the motion itself; for the progress bar.
const AROUND_S: f64 = 2.5;

/// What to demonstrate.
#[derive(Clone, Debug)]
pub struct Demo {
    pub config: Option<PathBuf>,
    /// The plant's own machine file, if it shall differ from the controller's.
    pub plant_config: Option<PathBuf>,
    pub motion: String,
    pub seconds: f64,
    pub rate_hz: Option<f64>,
    pub report: Option<PathBuf>,
    /// Folder for the pictures.
    pub charts: PathBuf,
}

/// Why a demonstration did not go well.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Chart(#[from] ChartError),
    #[error("cannot run the processes: {0}")]
    Process(#[from] io::Error),
    #[error("hexad {0} ended early: {1}")]
    Ended(&'static str, process::ExitStatus),
    #[error("the motion did not end within {0:.0} s")]
    TooLong(f64),
    #[error("stopped by a signal")]
    Interrupted,
    #[error("it did not go well: {0}")]
    NotWell(String),
}

/// Runs the demonstration and prints what came of it.
pub fn run(demo: &Demo, stop: &Stop) -> Result<(), DemoError> {
    let stage = Stage::new(demo)?;
    fs::create_dir_all(&demo.charts).map_err(FileError::on(&demo.charts))?;
    let recording = stage.perform(demo, stop)?;

    let tracking = recording.tracking();
    let mut report = Report::read(&stage.report)?;
    report.tracking = tracking.tracking();
    let pictures = pictures::write_all(&demo.charts, &stage.title, &stage.config, &recording)?;
    print(Summary { title: &stage.title, report: &report })?;
    print(format_args!("pictures         {} in {}\n", pictures.len(), demo.charts.display()))?;
    if let Some(path) = &demo.report {
        report.write(path)?;
        print(format_args!("report           {}\n", path.display()))?;
    }
    if !report.faults.is_empty() {
        return Err(DemoError::NotWell(format!("{} faults", report.faults.len())));
    }
    if tracking.count() == 0 {
        return Err(DemoError::NotWell("nothing was recorded".into()));
    }
    let control = &stage.config.deployment.control;
    let lost = report.tracking.position_max_m > control.engage_position_m.max(MAX_ERROR_M)
        || report.tracking.orientation_max_rad > control.engage_orientation_rad.max(MAX_ERROR_RAD);
    if lost { Err(DemoError::NotWell("the platform left the path".into())) } else { Ok(()) }
}

/// Off the path by more than this, the motion cannot be said to have been made \[m\], \[rad\].
const MAX_ERROR_M: f64 = 0.01;
const MAX_ERROR_RAD: f64 = 0.02;

/// Files for one demonstration, in a folder that goes away with it.
struct Stage {
    folder: PathBuf,
    title: String,
    config: Config,
    controller: PathBuf,
    plant: PathBuf,
    report: PathBuf,
}

impl Stage {
    /// Copies the configurations under a name of their own, so that a demonstration never meets a daemon
    /// in service, nor another demonstration.
    fn new(demo: &Demo) -> Result<Self, DemoError> {
        let (text, place) = read(demo.config.as_deref())?;
        // The user's files are judged under their own names.
        let original = Config::parse(&text, &place)?;
        let (plant_text, plant_place) = match &demo.plant_config {
            Some(path) => read(Some(path))?,
            None => (text.clone(), place.clone()),
        };
        Config::parse(&plant_text, &plant_place)?;

        let folder = env::temp_dir().join(format!("hexad-demo-{}", process::id()));
        fs::create_dir_all(&folder).map_err(FileError::on(&folder))?;
        let name = format!("{:.40}-demo-{}", original.name, process::id());
        let text = adapted(&text, &name, demo.rate_hz);
        let config = Config::parse(&text, &place)?;
        let stage = Self {
            title: original.name,
            config,
            controller: folder.join("controller.toml"),
            plant: folder.join("plant.toml"),
            report: folder.join("report.json"),
            folder,
        };
        write_whole(&stage.controller, text.as_bytes())?;
        let plant_text = adapted(&plant_text, &name, demo.rate_hz);
        Config::parse(&plant_text, &plant_place)?;
        write_whole(&stage.plant, plant_text.as_bytes())?;
        Ok(stage)
    }

    fn perform(&self, demo: &Demo, stop: &Stop) -> Result<Recording, DemoError> {
        let bus = self.config.join()?;
        let mut recorder = Recorder::new(&bus)?;
        let seconds = format!("{}", demo.seconds);
        let controller = ["--config".as_ref(), self.controller.as_os_str()];
        let plant = Process::start("plant", ["--config".as_ref(), self.plant.as_os_str()])?;
        let daemon = Process::start(
            "run",
            controller.into_iter().chain(["--report".as_ref(), self.report.as_os_str()]),
        )?;
        let setpoints = Process::start(
            "move",
            controller
                .into_iter()
                .chain(["--motion", demo.motion.as_str(), "--seconds", &seconds].map(AsRef::as_ref)),
        )?;
        let mut processes = vec![plant, daemon, setpoints];
        let operator = Operator::new(&bus)?;
        watch(&mut processes, &mut recorder, operator, demo.seconds, stop)?;
        // In the order they were started in reverse: the setpoint source has ended, the daemon says that
        // no force is valid, the plant brakes.
        for process in processes.drain(..).rev() {
            let name = process.name;
            let status = process.stop()?;
            if !status.success() {
                return Err(DemoError::Ended(name, status));
            }
            recorder.poll();
        }
        Ok(recorder.finish())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Engages, and records until the setpoint source, the last of the processes, has ended well.
fn watch(
    processes: &mut [Process],
    recorder: &mut Recorder,
    mut operator: Operator,
    seconds: f64,
    stop: &Stop,
) -> Result<(), DemoError> {
    let started = Instant::now();
    let bar = progress(seconds + AROUND_S);
    loop {
        if stop.is_requested() {
            return Err(DemoError::Interrupted);
        }
        recorder.poll();
        if let Some(status) = operator.status() {
            if status.state == State::Fault as u32 {
                let diagnostic = status.diagnostic.diagnostic().unwrap_or_default();
                return Err(DemoError::NotWell(format!("fault: {diagnostic}")));
            }
            if status.diagnostic.code == DiagnosticCode::ReadyToEngage as u32 {
                operator.send(Request::Engage)?;
            }
        }
        for process in processes.iter_mut() {
            match process.ended()? {
                Some(status) if status.success() && process.name == "move" => {
                    bar.finish_and_clear();
                    return Ok(());
                }
                Some(status) => return Err(DemoError::Ended(process.name, status)),
                None => {}
            }
        }
        let elapsed = started.elapsed();
        if elapsed.as_secs_f64() > seconds + GRACE_S {
            return Err(DemoError::TooLong(seconds + GRACE_S));
        }
        bar.set_position(elapsed.as_millis() as u64);
        thread::sleep(POLL);
    }
}

fn progress(seconds: f64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {elapsed}");
    ProgressBar::new((seconds * 1e3) as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn read(path: Option<&Path>) -> Result<(String, String), ConfigError> {
    path.map_or_else(|| Ok((DEFAULT_MACHINE.into(), "fried2008.toml".into())), text_of)
}

/// The configuration under another name and rate. The text has been parsed before.
///
/// A desktop takes the processor away for tens of milliseconds now and then. That is no fault of the loop,
/// so where the file sets no timeouts a demonstration is more patient than a deployment.
fn adapted(text: &str, name: &str, rate_hz: Option<f64>) -> String {
    let mut table: toml::Table = toml::from_str(text).unwrap_or_default();
    table.insert("name".into(), name.into());
    let mut set = |section: &str, key: &str, value: f64, replace: bool| {
        let section = table.entry(section).or_insert_with(|| toml::Table::new().into());
        if let Some(section) = section.as_table_mut().filter(|section| replace || !section.contains_key(key))
        {
            section.insert(key.into(), value.into());
        }
    };
    for (section, key) in
        [("timeouts", "setpoint_ms"), ("timeouts", "measured_ms"), ("plant", "force_timeout_ms")]
    {
        set(section, key, PATIENCE_MS, false);
    }
    if let Some(rate_hz) = rate_hz {
        set("realtime", "rate_hz", rate_hz, true);
    }
    table.to_string()
}
