//! Senders with another schema, clock or type: named at once, once, with the cure, in log and status.

use std::cell::Cell;
use std::thread::sleep;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, Header, MeasuredMessage, Message};
use iceoryx2::prelude::ZeroCopySend;

use crate::support::children::HANG;
use crate::support::machine::Machine;
use crate::support::socket::status;
use crate::support::trio::start_daemon;
use crate::support::turns;

/// Messages sent: about a second.
const MESSAGES: u32 = 1000;

/// What is done to the header of a message before it is sent.
type Change = fn(&mut Header);

thread_local! {
    static CHANGE: Cell<Change> = const { Cell::new(|_| {}) };
}

/// On the bus it is a measured message.
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("hexad_measured")]
#[repr(C)]
struct Wrong(MeasuredMessage);

impl Message for Wrong {
    const TOPIC: &'static str = MeasuredMessage::TOPIC;
    const SCHEMA: u32 = MeasuredMessage::SCHEMA;
    fn header(&self) -> &Header {
        self.0.header()
    }
    fn header_mut(&mut self) -> &mut Header {
        self.0.header_mut()
    }
    fn seal(&mut self) {
        CHANGE.get()(self.0.header_mut());
    }
}

/// The clock that counts from 1970.
fn other_clock_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as u64
}

/// Sends messages with a mistake to a daemon; these words must be in its log, once, and in the status.
fn named(test: &str, change: Change, words: &str) {
    let _turn = turns::beside_others();
    CHANGE.set(change);
    let machine = Machine::patient(test);
    let daemon = start_daemon(&machine);
    let bus = Bus::join(&machine.name).expect("to join");
    let mut driver = bus.publisher::<Wrong>().expect("to publish");
    let mut shown = String::new();
    for k in 0..MESSAGES {
        driver.publish(monotonic_ns(), Wrong::default()).expect("to send");
        sleep(Duration::from_millis(1));
        if k == MESSAGES / 2 {
            shown = status(&machine).to_string();
        }
    }
    assert!(shown.contains(words), "{shown}");
    daemon.says(words);
    let log = daemon.stops_on("TERM", HANG).stderr;
    assert_eq!(log.matches(words).count(), 1, "{log}");
}

#[test]
fn a_driver_with_another_schema_is_named() {
    let expected = MeasuredMessage::SCHEMA;
    let words = format!("messages have schema {}, must be {expected}; build the sender", expected + 7);
    named("other-schema", |header| header.schema += 7, &words);
}

#[test]
fn a_driver_with_another_clock_is_named() {
    let of_life = |header: &mut Header| (header.epoch, header.time_ns) = (other_clock_ns(), other_clock_ns());
    named("other-clock", of_life, "must not be in the future; epoch and time_ns are CLOCK_MONOTONIC");
    let of_stamps = |header: &mut Header| header.time_ns = other_clock_ns();
    named("other-stamps", of_stamps, "stamp with the CLOCK_MONOTONIC instant of sampling");
}

/// Not a message of hexad.
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("my_measured")]
#[repr(C)]
struct OtherType(MeasuredMessage);

impl Message for OtherType {
    const TOPIC: &'static str = MeasuredMessage::TOPIC;
    const SCHEMA: u32 = MeasuredMessage::SCHEMA;
    fn header(&self) -> &Header {
        self.0.header()
    }
    fn header_mut(&mut self) -> &mut Header {
        self.0.header_mut()
    }
}

#[test]
fn a_participant_with_another_type_is_named_in_either_order() {
    let _turn = turns::beside_others();
    const WORDS: &str = "another participant has declared the topic with another type";
    let machine = Machine::patient("other-type");
    let bus = Bus::join(&machine.name).expect("to join");
    let first = bus.publisher::<OtherType>().expect("to publish");
    let ended = crate::support::children::run(
        &machine,
        &["run".as_ref(), "--config".as_ref(), machine.file.as_os_str()],
    );
    assert_eq!(ended.status.code(), Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains(WORDS) && ended.stderr.contains("IncompatibleTypes"), "{}", ended.stderr);
    drop(first);
    drop(bus);

    let daemon = start_daemon(&machine);
    daemon.says("running");
    let bus = Bus::join(&machine.name).expect("to join");
    let refusal = bus.publisher::<OtherType>().err().expect("a refusal").to_string();
    assert!(refusal.contains(WORDS), "{refusal}");
    daemon.stops_on("TERM", HANG);
}
