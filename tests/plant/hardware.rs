//! Commands and sensors: nothing by default, the same with the same seed, and each imperfection alone.

use super::*;

/// What the sensors say, cycle after cycle of 0.7 ms, of a machine that is shaken and braked in turns. `forces` sees
/// what is true.
fn readings(machine: &Machine, hardware: &mut Hardware, cycles: u32) -> Vec<([f64; LEGS], [f64; LEGS])> {
    let cycle = |k| {
        let state = *hardware.simulator().state();
        let force = shaking(machine, &state, 0.7e-3 * f64::from(k), 0.1, 1.0);
        hardware.advance(700_000, (k % 100 < 90).then_some(force));
        hardware.measure()
    };
    (0..cycles).map(cycle).collect()
}

#[test]
fn without_imperfections_hardware_is_the_model_bit_for_bit() {
    for name in MACHINES {
        let machine = machine(name);
        let mut hardware = hardware(&machine, &Imperfections { seed: 99, ..Imperfections::default() });
        let mut simulator = Simulator::new(&machine, DECELERATION, DEFAULT_STEP_S);
        let read = readings(&machine, &mut hardware, 300);
        for (k, read) in (0..).zip(read) {
            let force = shaking(&machine, simulator.state(), 0.7e-3 * f64::from(k), 0.1, 1.0);
            simulator.advance(700_000.0 * 1e-9, (k % 100 < 90).then_some(&force));
            let legs = simulator.leg_motion();
            assert_eq!(read, (legs.length_m, legs.rate_m_s), "{name}, cycle {k}");
        }
        assert_eq!(hardware.simulator().state(), simulator.state(), "{name}");
    }
}

#[test]
fn a_configuration_without_the_keys_has_none_of_it() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let plant = deployed(name).deployment.plant;
        let none = Imperfections { seed: plant.imperfections.seed, ..Imperfections::default() };
        assert_eq!(plant.imperfections, none, "{name}");
        assert!((plant.tolerance_m / TOLERANCE_M - 1.0).abs() < 1e-15, "{name}");
    }
}

/// Everything that draws random numbers.
fn noisy(seed: u64) -> Imperfections {
    let mut wanted = Imperfections { seed, ..Imperfections::default() };
    (wanted.sensor.length_noise_m, wanted.sensor.rate_noise_m_s, wanted.build.joint_deviation_m) =
        (1e-6, 1e-4, 1e-5);
    wanted
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let machine = machine("motion_base");
    let run = |seed| readings(&machine, &mut hardware(&machine, &noisy(seed)), 200);
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn sensors_have_the_noise_and_the_steps_that_were_asked_for() {
    let machine = machine("motion_base");
    let mut wanted = Imperfections::default();
    (wanted.sensor.length_noise_m, wanted.sensor.rate_noise_m_s) = (3e-6, 2e-4);
    let mut noisy = hardware(&machine, &wanted);
    let truth = noisy.simulator().leg_motion();
    let [mut length, mut rate] = [Errors::default(); 2];
    let (mut sum, mut products) = (0.0, 0.0);
    for _ in 0..5000 {
        let (lengths, rates) = noisy.measure();
        for i in 0..LEGS {
            length.add(lengths[i] - truth.length_m[i]);
            rate.add(rates[i] - truth.rate_m_s[i]);
            sum += lengths[i] - truth.length_m[i];
        }
        products += (lengths[0] - truth.length_m[0]) * (lengths[1] - truth.length_m[1]);
    }
    // 30,000 samples: standard errors of 0.4 % of the deviation, 0.6 % of the mean, 1.4 % of the correlation.
    assert!((length.rms() / 3e-6 - 1.0).abs() < 0.02 && (rate.rms() / 2e-4 - 1.0).abs() < 0.02, "{length:?}");
    // A Gaussian's mean magnitude.
    assert!((length.mean() / 3e-6 - (2.0 / PI).sqrt()).abs() < 0.02, "{length:?}");
    assert!((sum / 30e3).abs() < 0.03 * 3e-6, "{sum}");
    assert!((products / 5e3).abs() < 0.06 * 9e-12, "legs are independent: {products}");

    wanted = Imperfections::default();
    (wanted.sensor.length_step_m, wanted.sensor.rate_step_m_s) = (1e-5, 1e-3);
    let mut coarse = hardware(&machine, &wanted);
    let (mut moved, mut largest) = (0, 0.0_f64);
    for k in 0..200 {
        let force = shaking(&machine, coarse.simulator().state(), 1e-3 * f64::from(k), 0.1, 1.0);
        coarse.advance(1_000_000, Some(force));
        let truth = coarse.simulator().leg_motion();
        let (lengths, rates) = coarse.measure();
        for i in 0..LEGS {
            for (read, true_value, step) in
                [(lengths[i], truth.length_m[i], 1e-5), (rates[i], truth.rate_m_s[i], 1e-3)]
            {
                assert!((read / step - (read / step).round()).abs() < 1e-9, "{read} is a multiple of {step}");
                assert!((read - true_value).abs() < 0.5001 * step, "{read} of {true_value}");
                largest = largest.max((read - true_value).abs() / step);
            }
            moved += usize::from(lengths[i] != truth.length_m[i]);
        }
    }
    assert!(moved > 1000 && largest > 0.45, "{moved} {largest}");
}

/// A dead time shifts everything, the brakes too: what is there at t is what would have been there before.
#[test]
fn a_dead_time_shifts_the_motion() {
    let machine = machine("motion_base");
    let mut wanted = Imperfections::default();
    wanted.drive.dead_time_ns = 2_100_000;
    let [mut prompt, mut late] = [Imperfections::default(), wanted].map(|wanted| hardware(&machine, &wanted));
    let mut past = vec![*late.simulator().state(); 3];
    for k in 0..400 {
        let force = shaking(&machine, prompt.simulator().state(), 0.7e-3 * f64::from(k), 0.1, 1.0);
        let command = (k % 100 < 90).then_some(force);
        prompt.advance(700_000, command);
        // However time is cut.
        for share in [100_000, 250_000, 350_000] {
            late.advance(share, command);
        }
        past.push(*prompt.simulator().state());
        let expected = past[past.len() - 4];
        let found = late.simulator().state();
        let apart = found.pose.displacement_to(&expected.pose).vector().norm()
            + (found.twist.vector() - expected.twist.vector()).norm();
        // What the brakes' midpoint rule makes of shorter pieces.
        assert!(apart < 1e-6, "cycle {k}: {apart}");
        if k > 0 && k < 4 {
            assert_eq!(late.simulator().brakes() == Brakes::Open, k >= 3, "cycle {k}");
        }
    }
    assert!(past[0].pose.displacement_to(&past[300].pose).vector().norm() > 1e-3, "it moved");
}

#[test]
fn a_force_is_rounded_to_its_step() {
    let machine = machine("motion_base");
    let mut wanted = Imperfections::default();
    wanted.drive.force_step_n = 50.0;
    let mut coarse = hardware(&machine, &wanted);
    let mut ideal = hardware(&machine, &Imperfections::default());
    let force = shaking(&machine, ideal.simulator().state(), 0.0, 0.1, 1.0);
    coarse.advance(1_000_000, Some(force));
    ideal.advance(1_000_000, Some(force.map(|newtons| (newtons / 50.0).round() * 50.0)));
    assert_eq!(coarse.simulator().state(), ideal.simulator().state());
    ideal = hardware(&machine, &Imperfections::default());
    ideal.advance(1_000_000, Some(force));
    assert_ne!(coarse.simulator().state(), ideal.simulator().state());
}

#[test]
fn joints_are_displaced_once_and_by_as_much_as_asked() {
    let machine = machine("tilted");
    let before = Legs::of(&machine);
    let (mut errors, mut sum) = (Errors::default(), 0.0);
    for seed in 0..200 {
        let mut wanted = Imperfections { seed, ..Imperfections::default() };
        wanted.build = BuildErrors { joint_deviation_m: 1e-4, ..BuildErrors::default() };
        let hardware = hardware(&machine, &wanted);
        let after = Legs::of(hardware.simulator().machine());
        assert_eq!(after.universal_axis, before.universal_axis);
        for (a, b) in after.base.iter().chain(&after.platform).zip(before.base.iter().chain(&before.platform))
        {
            for error in (a - b).iter() {
                errors.add(*error);
                sum += error;
            }
        }
    }
    // 7200 samples: standard errors of 0.8 % of the deviation, 1.2 % of the mean.
    assert!((errors.rms() / 1e-4 - 1.0).abs() < 0.04 && (sum / 7200.0).abs() < 0.05e-4, "{errors:?} {sum}");
}
