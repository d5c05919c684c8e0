//! What the simulated drives move: the simulated platform, or six legs without one.

use hexad_core::model::LEGS;
use hexad_core::plant::hardware::Hardware;

use crate::brake_test::holding_forces;

/// Moving mass of an uncoupled leg \[kg\].
const LEG_MASS_KG: f64 = 100.0;
/// Its viscous friction \[N s/m\].
const LEG_FRICTION_N_S_M: f64 = 2000.0;

/// Viscous friction of a leg whose brake slips \[N s/m\].
const SLIP_FRICTION_N_S_M: f64 = 20_000.0;

/// Forces on a leg \[N\].
#[derive(Clone, Copy, Debug, Default)]
pub struct LegForce {
    /// Of the drive.
    pub drive_n: f64,
    /// Largest of the brake; 0 with the brake open.
    pub brake_n: f64,
}

/// Mechanics behind the drives.
#[derive(Clone, Debug)]
pub enum Mechanics {
    /// The simulated platform of hexad. Its brakes close together: it is free while all six brakes are open. At rest a leg slips
    /// whose brake is open or bears too much.
    Platform(Box<Hardware>),
    /// Legs that are not coupled to the platform: each moves alone, without weight.
    Uncoupled {
        /// \[m\]
        length: [f64; LEGS],
        /// \[m/s\]
        rate: [f64; LEGS],
    },
}

impl Mechanics {
    /// Uncoupled legs at rest.
    pub fn uncoupled(length: [f64; LEGS]) -> Self {
        Self::Uncoupled { length, rate: [0.0; LEGS] }
    }

    /// Advances under constant forces.
    pub fn advance(&mut self, duration_ns: u64, forces: &[LegForce; LEGS]) {
        if duration_ns == 0 {
            return;
        }
        match self {
            Self::Platform(hardware) => {
                let all_open = forces.iter().all(|force| force.brake_n == 0.0);
                hardware.advance(duration_ns, all_open.then(|| forces.map(|force| force.drive_n)));
                if !all_open && forces.iter().any(|force| force.brake_n.is_finite()) {
                    hardware.slip(duration_ns, &slip_rates(hardware, forces));
                }
            }
            Self::Uncoupled { length, rate } => {
                let duration_s = duration_ns as f64 * 1e-9;
                for ((length, rate), force) in length.iter_mut().zip(rate).zip(forces) {
                    let acceleration = (force.drive_n - LEG_FRICTION_N_S_M * *rate) / LEG_MASS_KG;
                    *rate = if force.brake_n == 0.0 { *rate + acceleration * duration_s } else { 0.0 };
                    *length += *rate * duration_s;
                }
            }
        }
    }

    /// Lengths of the legs as their encoders measure them \[m\].
    pub fn lengths(&mut self) -> [f64; LEGS] {
        match self {
            Self::Platform(hardware) => hardware.measure().0,
            Self::Uncoupled { length, .. } => *length,
        }
    }
}

/// Rates \[m/s\] of legs whose drive and load together exceed their brake.
fn slip_rates(hardware: &Hardware, forces: &[LegForce; LEGS]) -> [f64; LEGS] {
    let simulator = hardware.simulator();
    let mut rates = holding_forces(simulator.machine(), simulator.state().pose).unwrap_or_default();
    for (rate, force) in rates.iter_mut().zip(forces) {
        let load_n = force.drive_n - *rate;
        *rate = (load_n.abs() - force.brake_n).max(0.0).copysign(load_n) / SLIP_FRICTION_N_S_M;
    }
    rates
}
