//! Plant, daemon and setpoint source of one machine, in motion, and somebody who listens.

use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{ForceMessage, MeasuredMessage};

use super::children::{Ended, HANG, Hexad};
use super::machine::Machine;
use super::recorder::{Recorder, Recording};
use super::{operator, rules};

/// A leg faster than this is in motion \[m/s\]. The fastest legs of the motion exceed it several times over.
const IN_MOTION: f64 = 0.1;

/// Longer than any test; the setpoint source is stopped when the test is done.
const MOTION: [&str; 4] = ["--motion", "sines", "--seconds", "100"];

/// Fields are dropped in this order: the processes before the one that listens, the files last.
pub struct Trio {
    pub setpoints: Hexad,
    pub daemon: Hexad,
    pub plant: Hexad,
    pub recorder: Recorder,
    pub machine: Machine,
}

impl Trio {
    /// Starts all three, engages and waits until the platform is in full motion.
    pub fn in_motion(test: &str) -> Self {
        let machine = Machine::patient(test);
        let recorder = Recorder::start(&machine.name);
        let plant = start_plant(&machine);
        let daemon = start_daemon(&machine);
        let setpoints = start_setpoints(&machine);
        operator::engage(&machine);
        let trio = Self { setpoints, daemon, plant, recorder, machine };
        trio.moves_after(0);
        trio
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

    /// An operator has ended control, and with it the player, which says so. Another one begins.
    pub fn replay(&mut self) {
        let ended = std::mem::replace(&mut self.setpoints, start_setpoints(&self.machine));
        player_ended(ended);
    }

    /// Waits until no force is valid any more, for this reason.
    pub fn loses_force_for(&self, cause: DiagnosticCode) {
        self.recorder.until("the daemon marks its forces as not valid", |recording| {
            recording
                .forces
                .last()
                .filter(|force| force.valid == 0 && force.diagnostic_code == cause as u32)
                .copied()
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

    /// Ends everything in order; the recording has passed the rules.
    pub fn finish(mut self) -> Recording {
        for process in [&mut self.setpoints, &mut self.daemon, &mut self.plant] {
            process.must_run();
        }
        self.daemon.stops_on("TERM", HANG);
        player_ended(self.setpoints);
        self.plant.stops_on("TERM", HANG);
        let recording = self.recorder.finish();
        rules::hold(&recording);
        rules::ends_at_rest(&recording);
        recording
    }
}

/// A player whose control an operator has ended, or the end of the daemon, which is a stop.
pub fn player_ended(player: Hexad) {
    let Ended { status, stderr, .. } = player.ends_within(HANG);
    let words = "hexad: the motion has ended: the daemon is in ";
    assert!(status.code() == Some(1) && stderr.contains(words), "{status}: {stderr}");
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
    Hexad::start(machine, "move", &MOTION)
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
