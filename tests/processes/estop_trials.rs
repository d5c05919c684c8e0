//! Emergency stops from every state, whatever else goes on: no force is valid two periods after the request was sent.
//!
//! 56 trials, or 1001 with `HEXAD_LONG=1`; `HEXAD_SEED` repeats a run, as far as the host lets it. What counts are forces: those that
//! were published as valid after the client took the time, before it connected. Where the host took a processor away meanwhile, which
//! threads of real-time priority witness, as many more are allowed as fit into that time.

use std::collections::BTreeMap;
use std::env;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::control::diagnostic::DiagnosticCode;
use hexad::control::state::State;
use hexad::daemon::cycle::WORD_EPOCH;
use hexad::messages::ForceMessage;
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::request_word;
use serde_json::{Value, json};

use crate::common::not_run::lacking;
use crate::support::children::{HANG, Hexad};
use crate::support::disturbance::{Disturbance, Situation, line_of, python};
use crate::support::machine::{Machine, PATIENT, PERIOD_NS};
use crate::support::nobody::cannot;
use crate::support::peer::Controlled;
use crate::support::random::Random;
use crate::support::recorder::{Recorder, Recording};
use crate::support::socket::path_of;
use crate::support::trio::start_daemon;
use crate::support::turns;
use crate::support::witness::Witness;

/// Trials in each situation.
const TRIALS: usize = 8;
const LONG_TRIALS: usize = 143;

/// Valid forces after sending: of two periods.
const MAX_CYCLES: u64 = 2;

/// Motions of a tenth of a second: time to stop during them.
const LIMITS: &str = "[limits]\nacceleration_m_s2 = 0.5\njerk_m_s3 = 5.0\nautonomous_scale = 1.0\n";

/// Longest wait in a motion before the request \[us\].
const WITHIN_US: u64 = 60_000;

/// The situation of a process in a namespace of its own, and the number of its trials.
const PART: &str = "HEXAD_TEST_FULL";

/// Before everything ordinary and the threads that serve requests, as an emergency-stop button would run. It is a process of its own:
/// in this one it would wait for the memory of whatever records or floods.
const BUTTON: &[&str] = &["chrt", "-f", "3"];
/// The same as the group of the daemon.
const MEMBER: &[&str] =
    &["chrt", "-f", "3", "setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"];

/// Its program: path of the socket; for each line that it reads a line with the time and the answer.
const PYTHON_CLIENT: &str = r#"
import socket, sys, time
for _ in sys.stdin:
    sent = time.monotonic_ns()
    link = socket.socket(socket.AF_UNIX)
    link.connect(sys.argv[1])
    link.sendall(b'{"version": 1, "request": "estop", "wait": true}\n')
    print(sent, link.makefile().readline().strip(), flush=True)
"#;

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
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("its folder").display().to_string();
    // The programs may be in /tmp themselves.
    const MOUNTS: &str = "mount --bind \"$0\" /mnt && mount -t tmpfs -o size=128m,mode=1777 tmpfs /dev/shm && \
                          mount -t tmpfs -o size=8m,mode=1777 tmpfs /tmp && mkdir -p \"$0\" && mount --bind /mnt \"$0\" && \
                          exec \"$@\"";
    let places = ["unshare", "--mount", "sh", "-c", MOUNTS, &target];
    if cannot(&[&places]) {
        return;
    }
    let mut command = Command::new(places[0]);
    command.args(&places[1..]).arg(env::current_exe().expect("this program"));
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

/// Sends `estop` from a process of its own.
struct Button {
    child: Child,
    words: BufReader<ChildStdout>,
}

impl Button {
    fn connect(user: &[&str], socket: &Path) -> Self {
        let mut child = python(user, PYTHON_CLIENT, socket);
        let words = BufReader::new(child.stdout.take().expect("a pipe"));
        Self { child, words }
    }

    /// The instant before it connected \[ns\].
    fn press(&mut self) -> u64 {
        self.child.stdin.as_mut().expect("a pipe").write_all(b"\n").expect("to write");
        let line = line_of(&mut self.words);
        let (sent_ns, answer) = line.split_once(' ').unwrap_or_else(|| panic!("{line:?}"));
        assert!(answer.contains("\"result\":\"done\""), "{answer}");
        sent_ns.parse().expect("an instant")
    }

    fn finish(mut self) {
        drop(self.child.stdin.take());
        self.child.wait().expect("its end");
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
    let (user, group) = match situation {
        Situation::Member => (MEMBER, "[operator]\ngroup = \"nogroup\"\n"),
        _ => (BUTTON, ""),
    };
    if cannot(&[user]) {
        return;
    }
    let seed = env::var("HEXAD_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or_else(monotonic_ns);
    let mut random = Random::new(seed);
    let machine = Machine::with("trials", &format!("{LIMITS}{PATIENT}{group}"));
    let recorder = Recorder::start(&machine.name);
    let daemon = start_daemon(&machine);
    let socket = path_of(&daemon);
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::with(machine, daemon);
    let mut button = Button::connect(user, &socket);
    let disturbance = Disturbance::begin(situation, &machine.name, &socket);
    let (mut tally, mut paused, mut longest_ns, mut posted_ns) = (Tally::new(), 0, 0, 0);
    for trial in 0..trials {
        bring_to(STATES[trial % STATES.len()], &socket, &mut random);
        let sent_ns = button.press();
        let found = Trial::find(&recorder, sent_ns);
        let paused_ns = witness.paused_ns(sent_ns, found.invalid_ns);
        let allowed = MAX_CYCLES + paused_ns.div_ceil(PERIOD_NS) + u64::from(paused_ns > 0);
        let what = format!(
            "HEXAD_SEED={seed} {situation:?}, trial {trial}: {found:?}, the host paused for {paused_ns} ns"
        );
        assert!(found.valid <= allowed, "{what}");
        // After a pause of the host a message may be too old first.
        let is_it = found.diagnostic_code == DiagnosticCode::EmergencyStop as u32;
        assert!(is_it || paused_ns > 0, "{what}");
        if found.valid > MAX_CYCLES {
            println!("{what}");
            paused += 1;
        } else {
            longest_ns = longest_ns.max(found.invalid_ns - sent_ns);
            posted_ns = posted_ns.max(found.posted_after_ns);
        }
        *tally.entry(found.state.name().into()).or_default().entry(found.valid).or_default() += 1;
    }
    disturbance.end();
    button.finish();
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
    /// Why.
    diagnostic_code: u32,
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
        let mut recording = recorder.so_far();
        let before = recording.forces.iter().rfind(|force| force.header.time_ns <= sent_ns);
        let first = recording.forces.iter().find(is_fault).expect("a fault");
        let since = recording.forces.iter().filter(|force| force.header.time_ns > sent_ns);
        let valid =
            since.take_while(|force| force.state != State::Fault as u32).filter(|it| it.valid == 1).count();
        let posted = recording.statuses.iter().rev().filter(|status| status.request_epoch == WORD_EPOCH);
        let posted = posted.map(|status| status.request_sequence);
        let posted = posted.map(request_word::time_ns).find(|time_ns| time_ns + 1000 >= sent_ns);
        let found = Self {
            state: before.and_then(|force| State::from_number(force.state)).expect("a state"),
            valid: valid as u64,
            invalid_ns: first.header.time_ns,
            diagnostic_code: first.diagnostic_code,
            posted_after_ns: posted.map_or(0, |posted_ns| posted_ns.saturating_sub(sent_ns)),
        };
        // Of a flood there are millions.
        *recording = Recording::default();
        found
    }
}
