//! Building blocks of the exchange between threads.
//!
//! [`triple_buffer`](super::triple_buffer) and [`event`](super::event) take them from here only: `tests/loom`
//! compiles both with a model checker's in their place.

pub use core::cell::UnsafeCell;
pub use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
pub use std::sync::Arc;
