//! Hard real-time computed-torque control of Gough-Stewart platforms.
//!
//! The command `hexad` (see `hexad --help`) is the product; this library is what it is made of.
//!
//! # Map
//!
//! | folder | computes | feature |
//! | --- | --- | --- |
//! | [`model`] | mathematics of the machine: geometry, kinematics, dynamics, fidelity | |
//! | [`control`] | input validation, states, reference, control law, limits: one cycle | |
//! | [`motion`] | trajectories, profiles, built-in motions | |
//! | [`plant`] | simulated platform: forward dynamics, drives, sensors | |
//! | `messages` | message structs and ports: what a driver needs | `client` |
//! | `analysis` | workspace, clearance, fidelity of a motion, loop margins, assembly modes | `daemon` |
//! | `realtime` | threads, clock, cyclic loop, exchange between threads | `daemon` |
//! | `output` | charts, tables, CSV and JSON files | `daemon` |
//! | `config` | machine and deployment files | `daemon` |
//! | `daemon` | the three threads, translation between messages and controller, reports | `daemon` |
//! | `commands` | one file or folder for each command of the command line | `daemon` |
//!
//! A folder uses folders above it in this table and no other; `tests/wall.rs` checks that. `output` stands above
//! `config` and `daemon`, as both write files. The first four neither allocate nor do I/O nor read a clock. Without a
//! feature the crate is these four alone, `no_std`; `client` adds what a driver needs, `daemon` (the default) all else.
//!
//! # Notation, frames, units
//!
//! | symbol | in code | meaning |
//! | --- | --- | --- |
//! | X, X', X'' | [`TaskState`](model::task::TaskState) | Bryan angles alpha, beta, gamma, then x, y, z of C; derivatives |
//! | R, C | [`Pose`](model::rigid::Pose) | platform axes in base axes; platform origin in the base frame |
//! | omega, v | [`Twist`](model::rigid::Twist) | angular velocity and velocity of C, base axes |
//! | `A_i`, `B_i` | [`Joints`](model::machine::Joints) | joint centres on the base and on the platform |
//! | `L_i`, `n_i` | [`inverse_geometry`](model::inverse_geometry) | length and direction of a leg, from base to platform |
//! | N = `J^-T` | [`inverse_jacobian`](model::inverse_jacobian) | leg forces to the wrench about C |
//! | Gamma | [`active_forces`](model::active_forces) | actuator forces; positive pushes the platform away |
//!
//! Everything is in base axes unless it says otherwise; angular parts come first; legs count 1..6 for
//! people and 0..5 in arrays. SI units and radians; names at the edges carry their unit.
#![cfg_attr(not(any(feature = "client", test)), no_std)]

#[cfg(feature = "daemon")]
pub mod analysis;
#[cfg(feature = "daemon")]
pub mod commands;
#[cfg(feature = "daemon")]
pub mod config;
pub mod control;
#[cfg(feature = "daemon")]
pub mod daemon;
#[cfg(feature = "client")]
pub mod messages;
pub mod model;
pub mod motion;
#[cfg(feature = "daemon")]
pub mod output;
pub mod plant;
#[cfg(feature = "daemon")]
pub mod realtime;

/// The driver in the README compiles.
#[cfg(all(doctest, feature = "daemon"))]
#[doc = include_str!("../README.md")]
struct Readme;
