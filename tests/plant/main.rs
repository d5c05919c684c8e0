//! The simulated platform against what does not depend on its equations of motion: energy, order of
//! convergence, brakes that stop.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod brakes;
#[path = "../common/mod.rs"]
mod common;
mod dynamics;
mod energy;
mod friction;
mod integration;
mod power;

use hexad::model::active_forces::inverse_dynamics;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::ladder::Exact;
use hexad::model::machine::{LEGS, Machine};
use hexad::model::rigid::{Acceleration, Motion, Twist};
use hexad::model::task::TaskState;
use hexad::plant::integrator::PlantState;
use nalgebra::Vector3;

/// Default of `plant.step_us`.
const DEFAULT_STEP_S: f64 = 250e-6;

/// Default of `plant.brake_deceleration_m_s2`.
const DECELERATION: f64 = 9.81;

/// Drives that only push.
fn without_drives(mut machine: Machine) -> Machine {
    let actuator = &mut machine.actuator;
    (actuator.reflected_mass, actuator.viscous_friction, actuator.coulomb_friction) = (0.0, 0.0, 0.0);
    machine
}

fn home(machine: &Machine) -> PlantState {
    PlantState { pose: TaskState::at_rest(machine.home).motion().pose, twist: Twist::default() }
}

/// Lengths and rates of the legs.
fn legs(machine: &Machine, state: &PlantState) -> ([f64; LEGS], [f64; LEGS]) {
    let motion = Motion { pose: state.pose, twist: state.twist, acceleration: Acceleration::default() };
    let legs = leg_motion(machine, &motion);
    (legs.length, legs.rate)
}

/// Forces that carry the platform and shake it about home: six sines of up to `size` radii and as many
/// radians, below `hertz`, and a damped spring of that frequency that brings it back.
fn shaking(machine: &Machine, state: &PlantState, t: f64, size: f64, hertz: f64) -> [f64; LEGS] {
    let w = core::f64::consts::TAU * hertz;
    let sine = |k: f64| (w * (0.3 + 0.09 * k) * t).sin() * size;
    let back = state.pose.displacement_to(&home(machine).pose);
    let Twist { angular, linear } = state.twist;
    let acceleration = Acceleration {
        angular: (back.angular + Vector3::new(sine(0.0), sine(1.0), sine(2.0))) * (w * w) - angular * w,
        linear: (back.linear + Vector3::new(sine(3.0), sine(4.0), sine(5.0)) * machine.joints.radius)
            * (w * w)
            - linear * w,
    };
    inverse_dynamics::<Exact>(machine, &Motion { pose: state.pose, twist: Twist::default(), acceleration })
        .unwrap()
}
