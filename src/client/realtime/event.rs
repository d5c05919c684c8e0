//! Event: one thread sleeps until another has handed in what it needs, where a message and not the clock
//! releases a cycle.
//!
//! The real-time thread sleeps on a futex: one system call, like the sleep of the grid. The I/O thread signals
//! after it has handed in the input of the cycle. Not `park` of the standard library: it may panic, and it
//! allocates where it has no handle of the thread yet. `tests/loom` checks that no signal is lost, in every order
//! in which the two threads can run.

use super::clock::Clock;
use super::futex;
use super::sync::{AtomicBool, AtomicU32, Ordering};
use super::triple_buffer::Reader;

/// Event that one thread signals and another waits for.
#[derive(Debug, Default)]
pub struct Event {
    /// Signals since start.
    signals: AtomicU32,
}

impl Event {
    /// Wakes the waiting thread.
    pub fn signal(&self) {
        self.signals.fetch_add(1, Ordering::Release);
        futex::wake(&self.signals);
    }

    /// Waits until there is something new in `inputs`: true; or until `instant_ns` or `stop`: false. After setting
    /// `stop`, a thread has to signal.
    pub fn wait<T: Copy>(
        &self,
        inputs: &mut Reader<T>,
        clock: &mut impl Clock,
        instant_ns: u64,
        stop: &AtomicBool,
    ) -> bool {
        loop {
            // Read before the inputs: a signal from here on ends the sleep, or keeps it from beginning.
            let signals = self.signals.load(Ordering::Acquire);
            if inputs.update() {
                return true;
            }
            if clock.now_ns() >= instant_ns || stop.load(Ordering::Relaxed) {
                return false;
            }
            futex::wait(&self.signals, signals, instant_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::clock::monotonic_ns;
    use crate::realtime::clock::Monotonic;
    use crate::realtime::triple_buffer::triple_buffer;
    use std::thread::{scope, sleep, spawn};
    use std::time::Duration;

    /// Much longer than a host takes a processor away \[ns\].
    const PATIENCE_NS: u64 = 2_000_000_000;

    /// Runs a test on a thread that is left behind if a wait in it does not end.
    fn bounded(test: fn()) {
        let limit_ns = monotonic_ns() + 10 * PATIENCE_NS;
        let running = spawn(test);
        while !running.is_finished() {
            assert!(monotonic_ns() < limit_ns, "a wait does not end");
            sleep(Duration::from_millis(1));
        }
        running.join().unwrap();
    }

    #[test]
    fn without_a_signal_the_wait_ends_at_its_instant() {
        bounded(|| {
            let (_writer, mut inputs) = triple_buffer(0);
            let instant_ns = monotonic_ns() + 5_000_000;
            let stop = AtomicBool::new(false);
            let signalled = Event::default().wait(&mut inputs, &mut Monotonic, instant_ns, &stop);
            assert!(!signalled && monotonic_ns() >= instant_ns);
        });
    }

    #[test]
    fn no_signal_is_missed() {
        bounded(answer_every_signal);
    }

    fn answer_every_signal() {
        let (event, answer) = (Event::default(), Event::default());
        let (mut writer, mut inputs) = triple_buffer(0);
        let (mut echo, mut echoed) = triple_buffer(0);
        let stop = AtomicBool::new(false);
        let limit = || monotonic_ns() + PATIENCE_NS;
        scope(|threads| {
            let answering = threads.spawn(|| {
                let mut limit_ns = limit();
                while event.wait(&mut inputs, &mut Monotonic, limit_ns, &stop) {
                    echo.write(*inputs.value());
                    answer.signal();
                    limit_ns = limit();
                }
                monotonic_ns() < limit_ns
            });
            for round in 1..10_000 {
                writer.write(round);
                event.signal();
                let limit_ns = limit();
                let is_answered = answer.wait(&mut echoed, &mut Monotonic, limit_ns, &stop);
                assert!(is_answered && monotonic_ns() < limit_ns, "a signal of round {round} was missed");
                assert_eq!(*echoed.value(), round);
            }
            stop.store(true, Ordering::Relaxed);
            event.signal();
            assert!(answering.join().unwrap(), "the signal for the stop was missed");
        });
    }
}
