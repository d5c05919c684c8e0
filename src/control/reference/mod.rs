//! The reference generator: pose, twist and acceleration of the platform in every cycle, within every limit.
//!
//! The reference owns its state and moves only by steps of constant jerk, or along a verified stop. Setpoints are targets:
//! never copied, only approached. So the limits hold whatever is sent, and whatever the state of the controller.
//!
//! Each step proposes a state a step later (`approach`) and verifies that the stop from there keeps every limit along its
//! whole way (`verification`). If so, the state is taken, with its stop. Otherwise the reference follows the stop that was
//! verified before, which needs no check. By induction every limit holds at all times, also if every setpoint is lost.
//! The assumptions and the proof: `docs/architecture.md`, section "Proof of the verified stop".
//!
//! | folder | content |
//! | --- | --- |
//! | `proposal` | acceleration towards a moving target, and away from bounds |
//! | `stop` | stop in closed form, and the one that is held ready |
//! | `proof` | whether a step, and the stop from its end, keep every limit |
//! | `history` | the reference of the last cycles |

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::parameters::{Parameters, ViolationPolicy};
use crate::control::reference::history::History;
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::{step::Step, verification::Verifier};
use crate::control::reference::proposal::approach::{Approach, TargetOffset, limit_leg_rates};
use crate::control::reference::proposal::walls::Walls;
use crate::control::reference::stop::constant_jerk::step_constant_jerk;
use crate::control::reference::stop::held_stop::HeldStop;
use crate::control::reference::stop::pose_stop::StopKind;
use crate::control::setpoint::motion::{RelativeMotion, SetpointMotion};
use crate::control::setpoint::target::Target;
use crate::control::setpoint::target::at_rest;
use crate::control::signals::errors::PoseError;
use crate::control::signals::limits::{Limit, LimitSet};
use crate::control::signals::pair::Pair;
use crate::control::signals::time::seconds_between;
use crate::model::rigid::{Acceleration, Motion, Twist};

mod history;
mod proof;
mod proposal;
#[cfg(test)]
mod random_vectors;
mod stop;
#[cfg(test)]
mod tests;

pub use self::proof::refusal::Refusal;

/// Longest step of the generator \[s\], so that slow loops give the same motion as fast ones.
const MAX_STEP_S: f64 = 1e-3;
/// Most steps in a cycle: after missed cycles they are longer, which is as safe and less smooth.
const MAX_STEPS: f64 = 32.0;
/// Steps after a refused one in which rotation and translation change in proportion, as they do at walls: limits of jerk that act on
/// each of them alone turn the direction of the first steps, away from the target and perhaps against a bound.
const IN_PROPORTION_STEPS: u32 = 50;

/// Reference generator.
///
/// ```
/// use hexad::config::Config;
/// use hexad::control::constants::Constants;
/// use hexad::control::reference::ReferenceGenerator;
/// use hexad::control::setpoint::target::Target;
/// use hexad::model::fidelity::Fidelity;
///
/// let config = Config::load("config/fried2008.toml".as_ref())?;
/// let parameters = hexad::daemon::parameters(&config.machine, &config.deployment, Fidelity::Exact);
/// let constants = Constants::new(&config.machine, parameters);
/// let mut reference = ReferenceGenerator::new(&constants);
/// // From rest at home to a pose 1 cm higher: within every limit all the way, and at rest there.
/// let mut goal = *constants.home.pose();
/// goal.position.z += 0.01;
/// let start = *reference.motion();
/// assert!(reference.verify_start(&constants, &start).is_ok());
/// reference.begin_at(0);
/// let mut fastest = 0.0_f64;
/// for cycle in 1..5000 {
///     reference.advance(&constants, cycle * parameters.period_ns, Some(&Target::Pose(&goal, 1.0)));
///     fastest = fastest.max(reference.motion().twist.linear.norm());
/// }
/// assert!((reference.motion().pose.position.z - goal.position.z).abs() < 1e-6);
/// assert!(fastest > 0.0 && fastest <= parameters.limits.position.velocity);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReferenceGenerator {
    /// At `time_ns`, the end of the last cycle's period.
    motion: Motion,
    time_ns: u64,
    /// Over the last cycle.
    mean_acceleration: Acceleration,
    stop: HeldStop,
    bounds: PoseBounds,
    verifier: Verifier,
    history: History,
    /// Share of the limits for closing the distance to a target.
    closing_scale: f64,
    /// What held the reference back in the last cycle.
    active_limits: LimitSet,
    /// For so many steps rotation and translation still change in proportion, after one that was refused.
    in_proportion_steps: u32,
}

impl ReferenceGenerator {
    /// At home, at rest.
    pub fn new(constants: &Constants) -> Self {
        Self {
            motion: at_rest(constants.home.pose()),
            time_ns: 0,
            mean_acceleration: Acceleration::default(),
            stop: HeldStop::default(),
            bounds: PoseBounds::nominal(constants),
            verifier: Verifier::default(),
            history: History::default(),
            closing_scale: 1.0,
            active_limits: LimitSet::default(),
            in_proportion_steps: 0,
        }
    }

    /// Places the reference at a motion, as that of a platform without force, and verifies a stop from there. If none was verified,
    /// returns why: the reference must not begin there.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn verify_start(&mut self, constants: &Constants, motion: &Motion) -> Result<(), Refusal> {
        self.motion = *motion;
        self.bounds = PoseBounds::around(constants, &motion.pose);
        let (step, spare) = (Step::default(), self.stop.spare());
        let verified = self.verifier.verify(constants, &self.bounds, &self.motion, &step, spare);
        self.stop.adopt(verified.unwrap_or(StopKind::BrakeAtOnce));
        verified.map(drop)
    }

    /// Begins at an instant with the motion at which it was placed.
    pub fn begin_at(&mut self, time_ns: u64) {
        (self.time_ns, self.in_proportion_steps) = (time_ns, 0);
        self.history.clear();
    }

    /// Sets the share of the limits with which the distance to a target is closed.
    pub fn set_closing_scale(&mut self, scale: f64) {
        self.closing_scale = scale;
    }

    /// The motion at the end of the last cycle.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// The end of the last cycle's period, to which [`Self::motion`] belongs.
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// What held the reference back in the last cycle.
    pub fn active_limits(&self) -> LimitSet {
        self.active_limits
    }

    /// The reference at an instant of the last cycles.
    pub fn motion_at(&self, instant_ns: u64) -> Motion {
        let start = || self.motion.after(seconds_between(self.time_ns, instant_ns));
        self.history.motion_at(instant_ns).unwrap_or_else(start)
    }

    /// What a force that is held for the last cycle's period shall move: pose and twist at an instant in its middle, and the
    /// mean acceleration, which leads to the velocity at its end.
    pub fn motion_of_hold(&self, middle_ns: u64) -> Motion {
        Motion { acceleration: self.mean_acceleration, ..self.motion_at(middle_ns) }
    }

    /// Whether the reference has come to rest along its stop.
    pub fn is_at_rest(&self) -> bool {
        self.stop.is_at_rest()
    }

    /// Target minus reference at the end of the last cycle.
    pub fn deviation(&self, constants: &Constants, target: &Target<'_>) -> Option<PoseError> {
        let desired = target.motion_at(&constants.parameters, self.time_ns)?;
        Some(PoseError::new(&desired, &self.motion.pose, &self.motion.twist))
    }

    /// The motion of a setpoint minus the reference at the end of the last cycle, to first order in the time between.
    pub fn deviation_of(&self, parameters: &Parameters, setpoint: &SetpointMotion) -> PoseError {
        let motion = &setpoint.motion;
        let continued = setpoint.continued(setpoint.extrapolation_s(parameters, self.time_ns));
        let error = PoseError::new(motion, &self.motion.pose, &self.motion.twist);
        PoseError {
            pose: Twist::from_vector(&(error.pose.vector() + continued.displacement)),
            twist: Twist::from_vector(&(continued.twist.vector() - self.motion.twist.vector())),
        }
    }

    /// Moves the reference to an instant, towards a target; without one along the stop.
    #[inline(never)]
    pub fn advance(&mut self, constants: &Constants, to_ns: u64, target: Option<&Target<'_>>) {
        let duration_s = seconds_between(self.time_ns, to_ns);
        self.active_limits = LimitSet::default();
        if !(duration_s > 0.0) {
            return;
        }
        let steps = (duration_s / MAX_STEP_S).clamp(1.0, MAX_STEPS);
        // Rounded up, but for the rounding of a period.
        let steps = (steps - 1e-6) as u32 + 1;
        let step_ns = (to_ns - self.time_ns) / u64::from(steps.max(1));
        let begin = self.motion.twist.vector();
        for k in 0..steps {
            let end_ns = if k + 1 == steps { to_ns } else { self.time_ns + step_ns };
            self.step(constants, end_ns, target);
        }
        let change = self.motion.twist.vector() - begin;
        self.mean_acceleration = Acceleration::from_vector(&(change / duration_s));
        self.bounds.tighten(constants, &self.motion.pose);
    }

    // Out of line: in the loop over the steps the limits would be kept in memory beside themselves.
    #[inline(never)]
    fn step(&mut self, constants: &Constants, end_ns: u64, target: Option<&Target<'_>>) {
        let (begin, begin_ns) = (self.motion, self.time_ns);
        let step_s = seconds_between(begin_ns, end_ns);
        let desired = target.and_then(|target| {
            Some((target, target.relative_to(&begin.pose, &constants.parameters, end_ns)?))
        });
        // Without a target nothing is refused.
        let verified = desired.map(|(target, desired)| {
            let (Acceleration { angular, linear }, effort) =
                self.proposed(constants, target, &desired, step_s);
            step_constant_jerk(&mut self.motion, &angular, &linear, step_s);
            let (now, next) = (&begin.acceleration, &self.motion.acceleration);
            let acceleration_change = Pair {
                angular: (next.angular - now.angular).norm(),
                linear: (next.linear - now.linear).norm(),
            };
            let step = Step { from: Some(&begin.pose), duration: step_s, acceleration_change, effort };
            let verified =
                self.verifier.verify(constants, &self.bounds, &self.motion, &step, self.stop.spare());
            self.in_proportion_steps = match verified {
                Ok(_) => self.in_proportion_steps.saturating_sub(1),
                Err(_) => IN_PROPORTION_STEPS,
            };
            verified
        });
        match verified {
            Some(Ok(kind)) => self.stop.adopt(kind),
            refused => {
                if let Some(Err(Refusal::Limit(limit))) = refused {
                    self.active_limits = self.active_limits.with(limit, true);
                }
                self.motion = self.stop.follow(constants, &begin, step_s);
            }
        }
        self.history.record(begin_ns, &begin, &self.motion.acceleration, step_s);
        self.time_ns = end_ns;
    }

    /// Acceleration of the next instant, towards its desired motion, and the effort of the walls for it.
    fn proposed(
        &mut self,
        constants: &Constants,
        target: &Target<'_>,
        desired: &RelativeMotion,
        h: f64,
    ) -> (Acceleration, u32) {
        let limits = target.limits(&constants.parameters.limits);
        let closing_scale = target.closing_scale(self.closing_scale);
        let approach = |limits| Approach::new(limits, closing_scale, h);
        let (turning, shifting) = (approach(limits.orientation), approach(limits.position));
        let Motion { pose, twist, acceleration } = &self.motion;
        // Where the present acceleration leads: to first order in its displacement, which is exact on the target.
        let (v, a) = (twist.vector(), acceleration.vector());
        let led = Twist::from_vector(&(v + a * h));
        let offset = desired.displacement - (v + a * (0.5 * h)) * h;
        let offset = Twist::from_vector(&offset);
        let orientation = TargetOffset {
            offset: offset.angular,
            velocity: desired.twist.angular,
            acceleration: desired.acceleration.angular,
        };
        let position = TargetOffset {
            offset: offset.linear,
            velocity: desired.twist.linear,
            acceleration: desired.acceleration.linear,
        };
        let approaches = Pair { angular: &turning, linear: &shifting };
        let ahead = Pair { angular: &led.angular, linear: &led.linear };
        let targets = Pair { angular: &orientation, linear: &position };
        let Pair { angular: mut turn, linear: mut shift } = Approach::wanted(approaches, targets, ahead);
        if limit_leg_rates(constants, pose, &mut turn, &mut shift) {
            self.active_limits = self.active_limits.with(Limit::LegRate, true);
        }
        let (mut effort, mut in_proportion) = (0, self.in_proportion_steps > 0);
        if constants.parameters.on_violation == ViolationPolicy::Limit {
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
