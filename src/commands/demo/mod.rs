//! `hexad demo`: daemon, plant and setpoint source as real processes, from rest at home through a motion
//! and back to rest.

use core::fmt;
use core::time::Duration;
use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{env, fs, io, process, thread};

use clap::Args;
use tracing::warn;

use self::children::ChildProcess;
use self::recording::{Recording, TopicRecorder};
use self::summary::Summary;
use super::arguments::{DEFAULT_CONFIG, DEFAULT_CONFIG_NAME, OptionalMachineFile, built_in_motion, duration};
use super::failure::Failure;
use super::progress::millisecond_bar;
use super::report::{self, recordings_in};
use hexad_client::messages::{StatusMessage, Subscriber};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::State;
use hexad_core::motion::built_in::BuiltInMotion;
use hexad_daemon::recording::RecordingError;
use hexad_daemon::report::Report;
use hexad_machine::config::text::read_file;
use hexad_machine::config::{Config, ConfigError};
use hexad_machine::text::files::{FileError, print, remark, write_whole};

pub mod children;
mod pictures;
mod recording;
mod summary;

/// Interval between two polls of the topics. At 20 kHz they fill only by a fraction in it.
const POLL_INTERVAL: Duration = Duration::from_millis(3);

/// Timeouts of a demonstration \[ms\]: four times the longest pause seen on a busy virtual machine.
const DEFAULT_TIMEOUT_MS: f64 = 200.0;

/// Longest time for the start of the processes and the approach, beyond the motion itself \[s\].
const MAX_OVERHEAD_S: f64 = 20.0;

/// Typical time from start to end beyond the motion itself, for the progress bar \[s\].
const TYPICAL_OVERHEAD_S: f64 = 2.5;

/// Files of a demonstration.
const RECORDING: &str = "recording.mcap";
const PAGE: &str = "report.html";

/// Size of the file of a recording \[MiB\]: one file, however long the demonstration is.
const RECORDING_MIB: &str = "65536";

/// Tracking errors above which the motion counts as not made \[m\], \[rad\].
const MAX_POSITION_ERROR_M: f64 = 0.01;
const MAX_ORIENTATION_ERROR_RAD: f64 = 0.02;

#[derive(Debug, Args)]
pub struct DemoArguments {
    #[command(flatten)]
    machine: OptionalMachineFile,
    /// Machine file of the plant, if it shall differ from the controller's
    #[arg(long, value_name = "FILE")]
    plant_config: Option<PathBuf>,
    /// The motion to make
    #[arg(long, value_parser = built_in_motion(), default_value = BuiltInMotion::Paper.name())]
    motion: BuiltInMotion,
    /// Length of the motion [s]; approach and settling come on top
    #[arg(long, default_value_t = 8.0, value_parser = duration, allow_negative_numbers = true)]
    seconds: f64,
    /// Rate of the loop [Hz], instead of the configured one
    #[arg(long, allow_negative_numbers = true)]
    rate_hz: Option<f64>,
    /// Write a JSON report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Folder for the recording and its page
    #[arg(long, value_name = "FOLDER", default_value = "hexad-demo")]
    charts: PathBuf,
    /// Write the charts also as pictures (SVG) into the folder
    #[arg(long)]
    pictures: bool,
}

impl DemoArguments {
    pub fn execute(self) -> Result<(), Failure> {
        run(&self, &Stop::on_signals()?)
    }
}

fn cannot_run(error: io::Error) -> Failure {
    Failure::after_start(format_args!("cannot run the processes: {error}"))
}

/// The bad outcome of a demonstration.
fn failed(reason: impl fmt::Display) -> Failure {
    Failure::after_start(format_args!("the demonstration failed: {reason}"))
}

fn ended(name: &str, status: process::ExitStatus) -> Failure {
    Failure::after_start(format_args!("hexad {name} ended early: {status}"))
}

/// Runs the demonstration, prints its summary and writes its files.
fn run(demo: &DemoArguments, stop: &Stop) -> Result<(), Failure> {
    let stage = Stage::new(demo)?;
    create_folder(&demo.charts)?;
    let performed = stage.perform(demo, stop);
    // The page of a failed demonstration is useful, too.
    let page = stage.write_page(&demo.charts);
    let recording = performed.inspect_err(|_| {
        if let Ok(page) = &page {
            remark(format_args!("report: {}", page.display()));
        }
    })?;

    let tracking = recording.tracking();
    let mut report = Report::read(&stage.report)?;
    report.tracking = tracking.tracking();
    print(Summary { title: &stage.title, report: &report })?;
    if demo.pictures {
        let pictures = pictures::write_all(&demo.charts, &stage.title, &stage.config, &recording)?;
        print(format_args!("pictures         {} in {}\n", pictures.len(), demo.charts.display()))?;
    }
    if let Some(path) = &demo.report {
        report.write(path)?;
        print(format_args!("figures          {}\n", path.display()))?;
    }
    print(format_args!("report           {}\n", page?.display()))?;
    if !report.faults.is_empty() {
        return Err(failed(format_args!("{} faults", report.faults.len())));
    }
    if tracking.count() == 0 {
        return Err(failed("nothing was recorded"));
    }
    let control = &stage.config.deployment.control;
    let position = (report.tracking.position_max_m, control.engage_position_m.max(MAX_POSITION_ERROR_M));
    let orientation =
        (report.tracking.orientation_max_rad, control.engage_orientation_rad.max(MAX_ORIENTATION_ERROR_RAD));
    for (unit, (error, bound)) in [("m", position), ("rad", orientation)] {
        if error > bound {
            return Err(failed(format_args!("tracking error {error:.3e} {unit} exceeds {bound} {unit}")));
        }
    }
    Ok(())
}

/// Files of one demonstration, in a temporary folder that is removed with it.
struct Stage {
    folder: PathBuf,
    title: String,
    config: Config,
    controller: PathBuf,
    plant: PathBuf,
    report: PathBuf,
}

impl Stage {
    /// Copies the configurations under a unique name, so that a demonstration never meets a daemon in
    /// service, nor another demonstration.
    fn new(demo: &DemoArguments) -> Result<Self, Failure> {
        let (text, place) = read(demo.machine.path())?;
        // Parsed first under its own name, which errors then show.
        let original = Config::parse(&text, &place)?;
        for warning in original.examine().into_result(&original)? {
            warn!("{warning}");
        }
        let (plant_text, plant_place) = match &demo.plant_config {
            Some(path) => read(Some(path))?,
            None => (text.clone(), place.clone()),
        };
        Config::parse(&plant_text, &plant_place)?;

        let folder = env::temp_dir().join(format!("hexad-demo-{}", process::id()));
        create_folder(&folder)?;
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
        write_whole(&stage.controller, text.as_bytes()).map_err(Failure::before_start)?;
        let plant_text = adapted(&plant_text, &name, demo.rate_hz);
        Config::parse(&plant_text, &plant_place)?;
        write_whole(&stage.plant, plant_text.as_bytes()).map_err(Failure::before_start)?;
        Ok(stage)
    }

    fn perform(&self, demo: &DemoArguments, stop: &Stop) -> Result<Recording, Failure> {
        let bus = self.config.join()?;
        let mut recorder = TopicRecorder::new(&bus)?;
        let seconds = format!("{}", demo.seconds);
        let controller = ["--config".as_ref(), self.controller.as_os_str()];
        let plant = ChildProcess::start("plant", ["--config".as_ref(), self.plant.as_os_str()])
            .map_err(cannot_run)?;
        let records = ["--record".as_ref(), demo.charts.as_os_str()];
        let size =
            ["--record-file-mib", RECORDING_MIB, "--record-total-mib", RECORDING_MIB].map(AsRef::as_ref);
        let report = ["--report".as_ref(), self.report.as_os_str()];
        let daemon =
            ChildProcess::start("run", controller.into_iter().chain(report).chain(records).chain(size))
                .map_err(cannot_run)?;
        let setpoints = ChildProcess::start(
            "move",
            controller.into_iter().chain(
                ["--motion", demo.motion.name(), "--seconds", &seconds, "--engage"].map(AsRef::as_ref),
            ),
        )
        .map_err(cannot_run)?;
        let mut processes = vec![plant, daemon, setpoints];
        let watched = watch(&mut processes, &mut recorder, bus.subscriber(8)?, demo.seconds, stop);
        // In reverse order of their start: the setpoint source has ended, the daemon publishes that no force
        // is valid, the plant brakes.
        for process in processes.drain(..).rev() {
            let name = process.name;
            let status = process.stop().map_err(cannot_run)?;
            if !status.success() && watched.is_ok() {
                return Err(ended(name, status));
            }
            recorder.poll();
        }
        watched.map(|()| recorder.finish())
    }

    /// Gives the recording its final name, replacing the last demonstration's recording, and writes its page.
    /// Returns the path of the page.
    fn write_page(&self, folder: &Path) -> Result<PathBuf, Failure> {
        let (recording, page) = (folder.join(RECORDING), folder.join(PAGE));
        let name = format!("{}.", self.config.name);
        let Some(file) = recordings_in(folder, &name).pop() else {
            return Err(Failure::after_start(RecordingError::Empty(folder.into())));
        };
        fs::rename(&file, &recording).map_err(FileError::on(&file))?;
        report::write(&[recording], &page).map_err(Failure::after_start)?;
        Ok(page)
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Records until the setpoint source, the last of the processes, has ended without error.
fn watch(
    processes: &mut [ChildProcess],
    recorder: &mut TopicRecorder,
    mut statuses: Subscriber<StatusMessage>,
    seconds: f64,
    stop: &Stop,
) -> Result<(), Failure> {
    let started = Instant::now();
    let bar = millisecond_bar(seconds + TYPICAL_OVERHEAD_S);
    loop {
        if stop.is_requested() {
            return Err(Failure::after_start("stopped by a signal"));
        }
        recorder.poll();
        // Before the status, because the setpoint source ends after a fault.
        let exits = processes.iter_mut().map(ChildProcess::exit_status);
        let exits: Vec<_> = exits.collect::<Result<_, _>>().map_err(cannot_run)?;
        if let Some(status) = statuses.receive_latest()
            && status.state == State::Fault as u32
        {
            let diagnostic = status.diagnostic.diagnostic().unwrap_or_default();
            return Err(failed(format_args!("fault: {diagnostic}")));
        }
        for (process, exit) in processes.iter().zip(exits) {
            match exit {
                Some(status) if status.success() && process.name == "move" => {
                    bar.finish_and_clear();
                    return Ok(());
                }
                Some(status) => return Err(ended(process.name, status)),
                None => {}
            }
        }
        let elapsed = started.elapsed();
        if elapsed.as_secs_f64() > seconds + MAX_OVERHEAD_S {
            let longest_s = seconds + MAX_OVERHEAD_S;
            return Err(Failure::after_start(format_args!("the motion did not end within {longest_s:.0} s")));
        }
        bar.set_position(elapsed.as_millis() as u64);
        thread::sleep(POLL_INTERVAL);
    }
}

fn create_folder(path: &Path) -> Result<(), Failure> {
    fs::create_dir_all(path).map_err(FileError::on(path)).map_err(Failure::before_start)
}

fn read(path: Option<&Path>) -> Result<(String, String), ConfigError> {
    path.map_or_else(|| Ok((DEFAULT_CONFIG.into(), DEFAULT_CONFIG_NAME.into())), read_file)
}

/// The configuration under another name and rate. The text has been parsed before.
///
/// A desktop sometimes preempts a process for tens of milliseconds. That is no fault of the loop. If the file sets no
/// timeouts, the demonstration uses longer ones than a deployment, longer even than the age at which its loop is stable.
fn adapted(text: &str, name: &str, rate_hz: Option<f64>) -> String {
    let mut table: toml::Table = toml::from_str(text).unwrap_or_default();
    table.insert("name".into(), name.into());
    let mut set = |section: &str, key: &str, value: toml::Value, replace: bool| {
        let section = table.entry(section).or_insert_with(|| toml::Table::new().into());
        if let Some(section) = section.as_table_mut().filter(|section| replace || !section.contains_key(key))
        {
            section.insert(key.into(), value);
        }
    };
    for (section, key) in
        [("timeouts", "setpoint_ms"), ("timeouts", "measured_ms"), ("plant", "force_timeout_ms")]
    {
        set(section, key, DEFAULT_TIMEOUT_MS.into(), false);
    }
    set("timeouts", "allow_unstable_age", true.into(), false);
    if let Some(rate_hz) = rate_hz {
        set("realtime", "rate_hz", rate_hz.into(), true);
    }
    table.to_string()
}
