//! `hexad plant`: the simulated platform as a separate process, in real time or in lock-step.
//!
//! In real time its ticks are the multiples of the period. At each tick it simulates the time since the last
//! tick and applies every force from the instant at which its message was sent, as a drive would. Then it
//! publishes lengths and rates. A force is applied for at most `plant.force_timeout_ms` after it was sent,
//! and only if its message is valid (`validation`).

use std::time::Instant;

use tracing::{debug, info, warn};

use self::other_driver::other_driver;
use self::validation::ForceValidation;
use crate::commands::failure::Failure;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::lockstep::{REPEAT_INTERVAL, poll_until};
use hexad_client::messages::{Bus, ForceMessage, MeasuredMessage, PortError, Publisher, Subscriber};
use hexad_client::realtime::clock::{Grid, sleep_until};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::inputs::DriveStatus;
use hexad_core::control::signals::inputs::Measurement;
use hexad_core::control::signals::state::State;
use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::LEGS;
use hexad_core::model::task::task_coordinates;
use hexad_core::plant::hardware::Hardware;
use hexad_core::plant::imperfections::Imperfections;
use hexad_core::plant::simulator::Brakes;
use hexad_core::plant::terms::PlantTerms;
use hexad_daemon::nanoseconds;
use hexad_machine::config::Config;

mod other_driver;
mod validation;

/// Forces kept between two ticks: 12.8 ms at 20 kHz. A late plant then still applies each force in order.
const FORCE_DEPTH: usize = 256;

/// A bit for each leg.
const ALL_LEGS: u32 = (1 << LEGS) - 1;

/// Longest pause that is simulated \[ns\]. After a longer one (the process was stopped) simulated time
/// continues from now, because all participants would wait for the simulation.
const MAX_PAUSE_NS: u64 = 1_000_000_000;

/// Runs the plant until `stop`.
pub fn run_on_bus(config: &Config, stop: &Stop) -> Result<(), Failure> {
    let bus = config.join()?;
    if let Some(driver) = other_driver(config, &bus)? {
        let name = &config.name;
        return Err(Failure::before_start(format_args!(
            "{driver} already publishes measurements of {name}: end it first"
        )));
    }
    let run = if bus.is_simulated() { run_in_lockstep } else { run_in_real_time };
    Ok(run(config, &bus, stop)?)
}

fn run_in_real_time(config: &Config, bus: &Bus, stop: &Stop) -> Result<(), PortError> {
    let mut forces = bus.subscriber::<ForceMessage>(FORCE_DEPTH)?;
    let mut measured = bus.publisher()?;
    config.deployment.realtime.prepare_peer_thread();

    let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
    let mut tick_ns = grid.next_after(monotonic_ns());
    let mut plant = DrivenPlant::new(config, tick_ns);
    let mut validation = ForceValidation::default();
    let mut pending = None;
    while !stop.is_requested() {
        sleep_until(tick_ns);
        if tick_ns - plant.time_ns > MAX_PAUSE_NS {
            let seconds = seconds_between(plant.time_ns, tick_ns);
            warn!(seconds, "was paused; simulated time continues from now");
            plant.time_ns = tick_ns;
        }
        let before = plant.hardware.simulator().brakes();
        // A force sent after this tick is applied at the next one.
        while let Some(message) = pending.take().or_else(|| forces.receive()) {
            if (tick_ns + 1..=monotonic_ns()).contains(&message.header.time_ns) {
                pending = Some(message);
                break;
            }
            if validation.accepts(&message, tick_ns, plant.timeout_ns) {
                plant.apply(&message);
            }
        }
        validation.update(forces.rejections());
        plant.advance_to(tick_ns);
        log_brakes(before, plant.hardware.simulator().brakes(), plant.code);
        measured.publish(tick_ns, plant.measure())?;
        // The newest grid point that is not in the future, or the next one.
        let now_ns = monotonic_ns();
        tick_ns = grid.next_after(tick_ns.max(now_ns.saturating_sub(grid.period_ns())));
    }
    validation.log_totals();
    Ok(())
}

/// Runs in simulated time, which begins at zero. A force acts from the instant of the measurement that it
/// responds to. The port validates the response; it cannot be old.
fn run_in_lockstep(config: &Config, bus: &Bus, stop: &Stop) -> Result<(), PortError> {
    let mut forces = bus.subscriber(FORCE_DEPTH)?;
    let mut measured = bus.publisher()?;
    let period_ns = nanoseconds(config.deployment.realtime.period_s());
    let mut plant = DrivenPlant::new(config, 0);
    info!("waiting for the daemon and a setpoint source in each step");
    while !stop.is_requested() {
        let time_ns = plant.time_ns;
        let response = exchange(&mut measured, &mut forces, time_ns, plant.measure(), stop);
        let Some(force) = response else { break };
        let before = plant.hardware.simulator().brakes();
        plant.apply(&force?);
        plant.advance_to(time_ns + period_ns);
        log_brakes(before, plant.hardware.simulator().brakes(), plant.code);
    }
    Ok(())
}

/// Publishes a measurement repeatedly until the force of its instant arrives, or until `stop`.
fn exchange(
    measured: &mut Publisher<MeasuredMessage>,
    forces: &mut Subscriber<ForceMessage>,
    time_ns: u64,
    message: MeasuredMessage,
    stop: &Stop,
) -> Option<Result<ForceMessage, PortError>> {
    let mut published: Option<Instant> = None;
    poll_until(
        || stop.is_requested(),
        || {
            if published.is_none_or(|published| published.elapsed() > REPEAT_INTERVAL) {
                published = Some(Instant::now());
                if let Err(error) = measured.publish(time_ns, message) {
                    return Some(Err(error));
                }
            }
            forces.receive_latest().filter(|force| force.release_ns == time_ns).map(Ok)
        },
    )
}

/// Simulated hardware and the force that acts on it.
struct DrivenPlant {
    hardware: Hardware,
    time_ns: u64,
    /// Forces, and the instant at which they expire.
    force: Option<([f64; LEGS], u64)>,
    /// Reason why the newest message contains no valid force.
    code: DiagnosticCode,
    timeout_ns: u64,
}

impl DrivenPlant {
    /// Plant at rest at home, with closed brakes.
    fn new(config: &Config, time_ns: u64) -> Self {
        let hardware = config.deployment.plant.hardware(&config.machine);
        log_terms(config, hardware.simulator().terms());
        info!(name = %config.name, "plant at rest at home, brakes closed");
        let timeout_ns = nanoseconds(config.deployment.plant.force_timeout_s);
        Self { hardware, time_ns, force: None, code: DiagnosticCode::None, timeout_ns }
    }

    /// Applies the force of a message from the instant at which it was sent.
    fn apply(&mut self, message: &ForceMessage) {
        self.advance_to(message.header.time_ns);
        self.code = DiagnosticCode::from_number(message.diagnostic_code).unwrap_or_default();
        let is_under_control = State::from_number(message.state).is_some_and(State::has_control);
        let is_valid = message.has_valid_content() && is_under_control;
        let expires_ns = message.header.time_ns.saturating_add(self.timeout_ns);
        self.force = is_valid.then_some((message.force_n, expires_ns));
    }

    fn advance_to(&mut self, time_ns: u64) {
        if let Some((force, expires_ns)) = self.force {
            self.simulate_until(time_ns.min(expires_ns), Some(&force));
            if time_ns > expires_ns {
                self.force = None;
            }
        }
        self.simulate_until(time_ns, None);
    }

    fn simulate_until(&mut self, time_ns: u64, force: Option<&[f64; LEGS]>) {
        if time_ns > self.time_ns {
            self.hardware.advance(time_ns - self.time_ns, force.copied());
            self.time_ns = time_ns;
        }
    }

    fn measure(&mut self) -> MeasuredMessage {
        let (length_m, rate) = self.hardware.measure();
        let simulator = self.hardware.simulator();
        let state = simulator.state();
        MeasuredMessage {
            pose_valid: 2,
            x: task_coordinates(&state.pose, &simulator.machine().home),
            twist: state.twist.vector().into(),
            ..MeasuredMessage::from(&Measurement {
                time_ns: self.time_ns,
                length_m,
                rate_m_s: Some(rate),
                drives: self.drive_status(),
                ..Measurement::default()
            })
        }
    }

    /// Status of the drives: enabled while a valid force is commanded, with the present brakes and forces.
    fn drive_status(&self) -> DriveStatus {
        let simulator = self.hardware.simulator();
        let all_if = |is_set: bool| Some(if is_set { ALL_LEGS } else { 0 });
        DriveStatus {
            enabled: all_if(self.force.is_some()),
            brake_open: all_if(simulator.brakes() == Brakes::Open),
            fault: Some(0),
            force_n: Some(simulator.forces()),
        }
    }
}

/// Logs the effects simulated beyond the model, and those omitted by the tolerance.
fn log_terms(config: &Config, terms: &PlantTerms) {
    let plant = &config.deployment.plant;
    if plant.imperfections == (Imperfections { seed: plant.imperfections.seed, ..Imperfections::default() }) {
        return;
    }
    let tolerance_um = plant.tolerance_m * 1e6;
    info!(seed = plant.imperfections.seed, step_us = terms.step_s * 1e6, tolerance_um, "imperfect plant");
    let wanted = &plant.imperfections;
    for (what, wanted, acts) in [
        ("drive.bandwidth_hz", wanted.drive.bandwidth_hz.is_some(), terms.lag_per_s.is_some()),
        ("leg", wanted.leg.is_some(), terms.elastic.is_some()),
    ] {
        if wanted && !acts {
            info!(tolerance_um, "plant.{what} is left out: it moves nothing by more than the tolerance");
        }
    }
}

fn log_brakes(before: Brakes, now: Brakes, code: DiagnosticCode) {
    match (before, now) {
        (Brakes::Open, Brakes::Open) | (Brakes::EndStop { .. }, _) => {}
        (Brakes::Open, Brakes::Closing { .. } | Brakes::Closed) => match code {
            DiagnosticCode::None => warn!("forces stopped arriving: brakes closing"),
            code if code.is_fault() => warn!("no valid force ({}): brakes closing", code.name()),
            code => info!("no valid force ({}): brakes closing", code.name()),
        },
        (_, Brakes::Open) => info!("valid force: brakes open"),
        (_, Brakes::EndStop { leg }) => {
            warn!(leg = leg + 1, "a leg reached its end stop: brakes closed for good")
        }
        (_, Brakes::Closed | Brakes::Closing { .. }) => debug!("brakes closed"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_force_acts_beyond_its_expiry_however_late_the_plant_looks() {
        let config = Config::parse(include_str!("../../../config/fried2008.toml"), "a test").unwrap();
        let expires_ns = 10_000_000;
        let lengths = |until_ns, looks: &[u64]| {
            let mut plant = DrivenPlant::new(&config, 0);
            plant.force = Some(([200.0; LEGS], until_ns));
            looks.iter().for_each(|time_ns| plant.advance_to(*time_ns));
            plant.hardware.measure()
        };
        let late = lengths(expires_ns, &[5 * expires_ns]);
        assert_eq!(late, lengths(expires_ns, &[expires_ns, 5 * expires_ns]));
        assert_ne!(late, lengths(5 * expires_ns, &[5 * expires_ns]), "a force that lasts");
    }
}
