//! Poses beyond a singular one have the lengths of poses before it. A platform that got there, whoever carried it,
//! is not taken for one that is still on the side of home: not until somebody has looked and said so.

use super::fichter::{ANY, AT_HOME, CONDITION, at, before, motion_base, on_the_way, reason, there_and_back};
use super::*;

/// From home to as far beyond \[s\]: peak speeds from 2.3 to 0.028 rad/s.
const TIMES_S: [f64; 4] = [0.5, 2.0, 10.0, 40.0];

/// Cycles that somebody takes to look.
const LOOK: u32 = 300;

/// One cycle of a platform that is where the task says, whatever the forces.
fn carried(rig: &mut Rig, task: &TaskState) -> Output {
    let legs = leg_motion(rig.simulator().machine(), &task.motion());
    let mut input = rig.input(task);
    let measurement = input.measurement.as_mut().unwrap();
    (measurement.length_m, measurement.rate_m_s) = (legs.length_m, Some(legs.rate_m_s));
    rig.now_ns += rig.parameters.period_ns;
    rig.controller.step(&input)
}

fn pose_error(output: &Output, truth: &Pose) -> f64 {
    output.platform.map_or(f64::NAN, |platform| platform.pose.displacement_to(truth).vector().norm())
}

/// In standby, active, and in a fault; with the default limit of the condition and without one.
#[test]
fn a_platform_that_passed_a_singular_pose_is_not_known_until_it_is_cleared() {
    for (condition, time_s) in [100.0, ANY].into_iter().flat_map(|c| TIMES_S.map(|t| (c, t))) {
        for state in [State::Standby, State::Active, State::Fault] {
            let what = format!("condition {condition}, {time_s} s, {}", state.name());
            let config = motion_base(condition);
            let mut rig = Rig::new(&config, &config.machine);
            let home = on_the_way(AT_HOME, &Profile::default());
            match state {
                State::Active => rig.engage(&home),
                State::Fault => rig.ask(Request::Estop),
                _ => {}
            }
            assert_eq!((0..3).map(|_| carried(&mut rig, &home)).last().unwrap().state, state, "{what}");
            let cycles = (3.0 * time_s * 1e3) as u32;
            let mut crossed = false;
            for k in 0..cycles {
                let task = there_and_back(f64::from(k) * 1e-3, time_s, -AT_HOME, 2.0 * time_s);
                let output = carried(&mut rig, &task);
                let truth = task.motion().pose;
                crossed |= !before(&config.machine, &truth);
                assert!(output.platform.is_none() || pose_error(&output, &truth) < 1e-6, "{what}");
                if crossed {
                    assert!(output.platform.is_none(), "{what}: {output:?}");
                    assert!(matches!(output.state, State::Off | State::Fault), "{what}: {output:?}");
                }
                if crossed && state == State::Standby {
                    assert_eq!(output.diagnostic.code, DiagnosticCode::SingularPose, "{what}");
                    let Diagnostic { value, bound, .. } = output.diagnostic;
                    assert!(value > bound && bound == condition.min(300.0), "{what}: {value} {bound}");
                }
            }
            assert!(crossed);
            // Home again, and yet nothing happens until it is cleared.
            rig.ask(Request::Engage);
            for _ in 0..LOOK {
                let output = carried(&mut rig, &home);
                assert!(!output.state.has_control() && output.platform.is_none(), "{what}: {output:?}");
            }
            rig.ask(Request::Clear);
            let output = (0..3).map(|_| carried(&mut rig, &home)).last().unwrap();
            assert_eq!(reason(&output), (State::Standby, DiagnosticCode::ReadyToEngage), "{what}");
            assert!(pose_error(&output, &home.motion().pose) < 1e-9, "{what}");
        }
    }
}

/// Something turns the platform harder than its drives can hold.
#[test]
fn a_platform_pushed_through_a_singular_pose_is_let_go_before() {
    for torque in [4e4, 1e5, 4e5] {
        for condition in [100.0, ANY] {
            let mut config = motion_base(condition);
            config.machine.actuator.max_force_n = 20e3;
            config.deployment.control.following_position_m = f64::MAX;
            config.deployment.control.following_orientation_rad = f64::MAX;
            config.deployment.control.following_velocity_m_s = f64::MAX;
            config.deployment.control.following_velocity_rad_s = f64::MAX;
            // The drives are what gives way, not the bound of feedback.
            config.deployment.limits.feedback_scale = 1e6;
            let wrench = Wrench { torque: Vector3::z() * torque, force: Vector3::zeros() };
            let mut rig = Rig::new(&config, &config.machine);
            let home = on_the_way(AT_HOME, &Profile::default());
            rig.engage(&home);
            let external = ExternalWrench { wrench, frequency_hz: 0.0 };
            let pushed = Imperfections { external, ..Imperfections::default() };
            rig.put(Rig::imperfect(&config, &config.machine, &pushed).hardware);
            let (mut limited, mut last) = (0, Output::default());
            for _ in 0..3000 {
                last = rig.cycle(&rig.input(&home));
                assert!(largest(&last.command_n) <= 20e3);
                assert!(!last.state.has_control() || before(&config.machine, &rig.simulator().state().pose));
                limited += u32::from(last.active_limits.contains(Limit::Force));
            }
            // The torque is more than the drives have, or more than a disturbance may be.
            let is_implausible = last.diagnostic.code == DiagnosticCode::MeasurementImplausible;
            assert!((limited > 10 || is_implausible) && last.state == State::Fault, "{torque}: {last:?}");
        }
    }
}

/// With constant speed toward the singular pose, and away from it.
#[test]
fn the_time_to_a_singular_pose_is_told() {
    for speed in [0.5, 0.05, -0.05] {
        let config = motion_base(100.0);
        let mut rig = Rig::new(&config, &config.machine);
        let way = f64::abs(0.2 / speed);
        let mut told = 0;
        for k in 0..(way * 1e3) as u32 {
            let t = f64::from(k) * 1e-3;
            let mut task = at(AT_HOME - speed * t);
            task.xd[2] = speed;
            let output = carried(&mut rig, &task);
            let distance = AT_HOME - speed * t;
            let Some(platform) = output.platform.filter(|_| k > 0) else { continue };
            told += 1;
            let ratio = platform.time_to_singularity_s * speed / distance;
            // The determinant is as good as linear at last, and taken from one measurement to the next.
            let near = (ratio - 1.0).abs() < 4.0 * distance + 1e-3 * speed / distance;
            let is_right = if speed > 0.0 { near } else { platform.time_to_singularity_s == f64::INFINITY };
            assert!(is_right, "{speed} {distance}: {ratio}");
            assert!(
                (platform.condition * distance / CONDITION - 1.0).abs() < 2.0 * distance * distance + 1e-3
            );
        }
        assert!(f64::from(told) > 0.9e3 * way, "{told}");
    }
}

/// Near a singular pose steps are short: what a platform can do in a pause of the measurements may be more of them
/// than a cycle has.
#[test]
fn further_than_the_steps_of_a_cycle_is_told_with_how_far_they_came() {
    /// Less than the timeout of measurements.
    const PAUSE: u32 = 18;
    let mut config = motion_base(ANY);
    // Somebody moves the platform beside its reference.
    config.deployment.control.following_velocity_m_s = f64::MAX;
    let home = at(0.012);
    config.machine.home = home.x.into();
    // Up, with the speed that it takes for that.
    let after = |way: f64| {
        let mut rig = Rig::new(&config, &config.machine);
        rig.engage(&home);
        rig.now_ns += u64::from(PAUSE - 1) * rig.parameters.period_ns;
        let mut task = home;
        task.x[5] += way;
        task.xd[5] = 2.0 * way / (f64::from(PAUSE) * 1e-3);
        (carried(&mut rig, &task), task)
    };
    let length = |task: &TaskState| leg_motion(&config.machine, &task.motion()).length_m;
    let (mut found, mut out_of_steps) = (0.0, 0);
    for k in 14..=20 {
        let (output, task) = after(f64::from(k) * 5e-4);
        let (now, before) = (length(&task), length(&home));
        let ways: [f64; 6] = core::array::from_fn(|leg| (now[leg] - before[leg]).abs());
        if output.state == State::Active {
            assert!(out_of_steps == 0 && pose_error(&output, &task.motion().pose) < 1e-9, "{k}: {output:?}");
            found = largest(&ways);
            continue;
        }
        out_of_steps += 1;
        assert_eq!(reason(&output), (State::Fault, DiagnosticCode::MeasurementJumped), "{k}");
        let Diagnostic { value, bound, .. } = output.diagnostic;
        assert!((value - largest(&ways)).abs() < 1e-12, "{k}: {output:?}");
        // A way that was found is within the bound; what is told of is beyond.
        assert!(0.0 < found && found < bound && bound < value, "{k}: {found}, {output:?}");
    }
    assert!(out_of_steps > 0);
}
