//! The daemon controls a platform that nobody here wrote, for a setpoint source that nobody here compiled: the
//! clients of `tests/clients` on the package `hexad`.

use std::collections::HashMap;
use std::fs;
use std::panic::{catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::process::{self, Command};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::commands::plant::hardware;
use hexad::config::Config;
use hexad::messages::{Bus, Publisher, Subscriber};
use hexad::messages::{ForceMessage, MeasuredMessage};
use hexad::model::LEGS;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::machine::Machine;
use hexad::model::rigid::{Acceleration, Motion, Twist};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::{BuiltInMotion, fit};
use nalgebra::Vector6;

use super::common::process::{HANG, Process};
use super::common::stalls::Watchdog;
use super::{DEPLOYED, file, python};
use crate::common::{Errors, Table, largest};

const PERIOD_NS: u64 = 1_000_000;
const PERIOD_S: f64 = 1e-3;

/// Of the motion \[s\], and from one row of the file to the next.
const SECONDS: f64 = 4.0;
const ROW_S: f64 = 0.01;

const LOCKSTEP: &str = "[realtime]\nrelease = \"lockstep\"";

/// Timeouts that hardly a stall of the host reaches, but for the driver's own.
const REAL_TIME: &str = "
[realtime]
release = \"external\"
[timeouts]
setpoint_ms = 200.0
measured_ms = 200.0
allow_unstable_age = true
";

/// What a run in real time does not survive, half of the driver's timeout, and how often it is tried.
const HELD: Duration = Duration::from_millis(25);
const ATTEMPTS: u32 = 5;

/// Each of these keeps two processors busy.
fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One run in a folder of its own.
struct Stage {
    name: String,
    folder: PathBuf,
    config: Config,
    lockstep: bool,
}

/// What the plant measured in a period, and the forces that it then had.
struct Period {
    time_ns: u64,
    x: Vector6<f64>,
    twist: Vector6<f64>,
    force: Option<[f64; LEGS]>,
}

/// What a run showed.
struct Run {
    position: Errors,
    orientation: Errors,
    /// Median \[m\].
    typical_position: f64,
    /// Differences to the inverse dynamics of the motion made, as shares of the largest force at the instant.
    force: Errors,
    /// Periods under control that were compared.
    periods: usize,
}

impl Stage {
    fn new(machine: &str, label: &str, sections: &str) -> Self {
        let name = format!("{machine}-{label}-{}", process::id());
        let folder = file(&name);
        fs::create_dir_all(&folder).unwrap();
        let text =
            fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("config/{machine}.toml")));
        let named = text.unwrap().replace(&format!("name = \"{machine}\""), &format!("name = \"{name}\""));
        assert!(named.contains(&name), "the name must have been replaced");
        fs::write(folder.join("machine.toml"), format!("{named}\n{sections}")).unwrap();
        let config = Config::load(&folder.join("machine.toml")).unwrap();
        let lockstep = config.deployment.realtime.is_simulated();
        let stage = Self { name, folder, config, lockstep };
        fs::write(stage.path("motion.csv"), trajectory(&stage.config.machine)).unwrap();
        stage
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn daemon(&self) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        command.args(["run", "--config"]).arg(self.path("machine.toml"));
        command.env(PARENT_VARIABLE, process::id().to_string()).env_remove("HEXAD_LOG");
        let daemon = Process::start(command, self.path("daemon.txt"));
        daemon.says("running");
        daemon
    }

    fn client(&self, script: &str, arguments: &[&Path]) -> Process {
        let mut command = python::command(script);
        command.arg(&self.name).args(arguments);
        if self.lockstep {
            command.arg("--lockstep");
        }
        Process::start(command, self.path(&format!("{script}.txt")))
    }

    fn export(&self, model: &Path) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        command.args(["export", "--format", "mjcf", "--config"]).arg(self.path("machine.toml"));
        assert!(command.arg("--output").arg(model).status().unwrap().success());
    }

    /// A setpoint source that engages.
    fn source(&self) -> Process {
        let [motion, played] = ["motion.csv", "played.csv"].map(|name| self.path(name));
        self.client("trajectory.py", &[&motion, "--engage".as_ref(), "--record".as_ref(), &played])
    }

    /// All of a run with MuJoCo in the plant's place.
    fn with_mujoco(&self) -> Run {
        let [model, measured] = ["machine.xml", "measured.csv"].map(|name| self.path(name));
        self.export(&model);
        let daemon = self.daemon();
        let plant = self.client("mujoco_plant.py", &[&model, "--record".as_ref(), &measured]);
        self.source().ends_well();
        // It stands, and is let go.
        daemon.says("standby: setpoint source ended");
        plant.stops();
        daemon.stops();
        let table = Table::read(&measured);
        let twist = ["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"];
        let period = |row| Period {
            time_ns: table.number(row, "time_ns") as u64,
            x: table.coordinates(row, ""),
            twist: twist.map(|name| table.number(row, name)).into(),
            force: Some(table.legs(row, "force")).filter(|force| force[0].is_finite()),
        };
        self.judge(&(0..table.rows.len()).map(period).collect::<Vec<_>>())
    }

    /// The same with our own plant, in lock-step.
    fn with_ours(&self) -> Run {
        let daemon = self.daemon();
        let bus = Bus::join_simulated(&self.name).unwrap();
        let mut measured = bus.publisher::<MeasuredMessage>().unwrap();
        let mut forces = bus.subscriber::<ForceMessage>(8).unwrap();
        let source = self.source();
        let mut hardware = hardware(&self.config);
        let mut periods = vec![];
        for time_ns in (0..).step_by(PERIOD_NS as usize) {
            let (length_m, length_rate_m_s) = hardware.measure();
            let state = *hardware.simulator().state();
            let x = task_coordinates(&state.pose, &self.config.machine.home);
            let message =
                MeasuredMessage { length_m, length_rate_m_s, rates_valid: 1, ..MeasuredMessage::default() };
            let force = ask(&mut measured, &mut forces, time_ns, message);
            let force = force.may_be_applied(force.header.time_ns, 0).then_some(force.force_n);
            periods.push(Period { time_ns, x: x.into(), twist: state.twist.vector(), force });
            hardware.advance(PERIOD_NS, force);
            if force.is_none() && periods.iter().any(|period| period.force.is_some()) {
                break;
            }
        }
        source.ends_well();
        daemon.stops();
        self.judge(&periods)
    }

    /// Tracking while the source played, and forces where the motion was under control.
    fn judge(&self, periods: &[Period]) -> Run {
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

/// Publishes a measurement until it is answered.
fn ask(
    measured: &mut Publisher<MeasuredMessage>,
    forces: &mut Subscriber<ForceMessage>,
    time_ns: u64,
    message: MeasuredMessage,
) -> ForceMessage {
    let began = Instant::now();
    loop {
        measured.publish(time_ns, message).unwrap();
        let said = Instant::now();
        while said.elapsed() < Duration::from_millis(100) {
            match forces.receive_latest() {
                Some(force) if force.release_ns == time_ns => return force,
                _ => std::thread::yield_now(),
            }
        }
        assert!(began.elapsed() < HANG, "no force for {time_ns}");
    }
}

/// As `hexad move --trajectory` reads it.
fn trajectory(machine: &Machine) -> String {
    let scene = fit(machine, BuiltInMotion::Sines, SECONDS);
    let names = ["alpha", "beta", "gamma", "x", "y", "z"];
    let header: String =
        ["", "_rate", "_accel"].map(|end| names.map(|name| format!(",{name}{end}")).concat()).concat();
    let rows = (0..=(SECONDS / ROW_S).round() as u32).map(|row| {
        let t = f64::from(row) * ROW_S;
        let TaskState { x, xd, xdd } = scene.at(t);
        let numbers: String = [x, xd, xdd].iter().flatten().map(|number| format!(",{number}")).collect();
        format!("{t}{numbers}\n")
    });
    format!("t{header}\n{}", rows.collect::<String>())
}

impl Run {
    fn print(&self, what: &str) {
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

/// Largest error \[m\], \[rad\] in MuJoCo. Its forces differ by up to 3e-4 from inverse dynamics, as its joints are held by
/// constraints with a time constant: 3e-4 of gravity over the stiffness of the loop, 3948 / s^2, is 0.7e-6.
const LARGEST_ERROR: f64 = 1.2e-6;

/// Daemon and plant have the same parameters, so what is off is what a period makes of a force, and what the engine does.
#[test]
fn a_platform_in_mujoco_tracks_as_well_as_our_own() {
    if python::is_lacking() {
        return;
    }
    let _turn = turn();
    for machine in DEPLOYED {
        let [mujoco, ours] = ["mujoco", "ours"].map(|who| Stage::new(machine, who, LOCKSTEP));
        let (mujoco, ours) = (mujoco.with_mujoco(), ours.with_ours());
        mujoco.print(&format!("{machine} in MuJoCo"));
        ours.print(&format!("{machine} in our plant"));
        assert!(ours.periods > (SECONDS / PERIOD_S) as usize && mujoco.periods == ours.periods);
        for (what, mujoco, ours) in [
            ("position", mujoco.position, ours.position),
            ("orientation", mujoco.orientation, ours.orientation),
        ] {
            for (mujoco, ours) in [(mujoco.rms(), ours.rms()), (mujoco.max, ours.max)] {
                assert!(
                    mujoco > 0.5 * ours && mujoco < LARGEST_ERROR,
                    "{machine}, {what}: {mujoco}, {ours} in our plant"
                );
            }
        }
        // Not zero: the other engine is there.
        assert!((1e-6..0.01).contains(&mujoco.force.max), "{machine}: forces {:?}", mujoco.force);
        assert!((1e-9..1e-5).contains(&ours.force.max), "{machine}: forces of our plant {:?}", ours.force);
    }
}

/// The drives are the clock, and time is everybody's. While the host holds somebody the platform drifts, rightly: the
/// typical error counts. How many periods an engine and a driver in Python manage is the host's speed: where it was too slow for
/// half of them the run is repeated, and the last one needs a tenth.
#[test]
fn a_platform_in_mujoco_moves_in_real_time() {
    if python::is_lacking() {
        return;
    }
    let _turn = turn();
    for attempt in 1.. {
        let host = Watchdog::start();
        let stage = Stage::new("fried2008", &format!("real{attempt}"), REAL_TIME);
        let run = catch_unwind(|| stage.with_mujoco());
        let held = host.largest();
        let share = if attempt < ATTEMPTS { 2 } else { 10 };
        let enough = (SECONDS / PERIOD_S) as usize / share;
        match run {
            Ok(run) if run.periods <= enough && attempt < ATTEMPTS => {
                println!("attempt {attempt}: {} periods", run.periods);
            }
            Ok(run) => {
                run.print("fried2008 in MuJoCo, in real time");
                println!("typically {:.1e} m off; the host held somebody for {held:?}", run.typical_position);
                assert!(run.periods > enough, "{} periods", run.periods);
                assert!((1e-8..20e-6).contains(&run.typical_position), "{} m", run.typical_position);
                assert!((1e-6..0.01).contains(&run.force.max), "forces {:?}", run.force);
                return;
            }
            Err(failure) if held < HELD || attempt == ATTEMPTS => resume_unwind(failure),
            Err(_) => println!("attempt {attempt} failed; the host held somebody for {held:?}"),
        }
    }
}
