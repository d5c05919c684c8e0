//! The mathematics of hexad: machine, controller, motions, simulated plant.
//!
//! Nothing here allocates, does I/O or reads a clock, and nothing in the cycle can panic. Glossary and notation are in the
//! documentation of the crate `hexad`.
//!
//! | folder | computes |
//! | --- | --- |
//! | [`model`] | mathematics of the machine: geometry, kinematics, dynamics, fidelity |
//! | [`control`] | input validation, states, reference, control law, limits: one cycle |
//! | [`motion`] | trajectories, profiles, built-in motions |
//! | [`plant`] | simulated platform: forward dynamics, drives, sensors |
//!
//! Without the feature `std` the crate needs neither an operating system nor an allocator.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

pub mod control;
pub mod model;
pub mod motion;
mod named;
pub mod plant;
