//! `hexad off && hexad park`, and `hexad estop && hexad clear && hexad park`, typed in a shell while the platform moves.

use std::fmt::Write;
use std::fs;
use std::panic::resume_unwind;
use std::process::{Command, Stdio};
use std::thread::scope;

use hexad::control::signals::state::State;
use hexad::messages::{ForceMessage, MeasuredMessage};

use crate::common::not_run::not_run;
use crate::support::children::{Ended, HANG, Hexad};
use crate::support::machine::{Machine, PERIOD_NS};
use crate::support::recorder::{Recorder, Recording};
use crate::support::trio::{start_daemon, start_plant};
use crate::support::{operator, rules, turns};

/// x of the home pose of the paper's machine \[m\], the heave along it and its duration \[s\]: peaks of 0.88 m/s and
/// 3.2 m/s^2.
const HOME_M: f64 = 1.1;
const HEAVE_M: f64 = 0.4;
const HEAVE_S: f64 = 0.85;
/// Rest between two heaves \[s\], and before the first.
const REST_S: f64 = 0.5;
/// Heaves of one trajectory, up and down in turn: more than a trial waits for.
const HEAVES: u32 = 12;
/// Part of the way up at which the operator presses return; the platform is at its fastest.
const TYPES_AT: f64 = 0.5;
/// Default of `limits.velocity_m_s`, with the allowance of the loop.
const LARGEST_SPEED_M_S: f64 = 1.02;
/// `actuator.min_length_m` and `actuator.max_length_m` of the paper's machine.
const STROKE_M: [f64; 2] = [0.85, 1.6];
/// Timeouts that pauses of the host do not reach. That of setpoints is the default: the trajectory needs its room to stop.
const TIMEOUTS: &str = "
[timeouts]
measured_ms = 400.0
allow_unstable_age = true

[plant]
force_timeout_ms = 400.0
";
/// A longer gap between two messages of one process is a pause of the host: what the platform does beyond its limits then is not judged.
const LONGEST_GAP_NS: u64 = 5 * PERIOD_NS;
/// Trials until one has no pause.
const TRIALS: u32 = 5;

#[test]
fn a_platform_released_in_motion_is_parked_within_its_limits() {
    let _turn = turns::beside_others();
    let judged = scope(|threads| {
        let judge = |requests| threads.spawn(move || (0..TRIALS).any(|_| trial(requests)));
        let both = [&["off", "park"] as &[_], &["estop", "clear", "park"]].map(judge);
        both.map(|thread| thread.join().unwrap_or_else(|failure| resume_unwind(failure)))
    });
    if judged.contains(&false) {
        not_run("the host paused in every trial");
    }
}

/// True if the host let the processes run: then the trial was judged.
fn trial(requests: &[&str]) -> bool {
    let machine = Machine::with("released", TIMEOUTS);
    let file = machine.path("heave.csv");
    fs::write(&file, trajectory()).expect("a trajectory");
    let recorder = Recorder::start(&machine.name);
    let plant = start_plant(&machine);
    let daemon = start_daemon(&machine);
    let setpoints = Hexad::start(&machine, "move", &["--trajectory".as_ref(), file.as_os_str()]);
    operator::engage(&machine);
    let from_ns = recorder.until("the platform heaves", |recording| {
        let (force, measured) = (recording.forces.last()?, recording.measured.last()?);
        if force.state == State::Fault as u32 {
            return Some(None);
        }
        let rises = measured.twist[3] > 0.0 && measured.x[3] > HOME_M + TYPES_AT * HEAVE_M;
        rises.then_some(Some(measured.header.time_ns))
    });
    let Some(from_ns) = from_ns else {
        println!("{requests:?}: {}; not judged", daemon.words());
        return false;
    };
    // Whether the last request is carried out or refused with its reason is the daemon's choice.
    let Ended { stderr, .. } = typed(&machine, requests).ends_within(HANG);
    recorder.until("the platform stands without forces", |recording| {
        let (force, measured) = (recording.forces.last()?, recording.measured.last()?);
        (force.valid == 0 && rules::stands(measured)).then_some(())
    });
    let words = plant.words();
    // A host that pauses may have ended control before the operator did.
    drop(setpoints);
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    let recording = recorder.finish();
    let since = |time_ns: u64| time_ns >= from_ns;
    let forces: Vec<_> =
        recording.forces.iter().filter(|force| since(force.header.time_ns)).copied().collect();
    let measured: Vec<_> =
        recording.measured.iter().filter(|measured| since(measured.header.time_ns)).copied().collect();
    let seen = Seen::of(&recording, &forces, &measured);
    println!("{requests:?}: {seen:?}; {}", stderr.trim());
    let is_within = !words.contains("end stop") && seen.margin_m > 0.0 && seen.speed_m_s <= LARGEST_SPEED_M_S;
    let pause_ns = |until_ns: u64| {
        let times_ns = forces.iter().map(|force| force.header.time_ns);
        let measured_ns = measured.iter().map(|measured| measured.header.time_ns);
        let until = |time_ns: &u64| *time_ns <= until_ns;
        longest_gap_ns(times_ns.filter(until)).max(longest_gap_ns(measured_ns.filter(until)))
    };
    // A pause before the request has released the platform may have done so itself; one after it excuses.
    let released = forces.iter().find(|force| force.valid == 0).expect("it was released");
    let judged_ns = if is_within { released.header.time_ns } else { u64::MAX };
    if pause_ns(judged_ns) > LONGEST_GAP_NS {
        println!("{requests:?}: a pause of {:.1} ms; not judged", pause_ns(judged_ns) as f64 * 1e-6);
        return false;
    }
    assert!(is_within, "{requests:?}: {seen:?}\n{words}");
    true
}

/// The requests in one line of a shell.
fn typed(machine: &Machine, requests: &[&str]) -> Hexad {
    let each: Vec<_> = requests.iter().map(|request| format!("\"$0\" {request} --config \"$1\"")).collect();
    let mut shell = Command::new("sh");
    shell
        .args(["-c", &each.join(" && "), env!("CARGO_BIN_EXE_hexad")])
        .arg(&machine.file)
        .stdin(Stdio::null());
    Hexad::spawn(machine, "sh", shell)
}

/// What the platform did under valid forces.
#[derive(Debug)]
struct Seen {
    speed_m_s: f64,
    margin_m: f64,
    /// Cycles in which the daemon parked.
    parking: usize,
}

impl Seen {
    fn of(recording: &Recording, forces: &[ForceMessage], measured: &[MeasuredMessage]) -> Self {
        let is_controlled = |measured: &&MeasuredMessage| {
            let next =
                recording.forces.partition_point(|force| force.header.time_ns < measured.header.time_ns);
            next > 0 && recording.forces[next - 1].valid == 1
        };
        let mut seen = Self { speed_m_s: 0.0, margin_m: f64::INFINITY, parking: 0 };
        for measured in measured.iter().filter(is_controlled) {
            let [.., x, y, z] = measured.twist;
            seen.speed_m_s = seen.speed_m_s.max((x * x + y * y + z * z).sqrt());
            for length in measured.length_m {
                seen.margin_m = seen.margin_m.min((length - STROKE_M[0]).min(STROKE_M[1] - length));
            }
        }
        seen.parking = forces.iter().filter(|force| force.state == State::Parking as u32).count();
        seen
    }
}

fn longest_gap_ns(times_ns: impl Iterator<Item = u64> + Clone) -> u64 {
    let gaps = times_ns.clone().skip(1).zip(times_ns).map(|(after, before)| after - before);
    gaps.max().unwrap_or(u64::MAX)
}

/// Up and down between rest and rest: rows at rest, between which the file's motion is one of minimum jerk.
fn trajectory() -> String {
    let axes = ["alpha", "beta", "gamma", "x", "y", "z"];
    let names = ["", "_rate", "_accel"].iter().flat_map(|suffix| axes.map(|axis| format!("{axis}{suffix}")));
    let mut text = std::iter::once("t".into()).chain(names).collect::<Vec<_>>().join(",");
    let mut row = |t: f64, x: f64| {
        write!(text, "\n{t:?},0,0,0,{x:?},0,0{}", ",0".repeat(12)).expect("a string takes all");
    };
    row(0.0, HOME_M);
    for heave in 0..HEAVES {
        let [from, to] = [heave, heave + 1].map(|heave| HOME_M + HEAVE_M * f64::from(heave % 2));
        let begin_s = REST_S + f64::from(heave) * (HEAVE_S + REST_S);
        row(begin_s, from);
        row(begin_s + HEAVE_S, to);
    }
    text + "\n"
}
