//! Request word: one atomic number by which a request reaches the real-time thread without a queue.
//!
//! The thread loads the word in every cycle and writes nothing. A request with a larger number has precedence: it
//! replaces another that was not seen yet, and is never replaced by one of lower precedence.
//!
//! | bits | content |
//! | --- | --- |
//! | 63 | 1 if the request names a cycle in simulated time |
//! | 60 to 62 | number of the request, 0 for none |
//! | 52 to 59 | ticket: distinguishes requests of the same microsecond |
//! | 0 to 51 | instant \[us\], for 142 years: CLOCK_MONOTONIC of the request, or the cycle before which it is not obeyed |

use core::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};

const TIME_BITS: u32 = 52;
const NUMBER_SHIFT: u32 = 60;
const NUMBER_BITS: u32 = 3;
const TIME_MASK: u64 = (1 << TIME_BITS) - 1;
const NUMBER_MASK: u64 = (1 << NUMBER_BITS) - 1;
const CYCLE_BIT: u64 = 1 << (NUMBER_SHIFT + NUMBER_BITS);

/// Word that requests are posted to and the real-time thread loads.
#[derive(Debug, Default)]
pub struct RequestWord {
    word: AtomicU64,
    /// The last word that the real-time thread has certainly loaded.
    seen: AtomicU64,
    ticket: AtomicU8,
    /// How often each request was posted, by its number.
    posts: [AtomicU32; 1 << NUMBER_BITS],
}

/// Number of the request in a word; 0 for none.
pub fn number(word: u64) -> u32 {
    (word >> NUMBER_SHIFT & NUMBER_MASK) as u32
}

/// Instant of a word \[ns\], to the microsecond: of the request, CLOCK_MONOTONIC, or of the cycle that it names.
pub fn time_ns(word: u64) -> u64 {
    (word & TIME_MASK) * 1000
}

/// Instant of the cycle that a word names, if it names one \[ns\].
pub fn cycle_ns(word: u64) -> Option<u64> {
    (word & CYCLE_BIT != 0).then(|| time_ns(word))
}

impl RequestWord {
    /// The word as it is now.
    pub fn load(&self) -> u64 {
        self.word.load(Ordering::Acquire)
    }

    /// Records a word that the real-time thread has seen, by what it answered.
    pub fn set_seen(&self, word: u64) {
        self.seen.store(word, Ordering::Release);
    }

    /// Posts a request. Only atomic operations: signal handlers call it.
    ///
    /// Returns the word to wait for: the new one, or the present one if the same request is waiting already. `None` if a
    /// request of higher precedence waits.
    pub fn post(&self, request: u32, now_ns: u64) -> Option<u64> {
        self.count(request);
        self.post_if(self.new_word(request, now_ns), || true)
    }

    /// Posts a request, for a cycle in simulated time if it names one, unless `is_overruled`, which compares [`Self::posts_of_higher_precedence`].
    /// A stop that is counted before the word is exchanged prevents it.
    pub fn post_unless(
        &self,
        request: u32,
        now_ns: u64,
        cycle_ns: Option<u64>,
        is_overruled: impl Fn() -> bool,
    ) -> Option<u64> {
        let of_cycle = |cycle_ns| self.new_word(request, cycle_ns) | CYCLE_BIT;
        let new = cycle_ns.map_or_else(|| self.new_word(request, now_ns), of_cycle);
        self.post_if(new, || !is_overruled()).inspect(|_| self.count(request))
    }

    fn count(&self, request: u32) {
        if let Some(posts) = self.posts.get(request as usize) {
            posts.fetch_add(1, Ordering::SeqCst);
        }
    }

    fn post_if(&self, new: u64, counts: impl Fn() -> bool) -> Option<u64> {
        let request = number(new);
        let mut current = self.load();
        loop {
            let waiting = if current == self.seen.load(Ordering::Acquire) { 0 } else { number(current) };
            // After the loads. A stop that is counted after this changes the word after that, and the exchange fails.
            if !counts() {
                return None;
            }
            if waiting == request && cycle_ns(current) == cycle_ns(new) {
                return Some(current);
            }
            if waiting > request {
                return None;
            }
            match self.word.compare_exchange_weak(current, new, Ordering::SeqCst, Ordering::SeqCst) {
                Ok(_) => return Some(new),
                Err(other) => current = other,
            }
        }
    }

    /// How many requests of higher precedence than this one were posted since the start, modulo 2^32.
    pub fn posts_of_higher_precedence(&self, request: u32) -> u32 {
        let above = self.posts.iter().skip(request as usize + 1);
        above.fold(0, |sum, posts| sum.wrapping_add(posts.load(Ordering::SeqCst)))
    }

    /// Removes a word that was not seen; without effect if another has replaced it.
    pub fn withdraw(&self, word: u64) {
        let _ = self.word.compare_exchange(word, 0, Ordering::AcqRel, Ordering::Acquire);
    }

    fn new_word(&self, request: u32, now_ns: u64) -> u64 {
        let ticket = u64::from(self.ticket.fetch_add(1, Ordering::Relaxed));
        u64::from(request) << NUMBER_SHIFT | ticket << TIME_BITS | ((now_ns / 1000) & TIME_MASK)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STOP: u32 = 4;
    const ESTOP: u32 = 6;

    #[test]
    fn a_word_contains_request_and_instant() {
        let word = RequestWord::default();
        let posted = word.post(ESTOP, 123_456_789_999).unwrap();
        assert_eq!((number(posted), time_ns(posted), word.load()), (ESTOP, 123_456_789_000, posted));
    }

    #[test]
    fn a_word_of_a_cycle_is_not_shared_with_one_of_now_or_of_another_cycle() {
        let word = RequestWord::default();
        let posted = [Some(7_000), None, Some(7_000), Some(8_000)]
            .map(|cycle_ns| word.post_unless(1, 123_000, cycle_ns, || false).unwrap());
        assert_eq!(posted.map(cycle_ns), [Some(7_000), None, Some(7_000), Some(8_000)]);
        assert_eq!(posted.map(number), [1; 4]);
        assert_eq!(word.post_unless(1, 124_000, Some(8_000), || false), Some(posted[3]), "the same request");
        assert_eq!(word.load(), posted[3]);
    }

    #[test]
    fn higher_precedence_replaces_lower_and_is_not_replaced_until_seen() {
        let word = RequestWord::default();
        let engage = word.post(1, 1000).unwrap();
        assert_eq!(word.post(1, 2000), Some(engage), "the same request is shared");
        let stop = word.post(STOP, 3000).unwrap();
        assert_ne!(stop, engage);
        assert_eq!((word.post(1, 4000), word.load()), (None, stop), "a stop waits");
        let estop = word.post(ESTOP, 5000).unwrap();
        word.set_seen(stop);
        assert_eq!((word.post(STOP, 6000), word.load()), (None, estop));
        word.set_seen(estop);
        assert_eq!([1, STOP, ESTOP].map(|request| word.posts_of_higher_precedence(request)), [3, 1, 0]);
        let again = word.post(1, 7000).unwrap();
        assert_eq!((word.load(), number(again)), (again, 1));
    }

    #[test]
    fn only_the_own_word_is_withdrawn() {
        let word = RequestWord::default();
        let engage = word.post(1, 1000).unwrap();
        let estop = word.post(ESTOP, 2000).unwrap();
        word.withdraw(engage);
        assert_eq!(word.load(), estop);
        word.withdraw(estop);
        assert_eq!(word.load(), 0);
    }
}
