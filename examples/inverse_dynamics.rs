//! Actuator forces of one motion, by every fidelity: `cargo run --example inverse_dynamics [MACHINE.toml]`.

use std::env;
use std::error::Error;
use std::path::PathBuf;

use hexad::config::Config;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::task::TaskState;

fn main() -> Result<(), Box<dyn Error>> {
    // A motion base of one tonne, z up.
    let path = env::args_os().nth(1).map_or("config/motion_base.toml".into(), PathBuf::from);
    let machine = Config::load(&path)?.machine;
    let model = InverseDynamics::new(&machine);

    // At home, moving up at 0.1 m/s, turning about z at 0.2 rad/s, accelerating along x at 1 m/s^2.
    let motion = TaskState {
        xd: [0.0, 0.0, 0.2, 0.0, 0.0, 0.1].into(),
        xdd: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0].into(),
        ..TaskState::at_rest(machine.home)
    };
    for fidelity in Fidelity::ALL {
        let forces = model.forces_of(fidelity, &motion.motion()).ok_or("home is a singular pose")?;
        println!("{:>14}: {forces:8.2?} N", fidelity.name());
    }
    Ok(())
}
