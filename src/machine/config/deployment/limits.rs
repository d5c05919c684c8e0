//! `[limits]`: limits of motions and forces.

use super::default_limits::DefaultLimits;
use super::realtime::Realtime;
use crate::analysis::held_forces::{HeldForces, SurveyedPose};
use crate::config::bound::Bound;
use crate::config::machine::rounded;
use crate::config::reader::SectionReader;
use hexad_core::control::signals::limits::{DerivativeLimits, Limits as ReferenceLimits};
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;

/// Time from no force to the largest at the default force rate \[s\]: slower than any noise
/// worth following, faster than any motion.
const FORCE_RISE_S: f64 = 0.01;
/// Default of the largest condition: an error of a length is up to a hundred times as large at the platform, and
/// a load needs leg forces of up to a hundred times its size.
const DEFAULT_CONDITION: f64 = 100.0;
/// Largest exponent of the growth of a displacement under constant forces, until a force computed from it acts. With this
/// exponent a loop with the default gains of a slow rate is stable with 0.7 of the modelled mass, as without growth.
const MAX_GROWTH_EXPONENT: f64 = 0.2;
/// Part of the bound on the change of an acceleration within a hold that motions reach. The bound itself is
/// for the worst direction at the largest velocity, where no stop from the worst pose would be verified.
/// Found, not proved: the worst of searches of 2e8 cycles was 0.17, and this is half as much again.
const TURNING_SHARE: f64 = 0.25;
/// From the beginning of a hold to its middle, in periods.
const MIDDLE_OF_HOLD: f64 = 0.5;
/// Least default of the condition, as a ratio of the condition at home. Otherwise the platform could not
/// leave home.
const MIN_CONDITION_PER_HOME: f64 = 1.5;
/// Default of the distance from the ends of the stroke, as a ratio of the stroke: many times the following
/// error of a faultless machine.
const DEFAULT_STROKE_MARGIN_RATIO: f64 = 0.005;
/// Smallest and largest `scale`. With the default `autonomous_scale` the smallest leaves a hundredth of the limits to
/// autonomous motions.
const SCALE_BOUND: Bound = Bound::Within(0.05, 1.0);

/// Section `[limits]`.
#[derive(Clone, Debug, PartialEq)]
pub struct DeploymentLimits {
    /// Limits of setpoints and of autonomous motions of the daemon, before `scale`.
    pub reference: ReferenceLimits,
    /// Factor on velocity, acceleration and jerk of the reference, for commissioning and for people on the platform.
    pub scale: f64,
    /// Acceleration that feedback may add to the limits, as a ratio of them.
    pub feedback_scale: f64,
    /// Change of the payload under control that is no fault \[kg\]; `None`: the default of the machine.
    pub payload_change_kg: Option<f64>,
    /// Sudden disturbance that is no impact \[m/s^2\]; `None` for the default, which follows from the limit
    /// of acceleration.
    pub disturbance_step_m_s2: Option<f64>,
    /// Distance that the reference keeps from the ends of the stroke.
    pub stroke_margin_m: f64,
    /// Largest change of a force.
    pub force_rate_n_s: f64,
    /// Largest Frobenius condition of the legs' wrenches under control.
    pub condition: f64,
    /// Largest pole of the platform under constant forces within that condition \[1/s\].
    pub held_pole_per_s: f64,
}

impl DeploymentLimits {
    /// Limits that the reference keeps. Checks of the machine, feedback and monitoring use `reference`: `scale`
    /// changes neither the validity of a file nor the size of disturbances.
    pub fn in_force(&self) -> ReferenceLimits {
        self.reference.scaled(self.scale)
    }
}

/// Reads the section. Autonomous motions use a fifth of the limits.
pub(super) fn read(mut section: SectionReader, machine: &Machine, realtime: &Realtime) -> DeploymentLimits {
    let default = DefaultLimits::new(machine);
    let mut of = |keys: [&'static str; 3], default: DerivativeLimits| {
        let defaults = [default.velocity, default.acceleration, default.jerk];
        let mut read = keys.into_iter().zip(defaults);
        let mut next = || read.next().map_or(f64::NAN, |(key, x)| section.number_or(key, x, Bound::Positive));
        DerivativeLimits { velocity: next(), acceleration: next(), jerk: next() }
    };
    let position = of(["velocity_m_s", "acceleration_m_s2", "jerk_m_s3"], default.position);
    let orientation = of(["velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"], default.orientation);
    let scale = section.number_or("scale", 1.0, SCALE_BOUND);
    let autonomous_scale = section.number_or("autonomous_scale", 0.2, Bound::PositiveUpTo(1.0));
    let force_rate_n_s =
        section.number_or("force_rate_n_s", machine.actuator.max_force_n / FORCE_RISE_S, Bound::Positive);
    let feedback_scale = section.number_or("feedback_scale", 0.5, Bound::Positive);
    let payload_change_kg = allowed(&mut section, "payload_change_kg");
    let disturbance_step_m_s2 = allowed(&mut section, "disturbance_step_m_s2");
    let stroke_margin_m = stroke_margin_m(&mut section, machine);
    let turning = turning_condition(machine, realtime, &position, feedback_scale);
    let (condition, survey) = condition(&mut section, machine, realtime, turning);
    let held_pole_per_s = survey.iter().map(|pose| pose.pole_per_s).fold(0.0, f64::max);
    let reference = ReferenceLimits { position, orientation, autonomous_scale };
    check_turning(&section, machine, realtime, &survey, &reference, feedback_scale);
    DeploymentLimits {
        reference,
        scale,
        feedback_scale,
        payload_change_kg,
        disturbance_step_m_s2,
        stroke_margin_m,
        force_rate_n_s,
        condition,
        held_pole_per_s,
    }
}

/// A given bound of the disturbance. The default follows from the controller's model, which is built later.
fn allowed(section: &mut SectionReader, key: &'static str) -> Option<f64> {
    let given = section.number_or(key, f64::INFINITY, Bound::PositiveOrInfinite);
    section.has(key).then_some(given)
}

/// Distance from the ends of the stroke. Home must keep it, otherwise the platform could not park.
fn stroke_margin_m(section: &mut SectionReader, machine: &Machine) -> f64 {
    let lengths = leg_lengths(machine, &machine.home_pose());
    let at_home =
        lengths.map(|length| machine.actuator.margin(length)).into_iter().fold(f64::INFINITY, f64::min);
    let default = (DEFAULT_STROKE_MARGIN_RATIO * machine.actuator.stroke()).min(0.5 * at_home).max(0.0);
    let margin = section.number_or("stroke_margin_m", default, Bound::NotNegative);
    // A home beyond the stroke is reported with its legs.
    if at_home >= 0.0 && margin > at_home {
        // The number in the message, rounded down, is accepted.
        let bound = format!("must be at most {} (the margin of home)", rounded(at_home * (1.0 - 5e-6)));
        section.reject("stroke_margin_m", bound);
    }
    margin
}

/// Condition up to which constant forces turn little enough with the legs.
///
/// Forces F that carry a load `m a` are at most `condition m a / |N|`. Constant forces turn with the legs: a
/// displacement s of the joints changes their wrench by at most `|N| F s / L`, and the acceleration by
/// `condition a / L s`. Within half a period at the largest velocity, the acceleration departs from its mean
/// by no more than feedback may add.
fn turning_condition(
    machine: &Machine,
    realtime: &Realtime,
    position: &DerivativeLimits,
    feedback_scale: f64,
) -> f64 {
    let middle_s = MIDDLE_OF_HOLD * realtime.period_s();
    let lengths = leg_lengths(machine, &machine.home_pose());
    let shortest = lengths.into_iter().fold(f64::INFINITY, f64::min);
    let load = machine.gravity_m_s2.norm() + (1.0 + feedback_scale) * position.acceleration;
    feedback_scale * position.acceleration / (position.velocity * middle_s) * shortest / load
}

/// Largest condition, and the surveyed poses within it. The default is less at a slow rate, so that no
/// displacement grows much before a new force acts. It leaves room around a home with a large condition; home
/// must keep the limit.
fn condition(
    section: &mut SectionReader,
    machine: &Machine,
    realtime: &Realtime,
    turning: f64,
) -> (f64, Vec<SurveyedPose>) {
    let at_home = KinematicState::new(machine, machine.home_pose()).sensitivity().condition;
    let usual = DEFAULT_CONDITION.max(2.0 * at_home);
    let given = section.has("condition").then(|| section.number_or("condition", usual, Bound::Positive));
    let mut survey = HeldForces::new(machine).survey(given.unwrap_or(usual));
    let delay_s = (realtime.longest_delay_periods_of_any_release() + MIDDLE_OF_HOLD) * realtime.period_s();
    let is_fast = |pose: &&SurveyedPose| pose.pole_per_s * delay_s > MAX_GROWTH_EXPONENT;
    let first_fast = survey.iter().filter(is_fast).map(|pose| pose.condition).fold(f64::INFINITY, f64::min);
    let slow = survey.iter().map(|pose| pose.condition).filter(|condition| *condition < first_fast);
    let held = if first_fast < usual { slow.fold(0.0, f64::max) } else { usual };
    let default = usual.min(held.min(turning).max(MIN_CONDITION_PER_HOME * at_home));
    let limit = given.unwrap_or(default);
    if limit < at_home {
        let bound = format!("must be at least {} (that of home)", rounded(at_home));
        section.reject("condition", bound);
    }
    survey.retain(|pose| pose.condition <= limit.max(at_home));
    (limit, survey)
}

/// Rejects limits of acceleration that forces would exceed, because they turn with the legs while they are
/// constant: within half a period the acceleration then departs from its mean by more than feedback may add.
/// Defaults follow from the machine. A machine with wrong joints is examined as a whole.
fn check_turning(
    section: &SectionReader,
    machine: &Machine,
    realtime: &Realtime,
    survey: &[SurveyedPose],
    limits: &ReferenceLimits,
    feedback_scale: f64,
) {
    let held_forces = HeldForces::new(machine);
    let jerks =
        survey.iter().filter_map(|pose| held_forces.angular_and_linear_jerk_bounds(&pose.pose, limits));
    let [angular, linear] = jerks.fold([0.0_f64; 2], |[a, b], [c, d]| [a.max(c), b.max(d)]);
    for (key, jerk, unit, limits) in [
        ("acceleration_rad_s2", angular, "rad/s^2", &limits.orientation),
        ("acceleration_m_s2", linear, "m/s^2", &limits.position),
    ] {
        let change = TURNING_SHARE * jerk * MIDDLE_OF_HOLD * realtime.period_s();
        let least = change / feedback_scale;
        if section.has(key) && limits.acceleration < least {
            // Rounded up, so that the number in the message is accepted.
            let least = rounded(least * (1.0 + 5e-6));
            let bound = format!(
                "must be at least {least}: forces held for {} s turn with the legs and change it by {} {unit}, more \
                 than feedback_scale adds; raise [realtime] rate_hz, or reduce velocity_* or [actuator] max_rate_m_s",
                rounded(realtime.period_s()),
                rounded(change),
            );
            section.reject(key, bound);
        }
    }
}
