//! Payloads that change under control and process forces: faults with a name, unless `[limits]` allows them.

use core::f64::consts::TAU;

use hexad::config::Config;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Exact;
use hexad::model::rigid::{Acceleration, Motion};
use hexad::model::task::TaskState;

use rayon::prelude::*;

use hexad_support::certificate::cases;
use hexad_support::deployed;
use hexad_support::rig::Rig;

const PERIOD_S: f64 = 1e-3;
/// Time at rest before anything changes: control knows the payload after a second.
const BEFORE_S: f64 = 1.5;
const AFTER_S: f64 = 3.0;

/// The end of a run.
#[derive(Debug)]
struct End {
    /// First fault, and the time from the change to it \[s\].
    fault: Option<(DiagnosticCode, f64)>,
    state: State,
    /// Largest distance of the true platform from home while there were forces \[m\].
    farthest: f64,
    /// Speed of the true platform at the end of control \[m/s\].
    final_speed: f64,
}

/// Control at home; from [`BEFORE_S`] on the platform has so many times its mass, and forces act beside those of the drives.
fn run(config: &Config, mass_ratio: f64, beside: impl Fn(f64) -> [f64; LEGS]) -> End {
    let mut rig = Rig::new(config, &config.machine);
    let home = TaskState::at_rest(config.machine.home);
    rig.engage(&home);
    let mut end = End { fault: None, state: State::Active, farthest: 0.0, final_speed: 0.0 };
    let before = (BEFORE_S / PERIOD_S) as u32;
    for cycle in 0..before + (AFTER_S / PERIOD_S) as u32 {
        let since_s = (f64::from(cycle) - f64::from(before)) * PERIOD_S;
        if cycle == before {
            let mut loaded = config.machine.clone();
            loaded.platform.mass_kg *= mass_ratio;
            rig.put(Rig::new(config, &loaded).hardware);
        }
        let input = rig.input(&home);
        let output = rig.controller.step(&input);
        end.state = output.state;
        if end.fault.is_none() && output.diagnostic.code != DiagnosticCode::None {
            end.fault = Some((output.diagnostic.code, since_s));
        }
        let state = rig.simulator().state();
        if !output.state.has_control() {
            end.final_speed = state.twist.linear.norm();
            break;
        }
        end.farthest = end.farthest.max((state.pose.position - home.motion().pose.position).norm());
        let beside = if since_s >= 0.0 { beside(since_s) } else { [0.0; LEGS] };
        rig.pass(Some(core::array::from_fn(|leg| output.command_n[leg] + beside[leg])));
    }
    end
}

fn nothing(_: f64) -> [f64; LEGS] {
    [0.0; LEGS]
}

/// Forces of the legs that accelerate the platform at home.
fn push(config: &Config, acceleration: [f64; 6]) -> [f64; LEGS] {
    let model = InverseDynamics::new(&config.machine);
    let still = TaskState::at_rest(config.machine.home).motion();
    let [pushed, usual] = [acceleration, [0.0; 6]].map(|acceleration| {
        let acceleration = Acceleration::from_vector(&acceleration.into());
        model.forces::<Exact>(&Motion { acceleration, ..still }).unwrap()
    });
    core::array::from_fn(|leg| pushed[leg] - usual[leg])
}

#[test]
fn a_payload_that_comes_or_goes_ends_in_a_stop_unless_it_is_allowed() {
    let mut config = deployed("motion_base");
    let mass = config.machine.platform.mass_kg;
    for ratio in [1.2, 0.8] {
        for allowed in [None, Some(0.05 * mass), Some(0.25 * mass), Some(f64::INFINITY)] {
            config.deployment.limits.payload_change_kg = allowed;
            let end = run(&config, ratio, nothing);
            println!("mass x {ratio}, allowed {allowed:?} kg: {end:?}");
            if allowed.is_some_and(|kg| kg > 0.2 * mass) {
                assert_eq!((end.fault, end.state), (None, State::Active), "{ratio}, {allowed:?}");
            } else {
                let (code, after_s) = end.fault.unwrap();
                assert_eq!((code, end.state), (DiagnosticCode::PayloadChanged, State::Fault));
                // The stop is under control: the platform hardly moves when the brakes close.
                assert!(after_s < 0.1 && end.final_speed < 0.01, "{end:?}");
            }
            assert!(end.farthest < 5e-4, "{end:?}");
        }
    }
}

/// A force that switches sides, as a ratio of the weight.
#[test]
fn certificate_a_process_force_is_a_fault_unless_it_is_allowed() {
    let all = [3, 4, 5].into_iter().flat_map(|axis| {
        [0.1, 0.2]
            .into_iter()
            .flat_map(move |ratio| [5.0, 10.0, 20.0, 50.0].map(|hertz| (axis, ratio, hertz)))
    });
    cases(all, 5).into_par_iter().for_each(|(axis, ratio, hertz)| {
        let mut config = deployed("motion_base");
        let weight = config.machine.gravity_m_s2.norm();
        let mut acceleration = [0.0; 6];
        acceleration[axis] = ratio * weight;
        let push = push(&config, acceleration);
        let switching = |t: f64| if (TAU * hertz * t).sin() >= 0.0 { push } else { push.map(|force| -force) };
        // From one side to the other it changes by twice itself; angles count a little, too.
        for allowed in [None, Some(2.2 * ratio * weight), Some(f64::INFINITY)] {
            let limits = &mut config.deployment.limits;
            (limits.disturbance_step_m_s2, limits.payload_change_kg) =
                (allowed, allowed.map(|_| f64::INFINITY));
            let end = run(&config, 1.0, switching);
            println!("axis {axis}, {ratio} of the weight, {hertz} Hz, allowed {allowed:?} m/s^2: {end:?}");
            assert!(end.farthest < 6e-4, "{end:?}");
            if allowed.is_some() {
                assert_eq!((end.fault, end.state), (None, State::Active));
            } else if ratio > 0.1 || hertz < 50.0 {
                let (code, after_s) = end.fault.unwrap();
                let is_named = matches!(
                    code,
                    DiagnosticCode::Oscillation | DiagnosticCode::PayloadChanged | DiagnosticCode::Impact
                );
                assert!(is_named && after_s < 0.5, "{end:?}");
            }
        }
    });
}
