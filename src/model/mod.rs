//! Mathematics of the machine. No allocation, no I/O, no clock, no panic.
//!
//! The source is Fried, Djouani, Borojeni and Iqbal, "An Inverse Dynamic Model of the Gough-Stewart
//! Platform", WSEAS Transactions on Systems 7(2), 2008, 88-98; "the paper" everywhere below. Where its
//! printed equations disagree with each other, the file that implements them says so.
//!
//! | paper | file |
//! | --- | --- |
//! | (1), task coordinates X | [`task`] |
//! | (3)-(5), inverse geometric model | [`inverse_geometry`] |
//! | (6)-(9), inverse Jacobian | [`inverse_jacobian`] |
//! | (13)-(33), (53), (73)-(87), one leg as a serial robot | [`leg`] |
//! | (88)-(93), mobile platform | [`platform`] |
//! | (94)-(97), active forces | [`active_forces`] |
//! | not in the paper | [`forward_kinematics`], [`mass_matrix`], [`regressor`], [`ladder`], [`rigid`], [`lanes`], [`machine`] |
//!
//! Frames: base axes unless a name says otherwise. `rotation` is R, platform axes expressed in base axes,
//! so `v_base = R v_platform`. Units: SI, radians. Twists and wrenches have the angular part first and
//! refer to the platform origin C.

pub mod active_forces;
mod balance;
pub mod forward_kinematics;
pub mod inverse_geometry;
pub mod inverse_jacobian;
pub mod ladder;
pub mod lanes;
pub mod leg;
pub mod machine;
pub mod mass_matrix;
pub mod platform;
pub mod regressor;
pub mod rigid;
pub mod task;
