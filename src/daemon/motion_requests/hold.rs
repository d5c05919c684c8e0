//! `hold`: brings the platform to rest and keeps it there, until its request is ended.

use super::job::{Job, JobFeed, MotionEvent};
use crate::target_source::TargetError;
use hexad_client::messages::Bus;
use hexad_core::control::constants::Constants;
use hexad_core::model::task::pose_of;
use hexad_machine::analysis::target_motion::{TargetRefusal, check_target};

/// Holds the platform.
pub fn hold_where_it_rests(
    job: &Job,
    constants: &Constants,
    feed: JobFeed<'_>,
    bus: &Bus,
) -> Result<(), TargetError> {
    let mut source = job.source(feed, bus, job.order.may_engage)?;
    let x = job.start_x(&mut source, constants)?;
    check_target(constants, &pose_of(&x)).map_err(TargetRefusal::Target)?;
    job.send(MotionEvent::Accepted("the platform comes to rest".into()));
    if job.publish_until_reached(&mut source, x)? {
        job.send(MotionEvent::Done("the platform stands under control".into()));
        while job.end().is_none() {
            source.publish(x)?;
        }
    }
    Ok(())
}
