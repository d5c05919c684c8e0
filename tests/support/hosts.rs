//! Hosts for each test of a bridge: one with the machine and the bridge, two with remote programs, and cables between them.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::hexad_process;

/// Longest wait for what has to happen.
const PATIENCE: Duration = Duration::from_secs(60);

/// A host: a network namespace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Host {
    Machine,
    Remote,
    /// On another interface of the machine's host.
    UntrustedDaemon,
}

impl Host {
    const ALL: [Self; 3] = [Self::Machine, Self::Remote, Self::UntrustedDaemon];
}

/// The hosts, a folder with files, and the processes that run on the hosts.
pub struct Hosts {
    name: String,
    folder: PathBuf,
    processes: Vec<(&'static str, Child)>,
}

fn ip(arguments: &str) -> Result<(), String> {
    let ended = Command::new("ip").args(arguments.split(' ')).output().map_err(|error| error.to_string())?;
    if ended.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&ended.stderr).into()) }
}

impl Hosts {
    /// Hosts, or why there are none. `test` is a short name.
    pub fn new(test: &str) -> Result<Self, String> {
        let name = format!("hexad-{test}-{}", std::process::id());
        let folder = std::env::temp_dir().join(&name);
        fs::create_dir_all(&folder).unwrap();
        let hosts = Self { name, folder, processes: vec![] };
        for host in Host::ALL {
            ip(&format!("netns add {}", hosts.namespace(host)))?;
            hosts.ip(host, "link set lo up")?;
        }
        for (port, remote, network) in [("net0", Host::Remote, 1), ("net1", Host::UntrustedDaemon, 2)] {
            let there = hosts.namespace(remote);
            hosts.ip(Host::Machine, &format!("link add {port} type veth peer name eth0 netns {there}"))?;
            for (host, port, number) in [(Host::Machine, port, 1), (remote, "eth0", 2)] {
                hosts.ip(host, &format!("addr add 10.77.{network}.{number}/24 dev {port}"))?;
                hosts.ip(host, &format!("link set {port} up"))?;
                hosts.ip(host, &format!("route add 224.0.0.0/4 dev {port}")).ok();
            }
        }
        Ok(hosts)
    }

    /// Network namespace of a host.
    pub fn namespace(&self, host: Host) -> String {
        format!("{}-{host:?}", self.name)
    }

    fn ip(&self, host: Host, arguments: &str) -> Result<(), String> {
        ip(&format!("-n {} {arguments}", self.namespace(host)))
    }

    /// Name of the machine: topics of its own.
    pub fn machine(&self) -> String {
        self.name.replace('-', "_")
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// A command on a host, in the folder.
    pub fn command(&self, host: Host, program: &Path, arguments: &str) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.namespace(host)]).arg(program).args(arguments.split(' '));
        command.current_dir(&self.folder).env("RUST_BACKTRACE", "0");
        command
    }

    /// The command `hexad`.
    pub fn hexad(&self, arguments: &str) -> Command {
        hexad_process::hexad(|program, role| self.command(Host::Machine, program, role), arguments)
    }

    /// Starts a process whose output is the file `name`. It takes the place of one that has this name.
    pub fn start(&mut self, name: &'static str, mut command: Command) {
        if let Some(place) = self.processes.iter().position(|(started, _)| *started == name) {
            self.kill(name);
            self.processes.swap_remove(place);
        }
        let log = File::create(self.path(name)).unwrap();
        let child =
            command.stdout(log.try_clone().unwrap()).stderr(log).stdin(Stdio::null()).spawn().unwrap();
        self.processes.push((name, child));
    }

    fn child(&mut self, name: &str) -> &mut Child {
        &mut self.processes.iter_mut().find(|(started, _)| *started == name).unwrap().1
    }

    /// Number of a process.
    pub fn process_id(&mut self, name: &str) -> u32 {
        self.child(name).id()
    }

    /// Ends a process at once.
    pub fn kill(&mut self, name: &str) {
        let child = self.child(name);
        child.kill().unwrap();
        child.wait().unwrap();
    }

    /// Whether a process has not ended.
    pub fn is_running(&mut self, name: &str) -> bool {
        self.child(name).try_wait().unwrap().is_none()
    }

    pub fn log(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_default()
    }

    /// Waits until the output of a process has a text.
    pub fn wait_for(&self, name: &str, text: &str) {
        let began = Instant::now();
        while !self.log(name).contains(text) {
            assert!(began.elapsed() < PATIENCE, "{text:?} in {name}:\n{}", self.ends());
            sleep(Duration::from_millis(20));
        }
    }

    /// The last lines of all processes.
    pub fn ends(&self) -> String {
        let end = |name: &&'static str| {
            let log = self.log(name);
            let lines: Vec<_> = log.lines().collect();
            format!("{name}:\n{}\n", lines[lines.len().saturating_sub(20)..].join("\n"))
        };
        self.processes.iter().map(|(name, _)| name).map(end).collect()
    }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        for (_, child) in &mut self.processes {
            let _ = child.kill();
            let _ = child.wait();
        }
        for host in Host::ALL {
            let _ = ip(&format!("netns del {}", self.namespace(host)));
        }
        let _ = fs::remove_dir_all(&self.folder);
    }
}
