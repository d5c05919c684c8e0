//! Hard real-time computed-torque control of Gough-Stewart platforms.
//!
//! The product is the command `hexad` (see `hexad --help`); this library is its implementation.
//!
//! # Map
//!
//! | crate | folder | computes |
//! | --- | --- | --- |
//! | [`hexad_core`] | [`model`] | mathematics of the machine: geometry, kinematics, dynamics, fidelity |
//! | | [`control`] | input validation, states, reference, control law, limits: one cycle |
//! | | [`motion`] | trajectories, profiles, built-in motions |
//! | | [`plant`] | simulated platform: forward dynamics, drives, sensors |
//! | [`hexad_client`] | [`messages`] | message structs and ports, for drivers |
//! | | [`operator`] | operator requests to the daemons of this host |
//! | | [`realtime`] | threads, clock, cyclic loop, exchange between threads |
//! | [`hexad_machine`] | [`text`] | numbers, tables of text, CSV files |
//! | | [`analysis`] | workspace, clearance, fidelity of a motion, loop margins, assembly modes |
//! | | [`config`] | machine and deployment files |
//! | [`hexad_daemon`] | [`recording`] | every cycle in a file: format, reader, repair |
//! | | [`daemon`] | the threads, translation between messages and controller, reports |
//! | `hexad` | [`output`] | charts and pages |
//! | | [`commands`] | one file or folder for each command of the command line |
//!
//! A folder uses only folders above it in this table; `tests/wall.rs` checks this. The first four neither allocate nor do I/O nor read
//! a clock. This crate names all of them again.
//!
//! The smallest complete use, without a daemon: `examples/controller.rs`.
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
//! Quantities are in base axes unless stated otherwise. Angular parts come first. Legs are numbered 1..6 for
//! people and 0..5 in arrays. Units are SI and radians; names at the interfaces contain their unit.
//!
//! # Glossary
//!
//! | word | meaning |
//! | --- | --- |
//! | active, engaging, parking, stopping, standby, off, fault | states of the controller, see [`control::signals::state`] |
//! | actuator, drive | prismatic joint of a leg with its motor; stroke, rate and force are limited |
//! | ambiguous start | start at rest with leg lengths that another permitted pose has, too, see [`analysis::other_pose_search`] |
//! | approach | motion of the reference to a setpoint or target that is away from it |
//! | assembly mode | one of the up to 40 poses that share the same six leg lengths |
//! | axial, transverse | along a leg; normal to it |
//! | bridge | process that connects a machine with a network: for the daemon a setpoint source, an operator and a reader |
//! | brakes | hold the legs while forces are disabled |
//! | calibration | joints and zeros of the lengths from poses that a tracker has measured, see [`analysis::calibration`] |
//! | clear | operator request that ends a fault, after inspection |
//! | computed torque | control law: inverse dynamics of the desired acceleration plus feedback on the tracking error |
//! | condition | ratio of the largest to the smallest amplification of leg forces, see [`model::sensitivity`] |
//! | confirmation of the legs | what a person has seen: each leg moves by its own number; kept by the daemon, `hexad confirm-legs` |
//! | cycle | one run of the controller, from measurement to force |
//! | demand | accelerations that a task requires in every direction |
//! | deployment | configuration of a running machine: rate, processors, gains, limits, timeouts, topics |
//! | diagnostic | result of a check: code, value, bound, index |
//! | disturbance | acceleration of the platform that the model does not contain: payload, friction, process forces |
//! | driver | process that measures the legs and applies the forces |
//! | engage | operator request to take the platform under control |
//! | envelope | poses of a task, which the reference keeps, with required velocities and accelerations |
//! | estimator | filter that gives error, its rate and the disturbance at the instant at which a force acts |
//! | estop, off | operator requests that disable forces at once; after estop until `clear` |
//! | excitation | periodic motion from which masses, friction and the delay of the drives can be identified |
//! | fault | state without valid forces until an operator clears it |
//! | fidelity | which terms of the dynamics the model evaluates, from `gravity` to `exact`, see [`model::fidelity`] |
//! | fit | shrinking a built-in motion until stroke, rates and forces keep a reserve |
//! | following error | distance of the platform from the reference |
//! | frame | axes with an origin: base, platform, and those named in the machine file, see tool frame and work frame |
//! | hold | constant force or pose between two instants |
//! | home | configured pose from which the machine starts and to which it parks |
//! | in position | the measured pose has been within a tolerance of an unchanged setpoint for the settling time, `[in_position]` |
//! | innovation | measured minus predicted tracking error |
//! | jog | motion by keys or requests, while they arrive |
//! | kinematic state | pose with its leg lengths and the factorization of N, see [`model::kinematic_state`] |
//! | lane | element of a SIMD vector; one leg each |
//! | leg masses | effective mass that each actuator moves at home |
//! | limit | largest velocity, acceleration, jerk, force or condition; a force at its limit is saturated |
//! | lockstep | plant, daemon and setpoint source advance in turn, in simulated time |
//! | margin | distance from a bound: of a leg's length from the ends of its stroke, of a loop from instability |
//! | measurement | leg lengths and rates at an instant, optionally a pose and twist |
//! | operator | person or program that sends requests over the control socket |
//! | overrun | cycle that is not finished at the next release |
//! | park | operator request to move home and disable forces |
//! | plant | simulated platform with drives and sensors, see [`plant`] |
//! | plausibility window | longest time over which lengths and rates of a measurement are compared |
//! | player | setpoint source that plays a motion, `hexad move` |
//! | policy | reaction to a setpoint that the limits do not allow: `stop` or `limit`, `[setpoint] on_violation` |
//! | prefault | touch memory in advance, so that no cycle causes a page fault |
//! | recording | file with every cycle of a run: timing, input, output, see [`recording`] |
//! | reflector, probe | what a tracker sees on the platform: a point, a body with orientation |
//! | reference | motion that the controller tracks; generated from the target, within all limits |
//! | reference generator | moves the reference towards the target, only to states with a verified stop |
//! | regressor | matrix that takes inertial parameters to forces, see [`model::regressor`] |
//! | release | instant at which a cycle begins, on a fixed grid |
//! | repeatability | standard deviation of the poses reached in several visits of one target |
//! | replay | computing the cycles of a recording again, compared bit for bit |
//! | replica | controller that repeats every cycle in the recorder, so that the recorder has its internal state |
//! | reservation | processor time that SCHED_DEADLINE guarantees in each period |
//! | resolution | smallest length and angle of a machine that are worth showing, by the noise of its lengths and its size |
//! | rotation order | order in which the rotations by alpha, beta and gamma are multiplied, see [`motion::rotation_order`] |
//! | sample | pose of a motion at one instant, without derivatives, see [`control::setpoint::pose_samples`] |
//! | saturation | a quantity held at its limit |
//! | setpoint | X, X', X'' that a source requests for an instant; or samples of X, or one X to hold |
//! | shortfall | set-up step that the kernel refused, with reason and remedy |
//! | singular pose, singularity | pose at which the legs cannot hold the platform; det N = 0 |
//! | stamp | CLOCK_MONOTONIC time in a message \[ns\] |
//! | strength | share of the acceleration limits with which the reference moves and stops, where the drives cannot give all |
//! | stroke | range of a leg's length |
//! | target | goal of the reference: the setpoint, or a pose to hold |
//! | timeline | hold, approach, settle, motion, settle |
//! | tool frame | frame fixed in the platform; a tool turns about its origin, see [`motion::frames`] |
//! | tracker | instrument that measures the platform from outside: laser tracker, camera, coordinate measuring machine |
//! | trusted step | change of pose for which Newton's method is proved to find the only solution |
//! | twist, wrench | angular and linear velocity; torque and force; angular part first |
//! | verified stop | motion from the reference to rest, proved to keep every limit over its whole length |
//! | visit | motion to a target of a table, and what was measured there, `hexad goto --table` |
//! | work frame | frame fixed in the base, in which the pose of a tool is given |
#![cfg_attr(not(test), deny(clippy::print_stderr, clippy::print_stdout))] // They panic where a pipe is closed.

pub use hexad_client::{messages, operator, realtime};
pub use hexad_core::{control, model, motion, plant};
pub use hexad_daemon as daemon;
pub use hexad_daemon::recording;
pub use hexad_machine::{analysis, config, log, text};

#[allow(missing_docs, reason = "the command line: its help texts document it")]
pub mod commands;
pub mod output;

/// README with the example driver, compiled as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
