//! Waiting for an instant: by sleep, or by sleep and a spin at the end.
//!
//! A sleeping thread wakes some tens of microseconds late. A thread that wakes a lead earlier and spins is
//! on time within a fraction of a microsecond, at the cost of the lead in processor time. The lead
//! follows the measured wake-up latency: up at once, down slowly. It never exceeds its bound, so the thread never spins
//! for a whole period, and Linux's real-time throttle (950 ms of each second) never applies.

use super::clock::Clock;

/// Time constant of the decay of the lead \[cycles\]: about the 99.9th percentile remains covered.
const LATENCY_MEMORY_CYCLES: u64 = 1024;

/// Time from the end of a sleep to the first reading of the clock, and between readings \[ns\].
const WAKE_MARGIN_NS: u64 = 1_000;

/// Waiter with an adaptive lead.
#[derive(Clone, Copy, Debug)]
pub struct Waiter {
    lead_ns: u64,
    max_lead_ns: u64,
}

impl Waiter {
    /// Spins at most `max_lead_ns` before an instant; 0 only sleeps.
    pub fn new(max_lead_ns: u64) -> Self {
        Self { lead_ns: max_lead_ns, max_lead_ns }
    }

    /// Waits until `instant_ns` and returns the present instant: that one or later.
    pub fn until(&mut self, clock: &mut impl Clock, instant_ns: u64) -> u64 {
        let wake_ns = instant_ns.saturating_sub(self.lead_ns);
        let mut now_ns = clock.now_ns();
        if now_ns < wake_ns {
            clock.sleep_until(wake_ns);
            now_ns = clock.now_ns();
            self.adapt(now_ns.saturating_sub(wake_ns));
        }
        while now_ns < instant_ns {
            core::hint::spin_loop();
            now_ns = clock.now_ns();
        }
        now_ns
    }

    /// The present lead \[ns\].
    pub fn lead_ns(&self) -> u64 {
        self.lead_ns
    }

    fn adapt(&mut self, latency_ns: u64) {
        let needed_ns = latency_ns + WAKE_MARGIN_NS;
        if needed_ns > self.max_lead_ns {
            // No lead within the bound covers this latency, so it does not change the lead.
            return;
        }
        let forgotten_ns =
            self.lead_ns - self.lead_ns.saturating_sub(needed_ns).div_ceil(LATENCY_MEMORY_CYCLES);
        self.lead_ns = forgotten_ns.max(needed_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bound of the leads here.
    const MAX_LEAD_NS: u64 = 200_000;

    /// What a look at the clock costs, and with it a turn of the spin.
    const LOOK_NS: u64 = 100;

    const PERIOD_NS: u64 = 1_000_000;

    /// A clock whose sleeps end late by a fixed time. More looks than fit into a lead, and sleeps for more than a
    /// period, fail at once.
    struct Late {
        now_ns: u64,
        latency_ns: u64,
        slept_ns: u64,
        /// Since the last sleep.
        looks: u64,
    }

    impl Late {
        fn new(now_ns: u64) -> Self {
            Self { now_ns, latency_ns: 50_000, slept_ns: 0, looks: 0 }
        }
    }

    impl Clock for Late {
        fn now_ns(&mut self) -> u64 {
            self.now_ns += LOOK_NS;
            self.looks += 1;
            assert!(self.looks <= MAX_LEAD_NS / LOOK_NS + 2, "{} looks without a sleep", self.looks);
            self.now_ns
        }

        fn sleep_until(&mut self, instant_ns: u64) {
            assert!(instant_ns <= self.now_ns + PERIOD_NS, "{}: asleep until {instant_ns}", self.now_ns);
            let end_ns = self.now_ns.max(instant_ns + self.latency_ns);
            self.slept_ns += end_ns - self.now_ns;
            self.looks = 0;
            self.now_ns = end_ns;
        }
    }

    fn lateness(waiter: &mut Waiter, clock: &mut Late, cycles: u64) -> u64 {
        let wait = |k| {
            let instant_ns = PERIOD_NS * (clock.now_ns / PERIOD_NS + 1) + k % 2;
            waiter.until(clock, instant_ns) - instant_ns
        };
        (0..cycles).map(wait).max().unwrap()
    }

    #[test]
    fn without_a_lead_the_latency_of_the_sleep_is_there() {
        let mut clock = Late::new(0);
        assert!((50_000..=50_000 + LOOK_NS).contains(&lateness(&mut Waiter::new(0), &mut clock, 100)));
    }

    #[test]
    fn with_a_lead_it_is_hidden_and_the_spin_shrinks_to_what_is_needed() {
        let mut clock = Late::new(0);
        let mut waiter = Waiter::new(MAX_LEAD_NS);
        assert!(lateness(&mut waiter, &mut clock, 20_000) <= LOOK_NS);
        assert!((51_000..52_000).contains(&waiter.lead_ns()), "{waiter:?}");
        clock.latency_ns = 90_000;
        assert!(lateness(&mut waiter, &mut clock, 1) > 30_000, "the first one cannot be known");
        assert!(lateness(&mut waiter, &mut clock, 100) <= LOOK_NS);
        clock.latency_ns = 10_000;
        assert!(lateness(&mut waiter, &mut clock, 1) <= LOOK_NS);
        assert!(waiter.lead_ns() > 90_000, "down slowly: {waiter:?}");
        assert!(lateness(&mut waiter, &mut clock, 10_000) <= LOOK_NS);
        assert!((11_000..12_000).contains(&waiter.lead_ns()), "{waiter:?}");
    }

    #[test]
    fn a_pause_of_the_host_does_not_raise_the_lead_and_no_latency_raises_it_over_its_bound() {
        let mut clock = Late::new(0);
        let mut waiter = Waiter::new(MAX_LEAD_NS);
        lateness(&mut waiter, &mut clock, 20_000);
        let before_ns = waiter.lead_ns();
        for latency_ns in [7_000_000, 199_000, 250_000] {
            clock.latency_ns = latency_ns;
            lateness(&mut waiter, &mut clock, 1);
            assert_eq!(waiter.lead_ns(), before_ns);
        }
        clock.latency_ns = 199_000 - LOOK_NS;
        lateness(&mut waiter, &mut clock, 10);
        assert_eq!(waiter.lead_ns(), 200_000);
    }

    #[test]
    fn an_instant_that_has_passed_is_not_slept_for_and_teaches_nothing() {
        let mut clock = Late::new(5_000_000);
        let mut waiter = Waiter::new(MAX_LEAD_NS);
        assert_eq!(waiter.until(&mut clock, 4_000_000), 5_000_000 + LOOK_NS);
        assert_eq!((clock.slept_ns, waiter.lead_ns()), (0, 200_000));
    }
}
