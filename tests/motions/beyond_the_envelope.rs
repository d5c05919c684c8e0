//! A setpoint that leaves the envelope, at every velocity and within the limits: the platform must stop inside.

use super::heave::{Heave, duration_s};
use super::report::{Report, Runs};
use hexad::control::parameters::Envelope;
use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters};

const MACHINES: [&str; 3] = ["reference", "motion_base", "fried2008"];
/// The envelope's highest point over home \[m\].
const HIGHEST_M: f64 = 0.150;
/// The envelope in every other direction, farther than the legs reach \[rad\], \[m\].
const FAR: f64 = 2.0;
/// The way from below to beyond the envelope, as multiples of the duration that the limits allow.
const SLOWER: [f64; 4] = [1.0, 1.3, 2.0, 4.0];
/// Time for a stop after the motion \[s\].
const AFTER_S: f64 = 0.5;

#[test]
fn a_setpoint_that_leaves_the_envelope_does_not_take_the_platform_with_it() {
    let mut report = Report::new("beyond the envelope");
    for name in MACHINES {
        let config = deployed(name);
        let mut parameters = parameters(&config);
        let heave = Heave::new(&config.machine, &parameters);
        let bound = heave.at([HIGHEST_M.min(0.75 * heave.range[1]), 0.0, 0.0]).x;
        let home = config.machine.home;
        let inside = |axis: usize, sign: f64| {
            let offset = bound[axis] - home[axis];
            if offset * sign > 1e-9 { bound[axis] } else { home[axis] + sign * FAR }
        };
        parameters.envelope = Some(Envelope {
            lowest: core::array::from_fn(|axis| inside(axis, -1.0)),
            highest: core::array::from_fn(|axis| inside(axis, 1.0)),
        });
        let way = [(-HIGHEST_M).max(heave.range[0]), heave.range[1].min(2.5 * HIGHEST_M)];
        let quickest_s = duration_s(&parameters, &config.machine, way[1] - way[0]);
        let mut runs = Runs::default();
        for slower in SLOWER {
            let duration_s = slower * quickest_s;
            let start = heave.moving(way, duration_s, 0.0);
            let mut observed = Rig::standing(&config, parameters, &start);
            observed.rates = runs.rates();
            observed.engage(&start);
            let start_s = observed.time_s();
            while observed.time_s() < start_s + duration_s + AFTER_S {
                let task = heave.moving(way, duration_s, observed.time_s() - start_s);
                observed.cycle(&observed.input(&task));
            }
            runs.add(&observed);
        }
        report.add(name, &runs);
    }
    report.assert();
}
