//! A motion in progress: what the motion thread and the control thread send each other.

use core::cell::{Cell, RefCell};
use std::process;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError};

use super::order::MotionOrder;
use super::snapshot_feed::SnapshotFeed;
use crate::process_names::{command, named};
use crate::reload::Loaded;
use crate::start::{REQUESTS_PRIORITY, prepare_support};
use crate::target_source::{
    Feed, Observation, TargetError, TargetSource, has_received, is_reached, reachable_target,
};
use hexad_client::messages::{Bus, SetpointMessage};
use hexad_client::operator::protocol::RequestResult;
use hexad_core::control::constants::Constants;
use hexad_machine::config::coordinates::Coordinates;

/// Newest request of a jog.
#[derive(Clone, Debug)]
pub struct Jog {
    /// Rates of the coordinates \[rad/s\], \[m/s\].
    pub rates: [f64; 6],
    /// Coordinates.
    pub coordinates: Coordinates,
    /// Instant at which it arrived \[ns\].
    pub time_ns: u64,
}

/// End of a motion before it is completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The platform comes to rest on its path.
    Rest,
    /// The next motion of the same connection takes over.
    TakeOver,
    /// The daemon ends, or control is not to be taken any more.
    AtOnce,
}

/// From the control thread.
#[derive(Debug)]
pub enum MotionInput {
    /// Another request of the jog.
    Jog(Box<Jog>),
    /// The motion is to end.
    End(End),
}

/// To the control thread. The channel closes when the motion has ended.
#[derive(Debug)]
pub enum MotionEvent {
    /// The motion is planned and begins; a sentence about it.
    Accepted(String),
    /// A target at the platform is published, and control is to be taken.
    WantsControl,
    /// The bound that stops a jog.
    Blocked(Option<String>),
    /// The request is fulfilled; a sentence about it.
    Done(String),
    /// The request has failed.
    Failed(RequestResult, String),
}

/// A motion in progress.
#[derive(Debug)]
pub struct Job {
    /// Configuration in force when it was requested.
    pub loaded: Arc<Loaded>,
    /// The motion.
    pub order: MotionOrder,
    /// Instant at which its request arrived \[ns\].
    pub time_ns: u64,
    inputs: Receiver<MotionInput>,
    events: Sender<MotionEvent>,
    end: Cell<Option<End>>,
    jog: RefCell<Option<Jog>>,
}

impl Job {
    /// A motion that is not begun.
    pub fn new(
        loaded: Arc<Loaded>,
        order: MotionOrder,
        time_ns: u64,
        inputs: Receiver<MotionInput>,
        events: Sender<MotionEvent>,
    ) -> Self {
        Self { loaded, order, time_ns, inputs, events, end: Cell::new(None), jog: RefCell::new(None) }
    }

    /// Whether, and how, the motion is to end.
    pub fn end(&self) -> Option<End> {
        loop {
            match self.inputs.try_recv() {
                Ok(MotionInput::Jog(jog)) => drop(self.jog.replace(Some(*jog))),
                Ok(MotionInput::End(end)) => self.end.set(Some(end)),
                Err(TryRecvError::Disconnected) => self.end.set(Some(End::AtOnce)),
                Err(TryRecvError::Empty) => return self.end.get(),
            }
            if self.end.get() == Some(End::AtOnce) {
                return self.end.get();
            }
        }
    }

    /// The newest request of a jog since the last call.
    pub fn take_new_jog(&self) -> Option<Jog> {
        self.jog.take()
    }

    /// Sends an event.
    pub fn send(&self, event: MotionEvent) {
        // The control thread may have ended.
        let _ = self.events.send(event);
    }

    /// The source of the motion. From now on this thread must be punctual.
    pub fn source<'a>(
        &'a self,
        feed: JobFeed<'a>,
        bus: &Bus,
        may_engage: bool,
    ) -> Result<TargetSource<'a, JobFeed<'a>>, TargetError> {
        let mut processes = bus.topic::<SetpointMessage>()?.publisher_process_ids().into_iter();
        let other = processes.find(|id| *id != process::id() && !command(*id).is_empty());
        if let Some(other) = other {
            return Err(TargetError::OtherSource(named(other)));
        }
        let source = TargetSource::open(&self.loaded.config, bus, feed, may_engage)?;
        prepare_support(&self.loaded.config.deployment.realtime, REQUESTS_PRIORITY);
        Ok(source)
    }

    /// X at which a motion without a target begins: of the target that is held, else where the platform comes to rest.
    pub fn start_x(
        &self,
        source: &mut TargetSource<'_, JobFeed<'_>>,
        constants: &Constants,
    ) -> Result<[f64; 6], TargetError> {
        let x = source.resting_or_present_x(constants)?;
        let (now, _) = source.feed.observe()?;
        Ok(reachable_target(constants, now).filter(|target| is_reached(&x, target)).unwrap_or(x))
    }

    /// Publishes a target until the reference is there. False if the motion was ended before.
    pub fn publish_until_reached(
        &self,
        source: &mut TargetSource<'_, JobFeed<'_>>,
        x: [f64; 6],
    ) -> Result<bool, TargetError> {
        loop {
            source.publish(x)?;
            let (since_ns, end) = (source.active_since_ns(), self.end());
            if end == Some(End::AtOnce) || since_ns.is_none() && end.is_some() {
                return Ok(false);
            }
            let (now, _) = source.feed.observe()?;
            let is_new = since_ns.is_some_and(|since_ns| now.time_ns >= since_ns) && has_received(now, &x);
            if is_new && now.reference_or_measured_x.is_some_and(|reference| is_reached(&reference, &x)) {
                return Ok(true);
            }
        }
    }
}

/// Observations of a motion, and its request for control.
pub struct JobFeed<'a> {
    job: &'a Job,
    snapshots: &'a mut SnapshotFeed,
    has_requested: bool,
}

impl<'a> JobFeed<'a> {
    /// Feed of a motion that has not requested control.
    pub fn new(job: &'a Job, snapshots: &'a mut SnapshotFeed) -> Self {
        Self { job, snapshots, has_requested: false }
    }
}

impl Feed for JobFeed<'_> {
    fn observe(&mut self) -> Result<(&Observation, Option<&Observation>), TargetError> {
        Ok(self.snapshots.update(&self.job.loaded.config.machine.home))
    }

    fn request_control(&mut self) -> Result<(), TargetError> {
        if !core::mem::replace(&mut self.has_requested, true) {
            self.job.send(MotionEvent::WantsControl);
        }
        Ok(())
    }
}
