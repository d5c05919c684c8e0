//! The simulated machine: dynamics, brakes and end stops.
//!
//! Brakes are open exactly while a valid force is applied. Without one they close: every leg rate falls to
//! zero in a straight line, all at the same instant, the fastest at the configured deceleration; the
//! platform follows the legs, whatever its weight. Then it stands. A leg that reaches its end of stroke
//! closes the brakes for good: on hardware somebody has to come and look.

use nalgebra::Vector6;

use super::forward_dynamics::ForwardDynamics;
use super::integrator::{PlantState, integrate};
use crate::model::inverse_geometry::{LegMotion, leg_lengths, leg_motion};
use crate::model::inverse_jacobian::twist_from_rates;
use crate::model::machine::{Actuator, LEGS, Machine};
use crate::model::rigid::{Acceleration, Motion, Twist};
use crate::model::task::TaskState;

/// Whether the legs may move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Brakes {
    /// Forces drive the legs.
    Open,
    /// Leg rates at the instant of closing, time since, time until standstill \[s\].
    Closing { rates: [f64; LEGS], elapsed: f64, duration: f64 },
    /// The legs stand.
    Closed,
    /// The legs stand because this leg (0-based) reached an end of its stroke.
    EndStop { leg: usize },
}

/// A platform in simulated time.
#[derive(Clone, Debug)]
pub struct Simulator {
    dynamics: ForwardDynamics,
    state: PlantState,
    brakes: Brakes,
    deceleration: f64,
    max_step: f64,
}

impl Simulator {
    /// At rest at home, brakes closed. `deceleration` of the brakes in m/s^2, `max_step` of the
    /// integrator in s.
    ///
    /// Coulomb friction acts within `smoothing / (coulomb / mass)`; where that is too fast for the step,
    /// the plant's smoothing speed is widened just enough for a stable integration.
    pub fn new(machine: &Machine, deceleration: f64, max_step: f64) -> Self {
        let pose = TaskState::at_rest(machine.home).motion().pose;
        let mut machine = machine.clone();
        if let Some(mass) = ForwardDynamics::new(&machine).smallest_leg_mass(&pose) {
            // Runge-Kutta is stable to 2.78 / rate; 1 is also accurate.
            let widest = machine.actuator.coulomb_friction * max_step / mass;
            machine.actuator.coulomb_smoothing = Actuator::COULOMB_SMOOTHING_M_S.max(widest);
        }
        Self {
            dynamics: ForwardDynamics::new(&machine),
            state: PlantState { pose, twist: Twist::default() },
            brakes: Brakes::Closed,
            deceleration,
            max_step,
        }
    }

    /// Pose and twist.
    pub fn state(&self) -> &PlantState {
        &self.state
    }

    /// Brakes.
    pub fn brakes(&self) -> Brakes {
        self.brakes
    }

    /// The machine simulated, with the friction it was given.
    pub fn machine(&self) -> &Machine {
        self.dynamics.machine()
    }

    /// Lengths and rates of the legs, what sensors would say. The accelerations are not filled in.
    pub fn leg_motion(&self) -> LegMotion {
        let PlantState { pose, twist } = self.state;
        let motion = Motion { pose, twist, acceleration: Acceleration::default() };
        LegMotion { accel: [0.0; LEGS], ..leg_motion(self.machine(), &motion) }
    }

    /// Lets `duration` seconds pass under constant forces, or without any.
    pub fn advance(&mut self, duration: f64, force: Option<&[f64; LEGS]>) {
        if !(duration > 0.0) || matches!(self.brakes, Brakes::EndStop { .. }) {
            return;
        }
        match force {
            Some(_) => self.brakes = Brakes::Open,
            None if self.brakes == Brakes::Open => self.close_brakes(),
            None => {}
        }
        let steps = (duration / self.max_step).ceil().clamp(1.0, f64::from(u32::MAX)) as u32;
        let step = duration / f64::from(steps);
        for _ in 0..steps {
            match (self.brakes, force) {
                (Brakes::Open, Some(force)) => self.drive(force, step),
                (Brakes::Closing { rates, elapsed, duration }, _) => {
                    self.brake(&rates, elapsed, duration, step)
                }
                _ => return,
            }
        }
    }

    fn drive(&mut self, force: &[f64; LEGS], step: f64) {
        match integrate(&self.dynamics, &self.state, force, step) {
            Some(state) => self.state = state,
            None => self.close_brakes(),
        }
        let actuator = &self.machine().actuator;
        let stroke = actuator.min_length..=actuator.max_length;
        let lengths = leg_lengths(self.machine(), &self.state.pose);
        if let Some(leg) = lengths.iter().position(|length| !stroke.contains(length)) {
            self.state.twist = Twist::default();
            self.brakes = Brakes::EndStop { leg };
        }
    }

    fn close_brakes(&mut self) {
        let rates = self.leg_motion().rate;
        let duration = Vector6::from(rates).amax() / self.deceleration;
        self.brakes = Brakes::Closing { rates, elapsed: 0.0, duration };
    }

    /// The legs follow their deceleration; the platform follows the legs (midpoint rule).
    fn brake(&mut self, rates: &[f64; LEGS], elapsed: f64, duration: f64, step: f64) {
        let twist_at = |time: f64, pose| {
            let share = (1.0 - time / duration).max(0.0);
            twist_from_rates(self.machine(), pose, &rates.map(|rate| rate * share)).unwrap_or_default()
        };
        let scaled = |twist: Twist, dt: f64| Twist { angular: twist.angular * dt, linear: twist.linear * dt };
        let start = twist_at(elapsed, &self.state.pose);
        let middle_pose = self.state.pose.displaced(&scaled(start, 0.5 * step));
        let middle = twist_at(elapsed + 0.5 * step, &middle_pose);
        let pose = self.state.pose.displaced(&scaled(middle, step));
        let elapsed = elapsed + step;
        let standing = !(elapsed < duration);
        let twist = if standing { Twist::default() } else { twist_at(elapsed, &pose) };
        self.state = PlantState { pose, twist };
        self.brakes =
            if standing { Brakes::Closed } else { Brakes::Closing { rates: *rates, elapsed, duration } };
    }
}
