//! Mathematics of the machine: geometry, kinematics, dynamics. No allocation, no I/O, no clock, no panic.
//!
//! The source is Fried, Djouani, Borojeni and Iqbal, "An Inverse Dynamic Model of the Gough-Stewart
//! Platform", WSEAS Transactions on Systems 7(2), 2008, 88-98; "the paper" everywhere below. If its printed
//! equations contradict each other, the file that implements them says so.
//!
//! | paper | file |
//! | --- | --- |
//! | (1), task coordinates X | [`task`] |
//! | (3)-(5), inverse geometric model | [`inverse_geometry`] |
//! | (6)-(9), inverse Jacobian | [`inverse_jacobian`] |
//! | (2), (13)-(33), (37)-(45), (53), (55)-(87), one leg as a serial robot | [`leg`] without joint coordinates, [`joint_space`] with them |
//! | (88)-(93), mobile platform | [`platform`] |
//! | (94)-(97), active forces | [`active_forces`] |
//! | (10)-(12), (34)-(36), (46)-(52), (54) | no file: their print is not at hand. Rates and accelerations of the joints, which |
//! | | their neighbours need: `tests/support/paper/kinematics.rs` |
//! | not in the paper | [`forward_kinematics`], [`mass_matrix`], [`regressor`], [`fidelity`], [`rigid`], [`sensitivity`], [`kinematic_state`], [`machine`], |
//! | | [`drive_loads`], [`transmission`], [`triples`], [`moving_base`], `conditioning`, `factorization`, `force_changes`, `fused`, `lanes`, `lanes3`, `lu`, |
//! | | `pose_factorization`, `pose_lanes` |
//!
//! # Errata of the print
//!
//! Size: largest error of a force, relative to the largest force of its row, on the states of `tests/data`.
//! `tests/paper` evaluates the paper's dense matrices, measures each error, and lists the illegible parts of
//! the print.
//!
//! | | equation | printed | correct | size |
//! | --- | --- | --- | --- | --- |
//! | 1 | (25), (27), (39) | `v_B = R_b [L', L gamma', -L beta']` with Euler rates | `-L beta' cos(gamma)` | fried2008 4e-2, tsai2000 4e-1 |
//! | 2 | (43), (45), last term | units do not fit | `+ R_b L'~ L~ R_b^T / L^2` on the leg's angular velocity | fried2008 2e-2 for L instead of L^2 |
//! | 3 | (74)-(82), H_1 | legs do not spin | they do, [`leg`] | scattered 1e-2, motion_base 1e-3, fried2008 1e-4 |
//! | 4 | (88), (93) | g with the sign opposite to (74)-(81) | `v' - g` everywhere | fried2008 1.2 |
//! | 5 | (90), (91) | inertia about the centre of mass, moments about C | parallel-axis term, [`platform`] | motion_base 1e-1 |
//! | 6 | (92) | sign of the centrifugal term | `+ m omega x (omega x CG)` | motion_base 7e-2 |
//! | 7 | Table 1 | an inertia that varies with L, as if rigid | `dI/dt omega`, `-1/2 dI/dL omega^2` too | fried2008 7e-3; kept as printed |
//!
//! Frames: base axes unless a name states another frame. `rotation` is R, platform axes expressed in base
//! axes, so `v_base = R v_platform`. Units: SI, radians. Twists and wrenches have the angular part first and
//! refer to the platform origin C.

pub mod active_forces;
pub mod conditioning;
pub mod drive_loads;
mod factorization;
pub mod fidelity;
pub mod force_changes;
pub mod forward_kinematics;
mod fused;
pub mod inverse_geometry;
pub mod inverse_jacobian;
pub mod joint_space;
pub mod kinematic_state;
mod lanes;
mod lanes3;
pub mod leg;
mod lu;
pub mod machine;
pub mod mass_matrix;
pub mod moving_base;
pub mod platform;
mod pose_factorization;
mod pose_lanes;
pub mod random;
pub mod regressor;
pub mod rigid;
pub mod sensitivity;
pub mod task;
pub mod transmission;
pub mod triples;

/// Number of legs.
pub const LEGS: usize = 6;
