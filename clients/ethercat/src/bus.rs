//! EtherCAT main device: ethercrab, polled by hand in one thread.
//!
//! Traps of ethercrab 0.7.1 that this module avoids: its own task for frames allocates in every poll and ends at a frame that
//! arrives after its timeout; an emergency in a mailbox in place of the expected response panics.

use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use ethercrab::{MainDevice, MainDeviceConfig, PduRx, PduStorage, PduTx, RetryBehaviour, Timeouts};

use crate::link::{Link, MAX_FRAME};
use crate::timer::take_next_wake_ns;

/// Memory of the frames under way.
pub type Frames = PduStorage<8, { PduStorage::element_size(1100) }>;

/// A process image of six drives is far smaller.
pub const MAX_PROCESS_DATA: usize = 512;
/// A power of two, as ethercrab requires; more than six are found and reported.
pub const MAX_DEVICES: usize = 16;

const FRAME_TIMEOUT: Duration = Duration::from_millis(20);
const FRAME_RETRIES: usize = 3;
const STATE_TIMEOUT: Duration = Duration::from_secs(3);
/// Datagrams that align the distributed clocks before the first cycle.
const CLOCK_ALIGNMENT_DATAGRAMS: u32 = 1000;

/// Main device and its wire: two fields, as an exchange borrows both.
pub struct Bus<'f, L> {
    /// Where datagrams are composed.
    pub main: MainDevice<'f>,
    /// Where frames are sent and received.
    pub wire: Wire<'f, L>,
}

impl<'f, L: Link> Bus<'f, L> {
    /// A main device on an interface. The memory of frames can be used once.
    pub fn new(frames: &'f Frames, link: L) -> Option<Self> {
        let (transmission, reception, pdu_loop) = frames.try_split().ok()?;
        let timeouts =
            Timeouts { pdu: FRAME_TIMEOUT, state_transition: STATE_TIMEOUT, ..Timeouts::default() };
        let config = MainDeviceConfig {
            dc_static_sync_iterations: CLOCK_ALIGNMENT_DATAGRAMS,
            retry_behaviour: RetryBehaviour::Count(FRAME_RETRIES),
        };
        let wire = Wire {
            link,
            transmission,
            reception,
            buffer: [0; MAX_FRAME + 4],
            sent_ns: 0,
            received_ns: 0,
            unmatched_frames: 0,
            emergency: None,
        };
        Some(Self { main: MainDevice::new(pdu_loop, timeouts, config), wire })
    }
}

/// Frames of a main device on an interface.
pub struct Wire<'f, L> {
    /// The interface.
    pub link: L,
    transmission: PduTx<'f>,
    reception: PduRx<'f>,
    buffer: [u8; MAX_FRAME + 4],
    /// Instant of the last sent frame \[ns\].
    pub sent_ns: u64,
    /// Instant of the last received frame \[ns\].
    pub received_ns: u64,
    /// Frames that arrived after their timeout, or belong to nobody.
    pub unmatched_frames: u64,
    /// Error code of the last emergency in a mailbox.
    pub emergency: Option<u16>,
}

impl<L: Link> Wire<'_, L> {
    /// Exchanges frames until the future is ready.
    pub fn run<F: Future>(&mut self, future: F) -> F::Output {
        let mut future = pin!(future);
        loop {
            if let Some(output) = self.run_until(future.as_mut(), u64::MAX) {
                return output;
            }
        }
    }

    /// The same no longer than until an instant \[ns\]; then the frame is lost.
    pub fn run_until<F: Future>(&mut self, future: F, deadline_ns: u64) -> Option<F::Output> {
        let mut future = pin!(future);
        loop {
            let output = self.poll(future.as_mut(), deadline_ns);
            if output.is_some() || self.link.now_ns() >= deadline_ns {
                return output;
            }
        }
    }

    fn poll<F: Future>(&mut self, mut future: std::pin::Pin<&mut F>, deadline_ns: u64) -> Option<F::Output> {
        let mut context = Context::from_waker(Waker::noop());
        take_next_wake_ns();
        if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
            return Some(output);
        }
        while let Some(frame) = self.transmission.next_sendable_frame() {
            self.sent_ns = self.link.now_ns();
            let link = &mut self.link;
            // The closure reports the whole frame as sent, so this cannot fail; the timeout notices a frame that is lost.
            let _ = frame.send_blocking(|bytes| {
                link.send(bytes);
                Ok(bytes.len())
            });
        }
        self.link.wait_for_frame(take_next_wake_ns().min(deadline_ns));
        while let Some(length) = self.link.receive(&mut self.buffer) {
            self.received_ns = self.link.now_ns();
            let Some(frame) = self.buffer.get_mut(..length) else { continue };
            if let Some(code) = emergency_as_abort(frame) {
                self.emergency = Some(code);
            }
            if self.reception.receive_frame(frame).is_err() {
                self.unmatched_frames += 1;
            }
        }
        match future.poll(&mut context) {
            Poll::Ready(output) => Some(output),
            Poll::Pending => None,
        }
    }
}

const FIXED_ADDRESS_READ: u8 = 4;
const MAILBOX_COE: u8 = 3;
const SERVICE_EMERGENCY: u8 = 1;
const SERVICE_REQUEST: u8 = 2;
const ABORT_TRANSFER: u8 = 0x80;
/// Shortest mailbox of the standard. A read of registers is shorter.
const MIN_MAILBOX: u16 = 32;

/// Turns an emergency that was read from a mailbox into an aborted transfer, on which ethercrab does not panic. The error code.
fn emergency_as_abort(frame: &mut [u8]) -> Option<u16> {
    let (header, mailbox) = frame.get_mut(16..)?.split_at_mut_checked(10)?;
    let &mut [command, _, _, _, _, _, length_low, length_high, ..] = header else { return None };
    let [_, _, _, _, _, kind, _, service, low, high, ..] = mailbox else { return None };
    let length = u16::from_le_bytes([length_low, length_high]) & 0x7ff;
    if command != FIXED_ADDRESS_READ
        || length < MIN_MAILBOX
        || *kind & 0xf != MAILBOX_COE
        || *service >> 4 != SERVICE_EMERGENCY
    {
        return None;
    }
    let code = u16::from_le_bytes([*low, *high]);
    (*service, *low) = (SERVICE_REQUEST << 4, ABORT_TRANSFER);
    Some(code)
}
