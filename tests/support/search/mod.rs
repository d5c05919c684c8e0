//! The search: for messages, requests, rates, machines and worlds with which a [property](property::PROPERTIES) does not hold.
//!
//! A [genome](genome) describes a run of the controller against a platform. Each run is judged by the true motion. A search begins with
//! the worst runs that were ever found, goes on with random ones, and climbs from the worst of each property. What fails is made simple
//! ([`genome::Genome::simple`]) and written to a file that can be replayed.
//!
//! An own search, as libraries for property tests (proptest, bolero) look for a failure but do not climb towards one.

pub mod climb;
pub mod genome;
pub mod machines;
pub mod messages;
pub mod property;
pub mod run;
pub mod scenario;
pub mod stream;
pub mod table;
