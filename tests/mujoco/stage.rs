//! A daemon, a setpoint source, and a body in MuJoCo in the plant's place: one run in a folder of its own.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, Command};
use std::sync::{Mutex, MutexGuard, PoisonError};

use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::config::Config;
use hexad::model::LEGS;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::machine::Machine;
use hexad::model::rigid::{Acceleration, Motion, Twist};
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};
use nalgebra::Vector6;

use super::{file, python};
use hexad_support::certificate::Certificate;
use hexad_support::process::{HANG, Process};
use hexad_support::python::output;
use hexad_support::{Errors, Table, largest};

pub const PERIOD_NS: u64 = 1_000_000;
pub const PERIOD_S: f64 = 1e-3;

/// From one row of a trajectory to the next \[s\].
const ROW_S: f64 = 0.01;

pub const LOCKSTEP: &str = "[realtime]\nrelease = \"lockstep\"";

/// Each of these keeps two processors busy.
pub fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One run in a folder of its own.
pub struct Stage {
    pub name: String,
    folder: PathBuf,
    pub config: Config,
    lockstep: bool,
}

/// Pose and twist of the platform at the beginning of a period, and the forces in it.
pub struct Period {
    pub time_ns: u64,
    pub x: Vector6<f64>,
    pub twist: Vector6<f64>,
    pub force: Option<[f64; LEGS]>,
}

/// Result of a run.
pub struct Run {
    pub position: Errors,
    pub orientation: Errors,
    /// Median \[m\].
    pub typical_position: f64,
    /// Differences to the inverse dynamics of the motion made, as shares of the largest force at the instant.
    pub force: Errors,
    /// Periods under control that were compared.
    pub periods: usize,
}

impl Stage {
    /// A machine of the folder `config` with more sections.
    pub fn new(machine: &str, label: &str, sections: &str) -> Self {
        let name = format!("{machine}-{label}-{}", process::id());
        let text =
            fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("config/{machine}.toml")));
        let named = text.unwrap().replace(&format!("name = \"{machine}\""), &format!("name = \"{name}\""));
        assert!(named.contains(&name), "the name must have been replaced");
        Self::of(file(&name), &format!("{named}\n{sections}"))
    }

    /// A run in this folder, with a configuration.
    pub fn of(folder: PathBuf, configuration: &str) -> Self {
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("machine.toml"), configuration).unwrap();
        let config = Config::load(&folder.join("machine.toml")).unwrap();
        let (name, lockstep) = (config.name.clone(), config.deployment.realtime.is_simulated());
        Self { name, folder, config, lockstep }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub fn daemon(&self, arguments: &[&OsStr]) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        command.args(["run", "--config"]).arg(self.path("machine.toml")).args(arguments);
        command.env(PARENT_VARIABLE, process::id().to_string()).env_remove("HEXAD_LOG");
        let daemon = Process::start(command, self.path("daemon.txt"));
        daemon.says("running");
        daemon
    }

    fn client(&self, script: &str, arguments: &[&OsStr]) -> Process {
        let mut command = python::command(script);
        command.arg(&self.name).args(arguments);
        if self.lockstep {
            command.arg("--lockstep");
        }
        Process::start(command, self.path(&format!("{script}.txt")))
    }

    /// A setpoint source that engages and plays a built-in motion of a machine.
    pub fn source(&self, machine: &Machine, motion: BuiltInMotion, seconds: f64) -> Process {
        let [motion_file, played] = ["motion.csv", "played.csv"].map(|name| self.path(name));
        fs::write(&motion_file, trajectory(machine, motion, seconds)).unwrap();
        self.client(
            "trajectory.py",
            &[motion_file.as_ref(), "--engage".as_ref(), "--record".as_ref(), played.as_ref()],
        )
    }

    /// A setpoint source of hexad that engages.
    pub fn command(&self, arguments: &[&str]) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        command.args(arguments).args(["--engage", "--config"]).arg(self.path("machine.toml"));
        command.env(PARENT_VARIABLE, process::id().to_string());
        Process::start(command, self.path("source.txt"))
    }

    /// A run with MuJoCo in the plant's place: the body of a machine file, with more arguments of the plant and the daemon.
    pub fn with_mujoco(
        &self,
        body: &Path,
        plant: &[&OsStr],
        daemon: &[&OsStr],
        source: impl FnOnce() -> Process,
    ) {
        let [model, measured] = ["body.xml", "measured.csv"].map(|name| self.path(name));
        let mut export = Command::new(env!("CARGO_BIN_EXE_hexad"));
        export.args(["export", "--format", "mjcf", "--config"]).arg(body).arg("--output").arg(&model);
        output(&mut export).unwrap();
        let daemon = self.daemon(daemon);
        let arguments = [model.as_ref(), "--record".as_ref(), measured.as_ref()];
        let plant = self.client("mujoco_plant.py", &[&arguments, plant].concat());
        // The motions of long forms take minutes.
        source().ends_well_within(if Certificate::is_long() { 10 * HANG } else { HANG });
        // It stands, and is let go.
        daemon.says("standby: setpoint source ended");
        plant.stops();
        daemon.stops();
    }

    /// The periods that MuJoCo recorded.
    pub fn periods(&self) -> Vec<Period> {
        let table = Table::read(&self.path("measured.csv"));
        let twist = ["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"];
        let period = |row| Period {
            time_ns: table.number(row, "time_ns") as u64,
            x: table.coordinates(row, ""),
            twist: twist.map(|name| table.number(row, name)).into(),
            force: Some(table.legs(row, "force")).filter(|force| force[0].is_finite()),
        };
        (0..table.rows.len()).map(period).collect()
    }

    /// Tracking while the source played, and forces where the motion was under control.
    pub fn judge(&self, periods: &[Period]) -> Run {
        let table = Table::read(&self.path("played.csv"));
        let number = |row| table.number(row, "time_ns") as u64;
        let played: HashMap<_, _> =
            (0..table.rows.len()).map(|row| (number(row), table.coordinates(row, ""))).collect();
        let [mut position, mut orientation, mut force] = [Errors::default(); 3];
        let mut away = vec![];
        for (now, next) in periods.iter().zip(&periods[1..]) {
            let (Some(pushed), Some(desired)) = (now.force, played.get(&now.time_ns)) else { continue };
            if next.time_ns != now.time_ns + PERIOD_NS {
                // The driver was held, and left out a period.
                continue;
            }
            let pose = |x: Vector6<f64>| TaskState::at_rest(x.into()).motion().pose;
            let error = pose(now.x).displacement_to(&pose(*desired));
            position.add(error.linear.norm());
            away.push(error.linear.norm());
            orientation.add(error.angular.norm());
            // The force is constant in the period, and so nearly is the acceleration.
            let motion = Motion {
                pose: pose(0.5 * (now.x + next.x)),
                twist: Twist::from_vector(&(0.5 * (now.twist + next.twist))),
                acceleration: Acceleration::from_vector(&((next.twist - now.twist) / PERIOD_S)),
            };
            let offline = inverse_dynamics::<Exact>(&self.config.machine, &motion).unwrap();
            for (pushed, offline_leg) in pushed.iter().zip(&offline) {
                force.add((pushed - offline_leg) / largest(&offline));
            }
        }
        away.sort_unstable_by(f64::total_cmp);
        Run { position, orientation, typical_position: away[away.len() / 2], force, periods: away.len() }
    }
}

/// As `hexad move --trajectory` reads it.
fn trajectory(machine: &Machine, motion: BuiltInMotion, seconds: f64) -> String {
    let scene = fit(machine, motion, seconds);
    let names = ["alpha", "beta", "gamma", "x", "y", "z"];
    let header: String =
        ["", "_rate", "_accel"].map(|end| names.map(|name| format!(",{name}{end}")).concat()).concat();
    let rows = (0..=(seconds / ROW_S).round() as u32).map(|row| {
        let t = f64::from(row) * ROW_S;
        let TaskState { x, xd, xdd } = scene.at(t);
        let numbers: String = [x, xd, xdd].iter().flatten().map(|number| format!(",{number}")).collect();
        format!("{t}{numbers}\n")
    });
    format!("t{header}\n{}", rows.collect::<String>())
}

impl Run {
    pub fn print(&self, what: &str) {
        let Self { position, orientation, force, periods, .. } = self;
        println!(
            "{what}: {periods} periods; position RMS {:.2e} max {:.2e} m, orientation RMS {:.2e} max {:.2e} rad; \
             forces off inverse dynamics: RMS {:.1e} max {:.1e}",
            position.rms(),
            position.max,
            orientation.rms(),
            orientation.max,
            force.rms(),
            force.max
        );
    }
}
