//! What the simulated drives move: the simulated platform, or six legs without one.

use hexad::model::LEGS;
use hexad::plant::hardware::Hardware;

/// Moving mass of an uncoupled leg \[kg\].
const LEG_MASS_KG: f64 = 100.0;
/// Its viscous friction \[N s/m\].
const LEG_FRICTION_N_S_M: f64 = 2000.0;

/// Force of a drive with its brake open \[N\]; `None` with the brake closed.
pub type LegForce = Option<f64>;

/// Mechanics behind the drives.
#[derive(Clone, Debug)]
pub enum Mechanics {
    /// The simulated platform of hexad. Its brakes close together: it is free while all six brakes are open.
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
                let all_open = forces.iter().all(Option::is_some);
                hardware.advance(duration_ns, all_open.then(|| forces.map(Option::unwrap_or_default)));
            }
            Self::Uncoupled { length, rate } => {
                let duration_s = duration_ns as f64 * 1e-9;
                for ((length, rate), force) in length.iter_mut().zip(rate).zip(forces) {
                    *rate = force.map_or(0.0, |force| {
                        let acceleration = (force - LEG_FRICTION_N_S_M * *rate) / LEG_MASS_KG;
                        *rate + acceleration * duration_s
                    });
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
