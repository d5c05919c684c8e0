//! The paper's own form: dense global matrices and explicit leg angles, with its printed terms and the right ones.

pub mod dense;
pub mod force;
pub mod form;
pub mod kinematics;
pub mod machine;
