//! Threads of the test that go on until it has seen enough.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::Duration;

use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, Message};

use super::machine::Machine;

/// Threads that end when this is finished or dropped: also when a test has failed, as the others need the processors.
pub struct Background<T> {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<T>>,
}

impl<T: Send + 'static> Background<T> {
    /// Each thread gets its number, and looks whether it is to end.
    pub fn start(count: usize, run: impl Fn(usize, &AtomicBool) -> T + Clone + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let start = |number| {
            let (stop, run) = (stop.clone(), run.clone());
            spawn(move || run(number, &stop))
        };
        Self { threads: (0..count).map(start).collect(), stop }
    }

    /// Ends all threads, with what they have found.
    pub fn finish(mut self) -> Vec<T> {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).map(|thread| thread.join().expect("a thread of the test")).collect()
    }
}

impl<T> Drop for Background<T> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}

/// Publishes the same message every millisecond, as another process would.
pub fn publish<T: Message + Send + Sync>(machine: &Machine, message: T) -> Background<()> {
    let name = machine.name.clone();
    Background::start(1, move |_, stop| {
        let bus = Bus::join(&name).expect("to join");
        let mut publisher = bus.publisher::<T>().expect("to publish");
        while !stop.load(Ordering::Relaxed) {
            publisher.publish(monotonic_ns(), message).expect("to send");
            sleep(Duration::from_millis(1));
        }
    })
}
