//! Dead time of the drives: each command acts later by a fixed time, for as long as it was commanded.

use heapless::Deque;

use crate::model::LEGS;

/// Command to the drives: six forces \[N\], or none.
pub type DriveCommand = Option<[f64; LEGS]>;

/// Most changes of the command within a dead time. A loop of 20 kHz makes 200 in the longest, 10 ms, and a
/// plant that starts and stops between them cuts each into three.
const MAX_QUEUED_COMMANDS: usize = 1024;

/// Queue of commands as long as the dead time.
#[derive(Clone, Debug, Default)]
pub struct DeadTime {
    /// Commands, oldest first, each with the time for which it has yet to act \[ns\].
    line: Deque<(DriveCommand, u64), MAX_QUEUED_COMMANDS>,
}

impl DeadTime {
    /// A queue without a command in it.
    pub fn new(dead_time_ns: u64) -> Self {
        let mut delay = Self::default();
        if dead_time_ns > 0 {
            delay.push(None, dead_time_ns);
        }
        delay
    }

    /// Takes in `command` for `duration_ns` and passes the commands that leave the queue meanwhile to `act`, piece by piece.
    pub fn pass(&mut self, duration_ns: u64, command: DriveCommand, mut act: impl FnMut(u64, &DriveCommand)) {
        if self.line.is_empty() {
            return act(duration_ns, &command);
        }
        self.push(command, duration_ns);
        let mut rest = duration_ns;
        while rest > 0 {
            let Some((command, time)) = self.line.pop_front() else { return };
            let acts = time.min(rest);
            act(acts, &command);
            rest -= acts;
            if time > acts {
                // There is room: it was taken from here.
                self.line.push_front((command, time - acts)).ok();
            }
        }
    }

    /// Appends a command. An unchanged command extends the last piece; so does a new one if the queue is full.
    fn push(&mut self, command: DriveCommand, duration_ns: u64) {
        let full = self.line.is_full();
        match self.line.back_mut() {
            Some((last, time)) if *last == command || full => *time += duration_ns,
            _ => self.line.push_back((command, duration_ns)).unwrap_or_default(),
        }
    }
}
