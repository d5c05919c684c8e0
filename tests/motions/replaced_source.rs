//! A setpoint source that is replaced by another while the platform moves: the new one continues within the tolerance, but
//! with another velocity and acceleration.

use super::heave::{FADE_S, Heave, amplitude};
use super::report::{Report, Runs};
use hexad::control::signals::inputs::Setpoint;
use hexad_support::certificate::cases;
use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters};

const MACHINES: [&str; 3] = ["reference", "motion_base", "fried2008"];
/// Angular frequencies of the vertical sines \[rad/s\], of the source before and the one after.
const SINES_RAD_S: [f64; 3] = [4.0, 9.0, 20.0];
/// Phases of the two sines at the replacement, in turns.
const PHASES: [f64; 8] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
/// Without any setpoint, from the source before to the one after \[cycles\].
const GAPS: [u32; 2] = [2, 30];
/// Part of the engage tolerance by which the new source begins elsewhere.
const STEP_RATIO: f64 = 0.7;
const AFTER_S: f64 = 0.6;

#[test]
#[ignore = "second tier: takes long"]
fn certificate_a_source_replaced_in_motion_leads_to_no_motion_beyond_the_limits() {
    let mut report = Report::new("replaced source");
    for name in MACHINES {
        let config = deployed(name);
        let parameters = parameters(&config);
        let heave = Heave::new(&config.machine, &parameters);
        let mut runs = Runs::default();
        for omega in SINES_RAD_S {
            let a = amplitude(&parameters, &config.machine, &heave, omega);
            let turn_s = core::f64::consts::TAU / omega;
            let turns = (FADE_S / turn_s).ceil();
            let all = PHASES.iter().flat_map(|phase| heave.middles(a).map(|m| (phase, m)));
            for (phase, middle) in cases(all, 4) {
                let sine = |t: f64| heave.sine(middle, a, omega, t);
                let last_s = (turns + phase) * turn_s;
                let mut followed = Rig::standing(&config, parameters, &sine(0.0));
                followed.engage(&sine(0.0));
                let start_s = followed.time_s();
                let mut last = Setpoint::default();
                while followed.time_s() - start_s < last_s {
                    last = Setpoint::motion(followed.now_ns, sine(followed.time_s() - start_s));
                    followed.cycle(&followed.input_with(Some(last)));
                }
                for (gap, next) in GAPS.iter().flat_map(|gap| PHASES.map(|next| (gap, next))) {
                    let mut observed = followed.clone();
                    observed.rates = runs.rates();
                    for _ in 0..*gap {
                        observed.cycle(&observed.input_with(Some(last)));
                    }
                    // Where the source before would be, but at another phase.
                    let gap_s = (observed.now_ns - last.time_ns) as f64 * 1e-9;
                    let carried = last.task.after(gap_s).x;
                    let begun_s = observed.time_s();
                    let step = heave.at([STEP_RATIO * parameters.engage_position_m, 0.0, 0.0]).x
                        - heave.at([0.0; 3]).x;
                    let shift = carried + step - sine((turns + next) * turn_s).x;
                    while observed.time_s() < begun_s + AFTER_S {
                        let mut task = sine((turns + next) * turn_s + observed.time_s() - begun_s);
                        task.x += shift;
                        let output = observed.cycle(&observed.input(&task));
                        if !output.state.has_control() {
                            break;
                        }
                    }
                    runs.add(&observed);
                }
            }
        }
        report.add(name, &runs);
    }
    report.assert();
}
