//! Types that the stages of a cycle pass to each other. They import no stage.

pub mod diagnostic;
pub mod errors;
pub mod inputs;
pub mod limits;
pub mod pair;
pub mod state;
pub mod time;
