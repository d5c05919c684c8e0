//! Measured lengths and the poses they lead to, or do not.

use core::array;

use hexad::control::controller::Controller;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::rigid::Pose;
use hexad::model::task::TaskState;

use super::inputs::assert_without_force;
use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters};

#[test]
fn a_pose_far_from_home_is_found_in_bounded_steps() {
    let config = deployed("motion_base");
    let mut task = TaskState::at_rest(config.machine.home);
    task.x += nalgebra::Vector6::new(0.1, -0.15, 0.2, 0.1, 0.1, -0.35);
    let length = leg_lengths(&config.machine, &task.motion().pose);
    let mut rig = Rig::new(&config, &config.machine);
    let mut input = rig.input(&task);
    input.measurement.as_mut().unwrap().length_m = length;
    let mut cycles = 0;
    while rig.controller.step(&input).state == State::Off {
        cycles += 1;
        assert!(cycles < 50);
    }
    assert!(cycles > 5, "{cycles}");
    let mut fresh = Controller::new(&config.machine, parameters(&config));
    for _ in 0..cycles {
        let output = fresh.step(&input);
        assert_without_force(&output, State::Off, DiagnosticCode::FindingPose);
        assert!(output.platform.is_none());
    }
    assert_without_force(&fresh.step(&input), State::Standby, DiagnosticCode::ReadyToEngage);
}

/// Legs all in one plane determine nothing across it.
#[test]
fn singular_poses_have_no_force() {
    let mut config = deployed("motion_base");
    config.machine.home = [0.0; 6];
    let flat = Pose { rotation: nalgebra::Matrix3::identity(), position: nalgebra::Vector3::zeros() };
    let rig = Rig::new(&config, &config.machine);
    let mut input = rig.input(&TaskState::default());
    for disturbance in [0.0, 1e-6, 1e-3, -1e-3] {
        let exact = leg_lengths(&config.machine, &flat);
        input.measurement.as_mut().unwrap().length_m =
            array::from_fn(|i| exact[i] + disturbance * (i as f64 - 2.2));
        let mut controller = Controller::new(&config.machine, parameters(&config));
        for _ in 0..3 {
            let output = controller.step(&input);
            assert!(
                [DiagnosticCode::PoseNotFound, DiagnosticCode::SingularPose]
                    .contains(&output.diagnostic.code),
                "{:?}",
                output.diagnostic.code
            );
            assert_without_force(&output, State::Off, output.diagnostic.code);
            assert!(output.diagnostic.code.is_fault());
        }
    }
}

#[test]
fn lengths_no_platform_can_have_are_a_fault() {
    let config = deployed("fried2008");
    let mut rig = Rig::new(&config, &config.machine);
    let mut input = rig.input(&TaskState::at_rest(config.machine.home));
    input.measurement.as_mut().unwrap().length_m = [1.59, 0.86, 0.86, 0.86, 0.86, 0.86];
    let mut causes = Vec::new();
    for _ in 0..1000 {
        let output = rig.controller.step(&input);
        assert_without_force(&output, State::Off, output.diagnostic.code);
        causes.push(output.diagnostic.code);
    }
    assert!(causes.contains(&DiagnosticCode::PoseNotFound));
    assert!(
        causes
            .iter()
            .all(|cause| [DiagnosticCode::PoseNotFound, DiagnosticCode::FindingPose].contains(cause))
    );
    // The real lengths are believed as soon as they come, if nobody remembers the others.
    rig.now_ns += 1_000_000_000;
    let good = rig.input(&TaskState::at_rest(config.machine.home));
    let cycles = (0..300).take_while(|_| rig.controller.step(&good).state == State::Off).count();
    assert!(cycles < 200, "{cycles}");
}
