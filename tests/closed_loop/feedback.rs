//! The bound of feedback: what a failed sensor, a collision or a wrong payload may add to the reference's acceleration.

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::law::ControlMode;
use hexad::control::parameters::Parameters;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::random::Random;
use hexad::model::rigid::{Acceleration, Twist};
use hexad::model::task::TaskState;
use hexad::plant::forward_dynamics::ForwardDynamics;
use nalgebra::{Vector3, Vector6};

use super::answer::answer;
use hexad_support::limit_check::TrueMotion;
use hexad_support::rig::{Rig, parameters};
use hexad_support::{deployed, largest};

const MACHINES: [&str; 3] = ["fried2008", "motion_base", "tsai2000"];

/// Forces without a limit of their own, and limits of acceleration so low that errors within what counts as noise of the
/// encoders saturate the feedback.
fn sensitive(name: &str, mode: ControlMode, acceleration: f64) -> Config {
    let mut config = deployed(name);
    // No gravity: in a mode without the model nothing else holds the platform up.
    config.machine.gravity_m_s2.fill(0.0);
    config.deployment.control.mode = mode;
    config.machine.actuator.max_force_n = 1e9;
    // No force for the estimated velocity, which the shoves of these tests have not.
    (config.machine.actuator.viscous_friction_n_s_m, config.machine.actuator.coulomb_friction_n) =
        ([0.0; 6], [0.0; 6]);
    let limits = &mut config.deployment.limits;
    limits.force_rate_n_s = 1e12;
    limits.reference.position.acceleration = acceleration;
    limits.reference.orientation.acceleration = acceleration;
    config
}

fn at_home(config: &Config) -> (Rig, TaskState, Parameters) {
    let mut rig = Rig::new(config, &config.machine);
    let home = TaskState::at_rest(config.machine.home);
    rig.engage(&home);
    (rig, home, parameters(config))
}

/// Position and orientation each: no more than `(1 + feedback_scale)` times the limit in the direction of the error, and
/// all of it where it is less.
#[test]
fn feedback_keeps_its_direction_and_ends_at_its_bound() {
    let mut random = Random::new(2008);
    let mut shove = || {
        let size = random.uniform();
        Vector3::from_fn(|_, _| size * (2.0 * random.uniform() - 1.0))
    };
    for name in MACHINES {
        let config = sensitive(name, ControlMode::ComputedTorque, 0.016);
        let (rig, home, parameters) = at_home(&config);
        let radius = config.machine.joints.radius_m.min(1.0);
        let dynamics = ForwardDynamics::new(&config.machine);
        let mut saturated = [0; 2];
        for _ in 0..200 {
            // A shove that is over before the next measurement: too small to be a jump.
            let (turn, shift) = (shove() * 3e-5, shove() * (3e-5 * radius));
            let mut aside = config.machine.clone();
            let x = home.x + Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
            aside.home = x.into();
            let mut rig = rig.clone();
            rig.put(Rig::new(&config, &aside).hardware);
            let output = rig.controller.step(&rig.input(&home));
            assert_eq!(output.state, State::Active, "{name}: {:?}", output.diagnostic);
            let pose = rig.simulator().state().pose;
            let found = dynamics.acceleration(&pose, &Twist::default(), &output.command_n).unwrap();
            let error = pose.displacement_to(&home.motion().pose).vector();
            let wanted = Acceleration::from_vector(&answer(&config, &error));
            let limits = &parameters.limits;
            let parts = [
                (found.angular, wanted.angular, limits.orientation.acceleration),
                (found.linear, wanted.linear, limits.position.acceleration),
            ];
            for ((found, wanted, limit), saturated) in parts.into_iter().zip(&mut saturated) {
                let bound = (1.0 + parameters.feedback_scale) * limit;
                let expected = wanted * (bound / wanted.norm()).min(1.0);
                *saturated += u32::from(wanted.norm() > bound);
                // The dynamics are evaluated at the estimated pose, which the shove has not yet reached.
                assert!((found - expected).norm() < 1e-2 * bound, "{name}: {found:?}, not {expected:?}");
            }
        }
        println!("{name}: {saturated:?} of 200 saturated");
        assert!(saturated.iter().all(|count| (20..198).contains(count)), "{name}: {saturated:?}");
    }
}

/// In motion the bound is that of the sum with the reference's acceleration: feedback against it may be larger.
#[test]
fn reference_and_feedback_together_end_at_the_bound() {
    let mut config = deployed("motion_base");
    config.machine.actuator.max_force_n = 1e9;
    let limits = &mut config.deployment.limits;
    (limits.force_rate_n_s, limits.feedback_scale) = (1e12, 0.1);
    limits.reference.position.acceleration = 1.0;
    // A platform lighter than the controller thinks: feedback pushes down, the reference goes either way.
    let mut light = config.machine.clone();
    light.platform.mass_kg *= 0.93;
    let (parameters, home) = (parameters(&config), TaskState::at_rest(config.machine.home));
    let bound = (1.0 + parameters.feedback_scale) * parameters.limits.position.acceleration;
    let mut rig = Rig::new(&config, &light);
    rig.engage(&home);
    let dynamics = ForwardDynamics::new(&config.machine);
    let w = 4.0 * core::f64::consts::TAU;
    let mut before: Option<Output> = None;
    let (mut at_bound, mut most) = ([0; 2], 0.0_f64);
    for cycle in 0..1800 {
        // From rest: 0.9 m/s^2 at 4 Hz: no saturation lasts, and all together not long enough.
        let t = f64::from(cycle) * 1e-3;
        let rise = (t / 2.0).min(1.0);
        let size = 0.9 / (w * w) * rise.powi(3) * (10.0 - 15.0 * rise + 6.0 * rise * rise);
        let mut task = home;
        // The envelope of the sine changes slowly: its derivatives are differences.
        task.x[5] += size * (w * t).sin();
        task.xd[5] = size * w * (w * t).cos();
        task.xdd[5] = -size * w * w * (w * t).sin();
        let input = rig.input(&task);
        let pose = rig.simulator().state();
        let measured = (pose.pose, pose.twist);
        let output = rig.cycle(&input);
        assert_eq!(output.state, State::Active, "{cycle}: {:?}", output.diagnostic);
        if let Some(reference) = before.and_then(|before: Output| before.reference) {
            let found = dynamics.acceleration(&measured.0, &measured.1, &output.command_n).unwrap().linear.z;
            let desired =
                0.5 * (reference.acceleration.linear.z + output.reference.unwrap().acceleration.linear.z);
            most = most.max(found.abs());
            let side = usize::from(desired > 0.0);
            at_bound[side] += u32::from((found.abs() / bound - 1.0).abs() < 0.01);
        }
        before = Some(output);
    }
    println!("{most} of {bound} m/s^2, {at_bound:?} cycles at the bound");
    assert!(most < 1.01 * bound, "{most} of {bound} m/s^2");
    assert!(at_bound.iter().sum::<u32>() > 30, "{at_bound:?}");
}

/// In the modes on legs: as leg accelerations, all shortened by the same factor.
#[test]
fn feedback_of_the_legs_is_shortened_for_all_alike() {
    for (name, mode) in MACHINES
        .into_iter()
        .flat_map(|name| ControlMode::ALL.map(|mode| (name, mode)))
        .filter(|(_, mode)| mode.acts_on_legs())
    {
        let config = sensitive(name, mode, 0.01);
        let (mut rig, home, parameters) = at_home(&config);
        (0..1500).for_each(|_| {
            assert_eq!(rig.cycle(&rig.input(&home)).state, State::Active, "{name} {}", mode.name())
        });
        let law = &parameters.law;
        let legs = hexad_support::Legs::of(&config.machine);
        let arm = legs.platform.iter().map(Vector3::norm).fold(0.0, f64::max);
        let limit =
            parameters.limits.position.acceleration + arm * parameters.limits.orientation.acceleration;
        let bounds = law
            .max_compensated_acceleration
            .map(|saturation| (1.0 + parameters.feedback_scale) * limit + saturation);
        let mass = law.leg_masses.mass_kg;
        let still = rig.input(&home);
        // What the model commands without feedback.
        let own = {
            let length = hexad::model::inverse_geometry::leg_lengths(&config.machine, &home.motion().pose);
            let measured = still.measurement.unwrap();
            let wanted = answer(&config, &(Vector6::from(length) - Vector6::from(measured.length_m)));
            Vector6::from(rig.controller.clone().step(&still).command_n) - wanted.component_mul(&mass)
        };
        let mut saturated = 0;
        for push in 0..60 {
            let mut input = still;
            let measured = input.measurement.as_mut().unwrap();
            for (leg, length) in measured.length_m.iter_mut().enumerate() {
                *length += 1e-6 * f64::from(push) * (f64::from(push) * 0.7 + leg as f64 * 1.9).sin();
            }
            let desired = hexad::model::inverse_geometry::leg_lengths(&config.machine, &home.motion().pose);
            let wanted = answer(&config, &(Vector6::from(desired) - Vector6::from(measured.length_m)));
            let excess = wanted.component_div(&bounds).amax().max(1.0);
            saturated += u32::from(excess > 1.0);
            let output = rig.controller.clone().step(&input);
            assert_eq!(output.state, State::Active, "{name} {}: {:?}", mode.name(), output.diagnostic);
            let found = (Vector6::from(output.command_n) - own).component_div(&mass);
            let apart = (found - wanted / excess).amax() / bounds.amax();
            assert!(apart < 1e-3, "{name} {}: {found:?}, not {:?}", mode.name(), wanted / excess);
        }
        println!("{name} {}: {saturated} of 60 saturated, bounds {:.3?}", mode.name(), bounds.as_slice());
        assert!((10..60).contains(&saturated), "{name} {}: {saturated} of 60", mode.name());
    }
}

/// A platform that something holds while the setpoint moves on, until `free_after` cycles of saturation. Returns the
/// cycles of saturation before control ended, and the last output.
fn held(free_after: u32) -> (u32, Output, TrueMotion, Parameters) {
    let mut config = deployed("motion_base");
    // An obstacle is an impact; here it is allowed.
    config.deployment.limits.disturbance_step_m_s2 = Some(f64::INFINITY);
    let (mut rig, home, parameters) = at_home(&config);
    (0..50).for_each(|_| _ = rig.cycle(&rig.input(&home)));
    let bound = (1.0 + parameters.feedback_scale) * parameters.limits.position.acceleration;
    let dynamics = ForwardDynamics::new(&config.machine);
    let mut felt = TrueMotion::new(&rig, &parameters);
    let (mut saturated, mut task, speed) = (0, home, 0.02);
    let mut last = Output::default();
    for cycle in 0..1500 {
        // Up to 20 mm/s in 50 ms, and on for 8 mm.
        let t = f64::from(cycle) * 1e-3;
        let (ramp, until) = (0.05, 0.4);
        let z = |t: f64| {
            let part = (t / ramp).clamp(0.0, 1.0);
            // Smooth from rest: the integral of 3 p^2 - 2 p^3.
            let grown = ramp * part.powi(3) * (1.0 - 0.5 * part) + (t - ramp).max(0.0);
            let rate = part * part * (3.0 - 2.0 * part);
            let accel = if (0.0..ramp).contains(&t) { 6.0 * part * (1.0 - part) / ramp } else { 0.0 };
            [grown, rate, accel].map(|value| value * speed)
        };
        let (go, end) = (z(t), z(t - until));
        (task.x[5], task.xd[5], task.xdd[5]) = (home.x[5] + go[0] - end[0], go[1] - end[1], go[2] - end[2]);
        // A sensor that is alive: what is held is the platform.
        let mut input = rig.input(&task);
        let measured = input.measurement.as_mut().unwrap();
        measured.length_m.iter_mut().for_each(|length| *length += 1e-9 * f64::from(cycle % 2));
        let output = rig.controller.step(&input);
        if !matches!(output.state, State::Active) {
            return (saturated, output, felt, parameters);
        }
        let pose = rig.simulator().state().pose;
        let found = dynamics.acceleration(&pose, &Twist::default(), &output.command_n).unwrap().linear.norm();
        // The reference has no acceleration any more.
        saturated += u32::from((found / bound - 1.0).abs() < 0.01 && t > ramp);
        let is_held = saturated < free_after;
        rig.pass(Some(output.command_n).filter(|_| !is_held));
        felt.observe(&rig);
        last = output;
    }
    (saturated, last, felt, parameters)
}

#[test]
fn saturation_of_a_tenth_of_a_second_is_a_fault() {
    let (saturated, output, ..) = held(u32::MAX);
    assert_eq!((output.state, output.diagnostic.code), (State::Fault, DiagnosticCode::FeedbackSaturated));
    // 0.1 s at 1 kHz, but for a few near the bound.
    assert!((100..=105).contains(&saturated), "{saturated} cycles");
    assert!((0.1..0.102).contains(&output.diagnostic.value) && output.diagnostic.bound == 0.1, "{output:?}");
}

/// What lets go earlier is no fault, and the platform is moved no faster than the bound says.
#[test]
fn a_shorter_saturation_is_ridden_through_within_the_bound() {
    let (saturated, output, felt, parameters) = held(90);
    println!("{saturated} cycles, {:?}", felt.largest);
    assert_eq!((output.state, output.diagnostic.code), (State::Active, DiagnosticCode::None));
    assert!((90..=105).contains(&saturated), "{saturated} cycles");
    let bound = 1.0 + parameters.feedback_scale;
    let acceleration = felt.largest.acceleration;
    assert!((0.9 * bound..1.01 * bound).contains(&acceleration), "{acceleration} of {bound}");
    assert!(largest(output.error.unwrap().pose.linear.as_slice()) < 1e-5, "{output:?}");
}
