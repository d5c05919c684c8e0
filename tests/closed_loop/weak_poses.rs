//! Targets anywhere, for drives from barely sufficient to generous: no force beyond the drives', no fault, and home again.

use std::collections::BTreeMap;

use hexad::analysis::target_motion::check_target;
use hexad::config::Config;
use hexad::control::constants::Constants;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::SetpointKind;
use hexad::control::signals::state::State;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Gravity;
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use nalgebra::Vector6;
use rayon::prelude::*;

use super::ride::{MACHINES, with_policy};
use hexad_support::certificate::Certificate;
use hexad_support::rig::{Rig, parameters};

/// Forces of the drives at home as shares of the largest force.
const HOLDING_AT_HOME: [f64; 3] = [0.6, 0.3, 0.1];
/// Targets of a run, and cycles for each.
const TARGETS: u32 = 8;
const CYCLES: u32 = 1000;

/// A machine whose drives need this share of their force at home.
fn machine(name: &str, policy: ViolationPolicy, holding: f64) -> Config {
    let mut config = with_policy(name, policy);
    let forces =
        inverse_dynamics::<Gravity>(&config.machine, &TaskState::at_rest(config.machine.home).motion());
    let largest = forces.unwrap().into_iter().map(f64::abs).fold(0.0, f64::max);
    config.machine.actuator.max_force_n = largest / holding;
    config.deployment.limits.reference.autonomous_scale = 1.0;
    config
}

/// The diagnostic that ends a run, and the largest force as a share of the drives'.
fn ride(run: u64, payload: f64) -> (DiagnosticCode, f64) {
    let policy = [ViolationPolicy::Stop, ViolationPolicy::Limit][run as usize % 2];
    let (name, holding) = (MACHINES[run as usize / 2 % 3], HOLDING_AT_HOME[run as usize / 6 % 3]);
    let config = machine(name, policy, holding);
    let mut plant = config.machine.clone();
    plant.platform.mass_kg *= 1.0 + payload;
    let mut rig = Rig::new(&config, &plant);
    let home = TaskState::at_rest(config.machine.home);
    rig.engage(&home);
    let constants = Constants::new(&config.machine, parameters(&config));
    let mut random = Random::new(run);
    let stroke = config.machine.actuator.stroke();
    let mut largest = 0.0_f64;
    for target in 0..=TARGETS {
        let mut anywhere = || {
            let size = [0.7, 0.7, 0.7, stroke, stroke, stroke];
            let offset = Vector6::from(size.map(|size| size * random.signed()));
            TaskState::at_rest((Vector6::from(config.machine.home) + offset).into())
        };
        let mut to = if target < TARGETS { anywhere() } else { home };
        // Under "stop" a target outside of the workspace is rejected.
        while policy == ViolationPolicy::Stop && check_target(&constants, &to.motion().pose).is_err() {
            to = anywhere();
        }
        // Under "limit" every other target is a setpoint far away.
        let kind = match policy {
            ViolationPolicy::Limit if target % 2 == 1 => SetpointKind::Motion,
            _ => SetpointKind::Target,
        };
        for _ in 0..CYCLES {
            let mut input = rig.input(&to);
            input.setpoint.as_mut().unwrap().kind = kind;
            let output = rig.cycle(&input);
            if output.state != State::Active {
                return (output.diagnostic.code, largest);
            }
            let forces = output.command_n.into_iter().map(f64::abs).fold(0.0, f64::max);
            largest = largest.max(forces / config.machine.actuator.max_force_n);
        }
    }
    (DiagnosticCode::None, largest)
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_weak_drives_make_the_motion_slower_and_cause_no_fault() {
    let certificate = Certificate::new("weak drives", 18, 1200);
    let runs = |payload: f64| -> Vec<_> {
        (0..certificate.total())
            .into_par_iter()
            .map(|run| {
                let outcome = ride(run, payload);
                certificate.advance(u64::from(payload == 0.0));
                (run, outcome)
            })
            .collect()
    };
    let faults: Vec<_> =
        runs(0.0).into_iter().filter(|(_, (code, _))| *code != DiagnosticCode::None).collect();
    assert!(faults.is_empty(), "{faults:?}");
    let (mut codes, mut largest) = (BTreeMap::<u32, u32>::new(), 0.0_f64);
    for (_, (code, force)) in runs(0.1) {
        *codes.entry(code as u32).or_default() += 1;
        largest = largest.max(force);
    }
    println!("with a tenth more mass: diagnostics {codes:?}, largest force {largest:.3}");
}
