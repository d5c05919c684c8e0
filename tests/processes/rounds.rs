//! Rounds of SIGKILL, or SIGSTOP and SIGCONT, at random moments on random participants, and each time the same
//! end: what was killed is started again, a fault is cleared, one `engage` engages.

use std::collections::BTreeMap;
use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::control::signals::state::{Request, State};
use hexad::messages::clock::monotonic_ns;

use crate::support::children::Hexad;
use crate::support::machine::{Machine, TIMEOUT_NS};
use crate::support::random::Random;
use crate::support::trio::{Trio, start_daemon, start_plant};
use crate::support::{operator, rules};
use hexad_support::certificate::Certificate;

/// Each kind of blow once.
const ROUNDS: u64 = BLOWS.len() as u64;
const LONG_ROUNDS: u64 = 500;

/// Longest wait for the blow \[ms\]: from engaging through settling and the approach into the motion.
const BEFORE_MS: u64 = 2000;
/// Longest that somebody is held: three timeouts \[ms\].
const HOLD_MS: u64 = 600;
/// Longest that somebody killed stays away \[ms\].
const AWAY_MS: u64 = 400;
/// Longest life of an operator's command before the blow \[ms\]: from its start to what it has asked for.
const COMMAND_MS: u64 = 60;

/// After this whatever a blow leads to has begun: timeouts are over.
const SETTLE: Duration = Duration::from_nanos(TIMEOUT_NS + TIMEOUT_NS / 2);

/// Where somebody who was not struck says nothing for longer than this, a busy host may be the reason that
/// control was lost once more \[ns\].
const STALL_NS: u64 = TIMEOUT_NS / 4;

/// One such round in so many may be: more is no host's fault.
const STALLS_IN: usize = 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Victim {
    Daemon,
    Plant,
    Setpoints,
    Operator,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Signal {
    Kill,
    Stop,
}

const BLOWS: [(Victim, Signal); 8] = [
    (Victim::Daemon, Signal::Kill),
    (Victim::Plant, Signal::Kill),
    (Victim::Setpoints, Signal::Kill),
    (Victim::Operator, Signal::Kill),
    (Victim::Daemon, Signal::Stop),
    (Victim::Plant, Signal::Stop),
    (Victim::Setpoints, Signal::Stop),
    (Victim::Operator, Signal::Stop),
];

/// What came of the rounds of one kind.
#[derive(Debug, Default)]
struct Tally {
    rounds: usize,
    faults: usize,
    longest: Duration,
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn certificate_after_any_blow_one_engage_engages() {
    let certificate = Certificate::new("rounds of kills and holds", ROUNDS, LONG_ROUNDS);
    let mut random = Random::new(certificate.seed());
    let mut trio = Trio::in_motion_of("rounds", start_setpoints);
    let (mut tallies, mut stalls) = (BTreeMap::<_, Tally>::new(), 0);
    let files_before = shared_files();
    for round in 0..certificate.total() as usize {
        // Each kind once, then any.
        let blow = BLOWS.get(round).copied().unwrap_or_else(|| random.one_of(&BLOWS));
        sleep(Duration::from_millis(random.below(BEFORE_MS)));
        strike(&mut trio, blow, &mut random);
        let struck = Instant::now();
        // An operator's request that ends control ends the player, as soon as the daemon has carried it out.
        if blow.0 == Victim::Operator {
            settled(&trio);
            if !trio.setpoints().runs() {
                trio.setpoints = Some(start_setpoints(&trio.machine));
            }
        }
        let (faults, again) = recover(&trio, &format!("round {round}, {blow:?}"));
        stalls += again;
        assert!(stalls <= 1 + round / STALLS_IN, "{stalls} times in {round} rounds");
        let tally = tallies.entry(blow).or_default();
        tally.rounds += 1;
        tally.faults += usize::from(faults);
        tally.longest = tally.longest.max(struck.elapsed());
        let Trio { setpoints, daemon, plant, .. } = &mut trio;
        setpoints.iter_mut().chain([daemon, plant]).for_each(Hexad::must_run);
        rules::hold(&trio.recorder.cut());
        certificate.advance(1);
    }
    for (blow, Tally { rounds, faults, longest }) in tallies {
        println!("{blow:?}: {rounds} rounds, {faults} with a fault, engaged again within {longest:.2?}");
    }
    println!("control lost once more while the host was away: {stalls}");
    println!("files in shared memory: {files_before}, at the end {}", shared_files());
    trio.finish();
    let rounds = certificate.total();
    certificate
        .finish(format_args!("{rounds} rounds, {stalls} of them engaged again after a pause of the host"));
}

/// Strikes, and starts again what was killed.
fn strike(trio: &mut Trio, (victim, signal): (Victim, Signal), random: &mut Random) {
    let Trio { machine, daemon, plant, setpoints, .. } = trio;
    let setpoints = setpoints.as_mut().expect("a setpoint source");
    let away = Duration::from_millis(random.below(AWAY_MS));
    let hold = Duration::from_millis(1 + random.below(HOLD_MS));
    let (process, start): (&mut Hexad, fn(&_) -> Hexad) = match victim {
        Victim::Daemon => (daemon, start_daemon),
        Victim::Plant => (plant, start_plant),
        Victim::Setpoints => (setpoints, start_setpoints),
        Victim::Operator => {
            let request = random.one_of(&Request::ALL).name();
            let command = Hexad::start::<&str>(machine, request, &[]);
            sleep(Duration::from_millis(random.below(COMMAND_MS)));
            return strike_command(command, signal, hold);
        }
    };
    match signal {
        Signal::Kill => {
            process.kill();
            sleep(away);
            *process = start(machine);
        }
        Signal::Stop => held(process, hold),
    }
}

/// A command may have ended before the blow. However it ends, it ends.
fn strike_command(mut command: Hexad, signal: Signal, hold: Duration) {
    if signal == Signal::Stop && command.runs() {
        held(&command, hold);
        drop(command.ends());
    }
    // Dropped: killed, if it still runs.
}

/// A source that nobody may strike for many rounds.
fn start_setpoints(machine: &Machine) -> Hexad {
    Hexad::start(machine, "move", &["--motion", "sines", "--seconds", "100"])
}

fn held(process: &Hexad, hold: Duration) {
    process.signal("STOP");
    sleep(hold);
    process.signal("CONT");
}

/// Out of a fault if there is one, and one `engage`; whether there was one, and how often the host took
/// control away again.
fn recover(trio: &Trio, what: &str) -> (bool, usize) {
    let (mut faults, mut again) = (false, 0);
    loop {
        let state = settled(trio);
        let from_ns = monotonic_ns();
        if state == State::Fault {
            faults |= again == 0;
            operator::clear(&trio.machine);
        }
        let ended = operator::ask(&trio.machine, "engage", &["--wait"]);
        if ended.status.success() {
            return (faults, again);
        }
        let silent_ns = trio.recorder.so_far().longest_silence_ns(from_ns..);
        println!("{what}: not engaged: {}; somebody was silent for {silent_ns} ns", ended.stderr.trim_end());
        assert!(silent_ns > STALL_NS, "{what}: from {}: {}", state.name(), ended.stderr);
        again += 1;
    }
}

/// The state in which a blow ends.
fn settled(trio: &Trio) -> State {
    sleep(SETTLE);
    let from_ns = monotonic_ns();
    trio.recorder.until("the daemon comes to a state that stays", |recording| {
        let status = recording.statuses.last().filter(|status| status.header.time_ns > from_ns)?;
        let state = State::from_number(status.state)?;
        [State::Off, State::Standby, State::Active, State::Fault].contains(&state).then_some(state)
    })
}

/// Files of iceoryx2.
fn shared_files() -> usize {
    let entries = fs::read_dir("/dev/shm").expect("shared memory");
    entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with("iox2_")).count()
}
