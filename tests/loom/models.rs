//! Programs of two threads that loom runs in every order.

use loom::thread;

use crate::clock::Clock;
use crate::event::Event;
use crate::sync::{Arc, AtomicBool, Ordering};
use crate::triple_buffer::triple_buffer;

/// A clock that stands still: no wait ends by its instant.
struct Still;

impl Clock for Still {
    fn now_ns(&mut self) -> u64 {
        0
    }

    fn sleep_until(&mut self, _instant_ns: u64) {}
}

/// Far in the future of [`Still`].
const NEVER_NS: u64 = u64::MAX;

/// What is read was written as a whole, is never older than what was read before, and is the newest in the end.
pub fn newest_value_arrives() {
    const LAST: u32 = 4;
    let (mut writer, mut reader) = triple_buffer([0; 2]);
    let writing = thread::spawn(move || (1..=LAST).for_each(|value| writer.write([value; 2])));
    let mut before = 0;
    for _ in 0..4 {
        let is_new = reader.update();
        let [value, again] = *reader.value();
        assert_eq!(value, again, "torn");
        assert!(value >= before, "{value} after {before}");
        assert_eq!(value > before, is_new, "{value} after {before}");
        before = value;
    }
    writing.join().unwrap();
    assert_eq!(*reader.read(), [LAST; 2]);
    assert!(!reader.update(), "nothing was written since");
}

/// Every input is seen by a thread that sleeps for it, however often that thread woke before.
pub fn no_signal_is_lost() {
    const LAST: u32 = 2;
    let event = Arc::new(Event::default());
    let (mut writer, mut inputs) = triple_buffer(0);
    let writing = {
        let event = event.clone();
        thread::spawn(move || {
            for value in 1..=LAST {
                writer.write(value);
                event.signal();
            }
        })
    };
    let stop = AtomicBool::new(false);
    while *inputs.value() != LAST {
        assert!(
            event.wait(&mut inputs, &mut Still, NEVER_NS, &stop),
            "neither the instant nor a stop has come"
        );
    }
    writing.join().unwrap();
}

/// A request to stop ends the wait, also where it comes together with an input.
pub fn stop_ends_the_wait() {
    let event = Arc::new(Event::default());
    let stop = Arc::new(AtomicBool::new(false));
    let (mut writer, mut inputs) = triple_buffer(0);
    let stopping = {
        let (event, stop) = (event.clone(), stop.clone());
        thread::spawn(move || {
            writer.write(1);
            event.signal();
            stop.store(true, Ordering::Relaxed);
            event.signal();
        })
    };
    while event.wait(&mut inputs, &mut Still, NEVER_NS, &stop) {
        assert_eq!(*inputs.value(), 1);
    }
    stopping.join().unwrap();
}

/// Two threads that answer each other through an event and a buffer each way.
pub fn questions_are_answered() {
    const LAST: u32 = 2;
    let [asked, answered] = [(); 2].map(|()| Arc::new(Event::default()));
    let (mut question, mut questions) = triple_buffer(0);
    let (mut answer, mut answers) = triple_buffer(0);
    let answering = {
        let (asked, answered) = (asked.clone(), answered.clone());
        thread::spawn(move || {
            let stop = AtomicBool::new(false);
            for value in 1..=LAST {
                assert!(asked.wait(&mut questions, &mut Still, NEVER_NS, &stop));
                assert_eq!(*questions.value(), value);
                answer.write(value);
                answered.signal();
            }
        })
    };
    let stop = AtomicBool::new(false);
    for value in 1..=LAST {
        question.write(value);
        asked.signal();
        assert!(answered.wait(&mut answers, &mut Still, NEVER_NS, &stop));
        assert_eq!(*answers.value(), value);
    }
    answering.join().unwrap();
}
