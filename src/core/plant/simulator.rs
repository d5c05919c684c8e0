//! The simulated machine: dynamics, drives, brakes and end stops.
//!
//! Brakes are open exactly while a valid force is applied. Without one they close: every leg rate falls to
//! zero in a straight line, all at the same instant, the fastest at the configured deceleration; the
//! platform follows the legs, whatever its weight. Then it is at rest. A leg that reaches its end of stroke
//! closes the brakes until the plant is started again: on hardware an operator would inspect it first.
//!
//! Where legs are elastic a brake holds rod and drive alike: the deflection remains until the brake
//! opens. A drive whose brake closes exerts no force.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector6;

use super::forward_dynamics::ForwardDynamics;
use super::imperfections::Imperfections;
use super::integrator::{BodyState, DriveStates, PlantState, integrate};
use super::terms::{PlantTerms, legs};
use crate::model::LEGS;
use crate::model::active_forces::inverse_dynamics;
use crate::model::fidelity::Exact;
use crate::model::inverse_geometry::{LegMotion, leg_lengths};
use crate::model::inverse_jacobian::twist_from_rates;
use crate::model::machine::Machine;
use crate::model::rigid::Twist;
use crate::model::task::TaskState;

/// State of the brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Brakes {
    /// Forces drive the legs.
    Open,
    /// Leg rates at the instant of closing, time since, time until standstill \[s\].
    Closing {
        /// \[m/s\]
        rates_m_s: [f64; LEGS],
        /// \[s\]
        elapsed_s: f64,
        /// \[s\]
        duration_s: f64,
    },
    /// The legs are at rest.
    Closed,
    /// The legs are at rest because one reached an end of its stroke.
    EndStop {
        /// Counted from 0.
        leg: usize,
    },
}

/// Simulated machine: dynamics, drives, brakes and end stops.
///
/// ```
/// use hexad_core::model::{active_forces::inverse_dynamics, fidelity::Exact, task::TaskState};
/// use hexad_core::plant::simulator::{Brakes, Simulator};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let mut simulator = Simulator::new(&machine, 10.0, 1e-4);
/// let weight = inverse_dynamics::<Exact>(&machine, &TaskState::at_rest(machine.home).motion()).unwrap();
/// // The forces of rest hold it at home; without forces the brakes do.
/// simulator.advance(0.01, Some(&weight));
/// assert!((simulator.state().pose.position - machine.home_pose().position).norm() < 1e-9);
/// simulator.advance(0.01, None);
/// assert_eq!(simulator.brakes(), Brakes::Closed);
/// ```
#[derive(Clone, Debug)]
pub struct Simulator {
    dynamics: ForwardDynamics,
    terms: PlantTerms,
    state: PlantState,
    brakes: Brakes,
    deceleration: f64,
    /// Forces of the drives \[N\].
    push: [f64; LEGS],
    /// Since the start \[s\].
    time: f64,
}

impl Simulator {
    /// The machine as configured: at rest at home, brakes closed. `deceleration_m_s2` of the brakes in m/s^2,
    /// `max_step_s` of the integrator in s.
    ///
    /// Coulomb friction acts within `smoothing / (coulomb / mass)`; where that is too fast for the step,
    /// the plant's smoothing speed is widened just enough for a stable integration.
    pub fn new(machine: &Machine, deceleration_m_s2: f64, max_step_s: f64) -> Self {
        // Nothing is imperfect, so no tolerance decides anything.
        Self::imperfect(machine, deceleration_m_s2, max_step_s, f64::INFINITY, &Imperfections::default())
    }

    /// The same with imperfect drives and elastic legs, positions exact to `tolerance_m` \[m\]. The other imperfections are
    /// applied by [`super::hardware`].
    pub fn imperfect(
        machine: &Machine,
        deceleration_m_s2: f64,
        max_step_s: f64,
        tolerance_m: f64,
        wanted: &Imperfections,
    ) -> Self {
        let terms = PlantTerms::choose(machine, wanted, max_step_s, tolerance_m);
        let machine = terms.machine(machine);
        let home = TaskState::at_rest(machine.home).motion();
        let mut length_m = Vector6::from(leg_lengths(&machine, &home.pose));
        if let (Some((spring, _)), Some(load)) = (terms.elastic, inverse_dynamics::<Exact>(&machine, &home)) {
            length_m += Vector6::from(load.map(|force| spring.deflection(force)));
        }
        Self {
            dynamics: ForwardDynamics::new(&machine),
            terms,
            state: PlantState {
                platform: BodyState { pose: home.pose, twist: Twist::default() },
                drives: DriveStates { length_m, rate_m_s: Vector6::zeros() },
            },
            brakes: Brakes::Closed,
            deceleration: deceleration_m_s2,
            push: [0.0; LEGS],
            time: 0.0,
        }
    }

    /// Pose and twist.
    pub fn state(&self) -> &BodyState {
        &self.state.platform
    }

    /// State of the brakes.
    pub fn brakes(&self) -> Brakes {
        self.brakes
    }

    /// Forces of the drives that act now \[N\]; none with closed brakes.
    pub fn forces(&self) -> [f64; LEGS] {
        self.push
    }

    /// The simulated machine, with its friction; without drives where legs are elastic.
    pub fn machine(&self) -> &Machine {
        self.dynamics.machine()
    }

    /// The terms that are evaluated.
    pub fn terms(&self) -> &PlantTerms {
        &self.terms
    }

    /// Lengths and rates of the legs, as perfect sensors on the drives measure them. Accelerations are zero.
    pub fn leg_motion(&self) -> LegMotion {
        match self.terms.elastic {
            Some(_) => LegMotion {
                length_m: self.state.drives.length_m.into(),
                rate_m_s: self.state.drives.rate_m_s.into(),
                accel_m_s2: [0.0; LEGS],
            },
            None => legs(self.machine(), &self.state),
        }
    }

    /// Advances by `duration_s` seconds under constant forces, or without any.
    pub fn advance(&mut self, duration_s: f64, force: Option<&[f64; LEGS]>) {
        if !(duration_s > 0.0) {
            return;
        }
        match (self.brakes, force) {
            (Brakes::EndStop { .. }, _) => return,
            (_, Some(_)) => self.brakes = Brakes::Open,
            (Brakes::Open, None) => self.close_brakes(),
            _ => {}
        }
        let steps = (duration_s / self.terms.step_s).ceil().clamp(1.0, f64::from(u32::MAX)) as u32;
        let step = duration_s / f64::from(steps);
        for _ in 0..steps {
            match (self.brakes, force) {
                (Brakes::Open, Some(force)) => self.drive(force, step),
                (Brakes::Closing { rates_m_s, elapsed_s, duration_s }, _) => {
                    self.brake(&rates_m_s, elapsed_s, duration_s, step)
                }
                _ => {}
            }
            self.time += step;
        }
    }

    /// Legs slip through their closed brakes at these rates \[m/s\] for `duration_s` seconds, as worn brakes let them.
    pub fn slip(&mut self, duration_s: f64, rates_m_s: &[f64; LEGS]) {
        if self.brakes != Brakes::Closed {
            return;
        }
        let before = self.state().pose;
        let twist = twist_from_rates(self.machine(), &before, rates_m_s).unwrap_or_default();
        let pose = before
            .displaced(&Twist { angular: twist.angular * duration_s, linear: twist.linear * duration_s });
        self.carry_drives(BodyState { pose, twist: Twist::default() });
    }

    fn drive(&mut self, force: &[f64; LEGS], step: f64) {
        let Self { dynamics, terms, state, push, time, .. } = &*self;
        let accelerations = |state: &PlantState, dt: f64| {
            terms.accelerations(dynamics, state, &terms.push(push, force, dt), time + dt)
        };
        match integrate(state, step, accelerations) {
            Some(state) => (self.state, self.push) = (state, terms.push(push, force, step)),
            None => self.close_brakes(),
        }
        let lengths = leg_lengths(self.machine(), &self.state().pose);
        if let Some(leg) = lengths.iter().position(|length| !self.machine().actuator.contains(*length)) {
            self.state.platform.twist = Twist::default();
            self.state.drives.rate_m_s.fill(0.0);
            self.push = [0.0; LEGS];
            self.brakes = Brakes::EndStop { leg };
        }
    }

    fn close_brakes(&mut self) {
        let rates_m_s = legs(self.machine(), &self.state).rate_m_s;
        let duration_s = Vector6::from(rates_m_s).amax() / self.deceleration;
        self.push = [0.0; LEGS];
        self.brakes = Brakes::Closing { rates_m_s, elapsed_s: 0.0, duration_s };
    }

    /// The legs follow their deceleration; the platform follows the legs (midpoint rule).
    fn brake(&mut self, rates: &[f64; LEGS], elapsed: f64, duration_s: f64, step: f64) {
        let twist_at = |time: f64, pose| {
            let share = (1.0 - time / duration_s).max(0.0);
            twist_from_rates(self.machine(), pose, &rates.map(|rate| rate * share)).unwrap_or_default()
        };
        let scaled = |twist: Twist, dt: f64| Twist { angular: twist.angular * dt, linear: twist.linear * dt };
        let before = self.state().pose;
        let start = twist_at(elapsed, &before);
        let middle_pose = before.displaced(&scaled(start, 0.5 * step));
        let middle = twist_at(elapsed + 0.5 * step, &middle_pose);
        let pose = before.displaced(&scaled(middle, step));
        let elapsed_s = elapsed + step;
        let standing = !(elapsed_s < duration_s);
        let twist = if standing { Twist::default() } else { twist_at(elapsed_s, &pose) };
        self.carry_drives(BodyState { pose, twist });
        self.brakes = if standing {
            Brakes::Closed
        } else {
            Brakes::Closing { rates_m_s: *rates, elapsed_s, duration_s }
        };
    }

    /// Moves the platform; drives keep their distance from the legs.
    fn carry_drives(&mut self, platform: BodyState) {
        let before = legs(self.machine(), &self.state);
        self.state.platform = platform;
        let after = legs(self.machine(), &self.state);
        let drives = &mut self.state.drives;
        drives.length_m += Vector6::from(after.length_m) - Vector6::from(before.length_m);
        drives.rate_m_s = after.rate_m_s.into();
    }
}
