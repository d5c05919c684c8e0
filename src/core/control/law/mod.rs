//! Control law: from the tracking error to the six actuator forces.
//!
//! | stage | file |
//! | --- | --- |
//! | tracking error against the reference, and its estimate | `error_tracker`, [`estimator`] |
//! | feedback acceleration | `feedback_law`, with [`gains`], [`leg_masses`], [`input_matrix`] and `mode` |
//! | bound on feedback | `feedback_limiter` |
//! | forces and their limits | `forces`, `force_limits` |
//! | sequence of the stages in one cycle | `actuation` |

pub(super) mod actuation;
pub(super) mod error_tracker;
pub mod estimator;
mod feedback_law;
pub(super) mod feedback_limiter;
pub(super) mod force_limits;
pub(super) mod forces;
pub mod gains;
pub mod input_matrix;
pub mod leg_masses;
mod mode;

pub use self::feedback_law::Law;
pub use self::mode::ControlMode;
