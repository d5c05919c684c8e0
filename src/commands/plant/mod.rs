//! `hexad plant`: the simulated platform as a process of its own, in real time or in lock-step.
//!
//! In real time it ticks on the multiples of the period. At each tick it lets the time since the last one pass, with
//! every force applied from the instant its message was sent, as a drive would; then it publishes lengths
//! and rates. A force is applied no longer than `plant.force_timeout_ms` after it was sent, and only if it
//! can be believed (`doubt`).

use std::time::Instant;

use tracing::{debug, info, warn};

use self::doubt::Doubt;
use crate::config::Config;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::State;
use crate::daemon::nanoseconds;
use crate::messages::clock::monotonic_ns;
use crate::messages::lockstep::{REPEAT, look_until};
use crate::messages::ports::{Bus, PortError, Time};
use crate::messages::structs::{ForceMessage, MeasuredMessage};
use crate::model::machine::LEGS;
use crate::model::task::task_coordinates;
use crate::plant::hardware::Hardware;
use crate::plant::imperfections::Imperfections;
use crate::plant::simulator::Brakes;
use crate::plant::terms::PlantTerms;
use crate::realtime::clock::{Grid, sleep_until};
use crate::realtime::setup::scheduling;
use crate::realtime::stop_request::Stop;

mod doubt;

/// Forces kept between two ticks: 12.8 ms at 20 kHz, so that a late plant still applies each in its turn.
const FORCE_DEPTH: usize = 256;

/// After a longer pause (the process was stopped) simulated time goes on from now: nobody waits for a
/// second of simulation.
const LONGEST_PAUSE_NS: u64 = 1_000_000_000;

/// Runs until `stop`.
pub fn run(config: &Config, stop: &Stop) -> Result<(), PortError> {
    let bus = config.join()?;
    match bus.time() {
        Time::Real => run_in_real_time(config, &bus, stop),
        Time::Simulated => run_in_lockstep(config, &bus, stop),
    }
}

fn run_in_real_time(config: &Config, bus: &Bus, stop: &Stop) -> Result<(), PortError> {
    let mut forces = bus.sink::<ForceMessage>(FORCE_DEPTH)?;
    let mut measured = bus.source::<MeasuredMessage>()?;
    prepare_thread(config);

    let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
    let mut tick_ns = grid.next_after(monotonic_ns());
    let mut driven = Driven::new(config, tick_ns);
    let mut doubt = Doubt::default();
    let mut pending = None;
    while !stop.is_requested() {
        sleep_until(tick_ns);
        if tick_ns - driven.time_ns > LONGEST_PAUSE_NS {
            warn!(seconds = (tick_ns - driven.time_ns) as f64 * 1e-9, "was paused; time goes on from now");
            driven.time_ns = tick_ns;
        }
        let before = driven.hardware.simulator().brakes();
        // A force sent after this tick waits for the next one.
        while let Some(message) = pending.take().or_else(|| forces.receive()) {
            if (tick_ns + 1..=monotonic_ns()).contains(&message.header.time_ns) {
                pending = Some(message);
                break;
            }
            if doubt.believes(&message, tick_ns, driven.timeout_ns) {
                driven.receive(&message);
            }
        }
        doubt.hear(forces.rejected());
        driven.advance_to(tick_ns);
        tell(before, driven.hardware.simulator().brakes(), driven.cause);
        measured.publish(tick_ns, measured_message(&mut driven.hardware))?;
        // The newest grid point that is not in the future, or else the next.
        let now_ns = monotonic_ns();
        tick_ns = grid.next_after(tick_ns.max(now_ns.saturating_sub(grid.period_ns())));
    }
    doubt.tell_all();
    Ok(())
}

/// In simulated time, which begins at zero: a force is there at the instant of the measurement that it answers. What
/// the answer needs is the port's to judge; it cannot be old.
fn run_in_lockstep(config: &Config, bus: &Bus, stop: &Stop) -> Result<(), PortError> {
    let mut forces = bus.sink::<ForceMessage>(FORCE_DEPTH)?;
    let mut measured = bus.source::<MeasuredMessage>()?;
    let period_ns = nanoseconds(config.deployment.realtime.period_s());
    let mut driven = Driven::new(config, 0);
    info!("waiting for the daemon and a setpoint source in each step");
    while !stop.is_requested() {
        let time_ns = driven.time_ns;
        let message = measured_message(&mut driven.hardware);
        measured.publish(time_ns, message)?;
        let mut said = Instant::now();
        let answer = look_until(
            || stop.is_requested(),
            || {
                if said.elapsed() > REPEAT {
                    said = Instant::now();
                    if let Err(failed) = measured.publish(time_ns, message) {
                        return Some(Err(failed));
                    }
                }
                forces.newest().filter(|force| force.release_ns == time_ns).map(Ok)
            },
        );
        let Some(force) = answer else { break };
        let before = driven.hardware.simulator().brakes();
        driven.receive(&force?);
        driven.advance_to(time_ns + period_ns);
        tell(before, driven.hardware.simulator().brakes(), driven.cause);
    }
    Ok(())
}

/// A simulator and the force on it.
struct Driven {
    hardware: Hardware,
    time_ns: u64,
    /// Forces and the instant they expire.
    force: Option<([f64; LEGS], u64)>,
    /// What the newest message says about why there is no force.
    cause: DiagnosticCode,
    timeout_ns: u64,
}

impl Driven {
    /// At rest at home, brakes closed.
    fn new(config: &Config, time_ns: u64) -> Self {
        let hardware = hardware(config);
        say_terms(config, hardware.simulator().terms());
        info!(name = %config.name, "plant at rest at home, brakes closed");
        let timeout_ns = nanoseconds(config.deployment.plant.force_timeout_s);
        Self { hardware, time_ns, force: None, cause: DiagnosticCode::None, timeout_ns }
    }

    /// Applies a message from the instant it was sent.
    fn receive(&mut self, message: &ForceMessage) {
        self.advance_to(message.header.time_ns);
        self.cause = DiagnosticCode::from_number(message.fault).unwrap_or_default();
        let is_under_control = State::from_number(message.state).is_some_and(State::has_control);
        let is_finite = message.force_n.iter().all(|force| force.is_finite());
        let usable = message.valid == 1 && is_under_control && is_finite;
        self.force =
            usable.then_some((message.force_n, message.header.time_ns.saturating_add(self.timeout_ns)));
    }

    fn advance_to(&mut self, time_ns: u64) {
        if let Some((force, expires_ns)) = self.force {
            self.pass(time_ns.min(expires_ns), Some(&force));
            if time_ns > expires_ns {
                self.force = None;
            }
        }
        self.pass(time_ns, None);
    }

    fn pass(&mut self, time_ns: u64, force: Option<&[f64; LEGS]>) {
        if time_ns > self.time_ns {
            self.hardware.advance(time_ns - self.time_ns, force.copied());
            self.time_ns = time_ns;
        }
    }
}

fn measured_message(hardware: &mut Hardware) -> MeasuredMessage {
    let (length_m, length_rate_m_s) = hardware.measure();
    let simulator = hardware.simulator();
    let state = simulator.state();
    MeasuredMessage {
        length_m,
        length_rate_m_s,
        pose_valid: 1,
        x: task_coordinates(&state.pose, &simulator.machine().home),
        twist: state.twist.vector().into(),
        ..MeasuredMessage::default()
    }
}

/// The hardware that a configuration describes.
pub fn hardware(config: &Config) -> Hardware {
    let plant = &config.deployment.plant;
    Hardware::new(
        &config.machine,
        plant.brake_deceleration_m_s2,
        plant.step_s,
        plant.tolerance_m,
        &plant.imperfections,
    )
}

/// What is simulated beyond the model, and what of it the tolerance leaves out.
fn say_terms(config: &Config, terms: &PlantTerms) {
    let plant = &config.deployment.plant;
    if plant.imperfections == (Imperfections { seed: plant.imperfections.seed, ..Imperfections::default() }) {
        return;
    }
    let tolerance_um = plant.tolerance_m * 1e6;
    info!(seed = plant.imperfections.seed, step_us = terms.step * 1e6, tolerance_um, "imperfect plant");
    let wanted = &plant.imperfections;
    for (what, wanted, acts) in [
        ("drive.bandwidth_hz", wanted.drive.bandwidth_hz.is_some(), terms.lag.is_some()),
        ("leg", wanted.leg.is_some(), terms.elastic.is_some()),
    ] {
        if wanted && !acts {
            info!(tolerance_um, "plant.{what} is left out: it moves nothing by more than the tolerance");
        }
    }
}

fn tell(before: Brakes, now: Brakes, cause: DiagnosticCode) {
    match (before, now) {
        (Brakes::Open, Brakes::Open) | (Brakes::EndStop { .. }, _) => {}
        (Brakes::Open, Brakes::Closing { .. } | Brakes::Closed) => match cause {
            DiagnosticCode::None => warn!("forces stopped arriving: brakes closing"),
            cause if cause.is_fault() => warn!("no valid force ({}): brakes closing", cause.name()),
            cause => info!("no valid force ({}): brakes closing", cause.name()),
        },
        (_, Brakes::Open) => info!("valid force: brakes open"),
        (_, Brakes::EndStop { leg }) => {
            warn!(leg = leg + 1, "a leg reached its end stop: brakes closed for good")
        }
        (_, Brakes::Closed | Brakes::Closing { .. }) => debug!("brakes closed"),
    }
}

/// Best effort: a simulator or a setpoint source below the daemon's priority, so that on a busy host it
/// is as punctual as hardware.
pub(super) fn prepare_thread(config: &Config) {
    scheduling::set_shortest_timer_slack();
    if let Err(shortfall) = scheduling::fifo_priority((config.deployment.realtime.io_priority - 1).max(1)) {
        debug!("{shortfall}");
    }
}
