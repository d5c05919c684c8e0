//! A thread of another process, as the kernel counts it.

use std::fs;
use std::path::PathBuf;

/// Fields of `/proc/[pid]/stat`, counted from the state, which follows the name in parentheses.
const MINOR_FAULTS: usize = 7;
const MAJOR_FAULTS: usize = 9;

/// A running thread.
pub struct Thread(PathBuf);

impl Thread {
    /// The thread of this name, such as `hexad-rt`.
    pub fn of(process: u32, name: &str) -> Self {
        let is_it = |thread: &Self| thread.read("comm").trim() == name;
        all(process).find(is_it).unwrap_or_else(|| panic!("process {process} has no thread {name}"))
    }

    /// Its number.
    pub fn id(&self) -> String {
        self.0.file_name().expect("a number").display().to_string()
    }

    /// Page faults since it began: minor, major.
    pub fn faults(&self) -> [u64; 2] {
        let stat = self.stat();
        let fields: Vec<_> = stat.split_whitespace().collect();
        [fields[MINOR_FAULTS], fields[MAJOR_FAULTS]].map(number)
    }

    /// Time on a processor since it began \[ns\].
    pub fn cpu_ns(&self) -> u64 {
        self.read("schedstat").split_whitespace().next().map(number).expect("a first field")
    }

    /// Whether a signal has stopped it.
    fn is_stopped(&self) -> bool {
        self.stat().starts_with(" T")
    }

    /// `/proc/[pid]/stat` after the name.
    fn stat(&self) -> String {
        let stat = self.read("stat");
        stat.rsplit_once(')').expect("a name").1.to_owned()
    }

    fn read(&self, file: &str) -> String {
        fs::read_to_string(self.0.join(file)).expect("the thread runs")
    }
}

/// Whether a signal has stopped every thread of a process.
pub fn all_stopped(process: u32) -> bool {
    all(process).all(|thread| thread.is_stopped())
}

fn all(process: u32) -> impl Iterator<Item = Thread> {
    let threads = fs::read_dir(format!("/proc/{process}/task")).expect("the threads of a process");
    threads.map(|entry| Thread(entry.expect("a thread").path()))
}

fn number(text: &str) -> u64 {
    text.parse().expect("a number")
}
