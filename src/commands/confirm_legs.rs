//! `hexad confirm-legs`: moves one leg after the other, and a person names the leg that moves.
//!
//! Legs that are exchanged as a whole, lengths and drives, look to the daemon like correct ones: only a person sees the difference. The
//! daemon keeps the answers, and warns at each engagement until they are right.

use std::io::{IsTerminal, stdin};
use std::os::fd::AsFd as _;

use clap::Args;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::arguments::{EngageOptions, MachineFile};
use super::failure::Failure;
use super::motion_client::{MotionClient, MotionError};
use super::quantity::length_within;
use hexad_client::operator::motion_fields::{GOTO, HOLD, TargetFields};
use hexad_client::operator::protocol::{CONFIRM_LEGS, RequestLine};
use hexad_client::operator::requests::status;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::model::LEGS;
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::task::{pose_of, task_coordinates};
use hexad_daemon::constants;
use hexad_daemon::leg_confirmation::{IN_ORDER, geometry_sha1};
use hexad_daemon::motion_requests::order::GotoOrder;
use hexad_daemon::motion_requests::plan::GotoPlan;
use hexad_daemon::target_source::Observation;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::files::{print, remark};
use hexad_machine::text::numbers::significant;

/// Share of the limits of autonomous motions: slow enough to look.
const SPEED: f64 = 0.03;

/// Default distance: what an eye sees \[m\], and the share of the stroke of a small machine that it must not exceed.
const DISTANCE_M: f64 = 5e-3;
const STROKE_SHARE: f64 = 0.05;

/// Interval at which a signal is noticed while a person looks \[ms\].
const SIGNAL_INTERVAL_MS: u8 = 100;

#[derive(Debug, Args)]
pub struct ConfirmLegsArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Distance by which each leg moves, with its unit; by default 5 mm, at most a twentieth of the stroke
    #[arg(long, value_name = "LENGTH", value_parser = |text: &str| length_within(text, ["1um", "50mm"]))]
    distance: Option<f64>,
    /// Legs that move, in the order of the motions, for example 1,2,3,4,5,6: instead of the questions, for scripts
    #[arg(long, value_name = "LEGS", value_parser = answers)]
    answers: Option<[u32; LEGS]>,
    #[command(flatten)]
    engage: EngageOptions,
}

impl ConfirmLegsArguments {
    pub fn execute(self) -> Result<(), Failure> {
        if self.answers.is_none() && !stdin().is_terminal() {
            let text = "confirm-legs asks a person: standard input must be a terminal, or give --answers";
            return Err(Failure::before_start(text));
        }
        let (config, stop) = (self.machine.load()?, Stop::on_signals()?);
        let actuator = &config.machine.actuator;
        let stroke = actuator.max_length_m - actuator.min_length_m;
        let distance = self.distance.unwrap_or(DISTANCE_M.min(STROKE_SHARE * stroke));
        let stops = status(&config.name)?.status.and_then(|report| report.stops);
        let mut client = MotionClient::connect(&config.name, &stop)?;
        let geometry_sha1 = Some(geometry_sha1(&config));
        let confirm = |legs| RequestLine {
            geometry_sha1: geometry_sha1.clone(),
            legs,
            ..RequestLine::new(CONFIRM_LEGS)
        };
        client.carry_out(confirm(None), |_| Ok(()))?;
        client.carry_out(RequestLine { stops, ..self.engage.line(HOLD) }, |_| Ok(()))?;
        let seen = Observation::of_answer(&client.status_under_control()?, 0, &config.machine.home);
        let seen = seen.unwrap_or_default();
        let from = seen.target.or(seen.reference_or_measured_x).unwrap_or(config.machine.home);
        let targets = targets(&config, &seen, &from, distance)?;
        print(legend(&config))?;
        let go = |x: [f64; 6]| {
            let target = Some(TargetFields::new(x.map(Some)));
            RequestLine { target, stops, speed: Some(SPEED), ..RequestLine::new(GOTO) }
        };
        let mut legs = [0; LEGS];
        for (number, (leg, target)) in (1..).zip(legs.iter_mut().zip(&targets)) {
            let scripted = self.answers.and_then(|answers| answers.get(number - 1).copied());
            let mut has_moved = false;
            while *leg == 0 {
                if scripted.is_none() {
                    *leg = ask(number, has_moved, &stop)?;
                }
                if *leg == 0 {
                    client.carry_out(go(*target), |_| Ok(()))?;
                    client.carry_out(go(from), |_| Ok(()))?;
                    (has_moved, *leg) = (true, scripted.unwrap_or_default());
                }
            }
        }
        let kept = client.carry_out(confirm(Some(legs)), |_| Ok(()))?.text;
        match mistake(&legs) {
            None => Ok(print(format_args!(
                "each leg is the one of its number ({kept}); the platform stands under control; hexad stop or park ends it\n"
            ))?),
            Some(message) => Err(Failure::after_start(message)),
        }
    }
}

/// The target for each leg: X at which only its length differs, by this distance. Longer, or shorter if it must not be longer.
fn targets(
    config: &Config,
    seen: &Observation,
    from: &[f64; 6],
    distance: f64,
) -> Result<[[f64; 6]; LEGS], Failure> {
    let (machine, constants) = (&config.machine, constants(config));
    let lengths = leg_lengths(machine, &pose_of(from));
    let reached = |leg: usize, change: f64| {
        let mut lengths = lengths;
        lengths.iter_mut().skip(leg).take(1).for_each(|length| *length += change);
        let mut tracker = Tracker::new(machine, pose_of(from));
        let (TrackingResult::Found, _) = tracker.find(machine, &lengths) else {
            return Err("no pose has these lengths".to_owned());
        };
        let x = task_coordinates(tracker.pose(), &machine.home);
        let order = GotoOrder {
            target: x.map(Some),
            relative: false,
            home: false,
            speed_share: SPEED,
            tolerance_m: None,
        };
        let plan = GotoPlan::new(config, &constants, &order, &Coordinates::default(), false, seen, || true);
        plan.map(|plan| plan.to).map_err(|error| error.to_string())
    };
    let mut targets = [*from; LEGS];
    for (leg, target) in targets.iter_mut().enumerate() {
        let found = reached(leg, distance).or_else(|first| reached(leg, -distance).map_err(|_| first));
        *target = found.map_err(|reason| {
            Failure::before_start(format_args!(
                "leg {} cannot change by {} mm from here: {reason}\nnothing has moved; go to another pose (hexad goto --home), \
                 or give a smaller --distance",
                leg + 1,
                significant(1e3 * distance)
            ))
        })?;
    }
    Ok(targets)
}

/// Where each leg is, and what the person does.
fn legend(config: &Config) -> String {
    let joints = &config.machine.joints;
    let legs = joints.triples.unpack_vectors(&joints.base);
    let lines: String = (1..)
        .zip(legs)
        .map(|(leg, joint)| {
            let [x, y, z] = joint.map(|coordinate| format!("{coordinate:.3}")).into();
            format!("leg {leg} is the one at base joint x {x}, y {y}, z {z} m\n")
        })
        .collect();
    format!(
        "{lines}(drawing: hexad check --drawing FILE)\nOne leg after the other moves and returns; look which one.\n"
    )
}

/// The leg that a person has seen to move; 0 for a motion.
fn ask(number: usize, has_moved: bool, stop: &Stop) -> Result<u32, Failure> {
    let question = if has_moved {
        "which leg moved? [1-6; Enter repeats it]"
    } else {
        "look at the legs; Enter begins it"
    };
    loop {
        remark(format_args!("motion {number} of {LEGS}: {question}"));
        while !has_line() {
            if stop.is_requested() {
                return Err(MotionError::Interrupted.into());
            }
        }
        let mut line = String::new();
        // At the end of the input nobody answers.
        if stdin().read_line(&mut line).unwrap_or_default() == 0 {
            return Err(MotionError::Interrupted.into());
        }
        match line.trim().parse() {
            Err(_) if line.trim().is_empty() => return Ok(0),
            Ok(leg) if has_moved && IN_ORDER.contains(&leg) => return Ok(leg),
            _ => {}
        }
    }
}

/// Waits a little for a line of the terminal.
fn has_line() -> bool {
    let input = stdin();
    let mut events = [PollFd::new(input.as_fd(), PollFlags::POLLIN)];
    poll(&mut events, PollTimeout::from(SIGNAL_INTERVAL_MS)).is_ok_and(|count| count > 0)
}

/// What is wrong with the legs that moved by the numbers 1 to 6, and the remedy; `None` if each is the one of its number.
fn mistake(legs: &[u32; LEGS]) -> Option<String> {
    if *legs == IN_ORDER {
        return None;
    }
    let mut sorted = *legs;
    sorted.sort_unstable();
    if sorted != IN_ORDER {
        return Some(format!(
            "{legs:?} were seen to move, but six legs must be six different numbers: repeat the command"
        ));
    }
    let wrong = (1..).zip(legs).filter(|(number, leg)| number != *leg);
    let lines = wrong.filter_map(|(number, leg)| match legs.get(*leg as usize - 1) == Some(&number) {
        true if *leg < number => None,
        true => Some(format!("legs {number} and {leg} are exchanged, lengths and drives")),
        false => Some(format!("lengths and drive of number {number} are those of leg {leg}")),
    });
    let lines: Vec<_> = lines.collect();
    Some(format!(
        "{}: exchange the cables of these legs, of encoder and drive, or their order in the driver; then repeat the command",
        lines.join("; ")
    ))
}

/// Six legs with commas between them.
fn answers(text: &str) -> Result<[u32; LEGS], String> {
    let legs: Option<Vec<u32>> = text.split(',').map(|leg| leg.trim().parse().ok()).collect();
    let legs = legs.filter(|legs| legs.iter().all(|leg| IN_ORDER.contains(leg)));
    legs.and_then(|legs| legs.try_into().ok())
        .ok_or("must be six legs of 1 to 6, for example 1,2,3,4,5,6".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_exchange_is_named_once_with_its_remedy() {
        for (legs, words) in [
            ([1, 2, 3, 4, 5, 6], None),
            ([2, 1, 3, 4, 5, 6], Some("legs 1 and 2 are exchanged, lengths and drives: exchange the cables")),
            (
                [6, 2, 4, 3, 5, 1],
                Some(
                    "legs 1 and 6 are exchanged, lengths and drives; legs 3 and 4 are exchanged, lengths and drives: ",
                ),
            ),
            (
                [2, 3, 1, 4, 5, 6],
                Some(
                    "lengths and drive of number 1 are those of leg 2; lengths and drive of number 2 are those of leg 3; \
                     lengths and drive of number 3 are those of leg 1: exchange",
                ),
            ),
            ([1, 1, 3, 4, 5, 6], Some("[1, 1, 3, 4, 5, 6] were seen to move, but")),
        ] {
            let found = mistake(&legs).unwrap_or_default();
            assert!(words.map_or(found.is_empty(), |words| found.starts_with(words)), "{found:?}");
        }
        assert_eq!(answers("1,2, 3,4,6,5"), Ok([1, 2, 3, 4, 6, 5]));
        for text in ["", "1,2,3,4,5", "1,2,3,4,5,7", "0,2,3,4,5,6", "1,2,3,4,5,6,6", "a,2,3,4,5,6"] {
            assert!(answers(text).is_err(), "{text}");
        }
    }

    #[test]
    fn one_length_changes_within_the_stroke_or_nothing_moves() {
        for name in ["fried2008", "motion_base", "reference", "tsai2000"] {
            let path = format!("{}/config/{name}.toml", env!("CARGO_MANIFEST_DIR"));
            let mut config = Config::load(path.as_ref()).unwrap();
            let home = config.machine.home;
            let lengths = leg_lengths(&config.machine, &pose_of(&home));
            let longest = lengths.iter().copied().fold(0.0, f64::max);
            let seen = Observation {
                reference_or_measured_x: Some(home),
                target: Some(home),
                ..Observation::default()
            };
            // The margin of the stroke is a few millimetres.
            for (room, is_longer) in [(0.1, true), (12e-3, false)] {
                config.machine.actuator.max_length_m = longest + room;
                let targets = targets(&config, &seen, &home, 20e-3).unwrap();
                for (leg, x) in targets.iter().enumerate() {
                    let now = leg_lengths(&config.machine, &pose_of(x));
                    let changes: Vec<f64> =
                        now.iter().zip(&lengths).map(|(now, before)| now - before).collect();
                    let wanted = |k| if k == leg { 20e-3 } else { 0.0 };
                    assert!(
                        (0..LEGS).all(|k| (changes[k].abs() - wanted(k)).abs() < 1e-7),
                        "{name}: {changes:?}"
                    );
                    assert!(
                        lengths[leg] < longest || (changes[leg] > 0.0) == is_longer,
                        "{name}: {changes:?}"
                    );
                }
            }
            config.machine.actuator.min_length_m = lengths.iter().copied().fold(longest, f64::min) - 5e-3;
            config.machine.actuator.max_length_m = longest + 5e-3;
            let Failure { exit_code, message } = targets(&config, &seen, &home, 50e-3).unwrap_err();
            assert_eq!(exit_code, 2);
            assert!(
                message.starts_with("leg 1 cannot change by 50.0 mm from here: the target is"),
                "{message}"
            );
        }
    }
}
