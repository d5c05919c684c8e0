//! What the driver needs of an Ethernet interface and its clock.

/// Longest Ethernet frame without checksum.
pub const MAX_FRAME: usize = 1514;

/// Interface that sends and receives whole Ethernet frames, with the clock of its instants.
pub trait Link {
    /// Present instant \[ns\]: CLOCK_MONOTONIC, or simulated.
    fn now_ns(&self) -> u64;

    /// Sends a frame. One that cannot be sent is lost, as one on the cable may be.
    fn send(&mut self, frame: &[u8]);

    /// Copies a received frame, if there is one; its length.
    fn receive(&mut self, buffer: &mut [u8]) -> Option<usize>;

    /// Waits until a frame has been received, no longer than until an instant \[ns\].
    fn wait_for_frame(&mut self, until_ns: u64);

    /// Waits until an instant \[ns\].
    fn sleep_until(&mut self, until_ns: u64);
}
