//! Publishing of the target, and on the way to it of a tool's path, until the platform is in position.

use std::time::Instant;

use super::plan::{heading, row};
use super::stream::Stream;
use crate::commands::coordinates::Coordinates;
use crate::commands::target::{Deviation, TargetError, TargetSource, has_received, is_reached, pose_of};
use crate::control::constants::Constants;
use crate::control::supervision::in_position::{InPosition, InPositionWindow};
use crate::daemon::nanoseconds;
use crate::model::rigid::Twist;
use crate::operator::protocol::AnswerLine;
use crate::output::files::print;
use crate::output::numbers::MotionDigits;
use crate::realtime::stop_request::Stop;

/// Longest time of the motion, as a multiple of the computed time, and an addition \[s\].
const LONGEST_SHARE: f64 = 1.5;
const LONGEST_EXTRA_S: f64 = 5.0;

/// Where the platform goes.
pub struct Goal<'a> {
    pub constants: &'a Constants,
    pub coordinates: &'a Coordinates,
    /// X of the platform before and after.
    pub from: [f64; 6],
    pub to: [f64; 6],
    pub window: InPositionWindow,
    pub duration_s: f64,
}

/// Publishes the path of a tool if there is one, then the target until the platform is in position; after a signal, until the
/// reference is at rest. Control begins at the pose of the platform.
pub fn drive(
    mut source: TargetSource,
    goal: &Goal,
    mut stream: Option<Stream>,
    stop: &Stop,
) -> Result<(), TargetError> {
    let Goal { constants, coordinates, from, to, window, duration_s } = goal;
    let settling_s = window.settling_ns as f64 * 1e-9;
    let longest_s = LONGEST_SHARE * duration_s + LONGEST_EXTRA_S + settling_s;
    let (mut resting, mut arrival, mut has_reference_arrived) = (None, InPosition::default(), false);
    loop {
        if stop.is_repeated() {
            return Err(TargetError::Interrupted);
        }
        let Some(since) = source.active_since() else {
            if stop.is_requested() {
                return Err(TargetError::InterruptedEarly);
            }
            source.publish(*from)?;
            continue;
        };
        if stop.is_requested() && resting.is_none() {
            let on_path = stream.as_mut().and_then(|stream| stream.slow_down(source.next_ns()));
            let x = on_path.map_or_else(|| source.resting_x(constants), Ok)?;
            (resting, has_reference_arrived) = (Some(x), false);
            source.set_speed(1.0);
        }
        if let Some(task) = stream.as_mut().and_then(|stream| stream.next(source.next_ns())) {
            source.publish_motion(task)?;
            continue;
        }
        let x = resting.unwrap_or(*to);
        source.publish(x)?;
        let elapsed_s = since.elapsed().as_secs_f64();
        if elapsed_s > longest_s {
            return Err(too_late(&source, &x, window, longest_s));
        }
        // An older status would have another pose, or another target if the way is short.
        let (requested, answer) = source.status().newest;
        if requested < since || !has_received(&answer, &x) {
            continue;
        }
        // Kept, because the reference is the measured pose plus its error, with the noise of both.
        has_reference_arrived |= is_reached(&source.present_x()?, &x);
        if resting.is_some() && has_reference_arrived {
            return Err(TargetError::Interrupted);
        }
        let error = error_to(&answer, &x).filter(|_| has_reference_arrived);
        let requested_ns = nanoseconds(requested.duration_since(since).as_secs_f64());
        if resting.is_none() && arrival.update(window, requested_ns, &x, error.as_ref()) {
            return arrived(&source, coordinates, since, error.unwrap_or_default());
        }
    }
}

/// The target minus the measured pose; `None` if it is unknown.
fn error_to(answer: &AnswerLine, x: &[f64; 6]) -> Option<Twist> {
    let pose = answer.status.as_ref()?.pose?;
    Some(pose_of(&pose).displacement_to(&pose_of(x)))
}

/// The error of a target that was not reached in time.
fn too_late(source: &TargetSource, x: &[f64; 6], window: &InPositionWindow, longest_s: f64) -> TargetError {
    let error = error_to(&source.status().newest.1, x);
    match error.filter(|_| source.present_x().is_ok_and(|present| is_reached(&present, x))) {
        Some(error) => TargetError::NotInPosition(longest_s, Deviation(error), *window),
        None => TargetError::TimedOut(longest_s),
    }
}

/// Reports the pose of the platform.
fn arrived(
    source: &TargetSource,
    coordinates: &Coordinates,
    since: Instant,
    error: Twist,
) -> Result<(), TargetError> {
    let (elapsed_s, answer) = (since.elapsed().as_secs_f64(), source.status().newest.1);
    let report = answer.status.unwrap_or_default();
    let text = format!(
        "in position after {elapsed_s:.2} s, {} from the target; the platform stands under control\n{}{}",
        Deviation(error),
        heading(&coordinates.label),
        row(
            "pose",
            &coordinates.tool_x(&report.pose.unwrap_or_default()),
            MotionDigits::new(report.resolution)
        )
    );
    // The platform has moved, so a closed standard output is not a failure.
    let _ = print(text);
    Ok(())
}
