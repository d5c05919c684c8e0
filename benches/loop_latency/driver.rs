//! The drives and the setpoint source of the machines under test, in one light thread: it publishes, on the
//! multiples of the period as a plant does, a setpoint on a moving path and the leg lengths of a platform
//! that is exactly on it. So the daemon is active and works as hard as in service, and the load on the other
//! processor is the least that this takes.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{JoinHandle, spawn};

use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, PortError, Publisher};
use hexad::messages::{MeasuredMessage, SetpointMessage};
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::machine::Machine;
use hexad::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use hexad::realtime::clock::{Grid, sleep_until};
use hexad::realtime::setup::scheduling;

use super::Failure;
use super::rig::{DRIVER_PRIORITY, Rig};

/// Length of the path; it begins and ends at home, so it can be repeated \[s\].
const PATH_S: f64 = 60.0;

/// It is followed this much slower than the machine could, so that the lengths do not jump when the host holds
/// this thread for some tens of milliseconds.
const SLOWER: f64 = 20.0;

/// Stops when dropped.
pub struct Driver {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Driver {
    /// Drives the machines with the numbers below `machines`. Returns when its ports are open.
    pub fn start(rig: &Rig, machines: usize, rate_hz: u32) -> Result<Self, Failure> {
        let stop = Arc::new(AtomicBool::new(false));
        let (ready, opened) = mpsc::channel();
        let thread = {
            let (stop, machine, cpu) = (stop.clone(), rig.config.machine.clone(), rig.processors.helpers);
            spawn(move || {
                let prepared = prepare(machines, cpu);
                let (ports, answer) = match prepared {
                    Ok(ports) => (ports, Ok(())),
                    Err(failure) => (vec![], Err(failure)),
                };
                let _ = ready.send(answer);
                let grid = Grid::new(1_000_000_000 / u64::from(rate_hz), 0);
                drive(&machine, &grid, ports, &stop);
            })
        };
        let driver = Self { stop, thread: Some(thread) };
        opened.recv()??;
        Ok(driver)
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

type Ports = (Publisher<SetpointMessage>, Publisher<MeasuredMessage>);

fn prepare(machines: usize, cpu: usize) -> Result<Vec<Ports>, String> {
    scheduling::bind_to_cpu(cpu).map_err(|shortfall| shortfall.to_string())?;
    scheduling::fifo_priority(DRIVER_PRIORITY).map_err(|shortfall| shortfall.to_string())?;
    let ports = |number| -> Result<Ports, PortError> {
        let bus = Bus::join(&Rig::machine_name(number))?;
        Ok((bus.publisher()?, bus.publisher()?))
    };
    (0..machines).map(ports).collect::<Result<_, _>>().map_err(|error| error.to_string())
}

fn drive(machine: &Machine, grid: &Grid, mut ports: Vec<Ports>, stop: &AtomicBool) {
    let path = fit(machine, BuiltInMotion::Sines, PATH_S);
    let mut tick_ns = grid.next_after(monotonic_ns());
    while !stop.load(Ordering::Relaxed) {
        sleep_until(tick_ns);
        let (setpoint, measured) = at(machine, &path, tick_ns);
        for (setpoints, measurements) in &mut ports {
            // A message that cannot be sent shows as a machine that is not active.
            let _ = setpoints.publish(tick_ns, setpoint);
            let _ = measurements.publish(tick_ns, measured);
        }
        tick_ns = grid.next_after(tick_ns.max(monotonic_ns()));
    }
}

fn at(machine: &Machine, path: &FittedMotion, time_ns: u64) -> (SetpointMessage, MeasuredMessage) {
    let mut state = path.at(time_ns as f64 * 1e-9 / SLOWER % PATH_S);
    state.xd /= SLOWER;
    state.xdd /= SLOWER * SLOWER;
    let legs = leg_motion(machine, &state.motion());
    let setpoint = SetpointMessage {
        x: state.x.into(),
        x_rate: state.xd.into(),
        x_accel: state.xdd.into(),
        ..SetpointMessage::default()
    };
    let measured = MeasuredMessage {
        length_m: legs.length_m,
        length_rate_m_s: legs.rate_m_s,
        rates_valid: 1,
        ..MeasuredMessage::default()
    };
    (setpoint, measured)
}
