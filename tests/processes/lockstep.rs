//! `release = "lockstep"`: everybody waits for everybody, and the forces are the same to the last bit, whoever is fast
//! or slow.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};
use std::{env, fs, thread};

use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::config::Config;
use hexad::control::signals::state::State;
use hexad::messages::Bus;
use hexad::messages::layout::FieldType;
use hexad::messages::{ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use hexad::realtime::setup::scheduling;
use serde_json::json;

use crate::support::children::{HANG, Hexad, hexad};
use crate::support::machine::{Machine, PERIOD_NS};
use crate::support::operator;
use crate::support::recorder::Recorder;
use crate::support::socket::Client;
use crate::support::trio::{player_ended, start_daemon};
use hexad_support::shipped;

const LOCKSTEP: &str = "[realtime]\nrelease = \"lockstep\"";

/// Length of the motion \[s\].
const SECONDS: &str = "3";

/// Cycles that it takes at least, with the way there and back.
const LEAST: usize = 3_000;

/// A build of `hexad` and the processor that it may use; any, if none is said.
pub struct Build {
    program: PathBuf,
    cpu: Option<usize>,
}

impl Build {
    /// The one under test.
    pub fn this(cpu: Option<usize>) -> Self {
        Self { program: hexad().get_program().into(), cpu }
    }

    fn start(&self, machine: &Machine, arguments: &[&str]) -> Hexad {
        let [command, more @ ..] = arguments else { panic!("a command") };
        let mut line = match self.cpu {
            Some(cpu) => {
                let mut taskset = Command::new("taskset");
                taskset.args(["-c", &cpu.to_string()]).arg(&self.program);
                taskset
            }
            None => Command::new(&self.program),
        };
        line.arg(command).arg("--config").arg(&machine.file).args(more);
        line.env(PARENT_VARIABLE, std::process::id().to_string()).env_remove("HEXAD_LOG");
        Hexad::spawn(machine, command, line)
    }

    /// Daemon and setpoint source.
    fn start_both(&self, machine: &Machine) -> (Hexad, Hexad) {
        let daemon = self.start(machine, &["run"]);
        let motion = ["move", "--motion", "sines", "--seconds", SECONDS, "--engage"];
        (daemon, self.start(machine, &motion))
    }

    /// All forces of a run whose plant is this process, until control has ended.
    pub fn forces_for_us(self) -> Vec<ForceMessage> {
        // In a thread of its own, whose processor ends with it.
        let run = move || {
            self.cpu.map_or(Ok(()), scheduling::bind_to_cpu).expect("the processor");
            let machine = Machine::with("lock-step-ours", LOCKSTEP);
            let bus = Bus::join_simulated(&machine.name).expect("to join");
            let mut measured = bus.publisher::<MeasuredMessage>().expect("to publish");
            let mut forces = bus.subscriber::<ForceMessage>(8).expect("to subscribe");
            let config = Config::load(&machine.file).expect("the machine file");
            let mut hardware = config.deployment.plant.hardware(&config.machine);
            let driver = Bus::join(&machine.name).expect("to join");
            let mut driver = driver.subscriber::<ForceMessage>(1).expect("to subscribe");
            let (daemon, source) = self.start_both(&machine);
            let mut said: Vec<ForceMessage> = vec![];
            for time_ns in (0..).step_by(PERIOD_NS as usize) {
                let (length_m, length_rate_m_s) = hardware.measure();
                let message = MeasuredMessage {
                    length_m,
                    length_rate_m_s,
                    rates_valid: 1,
                    ..MeasuredMessage::default()
                };
                let asked = Instant::now();
                measured.publish(time_ns, message).expect("to send");
                let mut times = 1;
                let force = loop {
                    match forces.receive() {
                        Some(force) => break force,
                        None => thread::yield_now(),
                    }
                    if asked.elapsed() > times * Duration::from_millis(50) {
                        assert!(asked.elapsed() < HANG, "no force for {time_ns}");
                        measured.publish(time_ns, message).expect("to send");
                        times += 1;
                    }
                };
                assert_eq!((force.release_ns, force.header.time_ns), (time_ns, time_ns), "one answer each");
                hardware.advance(
                    PERIOD_NS,
                    force.may_be_applied(force.header.time_ns, 0).then_some(force.force_n),
                );
                let ended = force.valid == 0 && said.last().is_some_and(|last| last.valid == 1);
                said.push(force);
                if ended {
                    break;
                }
            }
            assert_eq!(driver.receive_latest(), None, "a driver of the same machine");
            source.ends().succeeds();
            let words = daemon.stops();
            assert!(words.contains("TIME IS SIMULATED"), "{words}");
            said
        };
        thread::spawn(run).join().expect("the plant")
    }

    /// Forces of a run of which all parts are processes of this build, as far as somebody who listens hears
    /// them.
    fn forces_overheard(self) -> Vec<ForceMessage> {
        let machine = Machine::with("lock-step-theirs", LOCKSTEP);
        let recorder = Recorder::start_simulated(&machine.name);
        let plant = self.start(&machine, &["plant"]);
        let (daemon, source) = self.start_both(&machine);
        source.ends_within(10 * HANG).succeeds();
        daemon.says("standby: setpoint source ended");
        plant.stops();
        daemon.stops();
        recorder.finish().forces
    }
}

/// As it is in memory.
fn bytes(force: &ForceMessage) -> Vec<u8> {
    let mut bytes = vec![];
    force.visit(&mut |_, field| bytes.extend_from_slice(field));
    assert_eq!(bytes.len(), size_of::<ForceMessage>());
    bytes
}

/// Every byte of every message.
fn assert_same(a: &[ForceMessage], b: &[ForceMessage], what: &str) {
    assert_eq!(a.len(), b.len(), "{what}");
    for (a, b) in a.iter().zip(b) {
        assert_eq!(bytes(a), bytes(b), "{what}: {a:?} {b:?}");
    }
}

/// Every byte of what was heard, which is most of it.
fn assert_heard(all: &[ForceMessage], heard: &[ForceMessage], what: &str) {
    let mut count = 0;
    for heard in heard {
        // After the end of `all` time goes on.
        let Some(said) = all.get((heard.release_ns / PERIOD_NS) as usize) else { break };
        assert_eq!(bytes(said), bytes(heard), "{what}: {said:?} {heard:?}");
        count += 1;
    }
    println!("{what}: {count} of {} heard", all.len());
    assert!(count > all.len() / 2, "{what}: {count} of {} heard", all.len());
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn in_lock_step_the_forces_are_the_same_bytes_on_one_processor_and_on_two() {
    let first = Build::this(None).forces_for_us();
    let valid = first.iter().filter(|force| force.valid == 1).count();
    assert!(valid > LEAST, "{valid} cycles under control");
    assert_same(&first, &Build::this(None).forces_for_us(), "again");
    assert_same(&first, &Build::this(Some(0)).forces_for_us(), "on one processor");
    assert_heard(&first, &Build::this(None).forces_overheard(), "with hexad plant");
}

/// They stamp with what they have heard, as there is no other time.
#[test]
#[apply(beside_others)]
fn in_lock_step_operators_are_heard_and_the_daemon_ends_at_rest() {
    let machine = Machine::with("lock-step-operated", LOCKSTEP);
    let daemon = Hexad::start::<&str>(&machine, "run", &[]);
    let plant = Hexad::start::<&str>(&machine, "plant", &[]);
    let source = Hexad::start(&machine, "move", &["--motion", "sines", "--seconds", "200"]);
    // Before that it checks the whole motion, and the daemon would engage onto home, where it has no setpoint yet.
    source.says("the setpoints hold the pose of the platform");
    operator::engage(&machine);
    operator::does(&machine, "stop", &[], &["standby"]);
    player_ended(source);
    let source = Hexad::start(&machine, "move", &["--motion", "sines", "--seconds", "200"]);
    source.says("the setpoints hold the pose of the platform");
    operator::engage(&machine);
    let words = daemon.stops();
    assert!(!words.contains("did not come to rest"), "{words}");
    player_ended(source);
    plant.stops();
}

/// The forces, and what the status says of requests, of a run that is engaged in one cycle, from the first on, and then stopped.
fn requested_by_cycle() -> Vec<([u64; 3], Vec<u8>)> {
    const ENGAGED_IN: u64 = 20;
    const STOPPED_IN: u64 = 40;
    let machine = Machine::with("lock-step-cycle", LOCKSTEP);
    let daemon = start_daemon(&machine);
    let mut operator = Client::connect(&daemon);
    let posts = |operator: &mut Client, request: &str, cycle: u64| {
        let waits = operator.ask(request, &json!({"cycle_ns": cycle * PERIOD_NS}));
        let text = format!("posted for the cycle at {} ns", cycle * PERIOD_NS);
        assert_eq!([&waits["result"], &waits["text"]], ["waiting", text.as_str()], "{waits}");
    };
    let bus = Bus::join_simulated(&machine.name).expect("to join");
    let mut measured = bus.publisher::<MeasuredMessage>().expect("to publish");
    let mut setpoints = bus.publisher::<SetpointMessage>().expect("to publish");
    let mut forces = bus.subscriber::<ForceMessage>(8).expect("to subscribe");
    let mut statuses = bus.subscriber::<StatusMessage>(8).expect("to subscribe");
    let config = Config::load(&machine.file).expect("the machine file");
    let mut hardware = config.deployment.plant.hardware(&config.machine);
    let setpoint = SetpointMessage { x: config.machine.home, ..SetpointMessage::default() };
    let mut found = vec![];
    posts(&mut operator, "engage", ENGAGED_IN);
    for cycle in 0..STOPPED_IN + 5 {
        let time_ns = cycle * PERIOD_NS;
        let (length_m, length_rate_m_s) = hardware.measure();
        let message = MeasuredMessage { length_m, length_rate_m_s, rates_valid: 1, ..Default::default() };
        // No stop waits, so it is sent for its cycle, before the setpoint.
        if cycle == STOPPED_IN {
            posts(&mut operator, "estop", STOPPED_IN);
        }
        let began = Instant::now();
        let force = loop {
            measured.publish(time_ns, message).expect("to send");
            setpoints.publish(time_ns, setpoint).expect("to send");
            sleep(Duration::from_millis(1));
            if let Some(force) = forces.receive_latest() {
                break force;
            }
            assert!(began.elapsed() < HANG, "no force for {time_ns}");
        };
        assert_eq!(force.release_ns, time_ns);
        hardware.advance(PERIOD_NS, force.may_be_applied(time_ns, 0).then_some(force.force_n));
        let status = statuses.receive_latest().expect("the status comes first");
        let is_engaged = [State::Engaging as u32, State::Active as u32].contains(&status.state);
        assert_eq!(is_engaged, (ENGAGED_IN..STOPPED_IN).contains(&cycle), "cycle {cycle}: {status:?}");
        let answered = [u64::from(status.state), status.request_epoch, status.request_sequence];
        found.push((answered, bytes(&force)));
        match cycle {
            ENGAGED_IN => assert_eq!(operator.answer()["result"], "accepted"),
            STOPPED_IN => assert_eq!(operator.answer()["result"], "done"),
            _ => {}
        }
    }
    daemon.stops();
    found
}

#[test]
#[apply(beside_others)]
fn in_lock_step_a_request_acts_in_the_cycle_that_it_names_and_the_run_is_repeatable() {
    assert_eq!(requested_by_cycle(), requested_by_cycle());
}

/// From its first message on the daemon follows a source: it must not be home.
#[test]
#[apply(beside_others)]
fn in_lock_step_a_source_begins_where_the_platform_is_held() {
    let follows_any = "\n[setpoint]\non_violation = \"limit\"\n";
    let machine = Machine::with("lock-step-held", &format!("{LOCKSTEP}{follows_any}"));
    let daemon = Hexad::start::<&str>(&machine, "run", &[]);
    let plant = Hexad::start::<&str>(&machine, "plant", &[]);
    for (from, to, option) in [(0.0, 0.02, "--engage"), (0.02, 0.0, "--hold"), (0.0, 0.01, "--hold")] {
        let file = machine.path("way.csv");
        let x = |way: f64| format!("{},0,0", 1.1 + from + 0.1 * way * (to - from));
        let rows: String = (0..=10).map(|k| format!("{},0,0,0,{}\n", k, x(f64::from(k)))).collect();
        fs::write(&file, format!("t,alpha,beta,gamma,x,y,z\n{rows}")).unwrap();
        let options = ["--trajectory", file.to_str().unwrap(), "--hold", option];
        let options = &options[..if option == "--hold" { 3 } else { 4 }];
        machine.hexad("move", options).succeeds();
    }
    let said = daemon.stops();
    assert_eq!(said.matches("active:").count(), 1, "{said}");
    plant.stops();
}

/// The forces of this build and of another are the same bytes.
#[apply(beside_others)]
fn assert_same_as(other: PathBuf, what: &str) {
    let other = Build { program: other.clone(), cpu: None };
    assert_heard(&Build::this(None).forces_for_us(), &other.forces_overheard(), what);
}

#[test]
#[ignore = "second tier: builds the release"]
fn in_lock_step_the_forces_are_the_same_bytes_as_those_of_the_shipped_program() {
    assert_same_as(shipped::program(), "shipped");
}

#[test]
#[ignore = "builds without optimization, which takes minutes"]
fn in_lock_step_the_forces_are_the_same_bytes_without_optimization() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("unoptimized");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(env!("CARGO_MANIFEST_DIR")).env("CARGO_PROFILE_DEV_OPT_LEVEL", "0");
    // With them the threads have the stack that such code needs.
    cargo.env("CARGO_PROFILE_DEV_DEBUG_ASSERTIONS", "true");
    cargo.args(["build", "--bin", "hexad", "--target-dir"]).arg(&folder);
    assert!(cargo.status().expect("cargo").success());
    assert_same_as(folder.join("debug/hexad"), "without optimization");
}
