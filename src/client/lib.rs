//! What a driver, a setpoint source, a panel or a bridge of hexad needs.
//!
//! | folder | contains |
//! | --- | --- |
//! | [`messages`] | message structs and ports |
//! | [`operator`] | operator requests to the daemons of this host |
//! | [`realtime`] | threads, clock, cyclic loop, exchange between threads |
//!
//! The cyclic loop is here because it is generic: it knows no message and no controller, and a driver may run in it as well.
#![cfg_attr(not(test), deny(clippy::print_stderr, clippy::print_stdout))] // They panic where a pipe is closed.

pub mod messages;
pub mod operator;
pub mod realtime;
