//! Hard real-time computed-torque control of Gough-Stewart platforms.
//!
//! The command `hexad` (see `hexad --help`) is the product; this library is what it is made of.
//!
//! # Map
//!
//! ```text
//! model     mathematics of the machine           uses nothing
//! control   control law, limits, one cycle       uses model
//! plant     simulated platform                   uses model
//! scene     motions, and the model they need     uses model
//! ipc       messages, ports, exchange            uses control, model, parts of realtime
//! realtime  threads, clock, cyclic loop          uses control, ipc::exchange
//! host      configuration, commands, charts      uses everything
//! ```
//!
//! `model`, `control`, `plant` and `scene` do not allocate, do no I/O and read no clock. The root of the
//! crate is `no_std` and only files of the other folders say `extern crate std`, so the compiler enforces
//! it; `tests/wall.rs` checks the arrows above.
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
#![no_std]

pub mod control;
pub mod host;
pub mod ipc;
pub mod model;
pub mod plant;
pub mod realtime;
pub mod scene;

/// The driver in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
