//! Handover of new constants to the real-time thread, which neither allocates nor waits for it.
//!
//! One [`Offer`] is allocated at the start and circulates as a reference. The reload thread fills it. In a cycle without
//! control, the real-time thread exchanges its constants for the offered ones. The log thread returns the offer. So the
//! reload thread drops the old constants, and the log thread receives the number of the first cycle with the new
//! constants before it receives that cycle.
//!
//! ```text
//! reload thread --offers--> real-time thread --answers--> log thread --returned--> reload thread
//! ```

use std::sync::Arc;

use heapless::spsc::{Consumer, Producer, Queue};

use super::Loaded;
use super::io_parameters::{IoParameters, IoParametersInForce};
use hexad_client::operator::protocol::MAX_REQUEST_AGE_NS;
use hexad_core::control::controller::Controller;
use hexad_core::control::signals::state::State;

/// Length of a queue for one offer: a queue holds one element less than its length.
pub const LENGTH: usize = 2;

/// Queue of offers.
pub type OfferQueue<'o> = Queue<&'o mut Offer, LENGTH>;

/// Offer of new constants on their way to the real-time thread, or of the old ones on their way back.
pub struct Offer {
    /// Controller whose constants are exchanged.
    pub controller: Controller,
    /// Parameters of the I/O thread, of the same configuration.
    pub io_parameters: IoParameters,
    /// Configuration of the constants, for the recorder. The real-time thread does not use it.
    pub loaded: Arc<Loaded>,
    /// Instant of the offer \[ns\].
    pub offered_ns: u64,
    /// Answer, written by the real-time thread.
    pub answer: Answer,
}

/// Answer of the real-time thread to an offer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// No answer yet.
    None,
    /// The new constants are in force from this cycle on.
    Taken(u64),
    /// The platform is under control.
    Refused(State),
    /// The offer was too old, because the loop ran no cycle for a long time.
    TooOld,
}

impl Offer {
    /// Offer of the configuration that is in force.
    pub fn new(loaded: Arc<Loaded>) -> Self {
        let (controller, io_parameters) = (loaded.controller.clone(), loaded.io_parameters());
        Self { controller, io_parameters, loaded, offered_ns: 0, answer: Answer::None }
    }

    /// Whether all cycles before the first with the new constants have been received when `cycle` is
    /// received.
    pub fn is_due(&self, cycle: u64) -> bool {
        !matches!(self.answer, Answer::Taken(first) if first > cycle)
    }
}

/// Real-time thread's ends of the queues.
pub struct Handover<'q, 'o> {
    offers: Consumer<'q, &'o mut Offer>,
    answers: Producer<'q, &'o mut Offer>,
    io_parameters: &'q IoParametersInForce,
    /// Number of the cycle.
    cycle: u64,
}

impl<'q, 'o> Handover<'q, 'o> {
    /// Handover before the first cycle. Both queues have the length [`LENGTH`].
    pub fn new(
        offers: Consumer<'q, &'o mut Offer>,
        answers: Producer<'q, &'o mut Offer>,
        io_parameters: &'q IoParametersInForce,
    ) -> Self {
        Self { offers, answers, io_parameters, cycle: 0 }
    }

    /// Accepts or refuses an offer. Call it at the beginning of each cycle, before the controller's step.
    #[inline(never)]
    pub fn answer_offer(&mut self, controller: &mut Controller, woke_ns: u64) {
        self.cycle += 1;
        // Never true, but a queue divides by its length, and at each call the compiler must see that it is
        // not zero.
        if self.offers.capacity() != LENGTH - 1 {
            return;
        }
        let Some(offer) = self.offers.dequeue() else { return };
        let state = controller.state();
        offer.answer = if state.has_control() {
            Answer::Refused(state)
        } else if woke_ns.saturating_sub(offer.offered_ns) > MAX_REQUEST_AGE_NS {
            Answer::TooOld
        } else {
            controller.exchange_configuration(&mut offer.controller);
            self.io_parameters.set(&offer.io_parameters);
            Answer::Taken(self.cycle)
        };
        // There is only one offer, so there is room.
        if self.answers.capacity() == LENGTH - 1 {
            let _ = self.answers.enqueue(offer);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_machine::config::Config;

    #[test]
    fn an_offer_is_taken_while_it_is_fresh() {
        let config = Config::parse(include_str!("../../../config/fried2008.toml"), "a test").unwrap();
        let loaded = Arc::new(Loaded::new(config));
        let mut controller = loaded.controller.clone();
        let io_parameters = IoParametersInForce::new(&loaded.io_parameters());
        let expected = [(MAX_REQUEST_AGE_NS, Answer::Taken(1)), (MAX_REQUEST_AGE_NS + 1, Answer::TooOld)];
        for (age_ns, answer) in expected {
            let mut offer = Offer::new(loaded.clone());
            offer.offered_ns = 1_000;
            let (mut offers, mut answers) = (OfferQueue::new(), OfferQueue::new());
            let ((mut offered, offers), (answers, mut answered)) = (offers.split(), answers.split());
            assert!(offered.enqueue(&mut offer).is_ok());
            Handover::new(offers, answers, &io_parameters).answer_offer(&mut controller, 1_000 + age_ns);
            let found = answered.dequeue().map(|offer| offer.answer);
            assert_eq!(found, Some(answer), "{age_ns} ns after the offer");
        }
    }
}
