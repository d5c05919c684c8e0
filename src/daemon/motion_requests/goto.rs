//! `goto`: publishing of the target, and on the way to it of a tool's path, until the platform is in position.

use super::job::{End, Job, JobFeed, MotionEvent};
use super::order::{GotoOrder, MotionOrder};
use super::plan::{GotoPlan, window};
use super::tool_stream::ToolStream;
use crate::target_source::{
    Deviation, Feed as _, Observation, TargetError, TargetSource, has_received, is_reached,
};
use hexad_client::messages::Bus;
use hexad_core::control::constants::Constants;
use hexad_core::control::supervision::in_position::{InPosition, InPositionWindow};
use hexad_core::model::rigid::Twist;
use hexad_core::model::task::pose_of;
use hexad_machine::analysis::target_motion::TargetRefusal;

/// Longest time of the motion, as a multiple of the computed time, and an addition \[s\].
const LONGEST_SHARE: f64 = 1.5;
const LONGEST_EXTRA_S: f64 = 5.0;

/// Moves the platform to a target. Returns a sentence about its arrival; `None` if the request was ended before.
pub fn run(
    job: &Job,
    constants: &Constants,
    order: &GotoOrder,
    mut feed: JobFeed<'_>,
    bus: &Bus,
) -> Result<Option<String>, TargetError> {
    let config = &job.loaded.config;
    let MotionOrder { coordinates, is_straight, may_engage, .. } = &job.order;
    let (seen, _) = feed.observe()?;
    let go_on = || job.end().is_none();
    let plan = match GotoPlan::new(config, constants, order, coordinates, *is_straight, seen, go_on) {
        Err(TargetError::Refused(TargetRefusal::Interrupted)) => return Ok(None),
        plan => plan?,
    };
    let mut source = job.source(feed, bus, *may_engage)?;
    source.speed_share = order.speed_share;
    job.send(MotionEvent::Accepted(format!("{:.2} s to the target", plan.motion.duration_s)));
    drive(job, &mut source, plan, constants, &window(config, order.tolerance_m))
}

/// Publishes the path of a tool if there is one, then the target until the platform is in position. Control begins at the pose of
/// the platform.
fn drive(
    job: &Job,
    source: &mut TargetSource<'_, JobFeed<'_>>,
    plan: GotoPlan,
    constants: &Constants,
    window: &InPositionWindow,
) -> Result<Option<String>, TargetError> {
    let GotoPlan { from, to, motion, mut stream } = plan;
    let longest_s = LONGEST_SHARE * motion.duration_s + LONGEST_EXTRA_S + window.settling_ns as f64 * 1e-9;
    let (mut arrival, mut has_reference_arrived) = (InPosition::default(), false);
    loop {
        let end = job.end();
        let Some(since_ns) = source.active_since_ns() else {
            if end.is_some() {
                return Ok(None);
            }
            source.publish(from)?;
            continue;
        };
        match end {
            Some(End::AtOnce) => return Ok(None),
            // The next motion takes over from a target, but from a path only at rest.
            Some(End::TakeOver) if stream.as_mut().is_none_or(|it| it.next(source.next_ns()).is_none()) => {
                return Ok(None);
            }
            Some(_) => return rest(job, source, stream, constants),
            None => {}
        }
        if let Some(task) = stream.as_mut().and_then(|stream| stream.next(source.next_ns())) {
            source.publish_motion(task)?;
            continue;
        }
        source.publish(to)?;
        let (now, _) = source.feed.observe()?;
        let elapsed_s = now.time_ns.saturating_sub(since_ns) as f64 * 1e-9;
        if elapsed_s > longest_s {
            return Err(too_late(now, &to, window, longest_s));
        }
        // An older observation would have another pose, or another target if the way is short.
        if now.time_ns < since_ns || !has_received(now, &to) {
            continue;
        }
        // Kept, because the reference is the measured pose plus its error, with the noise of both.
        has_reference_arrived |= now.reference_or_measured_x.is_some_and(|x| is_reached(&x, &to));
        let error = error_to(now, &to).filter(|_| has_reference_arrived);
        if arrival.update(window, now.time_ns, &to, error.as_ref()) {
            let error = Deviation(error.unwrap_or_default());
            return Ok(Some(format!(
                "in position after {elapsed_s:.2} s, {error} from the target; the platform stands under control"
            )));
        }
    }
}

/// Brings the platform to rest, along the path of a tool if it is on one.
fn rest(
    job: &Job,
    source: &mut TargetSource<'_, JobFeed<'_>>,
    mut stream: Option<ToolStream>,
    constants: &Constants,
) -> Result<Option<String>, TargetError> {
    let on_path = stream.as_mut().and_then(|stream| stream.slow_down(source.next_ns()));
    let x = on_path.map_or_else(|| source.resting_or_present_x(constants), Ok)?;
    source.speed_share = 1.0;
    while let Some(task) = stream.as_mut().and_then(|stream| stream.next(source.next_ns())) {
        source.publish_motion(task)?;
    }
    job.publish_until_reached(source, x)?;
    Ok(None)
}

/// The target minus the measured pose; `None` if it is unknown.
fn error_to(seen: &Observation, x: &[f64; 6]) -> Option<Twist> {
    Some(pose_of(&seen.pose?).displacement_to(&pose_of(x)))
}

/// The error of a target that was not reached in time.
fn too_late(seen: &Observation, x: &[f64; 6], window: &InPositionWindow, longest_s: f64) -> TargetError {
    match error_to(seen, x)
        .filter(|_| seen.reference_or_measured_x.is_some_and(|reference| is_reached(&reference, x)))
    {
        Some(error) => TargetError::NotInPosition(longest_s, Deviation(error), *window),
        None => TargetError::TimedOut(longest_s),
    }
}
