//! The platform's own motion in each cycle under control, against the limits; not the measured one, not the reference.

use hexad::control::parameters::Parameters;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::rigid::Acceleration;
use hexad::plant::forward_dynamics::ForwardDynamics;

use super::largest;
use super::rig::Rig;

/// Largest ratios to the limits, position or orientation, whichever is greater.
#[derive(Clone, Copy, Debug)]
pub struct Largest {
    pub velocity: f64,
    pub acceleration: f64,
    /// Change of acceleration from cycle to cycle.
    pub jerk: f64,
    pub leg_rate: f64,
    pub condition: f64,
    pub force: f64,
    /// Smallest distance of a leg from the ends of its stroke, minus the margin \[m\].
    pub room: f64,
}

impl Default for Largest {
    fn default() -> Self {
        let [velocity, acceleration, jerk, leg_rate, condition, force] = [0.0; 6];
        Self { velocity, acceleration, jerk, leg_rate, condition, force, room: f64::INFINITY }
    }
}

/// Observer of a platform.
pub struct TrueMotion {
    parameters: Parameters,
    dynamics: ForwardDynamics,
    before: Option<Acceleration>,
    pub largest: Largest,
}

impl TrueMotion {
    pub fn new(rig: &Rig, parameters: &Parameters) -> Self {
        let dynamics = ForwardDynamics::new(rig.simulator().machine());
        Self { parameters: *parameters, dynamics, before: None, largest: Largest::default() }
    }

    /// Looks at the platform at the end of a cycle.
    pub fn observe(&mut self, rig: &Rig) {
        let state = rig.simulator().state();
        let accelerated = |force| self.dynamics.acceleration(&state.pose, &state.twist, force);
        let (Some(applied), Some(acceleration)) = (rig.force, rig.force.as_ref().and_then(accelerated))
        else {
            self.before = None;
            return;
        };
        let Largest { velocity, acceleration: of_acceleration, jerk, leg_rate, condition, force, room } =
            &mut self.largest;
        let limits = [&self.parameters.limits.orientation, &self.parameters.limits.position];
        let raise = |largest: &mut f64, value: f64| *largest = largest.max(value);
        let before = self.before.replace(acceleration).unwrap_or(acceleration);
        let period_s = self.parameters.period_ns as f64 * 1e-9;
        let parts = [
            (state.twist.angular, acceleration.angular, before.angular),
            (state.twist.linear, acceleration.linear, before.linear),
        ];
        for ((v, a, before), limits) in parts.into_iter().zip(limits) {
            raise(velocity, v.norm() / limits.velocity);
            raise(of_acceleration, a.norm() / limits.acceleration);
            raise(jerk, (a - before).norm() / period_s / limits.jerk);
        }
        let machine = rig.simulator().machine();
        let legs = rig.simulator().leg_motion();
        raise(force, largest(&applied) / machine.actuator.max_force_n);
        raise(leg_rate, largest(&legs.rate_m_s) / machine.actuator.max_rate_m_s);
        raise(condition, KinematicState::new(machine, state.pose).sensitivity().condition);
        for length in legs.length_m {
            *room = room.min(machine.actuator.margin(length) - self.parameters.stroke_margin_m);
        }
    }
}
