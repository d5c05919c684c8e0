//! `[control]`: the control law, its gains, and the conditions to engage.

use core::f64::consts::TAU;

use super::hardware::{Drive, SensorNoise};
use super::limits::DeploymentLimits;
use super::realtime::Realtime;
use crate::analysis::sampled_loop::{SampledLoop, edge};
use crate::config::bound::Bound;
use crate::config::machine::rounded;
use crate::config::reader::SectionReader;
use hexad_core::control::law::ControlMode;
use hexad_core::control::law::input_matrix::InputMatrix;
use hexad_core::control::law::leg_masses::LegMasses;
use hexad_core::control::signals::pair::Pair;
use hexad_core::control::signals::state::AfterStop;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::machine::Machine;

/// Default of the bandwidths if the rate permits it \[Hz\]: stiff enough for micrometres, soft enough for a
/// structure that is not quite rigid.
const DEFAULT_BANDWIDTH_HZ: f64 = 10.0;
/// Usual damping ratios; a ratio beyond them is a mistake.
const DAMPING_RATIO_BOUND: Bound = Bound::Within(0.1, 10.0);
/// Masses of the platform, as ratios of the modelled mass, for which the default bandwidths and the estimator are
/// stable; a narrower range causes a warning. A payload that is not configured should stay well within them.
pub const STABLE_MASS_RATIOS: [f64; 2] = [0.7, 1.5];
/// Largest bandwidth of the estimator over the lesser bandwidth of the loops: with the delay of the drives configured, and
/// without. A faster estimator only amplifies noise, and an unknown delay would make it unstable.
const ESTIMATOR_RATIO: f64 = 3.0;
const ESTIMATOR_RATIO_DELAY_UNKNOWN: f64 = 1.05;
/// Steps in which an estimator is slowed down until the loops have their gain margin, each a fifth.
const ESTIMATOR_STEPS: i32 = 20;
/// Default of `disturbance_m_s2_per_sqrt_s`: with a reading noise of 10 um an estimator of 30 Hz at 1 kHz.
const DEFAULT_DISTURBANCE: f64 = 2.0;
/// Largest distances between platform and setpoint to engage \[m\], \[rad\]. A greater distance needs a
/// trajectory.
const MAX_ENGAGE_M: f64 = 0.1;
const MAX_ENGAGE_RAD: f64 = 0.2;
/// Largest following errors that a configuration may allow \[m\], \[rad\].
const MAX_FOLLOWING_M: f64 = 1.0;
const MAX_FOLLOWING_RAD: f64 = 1.0;
/// Default of `lost_hold_s`: longer than the restart of a simulator, short enough for people on a tilted platform.
const DEFAULT_LOST_HOLD_S: f64 = 10.0;
/// Default of the largest velocity errors over the velocity limits: far above the noise of rates, and reached by a free
/// fall within hundredths of a second.
const DEFAULT_VELOCITY_ERROR_RATIO: f64 = 0.3;
/// The same for unstated friction: times its step of acceleration over the natural frequency. A step without stiction
/// causes 0.4, a leg that sticks and slips up to 1.1 (2026-11-26).
const VELOCITY_ERROR_BY_FRICTION: f64 = 1.5;

/// Section `[control]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// Law from errors to forces.
    pub mode: ControlMode,
    /// Natural frequency of the position error.
    pub position_bandwidth_hz: f64,
    /// Damping ratio of the position error.
    pub position_damping_ratio: f64,
    /// Natural frequency of the orientation error.
    pub orientation_bandwidth_hz: f64,
    /// Damping ratio of the orientation error.
    pub orientation_damping_ratio: f64,
    /// Largest distance between platform and setpoint to engage.
    pub engage_position_m: f64,
    /// The same for the angle between them.
    pub engage_orientation_rad: f64,
    /// Largest following error while the platform is controlled.
    pub following_position_m: f64,
    /// The same for the angle between them.
    pub following_orientation_rad: f64,
    /// Largest velocity error while the platform is controlled.
    pub following_velocity_m_s: f64,
    /// The same for the angular velocity.
    pub following_velocity_rad_s: f64,
    /// Terms of the dynamics that the loop evaluates.
    pub fidelity: FidelityChoice,
    /// Whether the estimated disturbance is compensated.
    pub compensate_disturbances: bool,
    /// Standard deviation of the change of a disturbance in a second; it grows with the root of the time.
    pub disturbance_m_s2_per_sqrt_s: f64,
    /// Bandwidth of the estimator, as it follows from noise, disturbances and the bandwidths of the loops.
    pub estimator_bandwidth_hz: f64,
    /// State after the stop of a platform that lost its setpoint.
    pub on_setpoint_lost: AfterStop,
    /// Time for which a platform without setpoints holds its pose before it parks or stops.
    pub lost_hold_s: f64,
    /// Largest error [`FidelityChoice::Auto`] may make, as a share of the peak force of the envelope.
    pub fidelity_tolerance_share: f64,
    /// Effective masses of the legs at home, and the loop gains of their modes.
    pub leg_masses: LegMasses,
}

/// Choice of the model's fidelity, `control.fidelity`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FidelityChoice {
    /// The cheapest fidelity that the envelope allows.
    Auto,
    /// A configured fidelity, which has inertia.
    Fixed(Fidelity),
}

/// Sections that the control law depends on.
pub(super) struct Plant<'a> {
    pub realtime: &'a Realtime,
    pub machine: &'a Machine,
    pub limits: &'a DeploymentLimits,
    pub noise: &'a SensorNoise,
    pub drive: &'a Drive,
}

pub(super) fn read(mut section: SectionReader, plant: &Plant<'_>) -> Control {
    let Plant { machine, limits, .. } = *plant;
    let modes = ControlMode::ALL.map(|mode| (mode.name(), mode));
    let mode = section.choice_or("mode", ControlMode::default(), &modes);
    let leg_masses = LegMasses::at_home(machine);
    let LegMasses { softest_mode_gain_ratio, stiffest_mode_gain_ratio, .. } = leg_masses;
    let gains_on_legs = [softest_mode_gain_ratio, stiffest_mode_gain_ratio];
    let [softest, stiffest] = if mode.acts_on_legs() { gains_on_legs } else { [1.0; 2] };
    let compensate_disturbances = section.flag_or("compensate_disturbances", mode.includes_inertia());
    let of = |damping_ratio: f64| plant.sampled_loop(damping_ratio, compensate_disturbances);
    let [position_bandwidth_hz, position_damping_ratio] =
        gains(&mut section, ["position_bandwidth_hz", "position_damping_ratio"], plant, of, stiffest);
    let [orientation_bandwidth_hz, orientation_damping_ratio] =
        gains(&mut section, ["orientation_bandwidth_hz", "orientation_damping_ratio"], plant, of, 1.0);
    let disturbance_m_s2_per_sqrt_s =
        section.number_or("disturbance_m_s2_per_sqrt_s", DEFAULT_DISTURBANCE, Bound::Positive);
    let loops = if mode.acts_on_legs() {
        [softest, stiffest].map(|gain| (position_bandwidth_hz, of(position_damping_ratio), gain))
    } else {
        let held_pole_t = limits.held_pole_per_s * plant.realtime.period_s();
        let with = |damping_ratio| SampledLoop { held_pole_t, ..of(damping_ratio) };
        [
            (position_bandwidth_hz, with(position_damping_ratio), 1.0),
            (orientation_bandwidth_hz, with(orientation_damping_ratio), 1.0),
        ]
    };
    let by_friction =
        velocity_errors_by_friction(machine, &leg_masses, [orientation_bandwidth_hz, position_bandwidth_hz]);
    let (on_setpoint_lost, lost_hold_s) = setpoint_loss(&mut section);
    let mut up_to = |key, default, most| section.number_or(key, default, Bound::PositiveUpTo(most));
    Control {
        mode,
        position_bandwidth_hz,
        position_damping_ratio,
        orientation_bandwidth_hz,
        orientation_damping_ratio,
        engage_position_m: up_to("engage_position_m", 0.002, MAX_ENGAGE_M),
        engage_orientation_rad: up_to("engage_orientation_rad", 0.005, MAX_ENGAGE_RAD),
        following_position_m: up_to("following_position_m", 0.02, MAX_FOLLOWING_M),
        following_orientation_rad: up_to("following_orientation_rad", 0.05, MAX_FOLLOWING_RAD),
        following_velocity_m_s: section.number_or(
            "following_velocity_m_s",
            by_friction.linear.max(DEFAULT_VELOCITY_ERROR_RATIO * limits.reference.position.velocity),
            Bound::Positive,
        ),
        following_velocity_rad_s: section.number_or(
            "following_velocity_rad_s",
            by_friction.angular.max(DEFAULT_VELOCITY_ERROR_RATIO * limits.reference.orientation.velocity),
            Bound::Positive,
        ),
        fidelity: fidelity(&mut section),
        fidelity_tolerance_share: section.number_or("fidelity_tolerance", 0.001, Bound::PositiveUpTo(1.0)),
        compensate_disturbances,
        disturbance_m_s2_per_sqrt_s,
        estimator_bandwidth_hz: plant.estimator_hz(disturbance_m_s2_per_sqrt_s, &loops),
        on_setpoint_lost,
        lost_hold_s,
        leg_masses,
    }
}

/// Goal of a platform that lost its setpoint, and the time for which it holds its pose before that.
fn setpoint_loss(section: &mut SectionReader) -> (AfterStop, f64) {
    let goals = [("fault", AfterStop::Fault), ("stop", AfterStop::Standby), ("park", AfterStop::Park)];
    let goal = section.choice_or("on_setpoint_lost", AfterStop::Fault, &goals);
    (goal, section.number_or("lost_hold_s", DEFAULT_LOST_HOLD_S, Bound::Positive))
}

/// Largest velocity errors of the platform where unstated friction of all legs reverses at once, in loops of these
/// bandwidths.
fn velocity_errors_by_friction(
    machine: &Machine,
    masses: &LegMasses,
    [turn_hz, shift_hz]: [f64; 2],
) -> Pair<f64> {
    let input_matrix = InputMatrix::at_home(machine, ControlMode::ComputedTorque, masses, Fidelity::Exact);
    let by_force = input_matrix.acceleration_by_force(machine, &machine.home_pose());
    let reversal = 2.0 * machine.actuator.friction_uncertainty_n;
    let of = |first: usize, hertz: f64| {
        let columns = by_force.column_iter().map(|column| column.fixed_rows::<3>(first).norm());
        VELOCITY_ERROR_BY_FRICTION * reversal * columns.sum::<f64>() / (TAU * hertz)
    };
    Pair { angular: of(0, turn_hz), linear: of(3, shift_hz) }
}

fn fidelity(section: &mut SectionReader) -> FidelityChoice {
    let fidelities = Fidelity::ALL.into_iter().rev().filter(|fidelity| fidelity.has_inertia());
    let options = fidelities
        .map(|fidelity| (fidelity.name(), FidelityChoice::Fixed(fidelity)))
        .chain([("auto", FidelityChoice::Auto)]);
    section.choice_or("fidelity", FidelityChoice::Fixed(Fidelity::Exact), &options.collect::<Vec<_>>())
}

impl Plant<'_> {
    /// The loop with its longest delay, and an estimator of the same bandwidth.
    fn sampled_loop(&self, damping_ratio: f64, compensates_disturbance: bool) -> SampledLoop {
        let delay_s = self.drive.total_delay_s();
        let sampled = self.realtime.sampled_loop(f64::NAN, damping_ratio, delay_s);
        SampledLoop { compensates_disturbance, ..sampled }
    }

    /// Bandwidth of the estimator \[Hz\]: the optimum for noise and disturbances, bounded by the ratio that the delay
    /// allows. It is slower if a loop would not be stable with [`STABLE_MASS_RATIOS`], and as fast as a loop if only that is
    /// stable.
    fn estimator_hz(&self, disturbance: f64, loops: &[(f64, SampledLoop, f64); 2]) -> f64 {
        let Self { realtime, noise, drive, .. } = self;
        let period_s = realtime.period_s();
        let optimum_hz = optimum_hz(disturbance, noise.length_m, period_s);
        let ratio = if drive.delay_s.is_some() { ESTIMATOR_RATIO } else { ESTIMATOR_RATIO_DELAY_UNKNOWN };
        let largest_hz = loops.iter().map(|(hertz, ..)| hertz * ratio).fold(f64::INFINITY, f64::min);
        // Another value in the file is wrong.
        if !(largest_hz.min(optimum_hz).is_finite() && largest_hz.min(optimum_hz) > 0.0) {
            return f64::NAN;
        }
        let first = |is_stable: fn(&SampledLoop) -> bool| {
            let is_stable_with = |estimator_hz: &f64| {
                loops.iter().all(|(hertz, sampled, gain)| {
                    let (wn_t, estimator_ratio) = (TAU * hertz * period_s, estimator_hz / hertz);
                    is_stable(&SampledLoop { wn_t, estimator_ratio, ..*sampled }.with_feedback_gain(*gain))
                })
            };
            // These steps do not depend on the noise, so that more noise never makes the estimator faster.
            let mut steps = (0..ESTIMATOR_STEPS).map(|step| largest_hz * libm::pow(0.8, step.into()));
            let slowed = steps.find(is_stable_with).map(|hertz| hertz.min(optimum_hz)).filter(is_stable_with);
            slowed.or_else(|| loops.iter().map(|(hertz, ..)| *hertz).find(is_stable_with))
        };
        let stable = first(is_stable_with_masses).or_else(|| first(SampledLoop::is_stable));
        stable.unwrap_or(largest_hz.min(optimum_hz))
    }
}

/// Bandwidth of the estimator that is best for these disturbances and this noise of the lengths \[Hz\].
pub(in crate::config) fn optimum_hz(disturbance: f64, noise_m: f64, period_s: f64) -> f64 {
    libm::pow(disturbance * disturbance / (noise_m * noise_m * period_s), 1.0 / 6.0) / TAU
}

fn is_stable_with_masses(sampled: &SampledLoop) -> bool {
    STABLE_MASS_RATIOS.iter().all(|mass| sampled.is_stable_with_gain(1.0 / mass))
}

/// Reads bandwidth and damping ratio of a loop, and rejects a bandwidth that is unstable with the longest delay.
/// `stiffest` is the gain of the stiffest mode as a multiple of the gain of the loop.
fn gains(
    section: &mut SectionReader,
    [bandwidth_key, damping_key]: [&'static str; 2],
    plant: &Plant<'_>,
    of: impl Fn(f64) -> SampledLoop,
    stiffest: f64,
) -> [f64; 2] {
    let Realtime { rate_hz, .. } = *plant.realtime;
    let damping_ratio = section.number_or(damping_key, 1.0, DAMPING_RATIO_BOUND);
    let sampled = of(damping_ratio);
    let with =
        |hertz: f64| SampledLoop { wn_t: TAU * hertz / rate_hz, ..sampled }.with_feedback_gain(stiffest);
    let default_hz = if is_stable_with_masses(&with(DEFAULT_BANDWIDTH_HZ)) {
        DEFAULT_BANDWIDTH_HZ
    } else {
        largest_hz(|hertz| is_stable_with_masses(&with(hertz)), rate_hz)
    };
    let bandwidth_hz = section.number_or(bandwidth_key, default_hz, Bound::Positive);
    let is_known = sampled.delay_periods.is_finite() && damping_ratio.is_finite() && bandwidth_hz.is_finite();
    if is_known && !with(bandwidth_hz).is_stable() {
        let modes = if stiffest == 1.0 {
            String::new()
        } else {
            format!(" in the stiffest mode of the legs, which has {} times the gain", rounded(stiffest))
        };
        let bound = format!(
            "must be at most {} at realtime.rate_hz = {rate_hz} and {damping_key} = {damping_ratio} \
             (stable with {:.2} periods from measurement to force{modes})",
            largest_hz(|hertz| with(hertz).is_stable(), rate_hz),
            sampled.delay_periods,
        );
        section.reject(bandwidth_key, bound);
        return [f64::NAN, damping_ratio];
    }
    [bandwidth_hz, damping_ratio]
}

/// Largest stable bandwidth \[Hz\], rounded down so that the number in a message is accepted.
fn largest_hz(is_stable: impl Fn(f64) -> bool, rate_hz: f64) -> f64 {
    (edge(0.0, rate_hz, is_stable) * 1e3).floor() / 1e3
}
