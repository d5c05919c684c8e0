//! The controller and a simulated platform without a daemon: engages, raises the platform by a centimetre, prints what happens.
//!
//!     cargo run --example controller

use std::error::Error;
use std::path::Path;

use hexad::config::Config;
use hexad::control::controller::Controller;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request};
use hexad::daemon;
use hexad::model::fidelity::Fidelity;
use hexad::motion::minimum_jerk::{rise, straight_move};
use hexad::plant::simulator::Simulator;
use nalgebra::Vector6;

fn main() -> Result<(), Box<dyn Error>> {
    let Config { machine, deployment, .. } = Config::load(Path::new("config/fried2008.toml"))?;
    let parameters = daemon::parameters(&machine, &deployment, Fidelity::Exact);
    let [period_s, delay_s] = [parameters.period_ns, parameters.force_delay_ns].map(|ns| ns as f64 * 1e-9);
    let mut controller = Controller::new(&machine, parameters);
    let mut platform = Simulator::new(&machine, 10.0, 1e-3);
    let home = Vector6::from(machine.home);
    let top = home + Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.01);
    let (mut force, mut state) = (None, controller.state());
    for now_ns in (1..3000).map(|cycle| cycle * parameters.period_ns) {
        let t = now_ns as f64 * 1e-9;
        let legs = platform.leg_motion();
        let (length_m, rate_m_s) = (legs.length_m, Some(legs.rate_m_s));
        let output = controller.step(&Input {
            release_ns: now_ns,
            measurement: Some(Measurement { time_ns: now_ns, length_m, rate_m_s, ..Measurement::default() }),
            setpoint: Some(Setpoint::motion(now_ns, straight_move(&home, &top, &rise(t - 1.0, 1.0)))),
            request: Some(OperatorRequest {
                request: Request::Engage,
                message: MessageId { epoch: 1, sequence: 1 },
            }),
            ..Input::default()
        });
        if output.state != state || now_ns % 500_000_000 == 0 {
            let height_mm = 1e3 * (platform.state().pose.position.z - home.b);
            println!(
                "{t:.3} s: {}, {}; {height_mm:.3} mm",
                output.state.name(),
                output.diagnostic.code.name()
            );
            state = output.state;
        }
        platform.advance(delay_s, force.as_ref());
        force = output.state.has_control().then_some(output.command_n);
        platform.advance(period_s - delay_s, force.as_ref());
    }
    Ok(())
}
