//! The controller is a pure function of its inputs.

use hexad::control::controller::{Controller, Output};
use hexad::control::signals::inputs::Input;
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters};

/// All bits of an output: `Debug` of a float reads back the same, signed zeros included.
fn bits(output: &Output) -> String {
    format!("{output:?}")
}

#[test]
fn recorded_inputs_give_the_same_outputs_bit_for_bit() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let config = deployed(name);
        let mut rig = Rig::new(&config, &config.machine);
        let scene = fit(&config.machine, BuiltInMotion::Sines, 4.0);
        let mut record: Vec<(Input, Output)> = Vec::new();
        rig.play(&scene, |input, output| record.push((*input, *output)));
        assert!(record.len() > 5000);

        let mut fresh = Controller::new(&config.machine, parameters(&config));
        let mut twin = fresh.clone();
        for (input, output) in &record {
            let again = fresh.step(input);
            assert_eq!(bits(&again), bits(output));
            assert_eq!(again.command_n.map(f64::to_bits), output.command_n.map(f64::to_bits));
            assert_eq!(bits(&twin.step(input)), bits(output), "a clone is as good");
        }
    }
}

/// A copy taken in the middle goes on as the original does.
#[test]
fn a_controller_is_its_state() {
    let config = deployed("fried2008");
    let (mut rig, task) = hexad_support::rig::in_motion(&config);
    let mut copy = rig.controller.clone();
    for _ in 0..100 {
        let input = rig.input(&task.after(0.0));
        assert_eq!(bits(&copy.step(&input)), bits(&rig.cycle(&input)));
    }
}

/// Nothing depends on when the machine was switched on.
#[test]
fn the_clock_may_start_anywhere() {
    let config = deployed("motion_base");
    let scene = fit(&config.machine, BuiltInMotion::Circle, 2.0);
    let mut outputs = [0, u64::MAX / 2].map(|start_ns| {
        let mut rig = Rig::new(&config, &config.machine);
        rig.now_ns = start_ns;
        let mut outputs = Vec::new();
        rig.play(&scene, |_, output| outputs.push(bits(output)));
        outputs
    });
    let [early, late] = &mut outputs;
    assert_eq!(early, late);
}
