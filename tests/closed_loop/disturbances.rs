//! Compensation of disturbances: it removes what a wrong payload leaves, and does not wind up.

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{Request, State};
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Gravity;
use hexad::model::task::TaskState;

use hexad_support::edited::{deployed_table, set};
use hexad_support::rig::{Rig, parameters};
use hexad_support::{deployed, edited};

fn compensating(is_compensating: bool) -> Config {
    let mut config = deployed("motion_base");
    config.deployment.plant.step_s = 1e-3;
    config.deployment.control.compensate_disturbances = is_compensating;
    config
}

/// Mass of the platform, relative to what the controller thinks.
const HEAVY: f64 = 1.2;

/// Outputs of some seconds at home with a heavy platform, and its position error then \[m\].
fn held(config: &Config, seconds: u32) -> (Vec<Output>, f64) {
    let mut heavy = config.machine.clone();
    heavy.platform.mass_kg *= HEAVY;
    let mut rig = Rig::new(config, &heavy);
    let home = TaskState::at_rest(config.machine.home);
    rig.engage(&home);
    let outputs: Vec<_> = (0..1000 * seconds).map(|_| rig.cycle(&rig.input(&home))).collect();
    assert!(outputs.iter().all(|output| output.state == State::Active));
    (outputs, (rig.simulator().state().pose.position - home.motion().pose.position).norm())
}

#[test]
fn a_payload_of_a_fifth_leaves_nothing() {
    let [without, with] = [false, true].map(|is_compensating| held(&compensating(is_compensating), 4).1);
    println!("without {without:e} m, with {with:e} m");
    assert!(without > 1e-4);
    assert!(with < 1e-3 * without, "{with} of {without}");
}

/// What is compensated has a bound. The cycle names it, also while feedback still holds the platform, a little below its place.
#[test]
fn a_payload_beyond_what_is_compensated_is_named() {
    let mut config = compensating(true);
    // More than of platform and legs together.
    let disturbance = 9.81 * (1.0 - 1.0 / HEAVY);
    for (compensated_share, is_named, most_sag_m) in
        [(2.0, false, 1e-6), (0.75, false, 1e-6), (0.5, true, 1e-3)]
    {
        config.deployment.limits.reference.position.acceleration = 2.0 * compensated_share * disturbance;
        let (outputs, sag_m) = held(&config, 2);

        let is_at_bound = |output: &Output| output.active_limits.contains(Limit::Compensation);
        assert_eq!(outputs.iter().any(is_at_bound), is_named, "{compensated_share}");
        assert_eq!(outputs.iter().skip(1000).all(is_at_bound), is_named, "{compensated_share}");
        assert!(sag_m < most_sag_m && (sag_m > 1e-5) == is_named, "{compensated_share}: {sag_m}");
    }
}

/// The first start of the guide for commissioning, with drives limited to little more than the weight.
#[test]
fn the_first_start_bears_a_platform_that_is_a_seventh_heavier_or_lighter() {
    let guide = include_str!("../../docs/commissioning.md");
    assert!(guide.contains("step 1 plus 30 %") && guide.contains("`feedback_scale = 4`"));
    for (name, mass_ratio) in
        ["motion_base", "fried2008", "tsai2000"].iter().flat_map(|name| [(name, 0.85), (name, 1.15)])
    {
        let Config { machine, .. } = deployed(name);
        let home = TaskState::at_rest(machine.home);
        let weight = InverseDynamics::new(&machine).forces::<Gravity>(&home.motion()).unwrap();
        let mut table = deployed_table(name);
        set(
            &mut table,
            "actuator",
            "max_force_n",
            1.3 * weight.iter().fold(0.0, |most: f64, force| most.max(force.abs())),
        );
        set(&mut table, "limits", "feedback_scale", 4.0);
        let config = edited::config(&table);
        let mut other = config.machine.clone();
        other.platform.mass_kg *= mass_ratio;
        other.platform.inertia *= mass_ratio;
        let mut rig = Rig::new(&config, &other);
        rig.engage(&home);
        for cycle in 0..2000 {
            let output = rig.cycle(&rig.input(&home));
            assert_eq!(output.state, State::Active, "{name} {mass_ratio} {cycle}: {:?}", output.diagnostic);
        }
    }
}

/// How far the platform shoots over when a load, a little too heavy for the drives, falls off.
fn overshoot(config: &Config) -> f64 {
    let mut rig = Rig::new(config, &config.machine);
    let home = TaskState::at_rest(config.machine.home);
    rig.engage(&home);
    let mut heavy = config.machine.clone();
    heavy.platform.mass_kg *= 1.3;
    let still = home.motion();
    let weight = [&heavy, &config.machine]
        .map(|machine| InverseDynamics::new(machine).forces::<Gravity>(&still).unwrap());
    let mut limited = 0;
    let mut highest: f64 = 0.0;
    for cycle in 0..2000 {
        let input = rig.input(&home);
        let output = rig.controller.step(&input);
        assert_eq!(output.state, State::Active, "{cycle}: {output:?}");
        limited += u32::from(output.active_limits.contains(Limit::Force));
        let loaded = cycle < 300;
        rig.pass(Some(core::array::from_fn(|leg| {
            output.command_n[leg] - if loaded { weight[0][leg] - weight[1][leg] } else { 0.0 }
        })));
        if !loaded {
            highest = highest.max(rig.simulator().state().pose.position.z - config.machine.home[5]);
        }
    }
    assert!(limited > 150, "{limited} cycles at the limit");
    highest
}

#[test]
fn it_does_not_wind_up_while_forces_are_limited() {
    let weak = |is_compensating| {
        let mut config = compensating(is_compensating);
        // Enough for the platform, not for the load.
        config.machine.actuator.max_force_n = 4300.0;
        config.deployment.control.following_position_m = 10.0;
        config.deployment.control.following_orientation_rad = 10.0;
        // Feedback has no bound of its own here: the limit of the forces is what holds the platform back.
        let limits = &mut config.deployment.limits;
        limits.feedback_scale = 100.0;
        (limits.payload_change_kg, limits.disturbance_step_m_s2) = (Some(f64::INFINITY), Some(f64::INFINITY));
        config
    };
    let config = weak(true);
    let (without, with) = (overshoot(&weak(false)), overshoot(&config));
    // What it would lift the platform by if it had all that it may have: half of the limit of acceleration.
    let parameters = parameters(&config);
    let wound_up = 0.5 * parameters.limits.position.acceleration / parameters.law.position.kp_per_s2;
    println!("overshoot without {without:e} m, with {with:e} m, wound up {wound_up:e} m");
    assert!(without < 1e-5 && with < 0.7 * wound_up, "{with} after {without}");
}

/// Whoever engages again begins without what was learnt before: the payload may be another.
#[test]
fn it_begins_anew_with_each_engagement() {
    let config = compensating(true);
    let mut heavy = config.machine.clone();
    heavy.platform.mass_kg *= 1.2;
    let mut rig = Rig::new(&config, &heavy);
    let home = TaskState::at_rest(config.machine.home);
    let first = |rig: &mut Rig| {
        rig.ask(Request::Engage);
        let setpoint = TaskState::at_rest(hexad::model::task::task_coordinates(
            &rig.simulator().state().pose,
            &config.machine.home,
        ));
        rig.controller.clone().step(&rig.input(&setpoint)).command_n
    };
    rig.cycle(&rig.input(&home));
    let fresh = first(&mut rig);
    rig.engage(&home);
    for _ in 0..2000 {
        rig.cycle(&rig.input(&home));
    }
    rig.ask(Request::Off);
    for _ in 0..50 {
        rig.cycle(&rig.input(&home));
    }
    let again = first(&mut rig);
    for (fresh, again) in fresh.iter().zip(again) {
        assert!((fresh - again).abs() < 1.0, "{fresh} {again}");
    }
}
