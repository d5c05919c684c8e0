//! Senders with another schema, clock or type: named at once, once, with the cure, in log and status.

use std::thread::{scope, sleep};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, MeasuredMessage, Message};

use crate::support::forged::{measured, other_type};
use crate::support::machine::Machine;
use crate::support::socket::status;
use crate::support::trio::start_daemon;

/// Messages sent: about a second.
const MESSAGES: u32 = 1000;

/// What is done to a measured message.
type Change = fn(&mut MeasuredMessage);

/// The clock that counts from 1970.
fn other_clock_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as u64
}

/// Sends messages with a mistake to a daemon; these words must be in its log, once, and in the status.
fn named(change: Change, words: &str) {
    measured::CHANGE.set(change);
    let machine = Machine::patient("wrong-sender");
    let daemon = start_daemon(&machine);
    let bus = Bus::join(&machine.name).expect("to join");
    let mut driver = bus.publisher::<measured::Forged>().expect("to publish");
    let mut shown = String::new();
    for k in 0..MESSAGES {
        driver.publish(monotonic_ns(), measured::Forged::default()).expect("to send");
        sleep(Duration::from_millis(1));
        if k == MESSAGES / 2 {
            shown = status(&machine).to_string();
        }
    }
    assert!(shown.contains(words), "{shown}");
    daemon.says(words);
    let log = daemon.stops();
    assert_eq!(log.matches(words).count(), 1, "{log}");
}

#[test]
#[apply(beside_others)]
fn a_driver_with_another_schema_or_clock_is_named() {
    let expected = MeasuredMessage::SCHEMA;
    let schema = format!("messages have schema {}, must be {expected}; build the sender", expected + 7);
    let cases: [(Change, &str); 3] = [
        (|message| message.header.schema += 7, &schema),
        (
            |MeasuredMessage { header, .. }| {
                (header.epoch, header.time_ns) = (other_clock_ns(), other_clock_ns())
            },
            "must not be in the future; epoch and time_ns are CLOCK_MONOTONIC",
        ),
        (
            |message| message.header.time_ns = other_clock_ns(),
            "stamp with the CLOCK_MONOTONIC instant of sampling",
        ),
    ];
    scope(|threads| {
        for (change, words) in cases {
            threads.spawn(move || named(change, words));
        }
    });
}

#[test]
#[apply(beside_others)]
fn a_participant_with_another_type_is_named_in_either_order() {
    const WORDS: &str = "another participant has declared the topic with another type";
    let machine = Machine::patient("other-type");
    let bus = Bus::join(&machine.name).expect("to join");
    let first = bus.publisher::<other_type::Forged>().expect("to publish");
    let stderr = start_daemon(&machine).ends().fails(1, WORDS);
    assert!(stderr.contains("IncompatibleTypes"), "{stderr}");
    drop(first);
    drop(bus);

    let daemon = start_daemon(&machine);
    let bus = Bus::join(&machine.name).expect("to join");
    let refusal = bus.publisher::<other_type::Forged>().err().expect("a refusal").to_string();
    assert!(refusal.contains(WORDS), "{refusal}");
    daemon.stops();
}
