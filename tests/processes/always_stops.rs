//! `estop`, `off` and `stop` reach the daemon whatever else happens to its shared memory, its socket and its log.

use std::any::Any;
use std::fs;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use nix::pty::{OpenptyResult, openpty};
use nix::sys::termios::{FlowArg, tcflow};

use hexad::messages::claim::running_daemons;
use hexad::messages::{Bus, Publisher, SetpointMessage, StatusMessage, Subscriber};

use crate::support::background::Background;
use crate::support::children::{HANG, Hexad, hexad, signal};
use crate::support::machine::Machine;
use crate::support::operator::{ask, clear, does, engage, is_refused};
use crate::support::peer::{self, Controlled};
use crate::support::recorder::Recorder;
use crate::support::socket::{path_of, state, status, stops};
use crate::support::trio::{start_daemon, start_plant};

/// Connections that mean no good: twice as many as the daemon serves, most of which only take a place.
const HOSTILE: usize = 128;

/// Emergency stops under them.
const TRIALS: usize = 6;

/// What fills every slot of the shared memory.
pub struct Slots {
    _setpoints: Vec<Publisher<SetpointMessage>>,
    _statuses: Vec<Subscriber<StatusMessage>>,
    _nodes: Vec<Bus>,
}

impl Slots {
    pub fn fill(machine: &str) -> Self {
        let bus = Bus::join(machine).expect("to join");
        let _setpoints: Vec<_> = std::iter::from_fn(|| bus.publisher::<SetpointMessage>().ok()).collect();
        let _statuses: Vec<_> = std::iter::from_fn(|| bus.subscriber::<StatusMessage>(8).ok()).collect();
        assert!(_setpoints.len() >= 2 && _statuses.len() >= 12, "room for others");
        // A node takes its place in a topic with its first port, and with that of the topic's own limit.
        let mut _nodes = vec![bus];
        while let Some(node) =
            Bus::join(machine).ok().filter(|node| node.publisher::<SetpointMessage>().is_ok())
        {
            _nodes.push(node);
        }
        Self { _setpoints, _statuses, _nodes }
    }
}

#[test]
#[apply(beside_others)]
fn with_every_slot_of_the_shared_memory_taken() {
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(Machine::patient("slots"));
    let _slots = Slots::fill(&machine.name);
    for (request, states) in [("estop", &["fault"] as &[_]), ("off", &["off"]), ("stop", &["standby"])] {
        // From control, and from the state that it leads to.
        for _ in 0..2 {
            stops(&machine, request, states);
        }
        if request == "estop" {
            clear(&machine);
        }
        engage(&machine);
    }
    does(&machine, "park", &[], &["off"]);
    assert_eq!(state(&machine), "off");
    daemon.stops();
    plant.stops();
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn under_hostile_connections_and_four_that_wait() {
    let machine = Machine::patient("hostile");
    let daemon = start_daemon(&machine);
    let path = path_of(&daemon);
    // Four operators wait to engage: there are no setpoints.
    let waiting: Vec<_> =
        (0..4).map(|_| Hexad::start(&machine, "engage", &["--wait", "--within", "60"])).collect();
    waiting.iter().for_each(|one| one.says("waiting: no measurement"));
    stops(&machine, "estop", &["fault"]);
    clear(&machine);
    drop(waiting);
    let plant = start_plant(&machine);
    let _peer = peer::start(&machine);
    let hostile = Hostile::start(&path, HOSTILE);
    hostile.must_have_sent(10_000_000);
    let (mut by_socket, mut longest) = (0, Duration::ZERO);
    for trial in 0..TRIALS {
        // Not under control each time.
        if trial % 2 == 0 {
            let is_engaged = || ask(&machine, "engage", &["--wait"]).status.success();
            assert!((0..5).any(|_| is_engaged()), "trial {trial}");
        }
        let began = Instant::now();
        by_socket += usize::from(stops(&machine, "estop", &["fault"]));
        longest = longest.max(began.elapsed());
        let is_cleared = || ask(&machine, "clear", &[]).status.success();
        assert!((0..5).any(|_| is_cleared()), "trial {trial}");
    }
    let sent = hostile.finish();
    println!(
        "{TRIALS} emergency stops under {HOSTILE} connections that sent {sent} bytes: {by_socket} by socket, longest {longest:?}"
    );
    assert!(by_socket > TRIALS / 2, "{by_socket} of {TRIALS}");
    let timing = &status(&machine)["status"]["timing"];
    println!("{timing}");
    daemon.stops();
    plant.stops();
}

#[test]
#[apply(beside_others)]
fn without_its_socket_by_signal() {
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(Machine::patient("signal"));
    fs::remove_file(path_of(&daemon)).expect("a socket");
    let by_signal = |request: &str, signal: &str, state: &str| {
        let ended = ask(&machine, request, &[]);
        let words =
            format!("did not answer; {signal} to process {}, confirmed by the status messages", daemon.id());
        assert!(ended.stderr.contains(&words), "{words:?} must be in {}", ended.stderr);
        assert_eq!(ended.succeeds().trim_end(), state);
    };
    by_signal("stop", "stop by SIGUSR2", "standby");
    by_signal("off", "estop by SIGUSR1", "fault");
    by_signal("estop", "estop by SIGUSR1", "fault");
    let words = format!("clear is not confirmed: process {} does not answer", daemon.id());
    is_refused(&machine, "clear", &[], &words);
    daemon.stops();
    plant.stops();
}

/// Nothing confirms that a held daemon stops; when it goes on it must have stopped.
#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_held_daemon_is_not_called_stopped_and_stops_when_it_goes_on() {
    let machine = Machine::patient("held");
    let recorder = Recorder::start(&machine.name);
    let Controlled { peer: _peer, daemon, plant, machine } = Controlled::start(machine);
    daemon.hold();
    let stderr = ask(&machine, "estop", &[]).fails(1, "estop is not confirmed: ");
    for words in ["by SIGUSR1 to process", "has not reported the result"] {
        assert!(stderr.contains(words), "{words:?} must be in {stderr}");
    }
    daemon.signal("CONT");
    recorder.until("it is in fault by the emergency stop, or by what it missed", |recording| {
        recording.forces.last().filter(|force| force.state == 6 && force.valid == 0).map(drop)
    });
    daemon.stops();
    plant.stops();
}

#[test]
#[apply(beside_others)]
fn with_a_log_that_nobody_reads() {
    with_a_blocked_log("pipe", || {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        (Box::new(reader), writer.into())
    });
}

/// Ctrl-S on its terminal, and a journal that is stopped.
#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn with_a_stopped_terminal_and_a_stopped_journal() {
    with_a_blocked_log("terminal", || {
        let OpenptyResult { master, slave } = openpty(None, None).expect("a terminal");
        tcflow(&slave, FlowArg::TCOOFF).expect("to stop it");
        (Box::new(master), slave.into())
    });
    with_a_blocked_log("journal", || {
        let (reader, writer) = UnixStream::pair().expect("a stream, as of the journal");
        (Box::new(reader), OwnedFd::from(writer).into())
    });
}

/// Nobody reads standard error, and no thread waits for it: requests are answered, cycles recorded, and SIGTERM ends the daemon.
/// `log`: its two ends.
fn with_a_blocked_log(name: &str, log: fn() -> (Box<dyn Any>, Stdio)) {
    let (_reader, stderr) = log();
    let machine = Machine::patient(name);
    let folder = machine.path("state");
    fs::create_dir(&folder).expect("a folder");
    let run = || {
        let mut command = hexad();
        command.arg("run").arg("--config").arg(&machine.file).arg("--state").arg(&folder);
        command.arg("--report").arg(machine.path("report.json"));
        command
    };
    let mut daemon = run().stderr(stderr).stdout(Stdio::null()).spawn().expect("a daemon");
    let plant = start_plant(&machine);
    let _peer = peer::start(&machine);
    let began = Instant::now();
    while running_daemons(&machine.name).is_empty() {
        assert!(began.elapsed() < HANG, "no record");
        sleep(Duration::from_millis(1));
    }
    engage(&machine);
    let path = running_daemons(&machine.name).pop().expect("a record").socket;
    let mut stream = UnixStream::connect(path).expect("a connection");
    stream.set_write_timeout(Some(Duration::from_secs(5))).expect("a limit");
    stream.set_read_timeout(Some(Duration::from_secs(5))).expect("a limit");
    // Several times what any of them holds.
    let line = b"{\"version\": 1, \"request\": \"engage\"}\n";
    let mut answer = [0; 4096];
    let answered = (0..5000)
        .take_while(|_| {
            stream.write_all(line).is_ok() && stream.read(&mut answer).is_ok_and(|count| count > 0)
        })
        .count();
    assert_eq!(answered, 5000, "it answers whether its log is read or not");
    let kept = || fs::read(folder.join("emergency-stop")).ok();
    let before = kept();
    does(&machine, "stop", &[], &["standby"]);
    let ended = ask(&machine, "estop", &[]);
    assert_eq!((ended.stderr.as_str(), ended.stdout.as_str()), ("", "fault\n"), "by its socket");
    let began = Instant::now();
    while kept() == before {
        assert!(began.elapsed() < HANG, "the emergency stop is not kept");
        sleep(Duration::from_millis(1));
    }
    signal(daemon.id(), "TERM");
    let began = Instant::now();
    while daemon.try_wait().expect("its state").is_none() {
        assert!(began.elapsed() < HANG, "it waits for its log");
        sleep(Duration::from_millis(1));
    }
    let report = fs::read_to_string(machine.path("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["recording"]["missing"], 0, "cycles are recorded all the same: {report}");
    let daemon = Hexad::spawn(&machine, "run", run());
    daemon.says("an emergency stop was not cleared before the daemon ended");
    daemon.says("fault: emergency stop");
    is_refused(&machine, "engage", &[], "engage was refused: not possible in state fault (emergency stop)");
    daemon.stops();
    plant.stops();
}

/// Clients that stay silent, send half a line, send without end, or never read; each connects again when it is closed.
pub struct Hostile {
    sent: Arc<AtomicU64>,
    clients: Background<()>,
}

impl Hostile {
    pub fn start(path: &Path, count: usize) -> Self {
        let (sent, path) = (Arc::new(AtomicU64::new(0)), path.to_owned());
        let clients = Background::start(count, {
            let sent = sent.clone();
            move |number, stop| {
                while !stop.load(Ordering::Relaxed) {
                    let Ok(mut stream) = UnixStream::connect(&path) else { continue };
                    let _ = stream.set_read_timeout(Some(Duration::from_millis(500)));
                    let _ = stream.set_write_timeout(Some(Duration::from_millis(500)));
                    let chunk = match number % 8 {
                        0..3 => vec![],
                        3..6 => b"{\"version\": 1, \"requ".to_vec(),
                        6 => vec![b'x'; 1 << 16],
                        _ => b"{\"version\": 1, \"request\": \"status\"}\n".repeat(100),
                    };
                    // No more than a gigabyte.
                    for _ in 0..1 << 14 {
                        if stop.load(Ordering::Relaxed) || stream.write_all(&chunk).is_err() {
                            break;
                        }
                        sent.fetch_add(chunk.len() as u64, Ordering::Relaxed);
                        if number % 8 < 6 && stream.read(&mut [0; 64]).is_ok_and(|count| count == 0) {
                            break;
                        }
                    }
                    sleep(Duration::from_millis(1));
                }
            }
        });
        Self { sent, clients }
    }

    fn must_have_sent(&self, bytes: u64) {
        let began = Instant::now();
        while self.sent.load(Ordering::Relaxed) < bytes {
            assert!(began.elapsed() < HANG, "{} bytes", self.sent.load(Ordering::Relaxed));
            sleep(Duration::from_millis(10));
        }
    }

    pub fn finish(self) -> u64 {
        self.clients.finish();
        self.sent.load(Ordering::Relaxed)
    }
}
