//! Peers that come and are killed ten times a second, and the real-time thread does not notice.
//!
//! Two daemons at 4 kHz under the same load in the same seconds: one among constant peers, one among peers
//! that die. What is zero is zero in both; the time of a cycle is compared between them, second by second.
//! Needs root (CAP_IPC_LOCK).

use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::control::signals::state::State;
use hexad::daemon::report::Report;
use hexad::messages::{Bus, StatisticsMessage, StatusMessage, Subscriber};

use crate::support::children::HANG;
use crate::support::machine::{Machine, PATIENT};
use crate::support::peer::Controlled;
use crate::support::threads::Thread;
use hexad_support::certificate::Certificate;
use hexad_support::not_run::lacking;

const RATE: &str = "[realtime]\nrate_hz = 4000.0\n";
const KILLS_PER_S: u32 = 10;

/// Length of a round \[s\].
const ROUND_S: u64 = 4;
const LONG_ROUND_S: u64 = 60;

/// Largest p99.9 of the time of a cycle among dying peers, over that among constant ones.
const LARGEST_RATIO: f64 = 1.5;

/// The host can slow one daemon down and not the other: for 16 s, while somebody else used its processor
/// (2026-11-27). What peers do to a cycle they do in every round, so one good round of these is enough.
const ROUNDS: usize = 12;

/// More than the log thread allocates for one line, far less than once for each of its rounds in between.
const PER_LINE: u64 = 20;

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn certificate_the_real_time_thread_does_not_notice_peers_that_die() {
    let certificate = Certificate::new("peers that die", ROUND_S, LONG_ROUND_S);
    let [calm, disturbed] =
        ["calm", "disturbed"].map(|name| Machine::with(name, &format!("{RATE}{PATIENT}")));
    let (mut calm, mut disturbed) = (Rig::start(calm), Rig::start(disturbed));
    if calm.controlled.daemon.words().contains("no locked memory") {
        lacking("locked memory");
        return;
    }
    let (mut kills, mut ratio) = (0, f64::INFINITY);
    let began = Instant::now();
    for round in 1..=ROUNDS {
        let before = [&calm, &disturbed].map(|it| it.p999_ns.len());
        for kill in 0..KILLS_PER_S * certificate.total() as u32 {
            disturbed.controlled.replace_peer();
            kills += 1;
            // Once at least: a slow host kills more slowly.
            loop {
                calm.look();
                disturbed.look();
                if began.elapsed() >= Duration::from_secs(1) * kills / KILLS_PER_S {
                    break;
                }
                sleep(Duration::from_millis(5));
            }
            certificate.advance(u64::from(round == 1 && kill % KILLS_PER_S == 0));
        }
        let [among_constant, among_dying] = [&calm, &disturbed].map(|it| it);
        let [reference, found] =
            [median(&among_constant.p999_ns[before[0]..]), median(&among_dying.p999_ns[before[1]..])];
        ratio = found as f64 / reference as f64;
        let rate = f64::from(kills) / began.elapsed().as_secs_f64();
        println!(
            "{rate:.1} kills/s; p99.9 of a cycle {found} ns, undisturbed {reference} ns: {ratio:.2} times"
        );
        if ratio <= LARGEST_RATIO {
            break;
        }
        assert!(round < ROUNDS, "in each of {ROUNDS} rounds");
    }
    among_constant_peers_nothing_is_used(&calm);
    let seen = disturbed.last.io.allocations - disturbed.first.io.allocations;
    assert!(seen >= kills.into(), "{kills} peers were killed, and the io thread allocated {seen} times");
    for observed in [calm, disturbed] {
        observed.ends();
    }
    certificate
        .finish(format_args!("{kills} kills, p99.9 of a cycle {ratio:.2} times that among constant peers"));
}

fn median(values: &[u64]) -> u64 {
    let mut values = values.to_vec();
    values.sort_unstable();
    values[values.len() / 2]
}

/// One daemon and what its status said.
struct Rig {
    controlled: Controlled,
    statuses: Subscriber<StatusMessage>,
    timings: Subscriber<StatisticsMessage>,
    first: StatusMessage,
    last: StatusMessage,
    /// p99.9 of the time of a cycle, of each second.
    p999_ns: Vec<u64>,
    /// When everybody was there: minor and major faults of the io and of the log thread.
    faults: [[u64; 2]; 2],
}

impl Rig {
    /// Returns when everybody is there and the first seconds are over, with all that is only done once.
    fn start(machine: Machine) -> Self {
        let controlled = Controlled::start(machine);
        let bus = Bus::join(&controlled.machine.name).expect("to join");
        let statuses = bus.subscriber(1).expect("to subscribe");
        let timings = bus.subscriber(8).expect("to subscribe");
        let nothing = StatusMessage::default();
        let mut observed = Self {
            controlled,
            statuses,
            first: nothing,
            last: nothing,
            timings,
            p999_ns: vec![],
            faults: [[0; 2]; 2],
        };
        let start = Instant::now();
        while observed.p999_ns.len() < 2 {
            assert!(start.elapsed() < HANG, "no statistics");
            observed.look();
            sleep(Duration::from_millis(5));
        }
        observed.p999_ns.clear();
        (observed.first, observed.faults) = (observed.last, observed.faults_now());
        observed
    }

    fn look(&mut self) {
        let Some(status) = self.statuses.receive_latest() else { return };
        self.last = status;
        let news = std::iter::from_fn(|| self.timings.receive());
        self.p999_ns.extend(news.map(|statistics| statistics.window.compute_ns.p999));
    }

    fn faults_now(&self) -> [[u64; 2]; 2] {
        ["hexad-io", "hexad-log"].map(|name| Thread::of(self.controlled.daemon.id(), name).faults())
    }

    fn ends(self) {
        let (words, machine) = self.controlled.finish();
        let report = Report::read(&machine.path("report.json")).expect("the report");
        println!(
            "{}: {} cycles, {:?}, {:?}",
            machine.name, report.cycles, report.rt_thread, report.deadline_misses
        );
        let used = report.rt_thread;
        assert_eq!((used.allocations, used.major_faults, used.minor_faults), (0, 0, 0), "{used:#?}");
        assert!(used.voluntary_switches <= report.cycles, "more than a sleep per cycle: {used:#?}");
        assert!(report.faults.is_empty(), "control was lost: {:#?}", report.faults);
        let lines = words.lines().filter(|line| line.contains("cycle=")).count() as u64;
        let log = report.log_thread;
        println!("log thread: {} allocations for {lines} lines, {log:?}", log.allocations);
        assert!(lines > 0 && log.allocations <= PER_LINE * lines, "{lines} lines: {log:#?}");
    }
}

/// From when everybody was there: neither the real-time thread nor the io thread allocates; no page is met
/// for the first time, by the log thread neither.
fn among_constant_peers_nothing_is_used(calm: &Rig) {
    let (first, last) = (&calm.first, &calm.last);
    assert!(last.counters.cycles > first.counters.cycles && last.state == State::Active as u32, "{last:#?}");
    assert_eq!(
        (last.counters.allocations, last.io.allocations),
        (0, first.io.allocations),
        "real-time and io thread"
    );
    assert_eq!(calm.faults_now(), calm.faults, "page faults of the io and of the log thread");
}
