//! The simulated platform against what does not depend on its equations of motion: energy, order of
//! convergence, brakes that stop.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod brakes;
mod dynamics;
mod elastic;
mod energy;
mod friction;
mod hardware;
mod held_forces;
mod imperfect;
mod integration;
mod power;

use hexad::plant::hardware::Hardware;
use hexad::plant::integrator::{Accelerations, BodyState, DriveStates, PlantState};
use hexad::plant::simulator::{Brakes, Simulator};

use crate::*;

/// Default of `plant.step_us`.
const DEFAULT_STEP_S: f64 = 250e-6;

/// Default of `plant.brake_deceleration_m_s2`.
const DECELERATION: f64 = 9.81;

/// Default of `plant.tolerance_um`.
const TOLERANCE_M: f64 = 1e-7;

fn simulator(machine: &Machine, wanted: &Imperfections) -> Simulator {
    Simulator::imperfect(machine, DECELERATION, DEFAULT_STEP_S, TOLERANCE_M, wanted)
}

fn hardware(machine: &Machine, wanted: &Imperfections) -> Hardware {
    Hardware::new(machine, DECELERATION, DEFAULT_STEP_S, TOLERANCE_M, wanted)
}

/// Every imperfection that there is, of a size that a motion base could have.
fn everything() -> Imperfections {
    Imperfections {
        seed: 5,
        drive: DriveErrors { bandwidth_hz: Some(80.0), force_step_n: 5.0, dead_time_ns: 1_500_000 },
        friction: Friction {
            viscous_n_s_m: 200.0,
            coulomb_n: 150.0,
            stiction_n: 100.0,
            ..Friction::default()
        },
        leg: Some(ElasticLeg { stiffness_n_per_m: 5e7, damping_n_s_m: 1e4, backlash_m: 2e-5 }),
        sensor: SensorErrors {
            length_step_m: 1e-6,
            rate_step_m_s: 1e-4,
            length_noise_m: 2e-6,
            rate_noise_m_s: 1e-4,
        },
        build: BuildErrors {
            payload_kg: 100.0,
            payload_at_m: Vector3::new(0.1, 0.0, 0.5),
            joint_deviation_m: 1e-4,
        },
        external: ExternalWrench {
            wrench: Wrench { torque: Vector3::new(50.0, 0.0, 0.0), force: Vector3::new(0.0, 100.0, 0.0) },
            frequency_hz: 2.0,
        },
    }
}

/// Forces that hold a machine where it is.
fn holding(machine: &Machine, pose: &Pose) -> [f64; LEGS] {
    let motion = Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() };
    inverse_dynamics::<Exact>(machine, &motion).unwrap()
}

/// Drives that only push.
fn without_drives(mut machine: Machine) -> Machine {
    let actuator = &mut machine.actuator;
    (actuator.reflected_mass_kg, actuator.viscous_friction_n_s_m, actuator.coulomb_friction_n) =
        (0.0, [0.0; 6], [0.0; 6]);
    machine
}

fn home(machine: &Machine) -> BodyState {
    BodyState { pose: machine.home_pose(), twist: Twist::default() }
}

/// The model's state a step later under constant forces.
fn integrate(
    dynamics: &ForwardDynamics,
    start: &BodyState,
    force: &[f64; LEGS],
    step: f64,
) -> Option<BodyState> {
    let start = PlantState { platform: *start, drives: DriveStates::default() };
    let accelerations = |state: &PlantState, _| {
        let platform = dynamics.acceleration(&state.platform.pose, &state.platform.twist, force)?;
        Some(Accelerations { platform, drives_m_s2: Vector6::zeros() })
    };
    Some(hexad::plant::integrator::integrate(&start, step, accelerations)?.platform)
}

/// Lengths and rates of the legs.
fn legs(machine: &Machine, state: &BodyState) -> ([f64; LEGS], [f64; LEGS]) {
    let motion = Motion { pose: state.pose, twist: state.twist, acceleration: Acceleration::default() };
    let legs = leg_motion(machine, &motion);
    (legs.length_m, legs.rate_m_s)
}

/// Forces that carry the platform and shake it about home: six sines of up to `size` radii and as many
/// radians, below `hertz`, and a damped spring of that frequency that brings it back.
fn shaking(machine: &Machine, state: &BodyState, t: f64, size: f64, hertz: f64) -> [f64; LEGS] {
    let w = TAU * hertz;
    let sine = |k: f64| (w * (0.3 + 0.09 * k) * t).sin() * size;
    let back = state.pose.displacement_to(&home(machine).pose);
    let Twist { angular, linear } = state.twist;
    let acceleration = Acceleration {
        angular: (back.angular + Vector3::new(sine(0.0), sine(1.0), sine(2.0))) * (w * w) - angular * w,
        linear: (back.linear + Vector3::new(sine(3.0), sine(4.0), sine(5.0)) * machine.joints.radius_m)
            * (w * w)
            - linear * w,
    };
    inverse_dynamics::<Exact>(machine, &Motion { pose: state.pose, twist: Twist::default(), acceleration })
        .unwrap()
}
