//! The machine: its files, and what follows from them.
//!
//! | folder | contains |
//! | --- | --- |
//! | [`text`] | numbers with units, tables of text, CSV files, files that are written whole |
//! | [`analysis`] | workspace, clearance, fidelity of a motion, loop margins, assembly modes, identification |
//! | [`config`] | machine and deployment files |
//! | [`log`] | the log of a program |
#![cfg_attr(not(test), deny(clippy::print_stderr, clippy::print_stdout))] // They panic where a pipe is closed.

pub mod analysis;
pub mod config;
pub mod log;
pub mod text;
