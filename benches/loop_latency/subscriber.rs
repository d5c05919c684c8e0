//! A subscriber that polls for forces without a pause and notes when it sees them.
//!
//! It is a thread of ordinary priority. With three processors it has one of its own. With two it polls on
//! that of the io thread, so that the loop's belongs to the loop alone: it then sees a force only when the io
//! thread, which goes before it, has published it and sleeps, and the switch between the two is in the figure.

use std::fs;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{JoinHandle, spawn};

use hexad::messages::Bus;
use hexad::messages::ForceMessage;
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::setup::scheduling;

use super::Failure;
use super::distribution::Distribution;
use super::rig::Rig;

/// The strongest of the ordinary priorities: nobody else's work shall stand between force and subscriber.
const NICE: &str = "-20";

/// Stops when dropped.
pub struct Subscriber {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Distribution>>,
}

impl Subscriber {
    /// Polls machine 0. Returns when its port is open.
    pub fn start(rig: &Rig) -> Result<Self, Failure> {
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, opened) = mpsc::channel();
        let thread = {
            let (stop, cpu) = (stop.clone(), rig.processors.subscriber);
            spawn(move || {
                let forces = prepare(cpu);
                let mut seen = Distribution::default();
                let mut forces = match forces {
                    Ok(forces) => forces,
                    Err(failure) => {
                        let _ = ready.send(Err(failure));
                        return seen;
                    }
                };
                let _ = ready.send(Ok(()));
                while !stop.load(Ordering::Relaxed) {
                    if let Some(force) = forces.receive_latest().filter(|force| force.valid == 1) {
                        seen.add(monotonic_ns().saturating_sub(force.release_ns), 1);
                    }
                }
                seen
            })
        };
        let subscriber = Self { stop, thread: Some(thread) };
        opened.recv()??;
        Ok(subscriber)
    }

    /// From release to seen.
    pub fn finish(mut self) -> Result<Distribution, Failure> {
        self.stop.store(true, Ordering::Relaxed);
        let thread = self.thread.take().ok_or("finished twice")?;
        Ok(thread.join().map_err(|_| "the subscriber died")?)
    }
}

fn prepare(cpu: usize) -> Result<hexad::messages::Subscriber<ForceMessage>, String> {
    scheduling::bind_to_cpu(cpu).map_err(|shortfall| shortfall.to_string())?;
    let thread = fs::read_link("/proc/thread-self").map_err(|error| error.to_string())?;
    let number = thread.file_name().unwrap_or_default();
    let mut command = Command::new("renice");
    let reniced = command.args(["-n", NICE, "-p"]).arg(number).output().map_err(|error| error.to_string())?;
    if !reniced.status.success() {
        return Err(format!("renice: {}", String::from_utf8_lossy(&reniced.stderr)));
    }
    let bus = Bus::join(&Rig::machine_name(0)).map_err(|error| error.to_string())?;
    bus.subscriber(1).map_err(|error| error.to_string())
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
