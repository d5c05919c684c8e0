//! A setpoint source that dies while it accelerates: what it had sent is carried on for a while.

use super::heave::{Heave, SHARE};
use super::report::{Report, Runs};
use hexad_support::edited::{config, deployed_table, set};
use hexad_support::rig::{Rig, parameters};

const MACHINES: [&str; 3] = ["reference", "motion_base", "fried2008"];
/// A limit that the present acceleration reaches soon after the last setpoint.
const VELOCITY_LIMIT_M_S: f64 = 0.2;
/// Parts of that limit at which the source dies.
const DIES_AT: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// After its death \[s\].
const AFTER_S: f64 = 1.0;

/// Offset, velocity and acceleration of a start with constant jerk up to an acceleration, and with that from then on.
fn starting([a, j]: [f64; 2], t: f64) -> [f64; 3] {
    let ramp_s = a / j;
    let ramp = t.clamp(0.0, ramp_s);
    let (s, v, now) = (j * ramp.powi(3) / 6.0, j * ramp * ramp / 2.0, j * ramp);
    let rest = (t - ramp_s).max(0.0);
    [s + v * rest + now * rest * rest / 2.0, v + now * rest, now]
}

#[test]
fn a_source_that_dies_while_accelerating_leads_to_no_motion_beyond_the_limits() {
    let mut report = Report::new("lost source");
    for name in MACHINES {
        let mut table = deployed_table(name);
        set(&mut table, "limits", "velocity_m_s", VELOCITY_LIMIT_M_S);
        set(&mut table, "control", "following_velocity_m_s", 0.3 * VELOCITY_LIMIT_M_S);
        let config = config(&table);
        let parameters = parameters(&config);
        let heave = Heave::new(&config.machine, &parameters);
        let limits = &parameters.limits.position;
        let accelerating = |t| {
            let [s, v, a] = starting([SHARE * limits.acceleration, SHARE * limits.jerk], t);
            heave.at([heave.middle() + s, v, a])
        };
        let mut runs = Runs::default();
        for share in DIES_AT {
            let mut observed = Rig::standing(&config, parameters, &accelerating(0.0));
            observed.rates = runs.rates();
            observed.engage(&accelerating(0.0));
            let (start_s, mut dead_s) = (observed.time_s(), 0.0);
            let mut input = observed.input(&accelerating(0.0));
            while dead_s < AFTER_S {
                let task = accelerating(observed.time_s() - start_s);
                let setpoint = input.setpoint;
                input = observed.input(&task);
                if task.xd.norm() > share * VELOCITY_LIMIT_M_S {
                    input.setpoint = setpoint;
                    dead_s += observed.period_s();
                }
                observed.cycle(&input);
            }
            runs.add(&observed);
        }
        report.add(name, &runs);
    }
    report.assert();
}
