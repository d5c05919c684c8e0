//! Reference generator: moves the reference (pose, twist, acceleration) towards a target, within every limit.
//!
//! **The generator owns the reference.** [`ReferenceGenerator`] holds the motion at the end of the last
//! cycle, a verified stop from this motion, bounds of the pose, and a history of the last cycles. A setpoint
//! is only a target: the reference approaches it, but never copies it.
//!
//! **A step proposes a motion** (`proposal`). A cycle consists of steps of at most 1 ms, longer only after
//! many missed cycles. Each step computes the acceleration at its end, towards the target and away from
//! bounds. The acceleration keeps its limit and changes with constant jerk. This gives the motion at the end
//! of the step.
//!
//! **The proposal is verified** (`proof`). The step, and a stop from its end, must keep every limit over
//! their whole length. In free space this is a release-first stop: the acceleration decreases to zero, then
//! the velocity. One pose is enough to verify it, because every margin exceeds the length of the stop. Near a
//! bound it is a stop that brakes at once, which needs less room. It is examined at several instants, the
//! knots. The effort is the compute budget of a step, counted in knots.
//!
//! **If the stop is proved**, the reference takes the proposed motion and holds the stop ready (`stop`).
//!
//! **The drives must be able to make it.** Near a weak pose, or with weak drives, they cannot give the
//! accelerations of `[limits]`. Proposal and stop then use a share of them, the strength. An autonomous motion is made with
//! the lesser of its accelerations and that share, and with less velocity: it brakes for a target among weak poses in
//! time, where the strength falls on the way.
//!
//! **On refusal** the proposal is dropped. The refusal names the limit that would be exceeded, or the effort
//! if it was spent before the proof was complete. The reference follows the held stop for one step. This
//! needs no check, because an earlier step verified this stop. The next step proposes again. Without a target
//! the reference follows the held stop, too.
//!
//! **So the limits always hold.** Control begins only with a verified stop. Every step either replaces this
//! stop by another verified stop, or moves along it. By induction the reference keeps every limit at all
//! times, whatever setpoints are sent or lost, and whatever the state of the controller. Assumptions and
//! proof: `docs/architecture.md`, section "Proof of the verified stop".
//!
//! What fails without a piece (2026-11-26, `tests/mutants`, 61 to 70):
//!
//! | piece | test |
//! | --- | --- |
//! | a stop may be as far beyond a bound as its start | `generator_bounds::a_reference_beyond_a_bound_by_rounding_only_returns` |
//! | relaxed bounds follow the reference back | `generator_bounds::bounds_that_were_relaxed_at_the_start_hold_after_the_return` |
//! | room beyond the pose of the start | `generator_bounds::a_start_beside_an_end_stop_never_leads_into_it` |
//! | free space is proved with one pose | `the_approach_keeps_the_limits` |
//! | looser bounds between knots, history | golden hashes only |
//! | forces of stops, force at rest | `tests/reference/weak_poses.rs`, `tests/closed_loop/weak_poses.rs` |
//!
//! | folder | content |
//! | --- | --- |
//! | `proposal` | acceleration towards a moving target, and away from bounds |
//! | `proof` | whether a step, and the stop from its end, keep every limit |
//! | `stop` | stops in closed form, and the stop that is held ready |
//! | `history` | reference of the last cycles |

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::parameters::{Parameters, ViolationPolicy};
use crate::control::reference::history::History;
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::step::{Step, inner_speeds};
use crate::control::reference::proof::verification::Verifier;
use crate::control::reference::proposal::approach::{Approach, ApproachTarget, limit_leg_rates};
use crate::control::reference::proposal::walls::Walls;
use crate::control::reference::stop::constant_jerk::step_to_acceleration;
use crate::control::reference::stop::held_stop::HeldStop;
use crate::control::reference::stop::pose_stop::StopKind;
use crate::control::setpoint::motion::{RelativeMotion, SetpointMotion};
use crate::control::setpoint::target::{NOTABLE_RATIO, Target, at_rest};
use crate::control::signals::errors::PoseError;
use crate::control::signals::limits::{Limit, LimitSet};
use crate::control::signals::pair::Pair;
use crate::control::signals::time::seconds_between;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

mod history;
mod proof;
mod proposal;
mod stop;
#[cfg(test)]
mod tests;

pub use self::proof::refusal::Refusal;

/// Longest step of the generator \[s\]: slow loops give the same motion as fast loops.
const MAX_STEP_S: f64 = 1e-3;
/// Largest number of steps in a cycle. After missed cycles the steps are longer, which is as safe and less
/// smooth.
const MAX_STEPS: f64 = 32.0;
/// Steps after a refusal in which rotation and translation change in proportion, as they do at walls
/// (2026-11-25). Separate limits of jerk would turn the direction of the first steps, away from the target
/// and perhaps against a bound.
const PROPORTIONAL_STEPS_AFTER_REFUSAL: u32 = 50;

/// Changes of the strength in a step that is refused because of forces, and in a step that is accepted. From
/// the least strength to all of it takes 1.5 s (2026-11-26: with 0.8 and 1.01 the acceleration changes four times
/// as much on the way to a weak pose).
const STRENGTH_REDUCTION: f64 = 0.6;
const STRENGTH_GROWTH: f64 = 1.003;
/// Least strength: with less, the approach loses its numerical precision.
const MIN_STRENGTH: f64 = 0.01;

/// Reference generator.
///
/// ```
/// use hexad_machine::config::Config;
/// use hexad_core::control::constants::Constants;
/// use hexad_core::control::reference::ReferenceGenerator;
/// use hexad_core::control::setpoint::target::Target;
/// use hexad_core::model::fidelity::Fidelity;
///
/// let config = Config::load("../../config/fried2008.toml".as_ref())?;
/// let parameters = hexad_daemon::parameters(&config.machine, &config.deployment, Fidelity::Exact);
/// let constants = Constants::new(&config.machine, parameters);
/// let mut reference = ReferenceGenerator::new(&constants);
/// // From rest at home to a pose 1 cm higher: within every limit all the way, and at rest there.
/// let mut goal = *constants.home.pose();
/// goal.position.z += 0.01;
/// let start = *reference.motion();
/// assert!(reference.verify_start(&constants, &start).is_ok());
/// reference.begin_placed_motion(0);
/// let mut fastest = 0.0_f64;
/// for cycle in 1..5000 {
///     reference.advance(&constants, cycle * parameters.period_ns, Some(&Target::Pose { pose: &goal, speed_share: 1.0 }));
///     fastest = fastest.max(reference.motion().twist.linear.norm());
/// }
/// assert!((reference.motion().pose.position.z - goal.position.z).abs() < 1e-6);
/// assert!(fastest > 0.0 && fastest <= parameters.limits.position.velocity);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReferenceGenerator {
    /// Reference at `time_ns`, the end of the last cycle's period.
    motion: Motion,
    time_ns: u64,
    /// Mean acceleration over the last cycle.
    mean_acceleration: Acceleration,
    stop: HeldStop,
    bounds: PoseBounds,
    verifier: Verifier,
    history: History,
    /// Share of the limits with which the reference closes the distance to a target.
    closing_scale: f64,
    /// Share of the acceleration limits of proposals and stops. It decreases where the drives cannot give
    /// more, and grows again.
    strength: f64,
    /// Limits that restricted the reference in the last cycle.
    active_limits: LimitSet,
    /// Steps after a refusal in which rotation and translation still change in proportion.
    proportional_steps_left: u32,
    /// Whether the target keeps the limits.
    keeps_limits: bool,
    /// Steps since one was accepted.
    stuck_steps: u32,
    /// Pose that the reference slides to along its walls, because the straight way to it ended at one.
    slides_to: Option<Pose>,
}

impl ReferenceGenerator {
    /// Generator at home, at rest.
    pub fn new(constants: &Constants) -> Self {
        Self {
            motion: at_rest(constants.home.pose()),
            time_ns: 0,
            mean_acceleration: Acceleration::default(),
            stop: HeldStop::default(),
            bounds: PoseBounds::configured(constants),
            verifier: Verifier::default(),
            history: History::default(),
            closing_scale: 1.0,
            strength: 1.0,
            active_limits: LimitSet::default(),
            proportional_steps_left: 0,
            keeps_limits: true,
            stuck_steps: 0,
            slides_to: None,
        }
    }

    /// Places the reference at a motion, for example of a platform without force, and verifies a stop from
    /// there. If the stop is refused, the reference must not begin there.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    pub fn verify_start(&mut self, constants: &Constants, motion: &Motion) -> Result<(), Refusal> {
        self.motion = *motion;
        self.bounds = PoseBounds::relaxed_to(constants, &motion.pose);
        let step = Step { strength_share: self.strength, ..Step::default() };
        let verified = self.verifier.verify(constants, &self.bounds, &self.motion, &step, self.stop.spare());
        // The strength of the next attempt. A platform at rest needs none.
        match verified {
            Ok(_) => {}
            Err(Refusal::Limit(Limit::Force)) => self.reduce_strength(),
            Err(_) => self.strength = (self.strength / STRENGTH_REDUCTION).min(1.0),
        }
        self.stop.adopt(verified.unwrap_or(StopKind::BrakeAtOnce), step.strength_share);
        verified.map(drop)
    }

    /// Whether an acceleration is within the strength. Until it is, the stop brakes with more, whatever the
    /// strength: a further reduction would not help this proof, and only make later stops longer.
    fn does_strength_act(&self, constants: &Constants, present: &Acceleration) -> bool {
        let limits =
            constants.parameters.limits.scaled_at_equal_stopping_distance(NOTABLE_RATIO * self.strength);
        present.linear.norm() <= limits.position.acceleration
            && present.angular.norm() <= limits.orientation.acceleration
    }

    fn reduce_strength(&mut self) {
        self.strength = (self.strength * STRENGTH_REDUCTION).max(MIN_STRENGTH);
    }

    /// Begins at an instant, with the motion of the last [`Self::verify_start`].
    pub fn begin_placed_motion(&mut self, time_ns: u64) {
        (self.time_ns, self.proportional_steps_left) = (time_ns, 0);
        self.history.clear();
    }

    /// Sets the share of the limits with which the reference closes the distance to a target.
    pub fn set_closing_scale(&mut self, scale: f64) {
        self.closing_scale = scale;
    }

    /// Sets whether the target keeps the limits. One that does not is followed along walls, under
    /// `on_violation = "limit"`.
    pub fn set_keeps_limits(&mut self, keeps_limits: bool) {
        self.keeps_limits = keeps_limits;
    }

    /// Whether the way to a target needs walls: it leads beyond the limits, or the straight way to a pose
    /// ended at a bound.
    fn needs_walls(&self, constants: &Constants, target: &Target<'_>) -> bool {
        constants.parameters.on_violation == ViolationPolicy::Limit
            && (!self.keeps_limits || self.slides_to.is_some() && self.slides_to.as_ref() == target.pose())
    }

    /// Reference at the end of the last cycle.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// End of the last cycle's period, the instant of [`Self::motion`].
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Limits that restricted the reference in the last cycle.
    pub fn active_limits(&self) -> LimitSet {
        self.active_limits
    }

    /// Reference at an instant of the last cycles.
    pub fn motion_at(&self, instant_ns: u64) -> Motion {
        let start = || self.motion.after(seconds_between(self.time_ns, instant_ns));
        self.history.motion_at(instant_ns).unwrap_or_else(start)
    }

    /// Motion of the reference for a force that is held over the last cycle's period: pose and twist at an
    /// instant in the middle of the period, and the mean acceleration, which leads to the velocity at the
    /// end.
    pub fn motion_for_held_force(&self, middle_ns: u64) -> Motion {
        Motion { acceleration: self.mean_acceleration, ..self.motion_at(middle_ns) }
    }

    /// Whether the reference is at rest at the end of its stop.
    pub fn is_at_rest(&self) -> bool {
        self.stop.is_at_rest()
    }

    /// Target minus reference at the end of the last cycle.
    pub fn offset_to(&self, constants: &Constants, target: &Target<'_>) -> Option<PoseError> {
        let desired = target.motion_at(&constants.parameters, self.time_ns)?;
        Some(PoseError::new(&desired, &self.motion.pose, &self.motion.twist))
    }

    /// Motion of a setpoint minus the reference, at the end of the last cycle. The setpoint is extrapolated
    /// to this instant, to first order in the angle covered.
    pub fn offset_to_setpoint(&self, parameters: &Parameters, setpoint: &SetpointMotion) -> PoseError {
        let motion = &setpoint.motion;
        let continued = setpoint.continued(setpoint.bounded_extrapolation_s(parameters, self.time_ns));
        let error = PoseError::new(motion, &self.motion.pose, &self.motion.twist);
        PoseError {
            pose: Twist::from_vector(&(error.pose.vector() + continued.displacement)),
            twist: Twist::from_vector(&(continued.twist.vector() - self.motion.twist.vector())),
        }
    }

    /// Moves the reference to an instant: towards a target, or along the held stop if there is no target.
    #[inline(never)]
    pub fn advance(&mut self, constants: &Constants, to_ns: u64, target: Option<&Target<'_>>) {
        let duration_s = seconds_between(self.time_ns, to_ns);
        self.active_limits = LimitSet::default();
        if !(duration_s > 0.0) {
            return;
        }
        let steps = (duration_s / MAX_STEP_S).clamp(1.0, MAX_STEPS);
        // Rounds up. The subtraction prevents one more step through the rounding of a period.
        let steps = (steps - 1e-6) as u32 + 1;
        let step_ns = (to_ns - self.time_ns) / u64::from(steps.max(1));
        let begin = self.motion.twist.vector();
        for k in 0..steps {
            let end_ns = if k + 1 == steps { to_ns } else { self.time_ns + step_ns };
            self.step(constants, end_ns, target);
        }
        let change = self.motion.twist.vector() - begin;
        self.mean_acceleration = Acceleration::from_vector(&(change / duration_s));
        self.bounds.withdraw_relaxation(constants, &self.motion.pose);
    }

    // Out of line: inlined into the loop over the steps, it would keep a copy of the limits in memory.
    #[inline(never)]
    fn step(&mut self, constants: &Constants, end_ns: u64, target: Option<&Target<'_>>) {
        let (begin, begin_ns) = (self.motion, self.time_ns);
        let step_s = seconds_between(begin_ns, end_ns);
        let desired = target.and_then(|target| {
            Some((target, target.relative_to(&begin.pose, &constants.parameters, end_ns)?))
        });
        // Without a target there is no proposal, and no refusal.
        let verified = desired.map(|(target, desired)| {
            let (Acceleration { angular, linear }, effort) =
                self.proposed(constants, target, &desired, step_s);
            step_to_acceleration(&mut self.motion, &angular, &linear, step_s);
            let Self { strength: strength_share, .. } = *self;
            let inner_speeds = inner_speeds(&begin, &self.motion, step_s);
            let step =
                Step { from: Some(&begin.pose), duration_s: step_s, inner_speeds, effort, strength_share };
            let verified =
                self.verifier.verify(constants, &self.bounds, &self.motion, &step, self.stop.spare());
            self.proportional_steps_left = match verified {
                Ok(_) => self.proportional_steps_left.saturating_sub(1),
                Err(_) => PROPORTIONAL_STEPS_AFTER_REFUSAL,
            };
            self.stuck_steps = if verified.is_ok() { 0 } else { self.stuck_steps.saturating_add(1) };
            match verified {
                Ok(_) => self.strength = (self.strength * STRENGTH_GROWTH).min(1.0),
                Err(Refusal::Limit(Limit::Force))
                    if self.does_strength_act(constants, &begin.acceleration) =>
                {
                    self.reduce_strength();
                }
                // In proportion too, the straight way leads into a bound.
                Err(Refusal::Limit(Limit::Stroke | Limit::Envelope))
                    if self.stop.is_at_rest() && self.stuck_steps > PROPORTIONAL_STEPS_AFTER_REFUSAL =>
                {
                    self.slides_to = target.pose().copied();
                }
                Err(_) => {}
            }
            (verified, strength_share)
        });
        match verified {
            Some((Ok(kind), strength)) => self.stop.adopt(kind, strength),
            refused => {
                if let Some((Err(Refusal::Limit(limit)), _)) = refused {
                    self.active_limits = self.active_limits.with(limit, true);
                }
                self.motion = self.stop.follow(constants, &begin, step_s);
            }
        }
        self.history.record(begin_ns, &begin, &self.motion.acceleration, step_s);
        self.time_ns = end_ns;
    }

    /// Acceleration at the end of the step, towards the desired motion, and the effort that the walls took.
    fn proposed(
        &mut self,
        constants: &Constants,
        target: &Target<'_>,
        desired: &RelativeMotion,
        h: f64,
    ) -> (Acceleration, u32) {
        let limits = &constants.parameters.limits;
        let limits = target.limits(limits, self.strength, &self.motion.acceleration);
        let closing_scale = target.closing_scale(self.closing_scale);
        let approach = |limits| Approach::new(limits, closing_scale, h);
        let (turning, shifting) = (approach(limits.orientation), approach(limits.position));
        let Motion { pose, twist, acceleration } = &self.motion;
        // State that the present acceleration leads to. Its displacement enters the offset to first order,
        // which is exact on the target.
        let (v, a) = (twist.vector(), acceleration.vector());
        let led = Twist::from_vector(&(v + a * h));
        let offset = desired.displacement - (v + a * (0.5 * h)) * h;
        let offset = Twist::from_vector(&offset);
        let orientation = ApproachTarget {
            offset: offset.angular,
            target_velocity: desired.twist.angular,
            target_acceleration: desired.acceleration.angular,
        };
        let position = ApproachTarget {
            offset: offset.linear,
            target_velocity: desired.twist.linear,
            target_acceleration: desired.acceleration.linear,
        };
        let approaches = Pair { angular: &turning, linear: &shifting };
        let ahead = Pair { angular: &led.angular, linear: &led.linear };
        let targets = Pair { angular: &orientation, linear: &position };
        let Pair { angular: mut turn, linear: mut shift } = Approach::wanted(approaches, targets, ahead);
        if limit_leg_rates(constants, pose, &mut turn, &mut shift) {
            self.active_limits = self.active_limits.with(Limit::LegRate, true);
        }
        let (mut effort, mut in_proportion) = (0, self.proportional_steps_left > 0);
        if self.needs_walls(constants, target) {
            let mut walls = Walls::new(constants, &self.bounds, &self.motion, &led, h);
            let restricting = walls.project(constants.machine().level, &mut turn, &mut shift);
            effort = walls.effort();
            if !restricting.is_empty() {
                in_proportion = true;
                turning.limit_velocity(&mut turn);
                shifting.limit_velocity(&mut shift);
                self.active_limits = self.active_limits.union(restricting);
            }
        }
        let wanted = Pair { angular: &turn, linear: &shift };
        let present = Pair { angular: &acceleration.angular, linear: &acceleration.linear };
        let (Pair { angular, linear }, limits) =
            Approach::accelerations(approaches, wanted, ahead, present, in_proportion);
        let is_too_fast = turn.is_limited | shift.is_limited;
        self.active_limits = self.active_limits.with(Limit::Velocity, is_too_fast).union(limits);
        (Acceleration { angular, linear }, effort)
    }
}
