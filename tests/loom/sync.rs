//! In place of `src/client/realtime/sync.rs`: what loom observes, and what a [`Flaw`] may weaken.

pub use loom::sync::atomic::{AtomicBool, Ordering};
pub use std::sync::Arc;

use crate::flaw::{Flaw, weakened};
use loom::cell;
use loom::sync::atomic;

/// Cell in which every access excludes all others, reading as well: no slot of a triple buffer is ever shared.
pub struct UnsafeCell<T>(cell::UnsafeCell<T>);

impl<T> UnsafeCell<T> {
    pub fn new(value: T) -> Self {
        Self(cell::UnsafeCell::new(value))
    }

    pub fn get(&self) -> *mut T {
        self.0.with_mut(|value| value)
    }
}

/// The number of the slot between.
pub struct AtomicU8(atomic::AtomicU8);

impl AtomicU8 {
    pub fn new(value: u8) -> Self {
        Self(atomic::AtomicU8::new(value))
    }

    pub fn load(&self, order: Ordering) -> u8 {
        self.0.load(order)
    }

    pub fn swap(&self, value: u8, order: Ordering) -> u8 {
        let order = weakened(order, Flaw::SwapWithoutRelease, Ordering::Acquire);
        self.0.swap(value, weakened(order, Flaw::SwapWithoutAcquire, Ordering::Release))
    }
}

/// The count of signals.
#[derive(Debug, Default)]
pub struct AtomicU32(atomic::AtomicU32);

impl AtomicU32 {
    pub fn load(&self, order: Ordering) -> u32 {
        self.0.load(weakened(order, Flaw::WaitWithoutAcquire, Ordering::Relaxed))
    }

    pub fn fetch_add(&self, value: u32, order: Ordering) -> u32 {
        self.0.fetch_add(value, weakened(order, Flaw::SignalWithoutRelease, Ordering::Relaxed))
    }
}
