//! A participant that may be killed at any time and replaced by another: the test program itself, started
//! once more. What it asks for depends on nothing but the time, so a successor takes over without a jump.

use std::env;
use std::io::{self, Write};
use std::process::{self, ChildStdin, Command, Stdio};

use hexad::messages::Bus;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use hexad::realtime::clock::{Grid, sleep_until};
use hexad::realtime::process as child;
use hexad::realtime::setup::scheduling;

use super::children::Hexad;
use super::machine::{Machine, PERIOD_NS};
use super::operator;
use super::trio::{start_daemon, start_plant};

/// Name of the machine and of the process that started it: "NAME PARENT".
const PART: &str = "HEXAD_TEST_PEER";

/// The setpoint's amplitude \[m\], about the home of the paper's machine. Always within the engage tolerance
/// of the platform at home.
const AMPLITUDE: f64 = 0.0015;
const HOME: [f64; 6] = [0.0, 0.0, 0.0, 1.1, 0.0, 0.0];
/// \[rad/s\]
const FREQUENCY: f64 = 4.0;

/// A platform under control: all that it takes, and nobody who listens.
pub struct Controlled {
    pub peer: Hexad,
    pub daemon: Hexad,
    pub plant: Hexad,
    pub machine: Machine,
}

impl Controlled {
    /// Returns when the daemon is active.
    pub fn start(machine: Machine) -> Self {
        let daemon = start_daemon(&machine);
        Self::with(machine, daemon)
    }

    /// With a daemon that was started in a special way.
    pub fn with(machine: Machine, daemon: Hexad) -> Self {
        let ready = Self::ready(machine, daemon);
        operator::engage(&ready.machine);
        ready
    }

    /// All that engaging takes.
    pub fn ready(machine: Machine, mut daemon: Hexad) -> Self {
        daemon.says_or_has_ended("running");
        let plant = start_plant(&machine);
        let peer = start(&machine);
        Self { peer, daemon, plant, machine }
    }

    /// Ends daemon and plant in order; all that the daemon has said, and the machine with its files.
    pub fn finish(self) -> (String, Machine) {
        let said = self.daemon.stops();
        self.plant.stops();
        (said, self.machine)
    }

    /// The present peer is killed; another one follows it within the timeout, however long a process takes to start.
    pub fn replace_peer(&mut self) {
        let next = Waiting::start(&self.machine);
        self.peer.kill();
        self.peer = next.joins();
    }
}

/// A peer that has started and has not joined.
struct Waiting {
    peer: Hexad,
    input: ChildStdin,
}

impl Waiting {
    fn start(machine: &Machine) -> Self {
        let mut command = Command::new(env::current_exe().expect("this program"));
        command.args(["support::peer::takes_part", "--exact", "--ignored", "--nocapture"]);
        command.env(PART, format!("{} {}", machine.name, process::id())).stdin(Stdio::piped());
        let mut peer = Hexad::spawn(machine, "peer", command);
        let input = peer.input();
        peer.says("ready");
        Self { peer, input }
    }

    /// Returns when it has sent its first setpoint.
    fn joins(mut self) -> Hexad {
        self.input.write_all(b"\n").expect("to write");
        self.peer.says("here");
        self.peer
    }
}

/// Starts one more; returns when it has sent its first setpoint.
pub fn start(machine: &Machine) -> Hexad {
    Waiting::start(machine).joins()
}

/// The setpoint at an instant.
pub fn setpoint(time_ns: u64) -> SetpointMessage {
    let phase = FREQUENCY * (time_ns as f64 * 1e-9);
    let mut message = SetpointMessage { x: HOME, ..SetpointMessage::default() };
    message.x[3] += AMPLITUDE * phase.sin();
    message.x_rate[3] = AMPLITUDE * FREQUENCY * phase.cos();
    message.x_accel[3] = -AMPLITUDE * FREQUENCY * FREQUENCY * phase.sin();
    message
}

#[test]
#[ignore = "not a test, but the peer process that tests start and kill"]
fn takes_part() {
    let Ok(part) = env::var(PART) else { return };
    let (machine, parent) = part.split_once(' ').expect("name and parent");
    assert!(child::stop_with_parent(parent.parse().expect("a process")), "its test is gone");
    // So that a busy machine does not make it late.
    let _ = scheduling::fifo_priority(1);
    eprintln!("ready");
    io::stdin().read_line(&mut String::new()).expect("a line");
    let bus = Bus::join(machine).expect("to join");
    let mut setpoints = bus.publisher::<SetpointMessage>().expect("to publish");
    // Present without a word: the plant measures.
    let _measured = bus.publisher::<MeasuredMessage>().expect("to publish");
    let mut forces = bus.subscriber::<ForceMessage>(8).expect("to subscribe");
    let mut statuses = bus.subscriber::<StatusMessage>(8).expect("to subscribe");
    let grid = Grid::new(PERIOD_NS, 0);
    let mut tick_ns = grid.next_after(monotonic_ns());
    for tick in 0_u64.. {
        sleep_until(tick_ns);
        setpoints.publish(tick_ns, setpoint(tick_ns)).expect("to send");
        let _ = (forces.receive_latest(), statuses.receive_latest());
        if tick == 0 {
            eprintln!("here");
        }
        tick_ns = grid.next_after(monotonic_ns());
    }
}
