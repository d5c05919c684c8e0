//! Choice of the plant's terms beyond the model, and of the integrator's step.
//!
//! Two terms have a time scale of their own, the lag of the drives and the spring of the legs. The largest effect of each
//! on a position follows from the machine:
//!
//! ```text
//! lag      F / (m w^2)         travel of a leg before the force F is reached
//! spring   F / k + play / 2    its deflection under the force F
//! ```
//!
//! with F the strongest force and m the least mass that a drive moves. A term whose effect is below the tolerance is
//! left out. The step of the others keeps the error of Runge-Kutta, a share of their effect, below it:
//! `(w h)^4 / 2880` for an exponential (Simpson's rule), `2 pi (w h)^4 / 120` in each period of an oscillation.
//! The model itself needs no shorter step than the configured one: the default's error is 1e-12 m.
//!
//! Not covered: a step in which a leg meets a flank of its play or turns around in dry friction is of a
//! lower order than that; its error is damped by the same contact, not bounded here.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector6;

use super::forward_dynamics::ForwardDynamics;
use super::imperfections::{ElasticLeg, ExternalWrench, Friction, Imperfections};
use super::integrator::{Accelerations, PlantState};
use crate::model::LEGS;
use crate::model::active_forces::inverse_dynamics;
use crate::model::fidelity::Gravity;
use crate::model::inverse_geometry::{LegMotion, leg_motion};
use crate::model::machine::{Actuator, Machine};
use crate::model::rigid::{Acceleration, Motion};
use crate::model::task::TaskState;
use crate::model::transmission::Transmission;

/// Longest step times rate, whatever the tolerance: Runge-Kutta is stable to 2.78, and 1 is also accurate.
const MAX_STEP_TIMES_RATE: f64 = 1.0;

/// Terms of the plant beyond the model, and the step of the integration.
#[derive(Clone, Copy, Debug)]
pub struct PlantTerms {
    /// Rate of the drives' lag \[rad/s\].
    pub lag_per_s: Option<f64>,
    /// The spring, and the mass of the drive behind it \[kg\].
    pub elastic: Option<(ElasticLeg, f64)>,
    /// Step of the integration \[s\].
    pub step_s: f64,
    /// Friction of each leg: where legs are rigid, what the machine does not have; else all of it.
    friction: [Friction; LEGS],
    /// Speed below which the sign of dry friction is proportional \[m/s\].
    smoothing: f64,
    external: ExternalWrench,
}

impl PlantTerms {
    /// Chooses terms and step, at most `longest_step_s`, for positions exact to `tolerance_m` \[m\]. A leg is elastic
    /// only where its drive has mass.
    pub fn choose(machine: &Machine, wanted: &Imperfections, longest_step_s: f64, tolerance_m: f64) -> Self {
        let actuator = &machine.actuator;
        let least_mass = |machine: &Machine| {
            ForwardDynamics::new(machine)
                .smallest_effective_leg_mass_kg(&machine.home_pose())
                .unwrap_or(f64::NAN)
        };
        let dry =
            wanted.friction.dry() + actuator.largest_coulomb_friction() + held_by_load_friction(machine);
        let depends = wanted.drive.bandwidth_hz.is_some() || wanted.leg.is_some() || wanted.friction.any();
        let leg_mass = if depends || dry > 0.0 { least_mass(machine) } else { f64::NAN };
        let drive_mass = actuator.reflected_mass_kg;
        let mut step_s = longest_step_s;
        let mut limit = |rate: f64, effect: f64, divisor: f64| {
            step_s = step_s.min((divisor * tolerance_m / effect).powf(0.25).min(MAX_STEP_TIMES_RATE) / rate);
        };

        let deflection =
            |spring: &ElasticLeg| actuator.max_force_n / spring.stiffness_n_per_m + 0.5 * spring.backlash_m;
        let spring = wanted.leg.filter(|spring| drive_mass > 0.0 && deflection(spring) > tolerance_m);
        let mut friction = [wanted.friction; LEGS];
        let mut moved = leg_mass;
        if let Some(spring) = spring {
            let compliance = 1.0 / drive_mass + 1.0 / least_mass(&without_drives(machine));
            let rate = (spring.stiffness_n_per_m * compliance).sqrt().max(spring.damping_n_s_m * compliance);
            limit(rate, deflection(&spring), 120.0 / core::f64::consts::TAU);
            let own = actuator.viscous_friction_n_s_m.iter().zip(&actuator.coulomb_friction_n);
            for (friction, (viscous, coulomb)) in friction.iter_mut().zip(own) {
                friction.viscous_n_s_m += viscous;
                friction.coulomb_n += coulomb;
            }
            moved = drive_mass;
        }
        let way = |rate: f64| actuator.max_force_n / (moved * rate * rate);
        let lag_rate = wanted.drive.bandwidth_hz.map(|hertz| core::f64::consts::TAU * hertz);
        let lag_per_s = lag_rate.filter(|rate| way(*rate) > tolerance_m);
        if let Some(rate) = lag_per_s {
            limit(rate, way(rate), 2880.0);
        }
        let viscous = friction.iter().map(|friction| friction.viscous_n_s_m).fold(0.0, f64::max);
        if viscous > 0.0 {
            step_s = step_s.min(MAX_STEP_TIMES_RATE * moved / viscous);
        }
        Self {
            lag_per_s,
            elastic: spring.map(|spring| (spring, drive_mass)),
            step_s,
            friction,
            // Dry friction acts within smoothing / (force / mass); where that is too fast for the step, its sign
            // is smoothed just enough for a stable integration.
            smoothing: Actuator::COULOMB_SMOOTHING_M_S.max(dry * step_s / moved),
            external: wanted.external,
        }
    }

    /// The machine whose equations are integrated: with drives that move with their legs, or without.
    pub fn machine(&self, machine: &Machine) -> Machine {
        let mut simulated = machine.clone();
        simulated.actuator.coulomb_smoothing_m_s = self.smoothing;
        if self.elastic.is_some() { without_drives(&simulated) } else { simulated }
    }

    /// Forces of the drives \[N\], as they know them, a `time_s` after `command_n`, from the forces `before_n` it.
    pub fn push(&self, before_n: &[f64; LEGS], command_n: &[f64; LEGS], time_s: f64) -> [f64; LEGS] {
        let Some(rate) = self.lag_per_s else { return *command_n };
        let share = (-rate * time_s).exp();
        let mut push = *command_n;
        for (push, before) in push.iter_mut().zip(before_n) {
            *push += (before - *push) * share;
        }
        push
    }

    /// Accelerations of a state under the forces `push_n` of the drives, `time_s` after the start of the plant.
    pub fn accelerations(
        &self,
        dynamics: &ForwardDynamics,
        state: &PlantState,
        push_n: &[f64; LEGS],
        time_s: f64,
    ) -> Option<Accelerations> {
        let PlantState { platform, drives } = state;
        let actuator = &dynamics.machine().actuator;
        let mut force = *push_n;
        let mut drives_accelerate = Vector6::zeros();
        if let Some((spring, drive_mass)) = self.elastic {
            let LegMotion { length_m, rate_m_s, .. } = legs(dynamics.machine(), state);
            force = Transmission::new(actuator, drives.rate_m_s.as_ref()).leg_forces(push_n);
            let on_drives = drives.length_m.iter().zip(&drives.rate_m_s).zip(&mut drives_accelerate);
            let on_rods = force.iter_mut().zip(&self.friction).zip(length_m.iter().zip(&rate_m_s));
            for (((force, friction), (length, rate)), ((drive, drive_rate), accelerates)) in
                on_rods.zip(on_drives)
            {
                let tension = spring.force(drive - length, drive_rate - rate);
                *accelerates = (*force - friction.force(*drive_rate, self.smoothing) - tension) / drive_mass;
                *force = tension;
            }
        } else if actuator.has_load_friction_or_scale() || self.friction.iter().any(Friction::any) {
            let rates = legs(dynamics.machine(), state).rate_m_s;
            force = Transmission::new(actuator, &rates).leg_forces(push_n);
            for ((force, friction), rate) in force.iter_mut().zip(&self.friction).zip(rates) {
                *force -= friction.force(rate, self.smoothing);
            }
        }
        let wrench = self.external.at(time_s);
        let platform = dynamics.acceleration_under(&platform.pose, &platform.twist, &force, &wrench)?;
        Some(Accelerations { platform, drives_m_s2: drives_accelerate })
    }
}

/// Lengths and rates of the legs themselves.
pub(super) fn legs(machine: &Machine, state: &PlantState) -> LegMotion {
    let (pose, twist) = (state.platform.pose, state.platform.twist);
    let motion = Motion { pose, twist, acceleration: Acceleration::default() };
    LegMotion { accel_m_s2: [0.0; LEGS], ..leg_motion(machine, &motion) }
}

/// Largest load friction of a leg that holds the platform at home \[N\].
fn held_by_load_friction(machine: &Machine) -> f64 {
    let home = TaskState::at_rest(machine.home).motion();
    let held = inverse_dynamics::<Gravity>(machine, &home).unwrap_or_default();
    let legs = held.iter().zip(&machine.actuator.load_friction_share);
    legs.map(|(force, load_friction)| force.abs() * load_friction).fold(0.0, f64::max)
}

fn without_drives(machine: &Machine) -> Machine {
    let mut bare = machine.clone();
    let actuator = &mut bare.actuator;
    (actuator.reflected_mass_kg, actuator.viscous_friction_n_s_m, actuator.coulomb_friction_n) =
        (0.0, [0.0; LEGS], [0.0; LEGS]);
    bare
}
