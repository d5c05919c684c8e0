//! `jog`: motion while requests arrive. Without one for 0.2 s, and after the end of its connection, the platform comes to rest.

use std::time::Instant;

use super::job::{Job, JobFeed, Jog, MotionEvent};
use super::jog_target::JogTarget;
use crate::target_source::{TargetError, is_reached};
use hexad_client::messages::Bus;
use hexad_client::messages::clock::monotonic_ns;
use hexad_core::control::constants::Constants;
use hexad_core::model::task::pose_of;

/// Time after a request at which motion ends unless another one arrives \[ns\]: twice the repetition interval of a slow keyboard.
const REQUEST_TIMEOUT_NS: u64 = 200_000_000;

/// Longest time for which a target moves in one cycle \[s\], so that it does not jump after a pause of this process.
const MAX_STEP_S: f64 = 0.02;

/// Moves the platform with the rates of the newest request, until the platform rests after the last one.
pub fn run(
    job: &Job,
    constants: &Constants,
    rates: [f64; 6],
    feed: JobFeed<'_>,
    bus: &Bus,
) -> Result<(), TargetError> {
    let mut source = job.source(feed, bus, job.order.may_engage)?;
    let mut target = JogTarget::new(constants, job.start_x(&mut source, constants)?);
    job.send(MotionEvent::Accepted("the target moves while requests arrive".into()));
    let mut newest = Jog { rates, coordinates: job.order.coordinates.clone(), time_ns: job.time_ns };
    let mut moved = Instant::now();
    loop {
        source.publish(target.x())?;
        let end = job.end();
        newest = job.take_new_jog().unwrap_or(newest);
        let step_s = core::mem::replace(&mut moved, Instant::now()).elapsed().as_secs_f64().min(MAX_STEP_S);
        let is_moving = end.is_none() && monotonic_ns().saturating_sub(newest.time_ns) < REQUEST_TIMEOUT_NS;
        if source.active_since_ns().is_none() {
            if !is_moving {
                return Ok(());
            }
            continue;
        }
        let reference = source.present_x()?;
        if is_moving {
            let blocked = target.blocked();
            target.advance(&newest.coordinates, &newest.rates, step_s, &pose_of(&reference));
            if target.blocked() != blocked {
                job.send(MotionEvent::Blocked(target.blocked().map(|bound| bound.to_string())));
            }
        } else if end.is_some() || is_reached(&reference, &target.x()) {
            return Ok(());
        }
    }
}
