//! Setpoints that arrive late, each stamped with its true instant and within the limits there.

use super::heave::{Heave, amplitude};
use super::report::{Report, Runs};
use hexad::config::Config;
use hexad::control::signals::inputs::Setpoint;
use hexad::model::task::TaskState;
use hexad_support::deployed;
use hexad_support::fast::Fast;
use hexad_support::rig::parameters;

const MACHINES: [&str; 3] = ["reference", "motion_base", "fried2008"];
const AGES_NS: [u64; 3] = [20_000_000, 30_000_000, 45_000_000];
/// Angular frequencies of the vertical sines \[rad/s\].
const SINES_RAD_S: [f64; 4] = [5.0, 10.0, 25.0, 60.0];
const DURATION_S: f64 = 5.0;

fn follow_late(config: &Config, motion: &dyn Fn(f64) -> TaskState, age_ns: u64, runs: &mut Runs) {
    runs.play((config, parameters(config)), motion, DURATION_S, |rig, t| {
        let task = motion(t - age_ns as f64 * 1e-9);
        rig.input_with(Some(Setpoint::motion(rig.now_ns - age_ns, task)))
    });
}

#[test]
fn old_setpoints_within_the_limits_lead_to_no_motion_beyond_them() {
    let mut report = Report::new("old setpoints");
    for name in MACHINES {
        let config = deployed(name);
        let parameters = parameters(&config);
        let (heave, fast) = (Heave::new(&config.machine, &parameters), Fast::new(&config));
        let mut runs = Runs::default();
        for age_ns in AGES_NS {
            for omega in SINES_RAD_S {
                let amplitude = amplitude(&parameters, &config.machine, &heave, omega);
                let sine = |t| heave.sine(heave.middle(), amplitude, omega, t);
                follow_late(&config, &sine, age_ns, &mut runs);
            }
            follow_late(&config, &|t| fast.at(t), age_ns, &mut runs);
        }
        report.add(name, &runs);
    }
    report.assert();
}
