//! A host of its own: `/run`, `/tmp` and `/dev/shm` that nobody else sees, with any users. Making one needs root.

use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::children::{Ended, Hexad};
use super::disturbance::line_of;
use super::machine::Machine;
use super::nobody::{cannot, program_for_others};

/// Users without a name.
pub const MALLORY: u32 = 64_010;
pub const OPERATOR: u32 = 64_020;
/// User of the service.
pub const SERVICE: u32 = 64_030;
/// The group `nogroup` of Debian and its like.
pub const NOGROUP: u32 = 65_534;

/// The folder of the machine, there.
const PLACE: &str = "/run/test";

/// Arguments: the folder of the machine, and that of the build's files, which stays where it is also if it is below `/run` or `/tmp`.
const MAKE: &str = "cd \"$1\" && mount -t tmpfs -o mode=755 tmpfs /run && mkdir /run/test && mount --bind \"$0\" /run/test && \
     mount -t tmpfs -o mode=1777 tmpfs /tmp && mount -t tmpfs -o mode=1777 tmpfs /dev/shm && mkdir -p \"$1\" && \
     mount --no-canonicalize --bind . \"$1\" && echo ready && exec sleep infinity";

/// It lasts until this is dropped and all its processes have ended.
pub struct Host {
    holder: Child,
    machine: Machine,
}

impl Host {
    /// Makes one; `None`, and the calling test is not run, where this user cannot.
    pub fn start(machine: Machine) -> Option<Self> {
        if cannot(&[&["unshare", "--mount"], &["setpriv", "--reuid", "64010", "--clear-groups"]]) {
            return None;
        }
        program_for_others(&machine);
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", "-c", MAKE]).arg(machine.folder()).arg(env!("CARGO_TARGET_TMPDIR"));
        command.stdout(Stdio::piped());
        let mut holder = command.spawn().expect("a host");
        let said = line_of(&mut BufReader::new(holder.stdout.take().expect("a pipe")));
        assert_eq!(said, "ready");
        Some(Self { holder, machine })
    }

    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// A path there, seen from here.
    pub fn path(&self, path: &str) -> PathBuf {
        format!("/proc/{}/root{path}", self.holder.id()).into()
    }

    /// A program there, as a user in groups.
    pub fn program(&self, user: u32, groups: &[u32], program: impl AsRef<Path>) -> Command {
        let mut command = Command::new("nsenter");
        let user = user.to_string();
        command.arg(format!("--mount=/proc/{}/ns/mnt", self.holder.id()));
        command.args(["setpriv", "--reuid", &user, "--regid", &user]);
        if groups.is_empty() {
            command.arg("--clear-groups");
        } else {
            let groups: Vec<_> = groups.iter().map(u32::to_string).collect();
            command.args(["--groups", &groups.join(",")]);
        }
        command.arg(program.as_ref()).env_remove("HEXAD_LOG").env_remove("XDG_RUNTIME_DIR");
        // Programs of the system, which every user may run.
        command.env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin").stdin(Stdio::null());
        command
    }

    /// `hexad COMMAND ...` there.
    pub fn hexad(&self, user: u32, groups: &[u32], arguments: &[&str]) -> Command {
        let mut command = self.program(user, groups, format!("{PLACE}/hexad"));
        command.args(arguments).env("TMPDIR", PLACE);
        command
    }

    /// The same to its end.
    pub fn run(&self, user: u32, groups: &[u32], arguments: &[&str]) -> Ended {
        self.spawn("hexad", self.hexad(user, groups, arguments)).ends()
    }

    /// Starts a process.
    pub fn spawn(&self, name: &str, command: Command) -> Hexad {
        Hexad::spawn(&self.machine, name, command)
    }

    /// A daemon that runs, of the machine with another name if one is given.
    pub fn daemon(&self, user: u32, groups: &[u32], name: Option<&str>) -> Hexad {
        let file = name.map_or("machine.toml".into(), |name| self.named(name));
        let daemon = self.spawn("run", self.hexad(user, groups, &["run", &format!("{PLACE}/{file}")]));
        daemon.says("running");
        daemon
    }

    /// File of the machine with another name.
    fn named(&self, name: &str) -> String {
        let text = fs::read_to_string(&self.machine.file).expect("the machine file");
        let file = format!("{name}.toml");
        fs::write(self.machine.path(&file), text.replace(&self.machine.name, name)).expect("a machine file");
        file
    }

    /// A shell script there, as root; it must succeed.
    pub fn does(&self, script: &str) {
        let mut command = Command::new("nsenter");
        command.arg(format!("--mount=/proc/{}/ns/mnt", self.holder.id())).args(["sh", "-ec", script]);
        assert!(command.status().expect("a shell").success(), "{script}");
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // It fails only if it has ended already.
        let _ = self.holder.kill();
        let _ = self.holder.wait();
    }
}
