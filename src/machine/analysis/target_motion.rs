//! Motion of the reference to a target, in advance: the daemon's own reference generator, cycle by cycle.
//!
//! Position and orientation go straight to the target, each in its own time. A path that leaves the workspace is
//! refused: the operator must choose another path.

use core::fmt;

use super::drive_capability::DriveCapability;
use hexad_core::control::constants::{Constants, MAX_HOLDING_SHARE};
use hexad_core::control::parameters::Envelope;
use hexad_core::control::reference::ReferenceGenerator;
use hexad_core::control::setpoint::target::Target;
use hexad_core::control::signals::limits::{Limit, LimitSet};
use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::{leg_lengths, leg_motion, universal_sine};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist};
use hexad_core::model::task::task_coordinates;

/// Distance \[m\] and angle \[rad\] at which the reference has reached a target: finer than people set a pose.
pub const REACHED_M: f64 = 1e-5;
/// See [`REACHED_M`].
pub const REACHED_RAD: f64 = 1e-5;

/// Where the way is short, the share of it at which the reference has reached the target.
const REACHED_SHARE: f64 = 0.01;

/// Time in which the distance must shrink by these shares of itself or of what the limits of velocity allow \[s\]; else a
/// bound is in the way. Every motion within sensible limits begins faster; along a bound it would creep for minutes.
const PROGRESS_TIME_S: f64 = 2.0;
const PROGRESS_OF_DISTANCE: f64 = 0.05;
const PROGRESS_OF_VELOCITY: f64 = 0.1;

/// Longest motion that is planned \[s\].
const LONGEST_S: f64 = 3600.0;

/// Shares of what is left of a way, of position and of orientation, at which its poses are examined.
const WAY_SAMPLES: u32 = 24;

/// Excess of a bound that is rounding \[m\], \[rad\] or without unit.
const ROUNDING: f64 = 1e-9;

/// Names of the coordinates of X.
const AXES: [&str; 6] = ["alpha", "beta", "gamma", "x", "y", "z"];

/// Motion of the reference from rest to rest at a target.
#[derive(Clone, Copy, Debug, Default)]
pub struct TargetMotion {
    /// Until the target is reached \[s\].
    pub duration_s: f64,
    /// Shortest and longest length of each leg on the way \[m\].
    pub lengths_m: [[f64; 2]; LEGS],
    /// Largest rate of each leg \[m/s\].
    pub leg_rates_m_s: [f64; LEGS],
    /// Largest velocity \[m/s\] and angular velocity \[rad/s\].
    pub velocity_m_s: f64,
    /// See [`Self::velocity_m_s`].
    pub velocity_rad_s: f64,
    /// Share of the time in which each limit held the reference back, in the order of [`Limit::ALL`].
    pub limited_shares: [f64; Limit::ALL.len()],
}

/// A bound of the workspace, and the quantity at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkspaceBound {
    /// Quantity.
    pub quantity: BoundedQuantity,
    /// Its value.
    pub value: f64,
    /// Bound that it has to keep.
    pub bound: f64,
    /// Distance from the bound, in the quantity's own unit; negative beyond it.
    pub margin: f64,
}

/// What bounds the workspace of the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundedQuantity {
    /// Length of a leg, counted from 0 \[m\].
    Length(usize),
    /// Coordinate of X, counted from 0 \[rad\] or \[m\].
    Coordinate(usize),
    /// Condition of the pose.
    Condition,
    /// Least sine of the angle between a leg and the first axis of its universal joint.
    UniversalSine,
    /// `det N / radius^3`, signed as at home.
    Determinant,
    /// Largest force at rest, of a leg counted from 0 \[N\].
    HoldingForce(usize),
}

impl BoundedQuantity {
    fn limit(self) -> Limit {
        match self {
            Self::Length(_) => Limit::Stroke,
            Self::Coordinate(_) => Limit::Envelope,
            Self::Condition | Self::UniversalSine | Self::Determinant => Limit::Condition,
            Self::HoldingForce(_) => Limit::Force,
        }
    }
}

impl fmt::Display for WorkspaceBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { quantity, value, bound, margin } = self;
        // At least one digit of the distance from the bound is shown.
        let digits = (1.0 - margin.abs().log10()).ceil().clamp(4.0, 9.0) as usize;
        match quantity {
            BoundedQuantity::Length(leg) => write!(
                f,
                "leg {}: length {value:.digits$} m, bound {bound:.digits$} m (the stroke less limits.stroke_margin_m)",
                leg + 1
            ),
            BoundedQuantity::Coordinate(axis) => {
                let unit = if *axis < 3 { "rad" } else { "m" };
                let name = AXES.get(*axis).unwrap_or(&"");
                write!(f, "{name} = {value:.digits$} {unit}, bound {bound:.digits$} {unit} ([envelope])")
            }
            BoundedQuantity::Condition => {
                write!(f, "condition {value:.2}, bound {bound:.2} (limits.condition with a margin)")
            }
            BoundedQuantity::UniversalSine => write!(
                f,
                "a leg is near the first axis of its universal joint: sine {value:.3}, bound {bound:.3}"
            ),
            BoundedQuantity::HoldingForce(leg) => write!(
                f,
                "leg {}: {value:.0} N to hold the platform, bound {bound:.0} N ({:.0} % of actuator.max_force_n)",
                leg + 1,
                100.0 * MAX_HOLDING_SHARE
            ),
            BoundedQuantity::Determinant => f.write_str("it is on the other side of a singular pose"),
        }
    }
}

/// A bound that is exceeded: it is only made of a value beyond its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExceededBound(WorkspaceBound);

impl ExceededBound {
    /// The bound that a pose exceeds most, of the first kind that it does.
    fn at(constants: &Constants, pose: &Pose) -> Option<Self> {
        let bounds = workspace_bounds(constants, pose);
        // NaN is outside.
        let is_exceeded = |bound: &WorkspaceBound| !(bound.margin >= -ROUNDING);
        let first = bounds.iter().find(|bound| is_exceeded(bound))?;
        Some(Self(nearest(&bounds, first.quantity.limit()).filter(is_exceeded).unwrap_or(*first)))
    }

    /// The bound and the value beyond it.
    pub fn get(&self) -> &WorkspaceBound {
        &self.0
    }
}

impl fmt::Display for ExceededBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Why the reference does not go to a target.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TargetRefusal {
    /// The target is outside of the workspace.
    #[error("the target is outside of the workspace: {0}")]
    Target(ExceededBound),
    /// The target is inside, the way is not.
    #[error(
        "the straight way to the target leaves the workspace after {percent:.0} %: {bound}; go by another pose, for example --home",
        percent = 100.0 * share
    )]
    Way {
        /// The bound that the way exceeds.
        bound: ExceededBound,
        /// Share of the way.
        share: f64,
    },
    /// The way exceeds no bound, but passes so near to one that no stop is proved.
    #[error(
        "after {percent:.0} % of the straight way to the target no stop within the limits is proved, with this bound as the nearest: {bound}; \
         go slower (--speed), or by another pose, for example --home",
        percent = 100.0 * share
    )]
    Unproved {
        /// The nearest bound.
        bound: WorkspaceBound,
        /// Share of the way.
        share: f64,
    },
    /// The motion takes at least so long \[s\].
    #[error(
        "the motion takes {0:.0} s or more, bound {LONGEST_S:.0} s; raise the speed of the request or the limits of velocity, or go in parts"
    )]
    TooLong(f64),
    /// The caller has given up.
    #[error("interrupted while it was planned")]
    Interrupted,
}

/// Every bound of the workspace at a pose, each with the leg or coordinate that is nearest to it.
pub fn workspace_bounds(constants: &Constants, pose: &Pose) -> Vec<WorkspaceBound> {
    let (machine, parameters) = (constants.machine(), &constants.parameters);
    let (shortest, longest) = (
        machine.actuator.min_length_m + parameters.stroke_margin_m,
        machine.actuator.max_length_m - parameters.stroke_margin_m,
    );
    let lengths = leg_lengths(machine, pose).into_iter().enumerate();
    let mut bounds: Vec<_> = lengths
        .map(|(leg, length)| between(BoundedQuantity::Length(leg), length, shortest, longest))
        .collect();
    if let Some(Envelope { lowest, highest }) = &parameters.envelope {
        let x = task_coordinates(pose, &machine.home).into_iter().enumerate();
        bounds.extend(
            x.zip(lowest.iter().zip(highest))
                .map(|((axis, x), (low, high))| between(BoundedQuantity::Coordinate(axis), x, *low, *high)),
        );
    }
    let state = KinematicState::new(machine, *pose);
    let (condition, largest) = (state.sensitivity().condition, constants.max_reference_condition);
    let sine = universal_sine(machine, pose);
    let side = state.sensitivity().determinant * constants.home.sensitivity().determinant.signum();
    let quantity = BoundedQuantity::Determinant;
    bounds.push(WorkspaceBound { quantity, value: side, bound: 0.0, margin: side });
    let quantity = BoundedQuantity::Condition;
    bounds.push(WorkspaceBound { quantity, value: condition, bound: largest, margin: largest - condition });
    let (quantity, bound) = (BoundedQuantity::UniversalSine, constants.least_universal_sine);
    bounds.push(WorkspaceBound { quantity, value: sine, bound, margin: sine - bound });
    let drives = DriveCapability::of(&constants.dynamics, pose).map(|drives| drives.largest_holding_force());
    let (leg, force) = drives.unwrap_or((0, f64::INFINITY));
    let (quantity, bound) = (
        BoundedQuantity::HoldingForce(leg),
        MAX_HOLDING_SHARE * machine.actuator.weakest_available_force_n(),
    );
    bounds.push(WorkspaceBound { quantity, value: force, bound, margin: bound - force });
    bounds
}

fn between(quantity: BoundedQuantity, value: f64, low: f64, high: f64) -> WorkspaceBound {
    let (below, above) = (value - low, high - value);
    let (bound, margin) = if below < above { (low, below) } else { (high, above) };
    WorkspaceBound { quantity, value, bound, margin }
}

/// Whether a pose is in the workspace of the reference; else the bound that it exceeds most, of the first kind that it does.
pub fn check_target(constants: &Constants, pose: &Pose) -> Result<(), ExceededBound> {
    ExceededBound::at(constants, pose).map_or(Ok(()), Err)
}

/// The bound of a limit with the least margin.
fn nearest(bounds: &[WorkspaceBound], limit: Limit) -> Option<WorkspaceBound> {
    let of_limit = bounds.iter().filter(|bound| bound.quantity.limit() == limit);
    // Other quantities than lengths and angles are compared with their bound.
    let ratio = |bound: &WorkspaceBound| {
        let is_length = matches!(limit, Limit::Stroke | Limit::Envelope);
        if is_length { bound.margin } else { bound.margin / bound.bound.abs().max(ROUNDING) }
    };
    of_limit.min_by(|a, b| ratio(a).total_cmp(&ratio(b))).copied()
}

/// Moves the reference from rest at a pose to a target and returns the motion. `speed` is a share of the limits of
/// autonomous motions. `observe` receives the generator after each cycle, and the motion at the beginning of the cycle, and says
/// whether to go on.
pub fn target_motion(
    constants: &Constants,
    from: &Pose,
    to: &Pose,
    speed: f64,
    mut observe: impl FnMut(&ReferenceGenerator, &Motion) -> bool,
) -> Result<TargetMotion, TargetRefusal> {
    check_target(constants, to).map_err(TargetRefusal::Target)?;
    check_duration(least_s(constants, from, to, speed))?;
    let period_ns = constants.parameters.period_ns;
    let mut reference = ReferenceGenerator::new(constants);
    let start = Motion { pose: *from, twist: Twist::default(), acceleration: Acceleration::default() };
    reference.verify_start(constants, &start).ok();
    reference.begin_placed_motion(0);
    let whole = distance(from, to);
    let mut survey = Survey::new(constants, &start);
    let (mut nearest_yet, mut progress_ns, mut stopped_by) = (whole, 0, LimitSet::default());
    let mut left = whole;
    let at_velocity = speed * slow_progress(constants);
    while left > (REACHED_SHARE * whole).clamp(ROUNDING / REACHED_M, 1.0) {
        let before = *reference.motion();
        let end_ns = reference.time_ns() + period_ns;
        reference.advance(constants, end_ns, Some(&Target::Pose { pose: to, speed_share: speed }));
        if !observe(&reference, &before) {
            return Err(TargetRefusal::Interrupted);
        }
        survey.add(constants, reference.motion(), reference.active_limits());
        left = distance(&reference.motion().pose, to);
        if left < (nearest_yet - at_velocity).max((1.0 - PROGRESS_OF_DISTANCE) * nearest_yet) {
            (nearest_yet, progress_ns, stopped_by) = (left, end_ns, LimitSet::default());
        }
        stopped_by = stopped_by.union(reference.active_limits());
        if (end_ns - progress_ns) as f64 * 1e-9 > PROGRESS_TIME_S {
            return Err(ended(
                constants,
                &reference.motion().pose,
                to,
                stopped_by,
                1.0 - nearest_yet / whole,
            ));
        }
    }
    Ok(survey.result(reference.time_ns() as f64 * 1e-9))
}

/// Whether a motion of this duration \[s\] is planned.
pub(super) fn check_duration(duration_s: f64) -> Result<(), TargetRefusal> {
    if duration_s > LONGEST_S { Err(TargetRefusal::TooLong(duration_s)) } else { Ok(()) }
}

/// What the limits of velocity take at least \[s\].
fn least_s(constants: &Constants, from: &Pose, to: &Pose, speed: f64) -> f64 {
    let (limits, way) = (&constants.parameters.limits, from.displacement_to(to));
    let share = limits.autonomous_scale * speed;
    let linear = way.linear.norm() / (share * limits.position.velocity);
    linear.max(way.angular.norm() / (share * limits.orientation.velocity))
}

/// Progress at [`PROGRESS_OF_VELOCITY`] of the limits of autonomous motions.
fn slow_progress(constants: &Constants) -> f64 {
    let limits = &constants.parameters.limits;
    let velocities = (limits.position.velocity / REACHED_M).min(limits.orientation.velocity / REACHED_RAD);
    PROGRESS_OF_VELOCITY * PROGRESS_TIME_S * limits.autonomous_scale * velocities
}

/// Distance from a target in distances at which it is reached; the sum of both parts shrinks while either does.
fn distance(from: &Pose, to: &Pose) -> f64 {
    let left = from.displacement_to(to);
    left.linear.norm() / REACHED_M + left.angular.norm() / REACHED_RAD
}

/// Why the way has ended at a pose: a bound that the rest of it exceeds, whichever of position and orientation goes first, or the
/// nearest of the limits that have stopped it.
fn ended(constants: &Constants, pose: &Pose, to: &Pose, stopped_by: LimitSet, share: f64) -> TargetRefusal {
    let left = pose.displacement_to(to);
    let shares = (0..WAY_SAMPLES * WAY_SAMPLES).map(|k| (k / WAY_SAMPLES, k % WAY_SAMPLES));
    let poses = shares.map(|(turn, shift)| {
        let [turn, shift] = [turn, shift].map(|k| f64::from(k) / f64::from(WAY_SAMPLES));
        pose.displaced(&Twist { angular: left.angular * turn, linear: left.linear * shift })
    });
    if let Some(bound) = poses.into_iter().find_map(|pose| ExceededBound::at(constants, &pose)) {
        return TargetRefusal::Way { bound, share };
    }
    let bounds = workspace_bounds(constants, pose);
    let limits = [Limit::Force, Limit::Stroke, Limit::Envelope, Limit::Condition];
    let limit = limits.into_iter().find(|limit| stopped_by.contains(*limit)).unwrap_or(Limit::Condition);
    let quantity = BoundedQuantity::Condition;
    let unknown = WorkspaceBound { quantity, value: 0.0, bound: 0.0, margin: 0.0 };
    TargetRefusal::Unproved { bound: nearest(&bounds, limit).unwrap_or(unknown), share }
}

/// Largest quantities on the way.
pub(super) struct Survey {
    motion: TargetMotion,
    limited: [u64; Limit::ALL.len()],
    cycles: u64,
}

impl Survey {
    pub fn new(constants: &Constants, start: &Motion) -> Self {
        let lengths_m = leg_lengths(constants.machine(), &start.pose).map(|length| [length; 2]);
        let motion = TargetMotion { lengths_m, ..TargetMotion::default() };
        Self { motion, limited: [0; Limit::ALL.len()], cycles: 0 }
    }

    /// Adds an instant, with the limits that hold the motion back.
    pub fn add(&mut self, constants: &Constants, now: &Motion, active_limits: LimitSet) {
        let legs = leg_motion(constants.machine(), now);
        let motion = &mut self.motion;
        for ([shortest, longest], length) in motion.lengths_m.iter_mut().zip(legs.length_m) {
            (*shortest, *longest) = (shortest.min(length), longest.max(length));
        }
        for (largest, rate) in motion.leg_rates_m_s.iter_mut().zip(legs.rate_m_s) {
            *largest = largest.max(rate.abs());
        }
        motion.velocity_m_s = motion.velocity_m_s.max(now.twist.linear.norm());
        motion.velocity_rad_s = motion.velocity_rad_s.max(now.twist.angular.norm());
        for (count, limit) in self.limited.iter_mut().zip(Limit::ALL) {
            *count += u64::from(active_limits.contains(limit));
        }
        self.cycles += 1;
    }

    /// The result of a motion of this duration \[s\].
    pub fn result(self, duration_s: f64) -> TargetMotion {
        let cycles = self.cycles.max(1) as f64;
        let limited_shares = self.limited.map(|count| count as f64 / cycles);
        TargetMotion { duration_s, limited_shares, ..self.motion }
    }
}
