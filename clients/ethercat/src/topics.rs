//! The daemon over its topics. A thread of its own uses the ports: they allocate when a peer appears or disappears, and the cycle must not.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::{self, JoinHandle};

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, ForceMessage, MeasuredMessage, PortError, Publisher, Subscriber};
use hexad_client::realtime::clock::Monotonic;
use hexad_client::realtime::event::Event;
use hexad_client::realtime::process::block_signals;
use hexad_client::realtime::setup::scheduling::fifo_priority;
use hexad_client::realtime::triple_buffer::{Reader, Writer, triple_buffer};

use crate::cycle::{Daemon, POLL_NS};

/// Above the cycle, which waits for this thread, and below the daemon. Its rounds are short.
const PRIORITY: i32 = 76;
/// Interval at which forces are looked for that respond to no measurement \[ns\].
const IDLE_NS: u64 = 1_000_000;

/// Ports of a driver, used by another thread.
pub struct Topics {
    measured: Writer<(u64, MeasuredMessage)>,
    forces: Reader<ForceMessage>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Result<(), PortError>>>,
}

#[derive(Default)]
struct Shared {
    /// There is a new measurement.
    event: Event,
    stop: AtomicBool,
}

/// The thread's ends. The ports belong to the thread that opens them.
struct Ports {
    publisher: Publisher<MeasuredMessage>,
    subscriber: Subscriber<ForceMessage>,
    measured: Reader<(u64, MeasuredMessage)>,
    forces: Writer<ForceMessage>,
}

impl Topics {
    /// Joins the topics of a machine, in a thread. Forces are expected within `answer_ns`.
    pub fn join(name: &str, answer_ns: u64) -> Result<Self, PortError> {
        let (measured_writer, measured) = triple_buffer(<_>::default());
        let (forces, forces_reader) = triple_buffer(ForceMessage::default());
        let (shared, (opened, outcome)) = (Arc::new(Shared::default()), channel());
        let (theirs, name) = (shared.clone(), name.to_string());
        let thread = thread::spawn(move || {
            block_signals();
            // The caller reports if it may not have its own.
            let _ = fifo_priority(PRIORITY);
            let bus = Bus::join(&name)?;
            let (publisher, subscriber) = (bus.publisher()?, bus.subscriber(8)?);
            // The receiver waits for it.
            let _ = opened.send(());
            Ports { publisher, subscriber, measured, forces }.serve(&theirs, answer_ns)
        });
        let mut topics =
            Self { measured: measured_writer, forces: forces_reader, shared, thread: Some(thread) };
        match outcome.recv() {
            Ok(()) => Ok(topics),
            Err(_) => topics.end().map(|()| topics),
        }
    }

    /// Whether a message could not be sent.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the thread, with its error.
    pub fn end(&mut self) -> Result<(), PortError> {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.event.signal();
        self.thread.take().map_or(Ok(()), |thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)))
    }
}

impl Ports {
    fn serve(mut self, shared: &Shared, answer_ns: u64) -> Result<(), PortError> {
        let (mut stamp_ns, mut until_ns) = (0, 0);
        while !shared.stop.load(Ordering::Relaxed) {
            let now_ns = monotonic_ns();
            let wake_ns = now_ns + if now_ns < until_ns { POLL_NS } else { IDLE_NS };
            if shared.event.wait(&mut self.measured, &mut Monotonic, wake_ns, &shared.stop) {
                let message;
                (stamp_ns, message) = *self.measured.value();
                self.publisher.publish(stamp_ns, message)?;
                until_ns = monotonic_ns() + answer_ns;
            }
            if let Some(force) = self.subscriber.receive_latest() {
                until_ns = if force.release_ns == stamp_ns { 0 } else { until_ns };
                self.forces.write(force);
            }
        }
        Ok(())
    }
}

impl Daemon for Topics {
    fn publish(&mut self, stamp_ns: u64, measured: MeasuredMessage) {
        self.measured.write((stamp_ns, measured));
        self.shared.event.signal();
    }

    fn receive(&mut self, _: u64) -> Option<ForceMessage> {
        self.forces.update().then(|| *self.forces.value())
    }
}
