//! What all rounds share: a folder, a machine, the processors.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::config::Config;
use hexad::realtime::process::terminate;
use tempfile::TempDir;

use super::Failure;
use super::tools::Processors;

/// The machine that is controlled.
const MACHINE: &str = include_str!("../../config/motion_base.toml");

/// FIFO priority of the loop and of cyclictest: the daemon's default.
pub const PRIORITY: i32 = 80;
/// Of the driver: below the io thread's default of 79, as a driver process should be.
pub const DRIVER_PRIORITY: i32 = 78;

/// Longer than any pause of the host: a lost cycle shall be counted, not become a fault \[ms\].
const TIMEOUT_MS: f64 = 1000.0;

/// How a cycle of the daemon is released: `realtime.release`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Release {
    Sleep,
    Hybrid,
}

impl Release {
    pub fn name(self) -> &'static str {
        match self {
            Self::Sleep => "sleep",
            Self::Hybrid => "hybrid",
        }
    }
}

/// What all rounds share.
pub struct Rig {
    folder: TempDir,
    pub config: Config,
    pub processors: Processors,
}

impl Rig {
    pub fn new(processors: Processors) -> Result<Self, Failure> {
        let config = Config::parse(MACHINE, "config/motion_base.toml")?;
        Ok(Self { folder: TempDir::new()?, config, processors })
    }

    /// A file that goes away with the bench.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The machine's topics, under a name nobody else has; `number` tells several machines apart.
    pub fn machine_name(number: usize) -> String {
        format!("bench-{}-{number}", std::process::id())
    }

    /// Writes a configuration of machine `number`.
    pub fn write_config(&self, number: usize, rate_hz: u32, release: Release) -> Result<PathBuf, Failure> {
        let mut table: toml::Table = toml::from_str(MACHINE)?;
        table.insert("name".into(), Self::machine_name(number).into());
        let Processors { contestant, helpers, .. } = &self.processors;
        let deployment = format!(
            "[realtime]\nrate_hz = {rate_hz}\nrelease = \"{}\"\ncpu = {contestant}\nio_cpu = {helpers}\n\
             priority = {PRIORITY}\nrequire_realtime = true\n\
             [timeouts]\nsetpoint_ms = {TIMEOUT_MS:?}\nmeasured_ms = {TIMEOUT_MS:?}\nallow_unstable_age = true\n",
            release.name()
        );
        table.extend(toml::from_str::<toml::Table>(&deployment)?);
        let path = self.path(&format!("machine-{number}.toml"));
        fs::write(&path, table.to_string())?;
        Ok(path)
    }
}

/// A child process; stopped when dropped.
pub struct Process {
    name: String,
    child: Child,
    errors: PathBuf,
}

impl Process {
    /// Starts a command; what it says on standard error is kept for a failure.
    pub fn start(rig: &Rig, command: &mut Command) -> Result<Self, Failure> {
        let name = Path::new(command.get_program()).display().to_string();
        let errors = rig.path(&format!("stderr-{}", fs::read_dir(rig.folder.path())?.count()));
        let child = command
            .env(PARENT_VARIABLE, std::process::id().to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(fs::File::create(&errors)?)
            .spawn()
            .map_err(|error| format!("cannot start {name}: {error}"))?;
        Ok(Self { name, child, errors })
    }

    /// Fails if it has ended.
    pub fn must_run(&mut self) -> Result<(), Failure> {
        match self.child.try_wait()? {
            Some(status) => Err(self.failure(status)),
            None => Ok(()),
        }
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Asks it to end, and does not wait.
    pub fn ask_to_stop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            terminate(self.child.id());
        }
    }

    /// Waits until it ends by itself; it must end well.
    pub fn finish(&mut self) -> Result<(), Failure> {
        let status = self.child.wait()?;
        if status.success() { Ok(()) } else { Err(self.failure(status)) }
    }

    /// Asks it to end; it must end well.
    pub fn stop(&mut self) -> Result<(), Failure> {
        self.must_run()?;
        self.ask_to_stop();
        self.finish()
    }

    fn failure(&self, status: std::process::ExitStatus) -> Failure {
        let words = fs::read_to_string(&self.errors).unwrap_or_default();
        format!("{} ended: {status}\n{words}", self.name).into()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.ask_to_stop();
        let _ = self.child.wait();
    }
}
