//! Targets: a pose to move to and stand at, under both policies.

use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::SetpointKind;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::{rise, straight_move};
use nalgebra::Vector6;

use super::ride::{MACHINES, Ride, TRUE_ACCELERATION, TRUE_JERK, beside, with_policy};
use hexad_support::limit_check::{Largest, TrueMotion};
use hexad_support::rig::{Rig, parameters};

/// One message with a pose to go to: the platform goes there with `autonomous_scale` of the limits and stands, for as long
/// as nobody sends anything else.
#[test]
fn a_target_is_reached_gently_and_stood_at_without_further_messages() {
    for (name, policy) in
        MACHINES.into_iter().flat_map(|name| [(name, ViolationPolicy::Stop), (name, ViolationPolicy::Limit)])
    {
        let config = with_policy(name, policy);
        let what = format!("{name} {policy:?}");
        let mut ride = Ride::new(&config);
        let there = beside(&ride.home, Vector6::new(0.05, 0.0, -0.05, 0.0, 0.03, -0.04));
        let scale = ride.parameters.limits.autonomous_scale;
        let mut reached = None;
        for cycle in 0..10_000 {
            let output = ride.cycle(SetpointKind::Target, (cycle == 0).then_some(there));
            assert_eq!(
                (output.state, output.diagnostic.code),
                (State::Active, DiagnosticCode::None),
                "{what} {cycle}"
            );
            let [position, orientation] = ride.distance(&there);
            if reached.is_none() && position < 1e-4 && orientation < 1e-4 {
                reached = Some(cycle);
            }
            assert!(
                reached.is_none() || position < 1.1e-4 && orientation < 1.1e-4,
                "{what} {cycle}: leaves it"
            );
        }
        // 5 cm at a fifth of the limits: 2 sqrt(d / A) + A / J = 457 ms.
        println!("{what}: reached after {reached:?} ms, {:?}", ride.felt.largest);
        assert!(reached.is_some_and(|cycle| (457..914).contains(&cycle)), "{what}: {reached:?}");
        assert!(
            ride.distance(&there).into_iter().all(|distance| distance < 1e-8),
            "{what}: {:?}",
            ride.distance(&there)
        );
        let Largest { velocity, acceleration, jerk, .. } = ride.felt.largest;
        for (value, bound) in [(velocity, 1.001), (acceleration, TRUE_ACCELERATION), (jerk, TRUE_JERK)] {
            assert!(value <= bound * scale, "{what}: {value} of the limit, not {scale}");
        }
        assert!(acceleration > 0.8 * scale, "{what}: {acceleration}");
    }
}

/// `limits.scale` holds for everything that moves: targets, and setpoints of a source far beyond it.
#[test]
fn with_a_tenth_of_the_limits_no_motion_exceeds_a_tenth() {
    for (name, kind) in
        MACHINES.into_iter().flat_map(|name| [(name, SetpointKind::Target), (name, SetpointKind::Motion)])
    {
        let mut config = with_policy(name, ViolationPolicy::Limit);
        config.deployment.limits.reference.autonomous_scale = 1.0;
        let full = parameters(&config);
        config.deployment.limits.scale = 0.1;
        let mut ride = Ride::new(&config);
        ride.felt = TrueMotion::new(&ride.rig, &full);
        let there = beside(&ride.home, Vector6::new(0.05, 0.0, -0.05, 0.0, 0.03, -0.04));
        for cycle in 0..4000 {
            let output = ride.cycle(kind, Some(there));
            let found = (output.state, output.diagnostic.code);
            assert_eq!(found, (State::Active, DiagnosticCode::None), "{name} {kind:?} {cycle}");
        }
        assert!(ride.distance(&there).into_iter().all(|distance| distance < 1e-6), "{name} {kind:?}");
        let Largest { velocity, acceleration, jerk, .. } = ride.felt.largest;
        println!("{name} {kind:?}: {:?}", ride.felt.largest);
        for (value, bound) in [(velocity, 1.001), (acceleration, TRUE_ACCELERATION), (jerk, TRUE_JERK)] {
            assert!(value <= 0.1 * bound, "{name} {kind:?}: {value} of the limit");
        }
        assert!(acceleration > 0.08, "{name} {kind:?}: {acceleration}");
    }
}

/// A payload that the file does not have needs an acceleration of feedback far beyond the scaled limits.
#[test]
fn a_slow_platform_carries_an_unknown_payload_as_a_fast_one_does() {
    for scale in [1.0, 0.05] {
        let mut config = with_policy("motion_base", ViolationPolicy::Stop);
        config.deployment.limits.scale = scale;
        let mut loaded = config.machine.clone();
        loaded.platform.mass_kg *= 1.15;
        let mut rig = Rig::new(&config, &loaded);
        let home = TaskState::at_rest(config.machine.home);
        rig.ask(Request::Engage);
        for cycle in 0..2000 {
            let output = rig.cycle(&rig.input(&home));
            assert_eq!(output.diagnostic.code, DiagnosticCode::None, "scale {scale}, {cycle}");
        }
        let distance = (rig.simulator().state().pose.position - home.motion().pose.position).norm();
        assert!(distance < 1e-6, "scale {scale}: {distance}");
    }
}

/// Control may begin on a target however far it is; the distance is closed with the limits of autonomous motions.
#[test]
fn control_begins_on_a_target_far_away() {
    for policy in [ViolationPolicy::Stop, ViolationPolicy::Limit] {
        let config = with_policy("motion_base", policy);
        let mut rig = Rig::new(&config, &config.machine);
        let parameters = parameters(&config);
        let mut felt = TrueMotion::new(&rig, &parameters);
        let there = beside(&TaskState::at_rest(config.machine.home), Vector6::ith(5, 0.1));
        rig.ask(Request::Engage);
        let mut states = Vec::new();
        let mut first = None;
        for _ in 0..2000 {
            let mut input = rig.input(&there);
            // One message.
            let setpoint = input.setpoint.as_mut().unwrap();
            setpoint.kind = SetpointKind::Target;
            input.setpoint = Some(*first.get_or_insert(*setpoint));
            states.push(rig.cycle(&input).state);
            felt.observe(&rig);
        }
        states.dedup();
        assert_eq!(states, [State::Engaging, State::Active], "{policy:?}");
        assert!((rig.simulator().state().pose.position - there.motion().pose.position).norm() < 1e-8);
        let Largest { velocity, acceleration, .. } = felt.largest;
        let bound = TRUE_ACCELERATION * parameters.limits.autonomous_scale;
        println!("{policy:?}: {:?}", felt.largest);
        assert!(velocity < bound && acceleration < bound, "{policy:?}: {velocity} {acceleration}");
    }
}

/// A stream takes over a target that is held, if it begins there; one that begins elsewhere is not followed.
#[test]
fn a_motion_takes_over_a_held_target_only_from_its_pose() {
    let mut ride = Ride::new(&with_policy("motion_base", ViolationPolicy::Stop));
    let (home, there) = (ride.home, beside(&ride.home, Vector6::new(0.05, 0.0, 0.0, 0.0, 0.03, -0.04)));
    for cycle in 0..2000 {
        ride.cycle(SetpointKind::Target, (cycle == 0).then_some(there));
    }
    let follow = |ride: &mut Ride, task: TaskState| {
        let output = ride.cycle(SetpointKind::Motion, Some(task));
        assert_eq!((output.state, output.diagnostic.code), (State::Active, DiagnosticCode::None));
    };
    (0..500).for_each(|_| follow(&mut ride, home));
    assert!(ride.distance(&there).into_iter().all(|distance| distance < 1e-6), "a far stream is followed");
    for cycle in 0..2500 {
        let profile = rise(1e-3 * f64::from(cycle), 2.0);
        follow(&mut ride, straight_move(&there.x, &home.x, &profile));
    }
    assert!(ride.distance(&home).into_iter().all(|distance| distance < 1e-5), "{:?}", ride.distance(&home));
    let Largest { acceleration, jerk, .. } = ride.felt.largest;
    assert!(acceleration < TRUE_ACCELERATION && jerk < TRUE_JERK, "{acceleration} {jerk}");
}
