//! Near a singular pose at several speeds: what passes, what is stopped before, and with which forces.
//!
//! The platform turns from home toward the singular pose, to a distance from it, and back.

use hexad::control::parameters::ViolationPolicy;
use rayon::prelude::*;

use super::fichter::{
    ANY, AT_HOME, CONDITION, HOLDING_N, at, before, motion_base, on_the_way, reason, there_and_back,
};
use super::*;

/// From home to the nearest pose \[s\]: up to 0.14, 0.38 and 0.94 rad/s.
const TIMES_S: [f64; 3] = [4.0, 1.5, 0.6];

/// How a run ended.
#[derive(Debug)]
struct Run {
    last: Output,
    /// Largest condition of the true pose under control.
    condition: f64,
    /// Largest force.
    force: f64,
    /// Largest force that holds the platform where it was.
    holding: f64,
    /// Whether a cycle said that the condition limits it.
    is_condition_told: bool,
    /// The first cycle that was at its limits of force.
    limited: Option<u32>,
    cycles: u32,
}

/// Follows the motion as long as it is controlled, or to its end; never beyond the singular pose.
fn run(config: &Config, time_s: f64, distance: f64) -> Run {
    let machine = &config.machine;
    let mut rig = Rig::new(config, machine);
    rig.engage(&on_the_way(AT_HOME, &Profile::default()));
    let mut run = Run {
        last: Output::default(),
        condition: 0.0,
        force: 0.0,
        holding: 0.0,
        is_condition_told: false,
        limited: None,
        cycles: 0,
    };
    while f64::from(run.cycles) < 2e3 * time_s {
        let task = there_and_back(f64::from(run.cycles) * 1e-3, time_s, distance, time_s);
        let output = rig.cycle(&rig.input(&task));
        let pose = rig.simulator().state().pose;
        if output.state.has_control() {
            assert!(before(machine, &pose), "{time_s} s, {distance:e}: beyond");
            run.condition = run.condition.max(KinematicState::new(machine, pose).sensitivity().condition);
            run.force = run.force.max(largest(&output.command_n));
            let resting = Motion { pose, ..TaskState::default().motion() };
            run.holding = run.holding.max(largest(&inverse_dynamics::<Exact>(machine, &resting).unwrap()));
        }
        run.is_condition_told |= output.active_limits.contains(Limit::Condition);
        if output.active_limits.contains(Limit::Force) {
            run.limited.get_or_insert(run.cycles);
        } else {
            assert_eq!(output.wrench_error, Wrench::default());
        }
        (run.last, run.cycles) = (output, run.cycles + 1);
    }
    run
}

/// Every distance at every speed.
fn runs(condition: f64) -> Vec<(f64, f64, Run)> {
    let cases: Vec<_> =
        (1..=8).flat_map(|power| TIMES_S.map(|time_s| (10_f64.powi(-power), time_s))).collect();
    let config = motion_base(condition);
    cases
        .into_par_iter()
        .map(|(distance, time_s)| (distance, time_s, run(&config, time_s, distance)))
        .collect()
}

/// Forces are what holds the platform where it is; what moves it slowly comes to less than a third of that.
fn assert_forces(run: &Run, what: &str) {
    assert!(run.force < 1.3 * run.holding, "{what}: {} N, holding {} N", run.force, run.holding);
    assert!(run.limited.is_none(), "{what}");
}

/// What the hardest stop within `[limits]` asks for at this distance.
fn stopping(config: &Config, distance: f64) -> f64 {
    let mut task = at(distance);
    task.xdd[2] = -config.deployment.limits.reference.orientation.acceleration;
    largest(&inverse_dynamics::<Exact>(&config.machine, &task.motion()).unwrap())
}

/// The default limit is at a distance of 0.032: what comes nearer is stopped before, whatever its speed.
#[test]
fn nearer_than_the_limit_of_condition_is_stopped_before() {
    let hardest = stopping(&motion_base(100.0), CONDITION / 100.0);
    for (distance, time_s, run) in runs(100.0) {
        let what = format!("{distance:e} rad, {time_s} s");
        // The reference ends at the limit; the platform is beside it by some microradians.
        assert!(run.condition < 100.03, "{what}: {}", run.condition);
        if distance > CONDITION / 100.0 {
            assert_forces(&run, &what);
            assert_eq!(reason(&run.last), (State::Active, DiagnosticCode::None), "{what}");
            assert!((run.condition * distance / CONDITION - 1.0).abs() < 0.02, "{what}: {}", run.condition);
            continue;
        }
        // The reference stopped before the limit, and said so; then the setpoint was too far ahead, unless the platform,
        // a little beside it, was beyond the limit before.
        let Diagnostic { code, value, bound, .. } = run.last.diagnostic;
        let expected = match code {
            DiagnosticCode::NearSingular => 100.0,
            _ => 1.0,
        };
        let is_told = matches!(code, DiagnosticCode::NearSingular | DiagnosticCode::SetpointBeyondLimits);
        assert!(run.last.state == State::Fault && is_told && run.is_condition_told, "{what}: {code:?}");
        assert!(value > bound && bound == expected, "{what}: {value} {bound}");
        assert!(run.force < hardest && run.limited.is_none(), "{what}: {} N of {hardest} N", run.force);
        // It comes to rest where the last setpoint that was good would have ended: not far from the limit.
        assert!(run.condition > 50.0, "{what}: stopped at a condition of {}", run.condition);
    }
}

/// Under the other policy it is no fault to send more: the platform waits at the limit, and comes back.
#[test]
fn under_the_policy_limit_the_platform_waits_before_the_limit_of_condition() {
    for time_s in TIMES_S {
        let mut config = motion_base(100.0);
        config.deployment.setpoint.on_violation = ViolationPolicy::Limit;
        let mut rig = Rig::new(&config, &config.machine);
        rig.engage(&on_the_way(AT_HOME, &Profile::default()));
        let mut most = 0.0_f64;
        let mut k = 0;
        while f64::from(k) < 2e3 * time_s + 1e3 {
            let task = there_and_back(f64::from(k) * 1e-3, time_s, -0.1, time_s);
            let output = rig.cycle(&rig.input(&task));
            assert_eq!(reason(&output), (State::Active, DiagnosticCode::None), "{time_s} s, cycle {k}");
            let pose = rig.simulator().state().pose;
            most = most.max(KinematicState::new(&config.machine, pose).sensitivity().condition);
            k += 1;
        }
        assert!((50.0..100.0).contains(&most), "{time_s} s: {most}");
    }
}

/// Without that limit forward kinematics ends at a condition of 10,000, a distance of 0.0003, and setpoints end
/// where a stop could end beyond the singular pose. Forces are as large as they must be there and no larger.
#[test]
fn without_a_limit_the_model_ends_before_the_singular_pose() {
    for (distance, time_s, run) in runs(ANY) {
        let what = format!("{distance:e} rad, {time_s} s");
        assert_forces(&run, &what);
        if distance > CONDITION / MAX_CONDITION {
            assert_eq!(reason(&run.last), (State::Active, DiagnosticCode::None), "{what}");
            assert!((run.holding * distance / HOLDING_N - 1.0).abs() < 0.15, "{what}: {} N", run.holding);
            continue;
        }
        assert_eq!(run.last.state, State::Fault, "{what}");
        let codes = [DiagnosticCode::NearSingular, DiagnosticCode::SingularPose];
        assert!(codes.contains(&run.last.diagnostic.code), "{what}: {:?}", run.last);
        assert!((300.0..1.2 * MAX_CONDITION).contains(&run.condition), "{what}: {}", run.condition);
    }
}

/// Drives that hold the platform to a distance of a quarter radian, and a motion that goes on: the reference leaves the
/// motion before the forces reach their limit, says so, and comes to rest.
#[test]
fn drives_that_are_too_weak_on_the_way_are_told_and_end_in_a_stop() {
    for time_s in TIMES_S {
        for distance in [0.15, 0.1, 0.05] {
            let what = format!("{distance} rad, {time_s} s");
            let mut config = motion_base(ANY);
            config.machine.actuator.max_force_n = 20e3;
            let more = (0..)
                .position(|k| {
                    let task = there_and_back(f64::from(k) * 1e-3, time_s, distance, time_s);
                    largest(&inverse_dynamics::<Exact>(&config.machine, &task.motion()).unwrap()) > 20e3
                })
                .unwrap() as u32;
            let run = run(&config, time_s, distance);
            assert!(run.limited.unwrap() < more, "{what}: {:?}, not before {more}", run.limited);
            assert!(run.force < 20e3, "{what}: {}", run.force);
            let Diagnostic { code, .. } = run.last.diagnostic;
            assert_eq!(code, DiagnosticCode::SetpointBeyondLimits, "{what}: {:?}", run.last.diagnostic);
        }
    }
}

/// A payload that the drives cannot hold, beside a controller whose drives can, until the forces part: the wrench that
/// is missing is told.
#[test]
fn what_limited_forces_leave_out_is_told_as_a_wrench() {
    let mut config = motion_base(ANY);
    let home = on_the_way(AT_HOME, &Profile::default());
    let held = largest(&inverse_dynamics::<Exact>(&config.machine, &home.motion()).unwrap());
    let mut heavier = config.machine.clone();
    heavier.platform.mass_kg *= 1.4;
    let mut strong = Rig::new(&config, &heavier);
    config.machine.actuator.max_force_n = held / 0.85;
    let mut rig = Rig::new(&config, &heavier);
    rig.engage(&home);
    strong.engage(&home);
    for _ in 0..10_000 {
        let (output, wanted) = (rig.cycle(&rig.input(&home)), strong.cycle(&strong.input(&home)));
        if output.active_limits.contains(Limit::Force) {
            let more = Vector6::from(output.command_n) - Vector6::from(wanted.command_n);
            let wrench = leg_wrenches(&config.machine, &home.motion().pose) * more;
            let apart = (output.wrench_error.vector() - wrench).norm() / wrench.norm();
            assert!(wrench.norm() > 10.0 && apart < 0.01, "{apart}: {wrench} {:?}", output.wrench_error);
            return;
        }
        assert_eq!((output.command_n, output.wrench_error), (wanted.command_n, Wrench::default()));
    }
    panic!("the forces have not parted");
}
