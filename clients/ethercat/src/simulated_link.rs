//! Interface with the simulated segment behind it, in simulated time: deterministic, without sockets.

use std::collections::VecDeque;

use crate::link::{Link, MAX_FRAME};
use crate::segment::Segment;
use crate::timer;

/// From the main device to the devices, and back \[ns\].
const ONE_WAY_NS: u64 = 20_000;
/// Frames on the cable at once.
const MAX_FRAMES: usize = 8;

struct Frame {
    sent_ns: u64,
    has_passed: bool,
    length: usize,
    bytes: [u8; MAX_FRAME],
}

/// Loss of frames on the simulated cable.
pub type Loss = Box<dyn FnMut(u64) -> bool>;
/// Pauses of the host.
pub type Pauses = Box<dyn FnMut(u64) -> u64>;

/// Simulated interface.
pub struct SimulatedLink {
    /// The devices on the cable.
    pub segment: Segment,
    /// Whether the cable loses a frame sent at an instant \[ns\].
    pub loses: Option<Loss>,
    /// How much later than at an instant the host wakes up \[ns\].
    pub pauses: Option<Pauses>,
    now_ns: u64,
    frames: VecDeque<Frame>,
}

impl SimulatedLink {
    /// A cable to a segment. The clock of this thread's timers is the simulated one from now on.
    pub fn new(segment: Segment, now_ns: u64) -> Self {
        timer::simulate(now_ns);
        Self { segment, loses: None, pauses: None, now_ns, frames: VecDeque::with_capacity(MAX_FRAMES) }
    }

    /// Waits until an instant, or for as much longer as the host pauses.
    fn wait_until(&mut self, until_ns: u64) {
        let pause_ns = self.pauses.as_mut().map_or(0, |pauses| pauses(until_ns));
        self.advance_to(until_ns + pause_ns);
    }

    /// Simulates until an instant, with the frames that pass until then.
    fn advance_to(&mut self, until_ns: u64) {
        for frame in &mut self.frames {
            let passes_ns = frame.sent_ns + ONE_WAY_NS;
            if frame.has_passed || passes_ns > until_ns {
                continue;
            }
            frame.has_passed = true;
            self.segment.advance_to(passes_ns);
            if let Some(bytes) = frame.bytes.get_mut(..frame.length)
                && !self.segment.process(passes_ns, bytes)
            {
                frame.length = 0;
            }
        }
        self.segment.advance_to(until_ns);
        self.now_ns = self.now_ns.max(until_ns);
        timer::simulate(self.now_ns);
    }
}

impl AsRef<Segment> for SimulatedLink {
    fn as_ref(&self) -> &Segment {
        &self.segment
    }
}

impl Link for SimulatedLink {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) {
        let is_lost = self.loses.as_mut().is_some_and(|loses| loses(self.now_ns));
        let mut bytes = [0; MAX_FRAME];
        let Some(part) = bytes.get_mut(..frame.len()).filter(|_| !is_lost && self.frames.len() < MAX_FRAMES)
        else {
            return;
        };
        part.copy_from_slice(frame);
        self.frames.push_back(Frame { sent_ns: self.now_ns, has_passed: false, length: frame.len(), bytes });
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let is_back = |frame: &Frame, now_ns| frame.has_passed && frame.sent_ns + 2 * ONE_WAY_NS <= now_ns;
        while self.frames.front().is_some_and(|frame| is_back(frame, self.now_ns)) {
            let frame = self.frames.pop_front()?;
            if frame.length > 0 {
                buffer.get_mut(..frame.length)?.copy_from_slice(frame.bytes.get(..frame.length)?);
                return Some(frame.length);
            }
        }
        None
    }

    fn wait_for_frame(&mut self, until_ns: u64) {
        let back_ns = self.frames.front().map_or(u64::MAX, |frame| frame.sent_ns + 2 * ONE_WAY_NS);
        self.wait_until(back_ns.min(until_ns));
    }

    fn sleep_until(&mut self, until_ns: u64) {
        self.wait_until(until_ns.max(self.now_ns));
    }
}
