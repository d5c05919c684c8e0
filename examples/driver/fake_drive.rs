//! Six drives that are not there, for examples that run without hardware.
//!
//! They carry the platform of `config/fried2008.toml`, linearized at its home pose: the forces there hold it, any others
//! accelerate the legs by the matrix in `mobility.inc`. That is right to a hundredth within some millimetres of home and for
//! slow motions; the legs have no ends, no friction, no noise. `hexad plant` simulates the whole machine.

/// Length of a leg and its force at home, by `hexad check`.
const HOME_LENGTH_M: f64 = 1.203_314_866_383_987_8;
const HOLDING_FORCE_N: f64 = 15.987_146_479_544_544;

/// From the command to an open brake \[s\]. A brake closes at once.
const BRAKE_OPENING_S: f64 = 0.05;

/// The bits of all six legs.
pub const ALL_LEGS: u32 = 0x3f;

/// Drives, brakes and what they move.
pub struct FakeDrive {
    /// L \[m\].
    pub length_m: [f64; 6],
    /// Forces that act \[N\].
    pub force_n: [f64; 6],
    /// Whether the drives are enabled.
    pub is_enabled: bool,
    enabled_for_s: f64,
    rate_m_s: [f64; 6],
    /// Accelerations of the legs by forces beyond those at home \[m/(s^2 N)\], by `hexad inverse-dynamics`.
    mobility: Vec<f64>,
}

impl Default for FakeDrive {
    fn default() -> Self {
        let numbers = include_str!("mobility.inc").split(',').filter_map(|number| number.trim().parse().ok());
        Self {
            length_m: [HOME_LENGTH_M; 6],
            force_n: [0.0; 6],
            is_enabled: false,
            enabled_for_s: 0.0,
            rate_m_s: [0.0; 6],
            mobility: numbers.collect(),
        }
    }
}

impl FakeDrive {
    /// Enables the drives and opens the brakes, if they are not, and applies the forces.
    pub fn apply(&mut self, force_n: [f64; 6]) {
        (self.is_enabled, self.force_n) = (true, force_n);
    }

    /// Closes the brakes and disables the drives.
    pub fn brake(&mut self) {
        (self.is_enabled, self.enabled_for_s) = (false, 0.0);
        (self.rate_m_s, self.force_n) = ([0.0; 6], [0.0; 6]);
    }

    /// Whether the brakes have opened.
    pub fn brake_is_open(&self) -> bool {
        self.enabled_for_s >= BRAKE_OPENING_S
    }

    /// Lets time pass.
    pub fn advance(&mut self, duration_s: f64) {
        if !self.is_enabled {
            return;
        }
        self.enabled_for_s += duration_s;
        if !self.brake_is_open() {
            return;
        }
        let rows = self.mobility.chunks_exact(6);
        for ((row, rate), length) in rows.zip(&mut self.rate_m_s).zip(&mut self.length_m) {
            let acceleration: f64 =
                row.iter().zip(self.force_n).map(|(share, force)| share * (force - HOLDING_FORCE_N)).sum();
            *rate += acceleration * duration_s;
            *length += *rate * duration_s;
        }
    }
}
