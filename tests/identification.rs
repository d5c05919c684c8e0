//! Identification of machines from motions whose samples are exact but for noise of the forces.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use hexad::analysis::identification::{
    Cause, Load, MotionSample, Run, identify, prediction_errors, repeated_and_changing_errors,
};
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::transmission::Transmission;
use nalgebra::{Matrix3, Rotation3, Vector3};

use hexad_support::identified::{Series, drawn, loaded, worst_error};
use hexad_support::machine;

fn run(truth: &Machine, series: &Series, seconds: f64, noise: f64, load: Load, random: &mut Random) -> Run {
    let sample = |k: u32| {
        let time_s = 0.005 * f64::from(k);
        let motion = series.at(truth, time_s).motion();
        let forces = inverse_dynamics::<Exact>(truth, &motion).unwrap();
        let command = Transmission::of_motion(truth, &motion).commands(&forces);
        (time_s, motion, command)
    };
    let samples = (0..(seconds / 0.005) as u32).map(sample).map(|(time_s, motion, command)| MotionSample {
        time_s,
        motion,
        command_n: command.map(|force| force + noise * random.near_gaussian()),
    });
    Run { samples: samples.collect(), load }
}

/// A file up to 30 % off, from samples with noise of the forces: every parameter within its own deviations, whatever the
/// excitation; and no body that cannot exist.
#[test]
fn parameters_are_found_within_their_deviations() {
    let mut random = Random::new(41);
    for (name, share) in [("motion_base", 1.0), ("fried2008", 1.0), ("tsai2000", 1.0), ("motion_base", 0.03)]
    {
        let file = machine(name);
        let (truth, series) = (drawn(&file, &mut random), Series::new(&file, share, &mut random));
        let noise = 1e-3 * file.actuator.max_force_n;
        let (mass_kg, at_m) =
            (0.15 * file.platform.mass_kg, [0.3, -0.2, 0.8].map(|x| x * file.joints.radius_m));
        let with_weight = loaded(&truth, mass_kg, Vector3::from(at_m));
        let runs = [
            run(&truth, &series, 60.0, noise, Load::Empty, &mut random),
            run(&with_weight, &series, 60.0, noise, Load::Known { mass_kg, at_m }, &mut random),
        ];
        let unused =
            [run(&truth, &Series::new(&file, 1.0, &mut random), 10.0, 0.0, Load::Empty, &mut random)];
        let found = identify(&file, &runs, false).unwrap();
        println!(
            "{name}, {share} of the amplitude: {} of {} combinations",
            found.shown,
            found.shown + found.unknown
        );
        let worst = worst_error(&found, &truth);
        println!("{worst:.1} deviations off");
        assert!(worst < 4.5, "{name} {share}");
        let moments = found.machine.platform.inertia.symmetric_eigenvalues();
        assert!(moments.min() > 0.0 && 2.0 * moments.max() < moments.sum(), "{name}: {moments:?}");
        let [before, after] = [&file, &found.machine].map(|machine| {
            prediction_errors(machine, &unused).iter().map(|[rms, _]| rms * rms).sum::<f64>().sqrt()
        });
        println!("predicts an unused motion to {after:.3} N, with the file {before:.3} N");
        assert!(after < 0.2 * before, "{name} {share}: {after} of {before}");
    }
}

/// The examination finds nothing where the model holds, and the direction of gravity where that is off by a degree; what it finds widens
/// the deviations until they contain the errors.
#[test]
fn gravity_that_is_off_is_found_and_contained() {
    let mut random = Random::new(5);
    let file = machine("motion_base");
    let (exact, series) = (drawn(&file, &mut random), Series::new(&file, 1.0, &mut random));
    let mut tilted = exact.clone();
    tilted.gravity_m_s2 = Rotation3::new(Vector3::new(0.01, 0.0145, 0.0)) * exact.gravity_m_s2;
    for (truth, is_exact) in [(&exact, true), (&tilted, false)] {
        let runs = [run(truth, &series, 30.0, 2.0, Load::Empty, &mut random)];
        let mut found = identify(&file, &runs, false).unwrap();
        let friction = |machine: &Machine, _: &_| machine.actuator.viscous_friction_n_s_m[0];
        let before = found.estimate(friction).deviation;
        // A delay that is known to 0.1 ms only matters to friction.
        let examination = found.examine(&runs, 1e-4).unwrap();
        println!("{examination:?}");
        assert_eq!(examination.holds(), is_exact);
        let named = examination.findings.first().map(|finding| finding.cause);
        assert!(is_exact || named == Some(Cause::Gravity), "{named:?}");
        let [same, different] = repeated_and_changing_errors(&found.machine, &runs)
            .unwrap()
            .iter()
            .fold([0.0; 2], |[a, b], [same, different]| [a + same, b + different]);
        // Noise of 2 N in the means of 80 ms; nothing of it repeats.
        println!("repeats {same}, differs {different}");
        assert!((same < 0.5 * different) == is_exact && (different - 6.0 * 0.5).abs() < 1.0);
        assert!(
            repeated_and_changing_errors(
                &found.machine,
                &[run(truth, &series, 9.0, 2.0, Load::Empty, &mut random)]
            )
            .is_none()
        );
        let after = found.estimate(friction);
        assert!(after.deviation > before, "{after:?} {before}");
        let off = after.value - truth.actuator.viscous_friction_n_s_m[0];
        assert!(off.abs() < 4.0 * after.deviation, "{off} {after:?}");
    }
}

/// Without a known weight the mean of the force scales stays, and masses are times it.
#[test]
fn without_a_known_weight_masses_are_relative() {
    let mut random = Random::new(7);
    let file = machine("motion_base");
    let (mut truth, series) = (drawn(&file, &mut random), Series::new(&file, 1.0, &mut random));
    truth.actuator.force_scale = [1.1; 6];
    let runs = [run(&truth, &series, 60.0, 1.0, Load::Empty, &mut random)];
    let found = identify(&file, &runs, false).unwrap();
    let mass = |machine: &Machine| machine.platform.mass_kg + 6.0 * machine.rod.mass_kg;
    assert!((mass(&found.machine) * 1.1 / mass(&truth) - 1.0).abs() < 1e-3, "{}", mass(&found.machine));
    assert!(found.machine.actuator.force_scale.iter().all(|scale| (scale - 1.0).abs() < 1e-3));
    assert!(found.base_parameters.is_none(), "the equations alone allow zero");
}

/// The file has a flat plate, the real platform is thick: the motion shows it, and the rods do not take its mass.
#[test]
fn a_flat_plate_may_be_thick() {
    let mut random = Random::new(11);
    let file = machine("fried2008");
    let mut truth = file.clone();
    truth.platform.mass_kg = 2.5;
    truth.platform.center_of_mass_m = Vector3::new(0.01, 0.02, -0.015);
    truth.platform.inertia = Matrix3::from_diagonal(&Vector3::new(0.32, 0.17, 0.2));
    let series = Series::new(&file, 1.0, &mut random);
    let (mass_kg, at_m) = (0.5, [0.0, 0.0, 0.1]);
    let with_weight = loaded(&truth, mass_kg, Vector3::from(at_m));
    let runs = [
        run(&truth, &series, 30.0, 0.1, Load::Empty, &mut random),
        run(&with_weight, &series, 30.0, 0.1, Load::Known { mass_kg, at_m }, &mut random),
    ];
    let found = identify(&file, &runs, false).unwrap();
    assert!(worst_error(&found, &truth) < 4.5);
}
