//! Instructions of usual cycles: the fast scene of a machine at 1 kHz, with the default limits.

use hexad::control::parameters::ViolationPolicy;

use super::count::instructions;
use hexad_support::fast::Fast;
use hexad_support::rig::{self, Rig};
use hexad_support::search::machines::{RATES_HZ, Variant, variant};

const RATE_HZ: f64 = 1000.0;

/// The median of so many of them, spread over the scene.
pub fn median(machine: usize, policy: ViolationPolicy, counted: usize) -> u64 {
    let rate = RATES_HZ.iter().position(|rate_hz| *rate_hz == RATE_HZ).unwrap();
    let config = variant(Variant { machine, rate, limits: 0, autonomous: 0 });
    let mut parameters = rig::parameters(&config);
    parameters.on_violation = policy;
    let scene = Fast::new(&config);
    let mut observed = Rig::metered(&config, &config.machine, parameters);
    observed.engage(&scene.at(0.0));
    let begun_s = observed.time_s();
    let cycles = (scene.duration() / observed.period_s()) as usize;
    let mut counts = vec![];
    for cycle in 0..cycles {
        let input = observed.input(&scene.at(observed.time_s() - begun_s));
        if cycle % (cycles / counted).max(1) == 0 {
            counts.push(instructions(&observed.controller, &input));
        }
        observed.cycle(&input);
    }
    counts.sort_unstable();
    counts[counts.len() / 2]
}
