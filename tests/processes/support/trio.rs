//! Plant, daemon and setpoint source of one machine, and somebody who listens.

use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{ForceMessage, MeasuredMessage};

use super::children::Hexad;
use super::machine::Machine;
use super::recorder::{Recorder, Recording};
use super::{operator, rules};

/// A leg faster than this is in motion \[m/s\]. The fastest legs of the motion exceed it several times over.
const IN_MOTION: f64 = 0.1;

/// Longer than any test but one; the setpoint source is stopped when the test is done. A player checks all of its motion before it begins.
const MOTION_S: &str = "40";

/// Fields are dropped in this order: the processes before the one that listens, the files last.
pub struct Trio {
    pub setpoints: Option<Hexad>,
    pub daemon: Hexad,
    pub plant: Hexad,
    pub recorder: Recorder,
    pub machine: Machine,
}

impl Trio {
    /// Without a setpoint source: the platform stands without force.
    pub fn standing(machine: Machine) -> Self {
        let recorder = Recorder::start(&machine.name);
        let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
        daemon.says("standby: no setpoint");
        Self { setpoints: None, daemon, plant, recorder, machine }
    }

    /// Starts all three, engages and waits until the platform is in full motion.
    pub fn in_motion(test: &str) -> Self {
        Self::in_motion_of(test, start_setpoints)
    }

    /// With the setpoints of another source.
    pub fn in_motion_of(test: &str, start_setpoints: fn(&Machine) -> Hexad) -> Self {
        let mut trio = Self::standing(Machine::patient(test));
        trio.setpoints = Some(start_setpoints(&trio.machine));
        operator::engage(&trio.machine);
        trio.moves_after(0);
        trio
    }

    pub fn setpoints(&mut self) -> &mut Hexad {
        self.setpoints.as_mut().expect("a setpoint source")
    }

    /// Waits until the platform moves under forces computed after an instant.
    pub fn moves_after(&self, instant_ns: u64) {
        self.recorder.until("the platform is in motion under a valid force", |recording| {
            let force = recording.forces.last().filter(|force| valid_after(force, instant_ns))?;
            let measured =
                recording.measured.last().filter(|measured| measured.header.time_ns > instant_ns)?;
            (fastest(measured) > IN_MOTION).then_some(force).map(drop)
        });
    }

    /// Waits until the daemon is in a state.
    pub fn is_in(&self, state: State) {
        self.recorder.until(state.name(), |recording| {
            recording.statuses.last().filter(|status| status.state == state as u32).map(drop)
        });
    }

    /// An operator has ended control, and with it the player, which says so. Another one begins.
    pub fn replay(&mut self) {
        self.setpoints.take().into_iter().for_each(player_ended);
        self.setpoints = Some(start_setpoints(&self.machine));
    }

    /// Waits until no force is valid any more, for this reason.
    pub fn loses_force_for(&self, cause: DiagnosticCode) {
        self.recorder.until("the daemon marks its forces as not valid", |recording| {
            let force = recording.forces.last()?;
            (force.valid == 0 && force.diagnostic_code == cause as u32).then_some(())
        });
    }

    /// Waits until the platform stands, and then a while longer: it must not only pass through.
    pub fn stands(&self) {
        let since_ns = self.recorder.until("the platform stands", |recording| {
            recording.measured.last().filter(|measured| rules::stands(measured)).map(|m| m.header.time_ns)
        });
        self.recorder.until("the plant goes on measuring", |recording| {
            let newest_ns = recording.measured.last()?.header.time_ns;
            (newest_ns > since_ns + 300_000_000).then_some(())
        });
    }

    /// Ends everything in order; the recording has passed the rules. A platform in motion comes to rest under control.
    pub fn finish(mut self) -> Recording {
        let in_motion = self.setpoints.is_some();
        self.setpoints.iter_mut().chain([&mut self.daemon, &mut self.plant]).for_each(Hexad::must_run);
        self.daemon.stops();
        self.setpoints.into_iter().for_each(player_ended);
        self.plant.stops();
        let recording = self.recorder.finish();
        rules::hold(&recording);
        if in_motion {
            rules::ends_at_rest(&recording);
        }
        recording
    }
}

/// A player whose control an operator has ended, or the end of the daemon, which is a stop.
pub fn player_ended(player: Hexad) {
    player.ends().fails(1, "hexad: the motion has ended: the daemon is in ");
}

/// Returns when it has joined, or has ended: a participant that begins meanwhile waits for its topics, but not for long.
pub fn start_plant(machine: &Machine) -> Hexad {
    let mut plant = Hexad::start::<&str>(machine, "plant", &[]);
    plant.says_or_has_ended("plant at rest");
    plant
}

/// Returns when it runs, or has ended: the commands of operators wait for a daemon, but not for long.
pub fn start_daemon(machine: &Machine) -> Hexad {
    let [report, histogram] = ["report.json", "histogram.csv"].map(|name| machine.path(name));
    let mut daemon =
        Hexad::start(machine, "run", &["--report".into(), report, "--histogram".into(), histogram]);
    daemon.says_or_has_ended("running");
    daemon
}

pub fn start_setpoints(machine: &Machine) -> Hexad {
    Hexad::start(machine, "move", &["--motion", "sines", "--seconds", MOTION_S])
}

/// Whether a force is valid and was computed after an instant.
pub fn valid_after(force: &ForceMessage, instant_ns: u64) -> bool {
    force.valid == 1 && force.release_ns > instant_ns
}

/// Speed of the fastest leg \[m/s\].
pub fn fastest(measured: &MeasuredMessage) -> f64 {
    measured.length_rate_m_s.iter().fold(0.0, |fastest, rate| fastest.max(rate.abs()))
}

/// Lets real time pass, at least this much, measured: from and to \[ns\].
pub fn let_pass(duration: Duration) -> (u64, u64) {
    let from_ns = monotonic_ns();
    std::thread::sleep(duration);
    (from_ns, monotonic_ns())
}
