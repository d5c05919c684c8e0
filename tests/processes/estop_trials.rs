//! Emergency stops from every state, whatever else goes on: no force is valid two periods after the request was sent.
//!
//! 56 trials, or 1001 with `HEXAD_LONG=1`; `HEXAD_SEED` repeats a run, as far as the host lets it. What counts are forces: those that
//! were published as valid after the client took the time, before it connected. Where the host took a processor away meanwhile, which
//! threads of real-time priority witness, as many more are allowed as fit into that time.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};
use std::{env, fs};

use hexad::control::diagnostic::DiagnosticCode;
use hexad::control::state::{Request, State};
use hexad::daemon::cycle::WORD_EPOCH;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, CommandMessage, ForceMessage};
use hexad::realtime::request_word;
use hexad::realtime::setup::scheduling;
use serde_json::{Value, json};

use crate::always_stops::{Hostile, Slots};
use crate::common::not_run::lacking;
use crate::support::children::{HANG, Hexad};
use crate::support::machine::{Machine, PATIENT, PERIOD_NS};
use crate::support::nobody::cannot;
use crate::support::peer::Controlled;
use crate::support::random::Random;
use crate::support::recorder::Recorder;
use crate::support::socket::path_of;
use crate::support::trio::start_daemon;
use crate::support::turns;
use crate::support::witness::Witness;

/// Trials in each situation.
const TRIALS: usize = 8;
const LONG_TRIALS: usize = 143;

/// Valid forces after sending: of two periods.
const MAX_CYCLES: u64 = 2;
/// The same where members of the group flood the socket: the request waits until theirs have been accepted and read.
const MAX_CYCLES_IN_FLOOD: u64 = 6;

/// Motions of a tenth of a second: time to stop during them.
const LIMITS: &str = "[limits]\nacceleration_m_s2 = 0.5\njerk_m_s3 = 5.0\nautonomous_scale = 1.0\n";

/// Longest wait in a motion before the request \[us\].
const WITHIN_US: u64 = 60_000;

/// The situation of a process in a namespace of its own, and the number of its trials.
const PART: &str = "HEXAD_TEST_FULL";

/// As the group of the daemon, or as a user outside of it; before everything ordinary, as an emergency-stop button would run.
const MEMBER: &[&str] =
    &["chrt", "-f", "2", "setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"];
const OUTSIDER: &[&str] = &["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"];

/// A client in another process: path of the socket; a line with the time and one with the answer for each line that it reads.
const PYTHON_CLIENT: &str = r#"
import socket, sys, time
for _ in sys.stdin:
    sent = time.monotonic_ns()
    link = socket.socket(socket.AF_UNIX)
    link.connect(sys.argv[1])
    link.sendall(b'{"version": 1, "request": "estop", "wait": true}\n')
    print(sent, link.makefile().readline().strip(), flush=True)
"#;

/// 64 that connect again and again; the number of those that succeeded.
const PYTHON_OUTSIDERS: &str = r#"
import socket, sys, threading, time
entered = 0
def knock():
    global entered
    while True:
        try:
            socket.socket(socket.AF_UNIX).connect(sys.argv[1])
            entered += 1
            print("entered", flush=True)
        except OSError:
            time.sleep(0.0001)
for _ in range(64):
    threading.Thread(target=knock, daemon=True).start()
print("here", flush=True)
time.sleep(3600)
"#;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Situation {
    /// Nothing else goes on; the user of the daemon, who is root.
    Quiet,
    /// Every slot of the shared memory is taken.
    Slots,
    /// Requests without pause on the topic.
    Messages,
    /// 64 connections of the group that stay silent, send halves, send without end.
    Connections,
    /// 64 users outside of the group.
    Outsiders,
    /// Sent by a member of the group.
    Member,
    /// `/dev/shm` and `/tmp` are full.
    Full,
}

const STATES: [State; 7] = State::ALL;

#[test]
fn no_force_is_valid_two_periods_after_an_emergency_stop() {
    let _turn = turns::alone();
    let trials = if is_long() { LONG_TRIALS } else { TRIALS };
    for situation in [
        Situation::Quiet,
        Situation::Slots,
        Situation::Messages,
        Situation::Connections,
        Situation::Outsiders,
        Situation::Member,
    ] {
        run(situation, trials);
    }
    in_full_file_systems(trials);
}

fn is_long() -> bool {
    env::var_os("HEXAD_LONG").is_some_and(|value| value == "1")
}

/// In a process whose `/dev/shm` and `/tmp` are its own.
fn in_full_file_systems(trials: usize) {
    const PLACES: &[&str] = &[
        "unshare",
        "--mount",
        "sh",
        "-c",
        "mount -t tmpfs -o size=128m,mode=1777 tmpfs /dev/shm && mount -t tmpfs -o size=8m,mode=1777 tmpfs /tmp && exec \"$@\"",
        "sh",
    ];
    if cannot(&[PLACES]) {
        return;
    }
    let mut command = Command::new(PLACES[0]);
    command.args(&PLACES[1..]).arg(env::current_exe().expect("this program"));
    command.args(["estop_trials::with_full_file_systems", "--exact", "--ignored", "--nocapture"]);
    command.env(PART, trials.to_string()).env("TMPDIR", env!("CARGO_TARGET_TMPDIR"));
    let output = command.output().expect("a process");
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    let words = words + &String::from_utf8_lossy(&output.stderr);
    println!("{words}");
    assert!(output.status.success() && words.contains("Full: "), "{words}");
}

#[test]
#[ignore = "not a test, but the part of one that needs file systems of its own"]
fn with_full_file_systems() {
    let Some(trials) = env::var(PART).ok().and_then(|trials| trials.parse().ok()) else { return };
    run(Situation::Full, trials);
}

/// What disturbs, until it is dropped.
enum Disturbance {
    None,
    Slots { _slots: Box<Slots> },
    Messages(Vec<Flood>),
    Connections(Hostile),
    Outsiders(Child, BufReader<std::process::ChildStdout>),
    Full(Vec<PathBuf>),
}

impl Disturbance {
    fn begin(situation: Situation, machine: &str, socket: &Path) -> Self {
        match situation {
            Situation::Quiet | Situation::Member => Self::None,
            Situation::Slots => Self::Slots { _slots: Box::new(Slots::fill(machine)) },
            Situation::Messages => Self::Messages((0..4).map(|_| Flood::start(machine)).collect()),
            Situation::Connections => Self::Connections(Hostile::start(socket, 64)),
            Situation::Outsiders => {
                let mut child = python(OUTSIDER, PYTHON_OUTSIDERS, socket);
                let mut words = BufReader::new(child.stdout.take().expect("a pipe"));
                assert_eq!(line_of(&mut words), "here");
                Self::Outsiders(child, words)
            }
            Situation::Full => {
                Self::Full(["/dev/shm", "/tmp"].map(|folder| filled(Path::new(folder))).into())
            }
        }
    }

    fn end(self) {
        match self {
            Self::None | Self::Slots { .. } => {}
            Self::Messages(floods) => floods.into_iter().for_each(Flood::finish),
            Self::Connections(hostile) => println!("the connections sent {} bytes", hostile.finish()),
            Self::Outsiders(mut child, mut words) => {
                child.kill().expect("a signal");
                child.wait().expect("its end");
                assert_eq!(line_of(&mut words), "", "nobody outside of the group may enter");
            }
            Self::Full(files) => files.iter().for_each(|file| fs::remove_file(file).expect("a file")),
        }
    }
}

fn python(user: &[&str], program: &str, socket: &Path) -> Child {
    let mut command = Command::new(user[0]);
    command.args(&user[1..]).args(["/usr/bin/env", "python3", "-c", program]).arg(socket);
    command
        .env("PATH", "/usr/bin:/bin")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("a process")
}

fn line_of(words: &mut impl BufRead) -> String {
    let mut line = String::new();
    words.read_line(&mut line).expect("a line");
    line.trim().into()
}

/// Fills the file system of a folder to its last byte.
fn filled(folder: &Path) -> PathBuf {
    let path = folder.join("full");
    let mut file = fs::File::create(&path).expect("a file");
    for size in [1 << 20, 1 << 12, 1] {
        while file.write_all(&vec![1; size]).is_ok() {}
    }
    path
}

/// Requests without pause on the topic.
struct Flood {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<u64>,
}

impl Flood {
    fn start(machine: &str) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let thread = {
            let (stop, machine) = (stop.clone(), machine.to_owned());
            spawn(move || {
                let bus = Bus::join(&machine).expect("to join");
                let mut commands = bus.publisher::<CommandMessage>().expect("to publish");
                let mut sent = 0;
                while !stop.load(Ordering::Relaxed) {
                    // So it is under control again as soon as the fault is cleared, and not before.
                    sent += u64::from(commands.publish(monotonic_ns(), Request::Engage.into()).is_ok());
                }
                sent
            })
        };
        Self { stop, thread }
    }

    fn finish(self) {
        self.stop.store(true, Ordering::Relaxed);
        let sent = self.thread.join().expect("a publisher");
        assert!(sent > 1000, "{sent} requests");
    }
}

/// Sends `estop`; the instant before it connected \[ns\].
enum Button {
    Own,
    Member(Child, BufReader<std::process::ChildStdout>),
}

impl Button {
    fn press(&mut self, socket: &Path) -> u64 {
        match self {
            Self::Own => {
                // A thread of its own: what others start must not inherit its priority.
                let press = || {
                    let _ = scheduling::fifo_priority(2);
                    let sent_ns = monotonic_ns();
                    let answer = ask(socket, "estop", true);
                    assert_eq!(answer["result"], "done", "{answer}");
                    sent_ns
                };
                thread::scope(|threads| threads.spawn(press).join().expect("an answer"))
            }
            Self::Member(child, words) => {
                child.stdin.as_mut().expect("a pipe").write_all(b"\n").expect("to write");
                let line = line_of(words);
                let (sent_ns, answer) = line.split_once(' ').unwrap_or_else(|| panic!("{line:?}"));
                assert!(answer.contains("\"result\":\"done\""), "{answer}");
                sent_ns.parse().expect("an instant")
            }
        }
    }
}

/// A request over a connection of its own, again if the daemon has closed it.
fn ask(socket: &Path, request: &str, wait: bool) -> Value {
    let line = json!({"version": 1, "request": request, "wait": wait, "until_ready": request == "engage"});
    let began = Instant::now();
    loop {
        let answered = UnixStream::connect(socket).and_then(|mut stream| {
            stream.set_read_timeout(Some(HANG))?;
            stream.write_all(format!("{line}\n").as_bytes())?;
            let mut answer = String::new();
            BufReader::new(stream).read_line(&mut answer).map(|_| answer)
        });
        if let Ok(answer) = answered.as_deref().map(serde_json::from_str).unwrap_or(Ok(Value::Null))
            && answer != Value::Null
        {
            return answer;
        }
        assert!(began.elapsed() < HANG, "{request}: {answered:?}");
    }
}

/// Brings the daemon out of a fault into a state, or on the way through it.
fn bring_to(state: State, socket: &Path, random: &mut Random) {
    // Of a fault that a pause of the host has brought, or of the last trial.
    let _ = ask(socket, "clear", true);
    let engage = |wait| ask(socket, "engage", wait);
    match state {
        State::Off => drop(ask(socket, "off", true)),
        State::Standby => {}
        State::Engaging => drop(engage(false)),
        State::Active => drop(engage(true)),
        State::Stopping => drop((engage(true), ask(socket, "stop", false))),
        State::Parking => drop((engage(true), ask(socket, "park", false))),
        State::Fault => drop(ask(socket, "estop", true)),
    }
    sleep(Duration::from_micros(random.below(WITHIN_US)));
}

/// Results by state: trials, and of them those with so many valid forces.
type Tally = BTreeMap<String, BTreeMap<u64, usize>>;

fn run(situation: Situation, trials: usize) {
    let Some(witness) = Witness::start() else { return lacking("the right to real-time priority") };
    let group = if situation == Situation::Member { "[operator]\ngroup = \"nogroup\"\n" } else { "" };
    if situation == Situation::Member && cannot(&[MEMBER]) {
        return;
    }
    let seed = env::var("HEXAD_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or_else(monotonic_ns);
    let mut random = Random::new(seed);
    let machine = Machine::with("trials", &format!("{LIMITS}{PATIENT}{group}"));
    let recorder = Recorder::start(&machine.name);
    let daemon = start_daemon(&machine);
    let socket = path_of(&daemon);
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::with(machine, daemon);
    let mut button = if situation == Situation::Member {
        let mut child = python(MEMBER, PYTHON_CLIENT, &socket);
        let words = BufReader::new(child.stdout.take().expect("a pipe"));
        Button::Member(child, words)
    } else {
        Button::Own
    };
    let disturbance = Disturbance::begin(situation, &machine.name, &socket);
    let (mut tally, mut paused, mut longest_ns, mut posted_ns) = (Tally::new(), 0, 0, 0);
    for trial in 0..trials {
        bring_to(STATES[trial % STATES.len()], &socket, &mut random);
        let sent_ns = button.press(&socket);
        let found = Trial::find(&recorder, sent_ns);
        let paused_ns = witness.paused_ns(sent_ns, found.invalid_ns);
        let bound = if situation == Situation::Connections { MAX_CYCLES_IN_FLOOD } else { MAX_CYCLES };
        let allowed = bound + paused_ns.div_ceil(PERIOD_NS) + u64::from(paused_ns > 0);
        let what = format!(
            "HEXAD_SEED={seed} {situation:?}, trial {trial}: {found:?}, the host paused for {paused_ns} ns"
        );
        assert!(found.valid <= allowed, "{what}");
        if found.valid > bound {
            println!("{what}");
            paused += 1;
        } else {
            longest_ns = longest_ns.max(found.invalid_ns - sent_ns);
            posted_ns = posted_ns.max(found.posted_after_ns);
        }
        *tally.entry(found.state.name().into()).or_default().entry(found.valid).or_default() += 1;
    }
    disturbance.end();
    if let Button::Member(mut child, _) = button {
        drop(child.stdin.take());
        child.wait().expect("its end");
    }
    println!(
        "{situation:?}: {trials} trials, {paused} with a pause of the host; longest of the others {longest_ns} ns, of them until posted {posted_ns} ns"
    );
    for (state, counts) in tally {
        println!("  {state}: valid forces after sending: trials {counts:?}");
    }
    ends(daemon, plant);
    drop(recorder);
}

fn ends(daemon: Hexad, plant: Hexad) {
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
}

/// What came of one request.
#[derive(Debug)]
struct Trial {
    /// State when it was sent.
    state: State,
    /// Forces published as valid since then.
    valid: u64,
    /// When the first force in fault was published \[ns\].
    invalid_ns: u64,
    /// From sending to the request word, by the status \[ns\].
    posted_after_ns: u64,
}

impl Trial {
    fn find(recorder: &Recorder, sent_ns: u64) -> Self {
        let is_fault =
            |force: &&ForceMessage| force.header.time_ns > sent_ns && force.state == State::Fault as u32;
        recorder.until("the emergency stop is carried out", |recording| {
            recording
                .forces
                .iter()
                .rev()
                .take_while(|it| it.header.time_ns > sent_ns)
                .find(is_fault)
                .map(drop)
        });
        let recording = recorder.cut();
        let before = recording.forces.iter().rfind(|force| force.header.time_ns <= sent_ns);
        let first = recording.forces.iter().find(is_fault).expect("a fault");
        assert_eq!(first.diagnostic_code, DiagnosticCode::EmergencyStop as u32, "{first:?}");
        let since = recording.forces.iter().filter(|force| force.header.time_ns > sent_ns);
        let valid =
            since.take_while(|force| force.state != State::Fault as u32).filter(|it| it.valid == 1).count();
        let posted = recording.statuses.iter().rev().filter(|status| status.request_epoch == WORD_EPOCH);
        let posted = posted.map(|status| status.request_sequence);
        let posted = posted.map(request_word::time_ns).find(|time_ns| time_ns + 1000 >= sent_ns);
        Self {
            state: before.and_then(|force| State::from_number(force.state)).expect("a state"),
            valid: valid as u64,
            invalid_ns: first.header.time_ns,
            posted_after_ns: posted.map_or(0, |posted_ns| posted_ns.saturating_sub(sent_ns)),
        }
    }
}
