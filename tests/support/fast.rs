//! The fast scene of a machine: its sines, played as fast as the limits of setpoints and drives allow with reserve.

use hexad::config::Config;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Exact;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, FittedMotion, fit};

/// Seconds that the scene takes at its usual speed.
const SECONDS: f64 = 8.0;
/// Share of every limit that may be used.
const SHARE: f64 = 0.8;
/// Instants that are looked at, near enough for a difference quotient of the acceleration.
const SAMPLES: u32 = 4000;

/// A scene in quick motion.
#[derive(Clone, Copy)]
pub struct Fast {
    scene: FittedMotion,
    pub speed: f64,
}

impl Fast {
    /// The fastest in steps of a twentieth.
    pub fn new(config: &Config) -> Self {
        let scene = fit(&config.machine, BuiltInMotion::Sines, SECONDS);
        let speeds = (1..200).map(|step| Self { scene, speed: 0.05 * f64::from(step) });
        speeds.take_while(|fast| fast.is_allowed(config)).last().unwrap()
    }

    /// How long it takes \[s\].
    pub fn duration(&self) -> f64 {
        self.scene.duration_s / self.speed
    }

    /// At rest at home before and after.
    pub fn at(&self, t: f64) -> TaskState {
        let TaskState { x, xd, xdd } = self.scene.at(self.speed * t);
        TaskState { x, xd: xd * self.speed, xdd: xdd * (self.speed * self.speed) }
    }

    fn is_allowed(&self, config: &Config) -> bool {
        let (machine, limits) = (&config.machine, &config.deployment.limits);
        let model = InverseDynamics::new(machine);
        let dt = self.duration() / f64::from(SAMPLES);
        let motions = (0..=SAMPLES).map(|k| self.at(dt * f64::from(k)).motion()).collect::<Vec<_>>();
        let force_rate = |before: &[f64; 6], after: &[f64; 6]| {
            let steps = before.iter().zip(after).map(|(before, after)| (after - before).abs() / dt);
            steps.fold(0.0, f64::max)
        };
        let forces: Vec<_> = motions.iter().map(|motion| model.forces::<Exact>(motion).unwrap()).collect();
        let (position, orientation) = (&limits.reference.position, &limits.reference.orientation);
        let within = |value: f64, limit: f64| value <= SHARE * limit;
        motions.iter().zip(&forces).all(|(motion, force)| {
            let rate = leg_motion(machine, motion).rate_m_s;
            within(motion.twist.linear.norm(), position.velocity)
                && within(motion.twist.angular.norm(), orientation.velocity)
                && within(motion.acceleration.linear.norm(), position.acceleration)
                && within(motion.acceleration.angular.norm(), orientation.acceleration)
                && rate.iter().all(|rate| within(rate.abs(), machine.actuator.max_rate_m_s))
                && force.iter().all(|force| within(force.abs(), machine.actuator.max_force_n))
        }) && motions.windows(2).all(|pair| {
            let [before, after] = [pair[0].acceleration, pair[1].acceleration];
            within((after.linear - before.linear).norm() / dt, position.jerk)
                && within((after.angular - before.angular).norm() / dt, orientation.jerk)
        }) && forces.windows(2).all(|pair| within(force_rate(&pair[0], &pair[1]), limits.force_rate_n_s))
    }
}
