//! The choice holds where the chooser did not look.

use hexad::analysis::fidelity_choice::FidelityComparison;
use hexad::analysis::fidelity_error::{ErrorStatistics, FidelitySample};

use super::scenes::{Scene, scenes};
use super::*;

/// Motions per set.
const DENSE: u32 = 50_000;

fn tally(scene: &Scene, mut shares: impl FnMut() -> EnvelopePoint) -> ErrorStatistics {
    let mut tally = ErrorStatistics::default();
    for _ in 0..DENSE {
        tally.add(&FidelitySample::take(&scene.model, &scene.envelope.at(&shares())));
    }
    tally
}

/// Anywhere in the envelope, and at any of its 262,144 corners.
fn dense(scene: &Scene) -> [ErrorStatistics; 2] {
    let mut random = Random::new(2008);
    let inside = tally(scene, || EnvelopePoint::from_fn(|_, _| random.uniform()));
    let corners = tally(scene, || {
        let bits = random.bits();
        EnvelopePoint::from_fn(|k, _| ((bits >> k) & 1) as f64)
    });
    [inside, corners]
}

#[test]
fn no_choice_exceeds_its_tolerance_by_more_than_a_tenth() {
    let mut choices = vec![];
    for scene in scenes() {
        let comparison = FidelityComparison::of_envelope(&scene.model, &scene.envelope);
        let [inside, corners] = dense(&scene);
        assert!(inside.evaluated > u64::from(DENSE) / 10, "{}: {inside:?}", scene.name);
        // 1e-9 to 1, ten to a decade.
        for step in 0..=90 {
            let tolerance = 10_f64.powf(-0.1 * f64::from(step));
            let choice = comparison.choice(tolerance);
            let number = Fidelity::ALL.iter().position(|fidelity| *fidelity == choice).unwrap();
            // In each set against its own peak: whoever looks at one alone must find it so.
            for (what, seen) in [("inside", &inside), ("corners", &corners)] {
                let share = seen.errors[number].max_n / seen.peak_n;
                let name = &scene.name;
                let is_within = seen.evaluated == 0 || share <= 1.1 * tolerance;
                assert!(is_within, "{name}, {what}: {choice:?}, {share:.3e} for {tolerance:.3e}");
            }
            choices.push(choice);
        }
    }
    choices.sort_by_key(|fidelity| *fidelity as u8);
    choices.dedup();
    assert_eq!(choices, &Fidelity::ALL[1..], "every fidelity with inertia is a choice for somebody");
}

/// Where every corner can be reached the errors are largest at one of them, or nearly.
#[test]
fn the_worst_that_is_reported_exists() {
    for scene in scenes() {
        let comparison = FidelityComparison::of_envelope(&scene.model, &scene.envelope);
        if ["wide", "moog", "camera"].iter().any(|kind| scene.name.ends_with(kind)) {
            continue;
        }
        assert_eq!(comparison.all.outside, 0, "{}", scene.name);
        let [inside, corners] = dense(&scene);
        for ((error, inside), corners) in comparison.errors.iter().zip(&inside.errors).zip(&corners.errors) {
            let (seen, name) = (inside.max_n.max(corners.max_n), &scene.name);
            assert!(
                seen >= 0.95 * error.max_n,
                "{name}, {:?}: {} N, seen {seen} N",
                error.fidelity,
                error.max_n
            );
            assert!(
                seen <= 1.05 * error.max_n,
                "{name}, {:?}: {} N, seen {seen} N",
                error.fidelity,
                error.max_n
            );
        }
    }
}

#[test]
fn what_is_out_of_reach_is_counted_and_passed_over() {
    let scenes = scenes();
    let moog = scenes.iter().find(|scene| scene.name == "motion_base moog").unwrap();
    let comparison = FidelityComparison::of_envelope(&moog.model, &moog.envelope);
    assert!(comparison.all.outside > 1000 && comparison.all.evaluated > 32_768, "{:?}", comparison.all);
    let own = FidelityComparison::of_envelope(&scenes[0].model, &scenes[0].envelope);
    assert_eq!((own.all.outside, own.all.singular), (0, 0));
    assert_eq!(own.all.evaluated, 32_768 + u64::from(CORNER_COUNT));
}

#[test]
fn every_machine_has_an_envelope_of_its_own() {
    for name in MACHINES {
        let mut machine = machine(name);
        let envelope_of =
            |machine: &Machine| reachable_envelope::reachable_envelope(&InverseDynamics::new(machine));
        let full = envelope_of(&machine);
        assert!(full.bounds().pose_max.iter().all(|x| *x > 0.0), "{name}: {full:?}");
        assert!(full.bounds().acceleration.iter().all(|x| *x > 0.0), "{name}: {full:?}");
        for k in 0..CORNER_COUNT {
            let sample = FidelitySample::take(&InverseDynamics::new(&machine), &full.at(&full.corner(k)));
            assert!(
                sample.is_ok_and(|s| s.peak_n < 0.8 * machine.actuator.max_force_n),
                "{name}, corner {k}"
            );
            let rates = leg_motion(&machine, &full.at(&full.corner(k)).motion()).rate_m_s;
            // Only the telescope's legs are so slow that this decides.
            let most = 0.8 * machine.actuator.max_rate_m_s;
            assert!(rates.iter().all(|rate| rate.abs() <= most), "{name}: {rates:?}");
        }
        // Too weak to hold itself, or without room: it stays at home, and still there is a choice.
        machine.actuator.max_force_n = 1e-3;
        assert_eq!(envelope_of(&machine).bounds().velocity, [0.0; 6]);
        let length = leg_lengths(&machine, &full.at(&full.rest()).motion().pose);
        machine.actuator.max_length_m = length.iter().copied().fold(0.0, f64::max);
        let none = envelope_of(&machine);
        assert_eq!(none.bounds().pose_max, [0.0; 6], "{name}");
        let comparison = FidelityComparison::of_envelope(&InverseDynamics::new(&machine), &none);
        assert!(comparison.all.evaluated > 0, "{name}");
        assert!(comparison.choice(0.0) as u8 >= Fidelity::NoVelocity as u8, "{name}");
        assert_eq!(none, MotionEnvelope::new(&machine.home, *none.bounds()));
    }
}
