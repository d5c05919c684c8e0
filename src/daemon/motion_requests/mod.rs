//! Requests `goto`, `hold` and `jog`: the motion thread plans each motion and publishes its setpoints.
//!
//! The thread is a setpoint source as any other: it publishes on the topic `setpoint`, so the control loop has one kind of
//! source. It plans as an ordinary process and publishes with the priority of the control thread, which passes on requests
//! and snapshots. One motion runs at a time.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use self::job::{Job, JobFeed, MotionEvent};
use self::order::MotionKind;
use self::snapshot_feed::SnapshotFeed;
use super::parameters::constants;
use super::snapshot::Snapshot;
use super::target_source::TargetError;
use hexad_client::messages::Bus;
use hexad_client::realtime::setup::scheduling;
use hexad_client::realtime::triple_buffer::Reader;

mod goto;
mod hold;
pub mod job;
mod jog;
mod jog_target;
pub mod order;
pub mod plan;
mod snapshot_feed;
pub mod tool_stream;

/// Interval of the observations without a motion, so that one that begins has the velocity of the platform.
const IDLE_INTERVAL: Duration = Duration::from_millis(50);

/// Carries out motions until their sender is dropped.
pub(super) fn run(home: [f64; 6], jobs: &Receiver<Job>, snapshots: Reader<Snapshot>) {
    let (mut feed, mut bus) = (SnapshotFeed::new(snapshots), None);
    loop {
        match jobs.recv_timeout(IDLE_INTERVAL) {
            Ok(job) => {
                let outcome = carry_out(&job, &mut feed, &mut bus);
                scheduling::set_ordinary_policy();
                match outcome {
                    Ok(Some(text)) => job.send(MotionEvent::Done(text)),
                    Ok(None) => {}
                    Err(error) => job.send(MotionEvent::Failed(error.result(), error.to_string())),
                }
            }
            Err(RecvTimeoutError::Timeout) => drop(feed.update(&home)),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Carries out a motion. Returns a sentence about its result, if it has one at its end.
fn carry_out(
    job: &Job,
    snapshots: &mut SnapshotFeed,
    bus: &mut Option<Bus>,
) -> Result<Option<String>, TargetError> {
    let config = &job.loaded.config;
    let bus = match bus {
        Some(bus) => bus,
        // Ports belong to the thread that opens them.
        None => bus.insert(config.join()?),
    };
    let (constants, feed) = (constants(config), JobFeed::new(job, snapshots));
    match &job.order.kind {
        MotionKind::Goto(order) => goto::run(job, &constants, order, feed, bus),
        MotionKind::Hold => hold::hold_where_it_rests(job, &constants, feed, bus).map(|()| None),
        MotionKind::Jog(rates) => jog::run(job, &constants, *rates, feed, bus).map(|()| None),
    }
}
