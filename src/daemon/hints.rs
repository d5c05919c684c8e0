//! Hints why a cycle was slow: counts of the kernel, read outside the real-time thread.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

/// Duration of a tick \[ms\], from `sysconf(_SC_CLK_TCK)`: 100 per second on every Linux in use.
const TICK_MS: u64 = 10;

/// Fields of `/proc/[pid]/stat`, counted from the state, which follows the name in parentheses.
const MINOR_FAULTS: usize = 7;
const MAJOR_FAULTS: usize = 9;
const PROCESSOR: usize = 36;

/// Field of a processor's line in `/proc/stat`, counted from its name.
const STEAL: usize = 8;

/// Size for the processors' lines of `/proc/stat` on a host with 128 processors.
const BUFFER_BYTES: usize = 16 * 1024;

/// Open files of the kernel about one thread. Reading them allocates nothing.
#[derive(Debug)]
pub struct ThreadFiles {
    stat: File,
    status: File,
    processors: File,
}

/// Counts since the thread began. `steal` belongs to the processor on which the thread last ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlowCycleHints {
    pub involuntary_switches: u64,
    pub page_faults: u64,
    pub steal_ms: u64,
}

impl ThreadFiles {
    /// Opens the files of the calling thread.
    pub fn of_this_thread() -> io::Result<Self> {
        let open = |path| File::open(path);
        Ok(Self {
            stat: open("/proc/thread-self/stat")?,
            status: open("/proc/thread-self/status")?,
            processors: open("/proc/stat")?,
        })
    }

    /// Reads the present counts. A count that cannot be read is zero.
    pub fn read(&self) -> SlowCycleHints {
        let mut buffer = [0; BUFFER_BYTES];
        let status = text(&self.status, &mut buffer);
        let involuntary_switches =
            status.lines().find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"));
        let involuntary_switches = number(involuntary_switches);
        // The name may contain any character, even parentheses.
        let stat = text(&self.stat, &mut buffer).rsplit(')').next().unwrap_or_default();
        let field = |index| number(stat.split_whitespace().nth(index));
        let (page_faults, processor) = (field(MINOR_FAULTS) + field(MAJOR_FAULTS), field(PROCESSOR));
        let steal_ms = steal_ticks(text(&self.processors, &mut buffer), processor) * TICK_MS;
        SlowCycleHints { involuntary_switches, page_faults, steal_ms }
    }
}

impl SlowCycleHints {
    /// Increase since `earlier`. Zero for a count that decreased, as the steal of another processor may do.
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            involuntary_switches: self.involuntary_switches.saturating_sub(earlier.involuntary_switches),
            page_faults: self.page_faults.saturating_sub(earlier.page_faults),
            steal_ms: self.steal_ms.saturating_sub(earlier.steal_ms),
        }
    }
}

fn text<'b>(file: &File, buffer: &'b mut [u8]) -> &'b str {
    let length = file.read_at(buffer, 0).unwrap_or(0);
    buffer.get(..length).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or_default()
}

fn number(text: Option<&str>) -> u64 {
    text.and_then(|text| text.trim().parse().ok()).unwrap_or(0)
}

fn steal_ticks(processors: &str, processor: u64) -> u64 {
    let is_its = |line: &&str| {
        let name = line.split_whitespace().next().and_then(|name| name.strip_prefix("cpu"));
        name.and_then(|digits| digits.parse().ok()) == Some(processor)
    };
    number(processors.lines().find(is_its).and_then(|line| line.split_whitespace().nth(STEAL)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn steal_is_found_on_the_line_of_the_processor() {
        let text =
            "cpu  1 2 3 4 5 6 7 800 9 10\ncpu0 1 2 3 4 5 6 7 80 9 10\ncpu10 1 2 3 4 5 6 7 81 9 10\nintr 5";
        assert_eq!([0, 10, 1].map(|processor| steal_ticks(text, processor)), [80, 81, 0]);
    }

    #[test]
    fn page_faults_of_this_thread_are_seen() {
        // Larger than any block that the allocator reuses, so the kernel maps fresh memory without pages. It
        // has 32 of the largest usual pages, 2 MB.
        let touch = || drop(black_box(vec![1_u8; 64 << 20]));
        let files = ThreadFiles::of_this_thread().unwrap();
        touch();
        let before = files.read();
        assert!(before.page_faults >= 16, "{before:?}");
        touch();
        let since = files.read().since(&before);
        assert!(since.page_faults >= 16, "{since:?}");
    }
}
