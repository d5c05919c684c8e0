//! From the error to six forces.
//!
//! | what | file |
//! | --- | --- |
//! | error against the reference, its estimate | `error_tracker`, [`estimator`] |
//! | acceleration by feedback | `feedback_law`, with [`gains`], [`leg_masses`], [`input_matrix`] and `mode` |
//! | bound on feedback | `feedback_limiter` |
//! | forces, and their limits | `forces`, `force_limits` |
//! | all of it in a cycle | `actuation` |

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
