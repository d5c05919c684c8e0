//! Triple buffer: hands the newest value of one thread to another, wait-free on both sides.
//!
//! Of three slots one belongs to the writer, one to the reader, and one lies between them. After writing, the
//! writer swaps its slot for the one between; to read, the reader does the same if what lies there is fresh.
//! Neither ever waits, and neither touches a slot that is not its own. `tests/loom` checks this in every order in
//! which the two threads can run.
//!
//! Packages do the same (`triple_buffer`), but they find a slot by an index that the compiler cannot
//! bound, so that a panic stays in the loop. Here every number means a slot.

use super::sync::{Arc, AtomicU8, Ordering, UnsafeCell};

/// Bits of the number of a slot.
const NUMBER: u8 = 0b011;

/// Set beside the number of the slot between while nobody has read it.
const FRESH: u8 = 0b100;

/// The writing end.
pub struct Writer<T> {
    shared: Arc<Shared<T>>,
    /// Number of the slot that is the writer's own.
    own: u8,
}

/// The reading end.
pub struct Reader<T> {
    shared: Arc<Shared<T>>,
    /// Number of the slot that is the reader's own.
    own: u8,
}

struct Shared<T> {
    slots: [Slot<T>; 3],
    /// Number of the slot between, and whether it is fresh.
    between: AtomicU8,
}

/// On cache lines of its own (two, because processors fetch them in pairs): writing one slot does not slow
/// down reading another.
#[repr(align(128))]
struct Slot<T>(UnsafeCell<T>);

// SAFETY: the ends hand values from thread to thread, which `Send` allows. No slot is ever shared: its
// number is in exactly one place of three (the writer, the reader, between), and only swaps move it.
unsafe impl<T: Send> Sync for Shared<T> {}

/// Returns both ends; until something is written the reader finds `initial`. Allocates; start-up only.
pub fn triple_buffer<T: Copy>(initial: T) -> (Writer<T>, Reader<T>) {
    let slots = [initial; 3].map(|value| Slot(UnsafeCell::new(value)));
    let shared = Arc::new(Shared { slots, between: AtomicU8::new(1) });
    (Writer { shared: shared.clone(), own: 0 }, Reader { shared, own: 2 })
}

impl<T: Copy> Writer<T> {
    /// Replaces what was written before, read or not.
    pub fn write(&mut self, value: T) {
        // SAFETY: the slot is the writer's own, and `&mut self` makes this its only use.
        unsafe { self.shared.slot(self.own).write(value) };
        // Release what was written; acquire the slot received, which the reader may have just left.
        self.own = self.shared.between.swap(self.own | FRESH, Ordering::AcqRel) & NUMBER;
    }
}

impl<T: Copy> Reader<T> {
    /// Fetches the newest value; false if that has been done.
    pub fn update(&mut self) -> bool {
        // Only the reader takes the mark away, so the swap cannot find it gone.
        let fresh = self.shared.between.load(Ordering::Relaxed) & FRESH != 0;
        if fresh {
            self.own = self.shared.between.swap(self.own, Ordering::AcqRel) & NUMBER;
        }
        fresh
    }

    /// What was fetched last.
    pub fn value(&self) -> &T {
        // SAFETY: the slot is the reader's own until the next `update`, which the borrow of `self` prevents.
        unsafe { &*self.shared.slot(self.own) }
    }

    /// The newest value.
    pub fn read(&mut self) -> &T {
        self.update();
        self.value()
    }
}

impl<T> Shared<T> {
    fn slot(&self, number: u8) -> *mut T {
        let [first, second, third] = &self.slots;
        let slot = match number {
            0 => first,
            1 => second,
            _ => third,
        };
        slot.0.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_counts_and_stays() {
        let (mut writer, mut reader) = triple_buffer(0);
        assert_eq!((*reader.read(), *reader.read()), (0, 0));
        writer.write(1);
        assert_eq!((*reader.read(), *reader.read()), (1, 1));
        (2..9).for_each(|value| writer.write(value));
        assert_eq!((*reader.read(), *reader.read()), (8, 8));
    }
}
