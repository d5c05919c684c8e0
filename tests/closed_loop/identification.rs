//! Identification from recordings of a closed loop on imperfect hardware.

use hexad::analysis::drive_delay::{MeasuredMotion, RecordedStretch, SentForce, drive_delay};
use hexad::analysis::identification::{Load, Run, identify, prediction_errors, samples};
use hexad::config::Config;
use hexad::control::signals::state::State;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::{scaled_by_profile, window};
use hexad::plant::imperfections::{Friction, Imperfections, SensorErrors};
use nalgebra::{Vector3, Vector6};

use super::common::hardware_loop::{HardwareLoop, configured};
use super::common::identified::{Series, drawn, loaded};

const SETTLING_S: f64 = 1.0;

fn recorded(
    config: &Config,
    platform: &Machine,
    series: &Series,
    seconds: f64,
    seed: u64,
) -> RecordedStretch {
    let most = config.machine.actuator.max_force;
    let imperfections = Imperfections {
        seed,
        sensor: SensorErrors { length_noise: 2e-6, ..SensorErrors::default() },
        friction: Friction { stiction: 0.003 * most, ..Friction::default() },
        ..Imperfections::default()
    };
    let mut control = HardwareLoop::new(config, platform, &imperfections);
    let mut stretch = RecordedStretch::default();
    let home = Vector6::from(config.machine.home);
    while control.time_s() < SETTLING_S + seconds {
        let t = control.time_s() - SETTLING_S;
        let mut state = series.at(&config.machine, t);
        state.x -= home;
        let mut state: TaskState = scaled_by_profile(&state, &window(t, seconds, 2.0));
        state.x += home;
        let input = control.input(&state);
        let output = control.cycle(&input);
        if control.time_s() > SETTLING_S {
            assert_eq!(output.state, State::Active, "{t} {:?}", output.diagnostic);
        }
        if output.state == State::Active {
            let measurement = input.measurement.unwrap();
            stretch.sent.push(SentForce { release_ns: input.release_ns, force: output.force });
            stretch.measured.push(MeasuredMotion {
                time_ns: measurement.time_ns,
                length: measurement.length,
                pose: output.platform.unwrap().pose,
                reference: output.reference.unwrap(),
            });
        }
    }
    stretch
}

#[test]
fn a_machine_is_identified_from_recordings() {
    let mut random = Random::new(7);
    let config = configured("motion_base", "[limits]\npayload_change_kg = inf\n");
    let truth = drawn(&config.machine, &mut random);
    let series = Series::new(&config.machine, 0.7, &mut random);
    let (mass, at) = (0.15 * config.machine.platform.mass, [0.3, -0.2, 0.8]);
    let began = std::time::Instant::now();
    let empty = recorded(&config, &truth, &series, 60.0, 1);
    let with = recorded(&config, &loaded(&truth, mass, Vector3::from(at)), &series, 60.0, 2);
    let other = recorded(&config, &truth, &Series::new(&config.machine, 0.7, &mut random), 10.0, 3);
    println!("simulated in {:?}", began.elapsed());
    let delay = drive_delay(&config.machine, core::slice::from_ref(&empty));
    println!("{delay:?}");
    for delay_s in [1e-4, 1e-4 + 1e-3, 0.0] {
        let run = |stretch, load| Run { samples: samples(stretch, delay_s), load };
        let runs = [run(&empty, Load::Empty), run(&with, Load::Known { mass, at })];
        let found = identify(&config.machine, &runs, false).unwrap();
        println!("delay {delay_s}: residual {:?} {:?}", found.residual, found.correlation);
        println!("before {:.1?}", prediction_errors(&config.machine, &[run(&other, Load::Empty).clone()]));
        println!("after {:.2?}", prediction_errors(&found.machine, &[run(&other, Load::Empty).clone()]));
        println!("truth {:.2?}", prediction_errors(&truth, &[run(&other, Load::Empty).clone()]));
        crate::common::identified::report(&found, &truth);
    }
}
