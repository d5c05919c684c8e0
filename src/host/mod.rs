//! Everything around the loop: configuration, commands, charts. May use everything.
//!
//! Exit codes of the commands: 0 done, 1 it ran and went wrong (a fault, a row without solution), 2 it
//! could not begin: bad command line, configuration, input or environment.

pub mod advise;
pub mod assembly;
pub mod axis;
pub mod batch;
pub mod charts;
pub mod check;
pub mod config;
pub mod daemon;
pub mod demo;
pub mod doctor;
mod excerpt;
pub mod export;
pub mod faults;
pub mod fidelity;
pub mod files;
pub mod histogram;
mod join;
mod lockstep;
pub mod loops;
pub mod machine_drawing;

mod numbers;
pub mod offline;
pub mod operator;
pub mod plant;
pub mod rehearsal;
pub mod report;
mod rows;
pub mod setpoints;
pub mod stop;
pub mod svg;
pub mod table;
pub mod workspace;
