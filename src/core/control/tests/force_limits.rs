//! Tests of the force limits: no force and no change exceeds its bound, and what must be lost is lost evenly.

use crate::control::law::force_limits::{ForceLimiter, LimitedForces};
use crate::control::tests::*;
use crate::model::transmission::Transmission;

/// How much of `whole` is left in `part`, and what of it is not in its direction, as a share; both from `from`.
fn share(part: &[f64; LEGS], whole: &[f64; LEGS], from: &[f64; LEGS]) -> (f64, f64) {
    let (part, whole) =
        (Vector6::from(*part) - Vector6::from(*from), Vector6::from(*whole) - Vector6::from(*from));
    let share = part.dot(&whole) / whole.norm_squared();
    (share, (part - whole * share).norm() / whole.norm())
}

fn largest(forces: &[f64; LEGS]) -> f64 {
    forces.iter().map(|force| force.abs()).fold(0.0, f64::max)
}

#[test]
fn beyond_a_limit_all_legs_lose_the_same_share_of_what_is_not_weight_or_of_the_change() {
    let mut samples = RandomVectors::new(31);
    let machine = machine(&mut samples);
    let constants = Constants::new(&machine, parameters(&machine));
    let motion = at_rest(constants.home.pose());
    let weight = constants.dynamics.forces::<Gravity>(&motion).unwrap();
    let transmission = Transmission::of_motion(&machine, &motion);
    let limit = machine.actuator.max_force_n;
    let (mut cut, mut slowed) = (0, 0);
    for k in 0..2000 {
        let size = limit * 3.0 * samples.uniform();
        let wanted = weight.map(|force| force + size * (2.0 * samples.uniform() - 1.0));
        let (mut limiter, mut limited) = (ForceLimiter::default(), LimitedForces::default());
        // Without control before, the rate of the forces is free.
        let cycle = Cycle { constants: &constants, release_ns: 0, state: State::Standby };
        limiter.limit(&cycle, &wanted, (&motion, &transmission), &mut limited).unwrap();
        let is_cut = limited.active_limits.contains(Limit::Force);
        assert_eq!(is_cut, largest(&wanted) > limit, "{k}");
        if is_cut {
            cut += 1;
            let (share, deviation) = share(&limited.command_n, &wanted, &weight);
            assert!((0.0..1.0).contains(&share) && deviation < 1e-9, "{k}: {share} {deviation}");
            assert!((largest(&limited.command_n) - limit).abs() < 1e-9 * limit, "{k}: more is lost");
        } else {
            assert_eq!(limited.command_n, wanted);
        }
        let before = limited.command_n;
        let next =
            before.map(|force| (force + 0.3 * limit * (2.0 * samples.uniform() - 1.0)).clamp(-limit, limit));
        let cycle = Cycle { state: State::Active, ..cycle };
        limiter.limit(&cycle, &next, (&motion, &transmission), &mut limited).unwrap();
        let most = constants.parameters.force_rate_n_s * 1e-3;
        let step = core::array::from_fn(|leg| limited.command_n[leg] - before[leg]);
        assert!(largest(&step) <= most * (1.0 + 1e-9), "{k}");
        if limited.active_limits.contains(Limit::ForceRate) {
            slowed += 1;
            let (share, deviation) = share(&limited.command_n, &next, &before);
            assert!((0.0..1.0).contains(&share) && deviation < 1e-9, "{k}: {share} {deviation}");
            assert!(largest(&step) > most * (1.0 - 1e-9), "{k}: no slower than it must be");
        } else {
            assert_eq!(limited.command_n, next);
        }
    }
    assert!((500..1900).contains(&cut) && slowed > 200, "{cut} {slowed}");
}
