//! Emergency stops from every state, whatever else goes on: no force is valid two periods after the request was sent, or five where
//! other connections are accepted and read before it: 64 hostile ones, or those of 31 other stops (4 and 19 of 1001 took more than two).
//!
//! What counts are forces: those that were published as valid after the client took the time, before it connected. Where the host
//! took a processor away meanwhile, which threads of real-time priority witness, as many more are allowed as fit into that time.

use std::collections::BTreeMap;
use std::env;
use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::messages::ForceMessage;
use hexad::realtime::request_word;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::support::button::Button;
use crate::support::children::HANG;
use crate::support::disturbance::{Disturbance, Situation};
use crate::support::machine::{Machine, PATIENT, PERIOD_NS};
use crate::support::nobody::cannot;
use crate::support::peer::Controlled;
use crate::support::random::Random;
use crate::support::recorder::{Recorder, Recording};
use crate::support::socket::path_of;
use crate::support::trio::start_daemon;
use crate::support::witness::Witness;
use hexad_support::certificate::Certificate;
use hexad_support::not_run::lacking;

/// Trials in each situation, and the number of situations.
const TRIALS: u64 = STATES.len() as u64;
const LONG_TRIALS: u64 = 1001;
const SITUATIONS: u64 = 9;

/// Situations with one daemon, one after the other.
const BESIDE_ROOT: [Situation; 7] = [
    Situation::Quiet,
    Situation::Slots,
    Situation::Requests,
    Situation::Connections,
    Situation::Outsiders,
    Situation::Files,
    Situation::Together,
];

/// Valid forces after sending: of two periods, and of those that other connections take.
const MAX_CYCLES: u64 = 2;
const MAX_CYCLES_AMONG_CONNECTIONS: u64 = 5;

/// How long before it a pause may have led to a fault \[ns\].
const BEFORE_NS: u64 = 100_000_000;

/// Motions of a tenth of a second: time to stop during them.
const LIMITS: &str = "[limits]\nacceleration_m_s2 = 0.5\njerk_m_s3 = 5.0\nautonomous_scale = 1.0\n";

/// Longest wait in a motion before the request \[us\].
const WITHIN_US: u64 = 60_000;

/// The situation of a process in a namespace of its own: seed and number of its trials. The line of its outcome begins with:
const PART: &str = "HEXAD_TEST_FULL";
const OUTCOME: &str = "outcome: ";

/// Before everything ordinary and the threads that serve requests, as an emergency-stop button would run.
const BUTTON: &[&str] = &["chrt", "-f", "3"];
/// The same as the group of the daemon.
const MEMBER: &[&str] =
    &["chrt", "-f", "3", "setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"];

const STATES: [State; 7] = State::ALL;

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn certificate_no_force_is_valid_two_periods_after_an_emergency_stop() {
    let Some(witness) = Witness::start() else { return lacking("the right to real-time priority") };
    let certificate = Certificate::new("emergency stops", SITUATIONS * TRIALS, SITUATIONS * LONG_TRIALS);
    let (seed, trials) = (certificate.seed(), certificate.total() / SITUATIONS);
    let mut outcome = Outcome::default();
    for (user, group, situations) in
        [(BUTTON, "", &BESIDE_ROOT[..]), (MEMBER, "[operator]\ngroup = \"nogroup\"\n", &[Situation::Member])]
    {
        if cannot(&[user]) {
            continue;
        }
        let mut stand = Stand::new(user, group, seed);
        for situation in situations {
            outcome.add(stand.run(&witness, *situation, trials, || certificate.advance(1)));
        }
        stand.finish();
    }
    outcome.add(in_full_file_systems(seed, trials));
    certificate.advance(trials);
    certificate.finish(outcome);
}

/// In a process whose `/dev/shm` and `/tmp` are its own.
fn in_full_file_systems(seed: u64, trials: u64) -> Outcome {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("its folder").display().to_string();
    // The programs may be in /tmp themselves.
    const MOUNTS: &str = "mount --bind \"$0\" /mnt && mount -t tmpfs -o size=128m,mode=1777 tmpfs /dev/shm && \
                          mount -t tmpfs -o size=8m,mode=1777 tmpfs /tmp && mkdir -p \"$0\" && mount --bind /mnt \"$0\" && \
                          exec \"$@\"";
    let places = ["unshare", "--mount", "sh", "-c", MOUNTS, &target];
    if cannot(&[&places]) {
        return Outcome::default();
    }
    let mut command = Command::new(places[0]);
    command.args(&places[1..]).arg(env::current_exe().expect("this program"));
    command.args(["alone::estop_trials::with_full_file_systems", "--exact", "--ignored", "--nocapture"]);
    command.env(PART, format!("{seed} {trials}")).env("TMPDIR", env!("CARGO_TARGET_TMPDIR"));
    let output = command.output().expect("a process");
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    let words = words + &String::from_utf8_lossy(&output.stderr);
    println!("{words}");
    let outcome = words.lines().find_map(|line| line.strip_prefix(OUTCOME));
    assert!(output.status.success() && outcome.is_some(), "{words}");
    serde_json::from_str(outcome.expect("just seen")).expect("an outcome")
}

#[test]
#[ignore = "not a test, but the part of one that needs file systems of its own"]
fn with_full_file_systems() {
    let Ok(part) = env::var(PART) else { return };
    let (seed, trials) = part.split_once(' ').expect("seed and trials");
    let [seed, trials] = [seed, trials].map(|number| number.parse().expect("a number"));
    let witness = Witness::start().expect("the right to real-time priority, as that of its parent");
    let mut stand = Stand::new(BUTTON, "", seed);
    let outcome = stand.run(&witness, Situation::Full, trials, || {});
    stand.finish();
    println!("{OUTCOME}{}", serde_json::to_string(&outcome).expect("JSON"));
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

/// A platform under control, somebody who listens, and a button.
struct Stand {
    controlled: Controlled,
    recorder: Recorder,
    user: &'static [&'static str],
    random: Random,
}

impl Stand {
    fn new(user: &'static [&'static str], group: &str, seed: u64) -> Self {
        let machine = Machine::with("trials", &format!("{LIMITS}{PATIENT}{group}"));
        let recorder = Recorder::start(&machine.name);
        let daemon = start_daemon(&machine);
        let controlled = Controlled::with(machine, daemon);
        Self { controlled, recorder, user, random: Random::new(seed) }
    }

    fn run(&mut self, witness: &Witness, situation: Situation, trials: u64, advance: impl Fn()) -> Outcome {
        let Self { controlled, recorder, user, random } = self;
        let socket = path_of(&controlled.daemon);
        let at_once = if situation == Situation::Together { 32 } else { 1 };
        let mut button = Button::connect(user, &socket, at_once);
        let most = match situation {
            Situation::Connections | Situation::Together => MAX_CYCLES_AMONG_CONNECTIONS,
            _ => MAX_CYCLES,
        };
        let disturbance = Disturbance::begin(situation, &controlled.machine.name, &socket);
        let (mut tally, mut outcome) = (Tally::new(), Outcome { trials, ..Outcome::default() });
        for trial in 0..trials {
            bring_to(STATES[trial as usize % STATES.len()], &socket, random);
            let [sent_ns, delivered_ns] = button.press();
            let found = Trial::find(recorder, sent_ns);
            let paused_ns = witness.paused_ns(sent_ns, found.invalid_ns);
            let allowed = most + paused_ns.div_ceil(PERIOD_NS) + u64::from(paused_ns > 0);
            let what = format!(
                "{situation:?}, trial {trial}: {found:?}, all of it sent after {} ns, the host paused for {paused_ns} ns",
                delivered_ns - sent_ns
            );
            assert!(found.valid <= allowed, "{what}");
            // After a pause of the host another fault may come first: a message is too old, or the plant was held.
            let is_it = found.diagnostic_code == DiagnosticCode::EmergencyStop as u32;
            let before_ns = witness.paused_ns(sent_ns - BEFORE_NS, sent_ns);
            assert!(is_it || paused_ns + before_ns > 0, "{what}");
            if found.valid > most {
                println!("{what}");
                outcome.paused += 1;
            } else {
                outcome.longest_ns = outcome.longest_ns.max(found.invalid_ns - sent_ns);
                outcome.posted_ns = outcome.posted_ns.max(found.posted_after_ns);
            }
            *tally.entry(found.state.name().into()).or_default().entry(found.valid).or_default() += 1;
            advance();
        }
        disturbance.end();
        button.finish();
        println!("{situation:?}: {outcome}");
        for (state, counts) in tally {
            println!("  {state}: valid forces after sending: trials {counts:?}");
        }
        outcome
    }

    fn finish(self) {
        self.controlled.finish();
    }
}

/// What came of some trials: of those without a pause of the host the longest times.
#[derive(Default, Serialize, Deserialize)]
struct Outcome {
    trials: u64,
    /// Trials with more valid forces, in which the host paused.
    paused: u64,
    /// From sending to the first force in fault, and to the request word \[ns\].
    longest_ns: u64,
    posted_ns: u64,
}

impl Outcome {
    fn add(&mut self, other: Self) {
        self.trials += other.trials;
        self.paused += other.paused;
        self.longest_ns = self.longest_ns.max(other.longest_ns);
        self.posted_ns = self.posted_ns.max(other.posted_ns);
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { trials, paused, longest_ns, posted_ns } = self;
        let [longest_ms, posted_ms] = [longest_ns, posted_ns].map(|ns| *ns as f64 * 1e-6);
        write!(
            f,
            "{trials} trials, in {paused} more valid forces than allowed, and a pause of the host; of the others "
        )?;
        write!(f, "{longest_ms:.1} ms to the first invalid one, {posted_ms:.1} ms until posted")
    }
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
        let posted = recording.statuses.iter().rev().map(|status| status.request_sequence);
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
