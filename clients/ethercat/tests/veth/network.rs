//! A network of its own for each test: a cable between the interfaces `ec0` and `ec1`, and processes in it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad_support::hexad_process;

/// Network namespace with the cable, a folder with files, and the processes that run in it.
pub struct Network {
    name: String,
    pub folder: tempfile::TempDir,
    processes: Vec<(&'static str, Child)>,
}

fn ip(arguments: &str) -> Result<(), String> {
    let ended = Command::new("ip").args(arguments.split(' ')).output().map_err(|error| error.to_string())?;
    if ended.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&ended.stderr).into()) }
}

impl Network {
    /// A network, or why there is none.
    pub fn new(test: &str) -> Result<Self, String> {
        let name = format!("hexad-{test}-{}", std::process::id());
        ip(&format!("netns add {name}"))?;
        let network = Self { name, folder: tempfile::tempdir().unwrap(), processes: vec![] };
        network.ip("link add ec0 type veth peer name ec1")?;
        network.ip("link set ec0 up")?;
        network.ip("link set ec1 up")?;
        Ok(network)
    }

    fn ip(&self, arguments: &str) -> Result<(), String> {
        ip(&format!("-n {} {arguments}", self.name))
    }

    /// Name of the machine: topics of its own.
    pub fn machine(&self) -> &str {
        &self.name
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A command in the network, in the folder.
    pub fn command(&self, program: &Path, arguments: &str) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.name]).arg(program).args(arguments.split(' '));
        command.current_dir(self.folder.path()).env("RUST_BACKTRACE", "0");
        command
    }

    /// The command `hexad-ethercat`.
    pub fn driver(&self, arguments: &str) -> Command {
        self.command(Path::new(env!("CARGO_BIN_EXE_hexad-ethercat")), arguments)
    }

    /// The command `hexad`.
    pub fn hexad(&self, arguments: &str) -> Command {
        hexad_process::hexad(|program, role| self.command(program, role), arguments)
    }

    /// Starts a process whose output is the file `name`.
    pub fn start(&mut self, name: &'static str, mut command: Command) {
        // One with this name that was killed leaves a process that has not been waited for.
        for (_, mut child) in self.processes.extract_if(.., |(started, _)| *started == name) {
            let _ = child.kill();
            let _ = child.wait();
        }
        let log = File::create(self.path(name)).unwrap();
        let child =
            command.stdout(log.try_clone().unwrap()).stderr(log).stdin(Stdio::null()).spawn().unwrap();
        self.processes.push((name, child));
    }

    /// Whether a process has not ended.
    pub fn is_running(&mut self, name: &str) -> bool {
        let (_, child) = self.processes.iter_mut().find(|(started, _)| *started == name).unwrap();
        child.try_wait().unwrap().is_none()
    }

    /// Waits for the end of a process.
    pub fn exit_code(&mut self, name: &str) -> Option<i32> {
        let (_, child) = self.processes.iter_mut().find(|(started, _)| *started == name).unwrap();
        child.wait().unwrap().code()
    }

    /// Numbers of threads, of open descriptors and of mapped files of shared memory of a process, and its memory \[kB\].
    pub fn resources(&self, name: &str) -> [usize; 4] {
        let (_, child) = self.processes.iter().find(|(started, _)| *started == name).unwrap();
        let folder = PathBuf::from(format!("/proc/{}", child.id()));
        let count = |name: &str| fs::read_dir(folder.join(name)).unwrap().count();
        let maps = fs::read_to_string(folder.join("maps")).unwrap();
        let status = fs::read_to_string(folder.join("status")).unwrap();
        let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        let memory_kb = memory.trim().trim_end_matches(" kB").parse().unwrap();
        [count("task"), count("fd"), maps.matches("/dev/shm/").count(), memory_kb]
    }

    /// Sends a signal to a process.
    pub fn signal(&mut self, name: &str, signal: i32) {
        let (_, child) = self.processes.iter_mut().find(|(started, _)| *started == name).unwrap();
        #[allow(unsafe_code, reason = "no other call sends a signal")]
        // SAFETY: the call takes numbers; the process is a child that has not been waited for.
        unsafe {
            libc::kill(child.id() as i32, signal)
        };
    }

    pub fn log(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_default()
    }

    /// Waits until the output of a process has a text so often.
    pub fn wait_for(&self, name: &str, text: &str, count: usize) {
        let began = Instant::now();
        while self.log(name).matches(text).count() < count {
            assert!(
                began.elapsed() < Duration::from_secs(60),
                "{text:?} {count} times in {name}:\n{}",
                self.ends()
            );
            sleep(Duration::from_millis(20));
        }
    }

    /// The last lines of all processes.
    pub fn ends(&self) -> String {
        let end = |name: &&'static str| {
            let log = self.log(name);
            let lines: Vec<_> = log.lines().collect();
            format!("{name}:\n{}\n", lines[lines.len().saturating_sub(12)..].join("\n"))
        };
        self.processes.iter().map(|(name, _)| name).map(end).collect()
    }

    /// What a command prints; it must succeed.
    pub fn output(&self, mut command: Command) -> String {
        let ended = command.output().unwrap();
        let text =
            [ended.stdout, ended.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(ended.status.success(), "{command:?}: {text}");
        text
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        for (_, child) in &mut self.processes {
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = ip(&format!("netns del {}", self.name));
    }
}
