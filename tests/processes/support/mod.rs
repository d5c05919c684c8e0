//! What the tests share.

pub mod background;
pub mod button;
pub mod children;
pub mod disturbance;
pub mod forged;
pub mod host;
pub mod machine;
pub mod nobody;
pub mod operator;
pub mod peer;
pub mod random;
pub mod recorder;
pub mod rules;
pub mod socket;
pub mod steps;
pub mod threads;
pub mod trio;
#[macro_use]
pub mod turns;
pub mod witness;
pub mod xml;
