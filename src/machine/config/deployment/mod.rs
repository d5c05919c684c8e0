//! The sections of the deployment: `[realtime]`, `[control]`, `[measured]`, `[drive]`, `[limits]`, `[setpoint]`,
//! `[in_position]`, `[timeouts]`, `[operator]`, `[plant]`, `[envelope]`.
//!
//! Every key has a default that works at the configured rate: a slow loop gets smaller gains and longer
//! timeouts. Given values are checked against the limits that follow from the rate.

pub use self::control::{Control, FidelityChoice, STABLE_MASS_RATIOS};
use self::default_limits::rounded_down;
pub use self::hardware::{Drive, SensorNoise};
pub use self::limits::DeploymentLimits;
pub use self::operator::OperatorAccess;
pub use self::plant::Plant;
pub use self::realtime::{Realtime, Scheduler};
use super::bound::Bound;
use super::control_loops::bounded_age_s;
use super::machine::rounded;
use super::reader::SectionReader;
use crate::analysis::envelope;
use hexad_client::messages::source_clock::ClockRule;
use hexad_core::control::parameters::ViolationPolicy;
use hexad_core::control::supervision::in_position::InPositionWindow;
use hexad_core::model::inverse_jacobian::leg_wrenches;
use hexad_core::model::machine::Machine;

pub(in crate::config) mod control;
pub mod default_limits;
mod hardware;
mod limits;
mod operator;
mod plant;
mod realtime;

/// Least default of a timeout in periods. One late message does not mean that its sender is lost.
const MIN_DEFAULT_TIMEOUT_PERIODS: f64 = 4.0;
/// Default of `measured_ms`, if the loop is stable with it; and its least default in periods: longer than one.
const MAX_DEFAULT_MEASURED_MS: f64 = 20.0;
const MIN_MEASURED_PERIODS: f64 = 1.5;
/// Longest timeout \[ms\]. After a second without messages the pose of the platform is unknown.
const MAX_TIMEOUT_MS: f64 = 1000.0;
/// Largest deceleration of the brakes \[m/s^2\]: a hundred times gravity is an impact.
const MAX_BRAKE_DECELERATION_M_S2: f64 = 1000.0;
/// Defaults of `in_position.tolerance_*`, over the RMS error of the pose by noise of the lengths: noise alone does not exceed
/// them in the settling time.
const IN_POSITION_PER_NOISE: f64 = 5.0;
/// Largest tolerance \[m\], \[rad\]: a larger one is in a wrong unit.
const MAX_IN_POSITION: f64 = 0.1;
/// Default and largest settling time \[ms\]: a few periods of the slowest loops; longer than people wait.
const DEFAULT_SETTLING_MS: f64 = 100.0;
const MAX_SETTLING_MS: f64 = 10_000.0;
/// Largest angle of an envelope \[rad\], just over half a turn; a larger one is in a wrong unit.
const MAX_ENVELOPE_ANGLE_RAD: f64 = 3.2;

/// Settings with which a machine is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Deployment {
    /// Cycle and threads.
    pub realtime: Realtime,
    /// Control law.
    pub control: Control,
    /// Limits of motions and forces.
    pub limits: DeploymentLimits,
    /// Errors of the sensors.
    pub noise: SensorNoise,
    /// Delay of the drives.
    pub drive: Drive,
    /// Largest ages of messages.
    pub timeouts: Timeouts,
    /// Treatment of setpoints.
    pub setpoint: SetpointPolicy,
    /// When the platform counts as arrived.
    pub in_position: InPositionWindow,
    /// Access to the control socket.
    pub operator: OperatorAccess,
    /// Simulated hardware.
    pub plant: Plant,
    /// Ranges of the machine's motions, if configured.
    pub envelope: Option<envelope::EnvelopeBounds>,
}

/// Section `[setpoint]`: treatment of setpoints.
#[derive(Clone, Debug, PartialEq)]
pub struct SetpointPolicy {
    /// Reaction to a setpoint that the limits do not allow to follow.
    pub on_violation: ViolationPolicy,
    /// Whether control may begin beyond the engage tolerance of a source in motion.
    pub approach: bool,
    /// Whether a source that is back, away from the platform, is followed only after the request `engage`.
    pub holds_on_return: bool,
    /// What the stamps of remote sources are.
    pub clock: ClockRule,
}

/// Section `[timeouts]`: largest ages of the newest messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeouts {
    /// Age of the setpoint.
    pub setpoint_s: f64,
    /// Age of the measured lengths and rates.
    pub measured_s: f64,
    /// Whether `measured_s` may be longer than the age of measurements with which the loop is stable.
    pub allow_unstable_age: bool,
}

/// Reads and checks the sections; some defaults follow from the machine. Rejected numbers are NaN.
pub(super) fn read(root: &mut SectionReader, machine: &Machine) -> Deployment {
    let realtime = realtime::read(root.section("realtime"));
    let rate_hz = realtime.rate_hz;
    let limits = limits::read(root.section("limits"), machine, &realtime);
    let noise = hardware::read_noise(root.section("measured"));
    let drive = hardware::read_drive(root.section("drive"));
    let control = control::read(
        root.section("control"),
        &control::Plant { realtime: &realtime, machine, limits: &limits, noise: &noise, drive: &drive },
    );
    let setpoint = setpoint(root.section("setpoint"));
    let stable_ms = |age_ms: f64| 1e3 * bounded_age_s(1e-3 * age_ms, &realtime, &control, &drive, &limits);
    let timeouts = timeouts(root.section("timeouts"), rate_hz, setpoint.on_violation, stable_ms);
    let in_position = in_position(root.section("in_position"), &noise, machine);
    Deployment {
        control,
        limits,
        noise,
        drive,
        timeouts,
        setpoint,
        in_position,
        operator: operator::read(root.section("operator")),
        plant: plant::read(root.section("plant"), rate_hz, machine),
        envelope: envelope(root.section("envelope")),
        realtime,
    }
}

fn setpoint(mut section: SectionReader) -> SetpointPolicy {
    let policies = [("stop", ViolationPolicy::Stop), ("limit", ViolationPolicy::Limit)];
    let on_violation = section.choice_or("on_violation", ViolationPolicy::Stop, &policies);
    let approach = section.flag_or("approach", false);
    let holds_on_return = section.choice_or("on_return", false, &[("follow", false), ("hold", true)]);
    let clocks = [
        ("real_time", ClockRule::RealTime),
        ("any_rate", ClockRule::AnyRate),
        ("arrival", ClockRule::Arrival),
    ];
    let clock = section.choice_or("clock", ClockRule::RealTime, &clocks);
    SetpointPolicy { on_violation, approach, holds_on_return, clock }
}

fn in_position(mut section: SectionReader, noise: &SensorNoise, machine: &Machine) -> InPositionWindow {
    // RMS errors of the pose at home by errors of the lengths of RMS 1.
    let by_lengths = leg_wrenches(machine, &machine.home_pose()).try_inverse().unwrap_or_default();
    let [angular, linear] = [0, 3].map(|first| by_lengths.fixed_columns::<3>(first).norm());
    let default =
        |error: f64| rounded_down(IN_POSITION_PER_NOISE * noise.length_m * error).min(MAX_IN_POSITION);
    let bound = Bound::PositiveUpTo(MAX_IN_POSITION);
    let tolerance_m = section.number_or("tolerance_m", default(linear), bound);
    let tolerance_rad = section.number_or("tolerance_rad", default(angular), bound);
    let longest = Bound::Within(0.0, MAX_SETTLING_MS);
    let settling_ms = section.number_or("settling_ms", DEFAULT_SETTLING_MS, longest);
    InPositionWindow { tolerance_m, tolerance_rad, settling_ns: (1e6 * settling_ms) as u64 }
}

fn timeouts(
    mut section: SectionReader,
    rate_hz: f64,
    policy: ViolationPolicy,
    stable_ms: impl Fn(f64) -> f64,
) -> Timeouts {
    let setpoint_ms = match policy {
        ViolationPolicy::Stop => 50.0,
        // Sources may send 30 poses per second, and some are lost.
        ViolationPolicy::Limit => 200.0,
    };
    let mut measured_ms = default_timeout_ms(MAX_DEFAULT_MEASURED_MS, rate_hz);
    if !section.has("measured_ms") {
        // Without measurements control continues only up to the age at which the loop is stable.
        let stable_ms = stable_ms(measured_ms).max(MIN_MEASURED_PERIODS * 1e3 / rate_hz);
        measured_ms = if stable_ms < measured_ms { rounded_down(stable_ms) } else { measured_ms };
    }
    Timeouts {
        setpoint_s: timeout_s(&mut section, "setpoint_ms", default_timeout_ms(setpoint_ms, rate_hz), rate_hz),
        measured_s: timeout_s(&mut section, "measured_ms", measured_ms, rate_hz),
        allow_unstable_age: section.flag_or("allow_unstable_age", false),
    }
}

/// Reads `[envelope]`: all four keys, or none. The reference keeps its poses; velocity and acceleration are requirements.
fn envelope(mut section: SectionReader) -> Option<envelope::EnvelopeBounds> {
    let pose = |angle: Bound, position: Bound| [angle, angle, angle, position, position, position];
    let keys = [
        ("pose_min", pose(Bound::Within(-MAX_ENVELOPE_ANGLE_RAD, 0.0), Bound::NotPositive)),
        ("pose_max", pose(Bound::Within(0.0, MAX_ENVELOPE_ANGLE_RAD), Bound::NotNegative)),
        ("velocity", [Bound::NotNegative; 6]),
        ("acceleration", [Bound::NotNegative; 6]),
    ];
    let found = keys.map(|(key, bounds)| section.vector_within(key, &bounds));
    for ((key, _), value) in keys.iter().zip(&found) {
        if value.is_none() && found.iter().any(Option::is_some) {
            section.reject(key, "missing, must be given with the other keys of the section");
        }
    }
    let [Some(pose_min), Some(pose_max), Some(velocity), Some(acceleration)] = found else { return None };
    Some(envelope::EnvelopeBounds { pose_min, pose_max, velocity, acceleration })
}

/// Default of a timeout \[ms\]. It is longer for long periods.
fn default_timeout_ms(timeout_ms: f64, rate_hz: f64) -> f64 {
    timeout_ms.max(MIN_DEFAULT_TIMEOUT_PERIODS * 1e3 / rate_hz)
}

/// Reads a timeout \[s\]. It must be longer than a period, because messages are sent once per period.
fn timeout_s(section: &mut SectionReader, key: &'static str, default_ms: f64, rate_hz: f64) -> f64 {
    let period_ms = 1e3 / rate_hz;
    let timeout_ms = section.number_or(key, default_ms, Bound::PositiveUpTo(MAX_TIMEOUT_MS));
    if timeout_ms <= period_ms {
        let bound = format!(
            "must be greater than {} (one period of realtime.rate_hz = {rate_hz})",
            rounded(period_ms)
        );
        section.reject(key, bound);
    }
    timeout_ms / 1e3
}
