//! Velocity or step of a jog by keys.

use super::keys::Key;
use hexad_machine::config::Config;
use hexad_machine::text::numbers::MotionDigits;

/// Velocities, as shares of the velocity of autonomous motions.
const SHARES: [f64; 7] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];
const FIRST_SHARE: usize = 3;

/// Steps of a coordinate, over the last digit that is shown of it.
const STEPS: [f64; 4] = [1e1, 1e2, 1e3, 1e4];
const FIRST_STEP: usize = 2;

/// Motion by a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// While keys arrive, with this velocity of position and of angles \[m/s\], \[rad/s\].
    Continuous([f64; 2]),
    /// One step per key \[m\], \[rad\].
    Step([f64; 2]),
}

impl Pace {
    /// Velocities or step of a coordinate of X, counted from 0, in the order of X.
    pub fn along(self, axis: usize, sign: f64) -> [f64; 6] {
        let (Self::Continuous([position, angle]) | Self::Step([position, angle])) = self;
        core::array::from_fn(|k| if k != axis { 0.0 } else { sign * if k < 3 { angle } else { position } })
    }
}

/// Choice of the pace.
#[derive(Clone, Debug)]
pub struct JogPace {
    digits: MotionDigits,
    /// Largest velocity of position and of angles \[m/s\], \[rad/s\].
    largest: [f64; 2],
    is_continuous: bool,
    share: usize,
    step: usize,
}

impl JogPace {
    /// Continuous motion of a machine.
    pub fn new(config: &Config) -> Self {
        let limits = config.deployment.limits.in_force();
        let largest = [&limits.position, &limits.orientation]
            .map(|limits_of| limits.autonomous_scale * limits_of.velocity);
        let digits = MotionDigits::new(config.resolution());
        Self { digits, largest, is_continuous: true, share: FIRST_SHARE, step: FIRST_STEP }
    }

    pub fn pace(&self) -> Pace {
        if self.is_continuous {
            let share = SHARES.get(self.share).copied().unwrap_or_default();
            return Pace::Continuous(self.largest.map(|largest| share * largest));
        }
        let step = STEPS.get(self.step).copied().unwrap_or_default();
        let MotionDigits { mm, deg } = self.digits;
        let [position_mm, angle_deg] = [mm, deg].map(|digits| step * 0.1_f64.powi(digits as i32));
        Pace::Step([1e-3 * position_mm, angle_deg.to_radians()])
    }

    /// Changes the pace by a key.
    pub fn press(&mut self, key: Key) {
        match (key, self.is_continuous) {
            (Key::Faster, true) => self.share = (self.share + 1).min(SHARES.len() - 1),
            (Key::Slower, true) => self.share = self.share.saturating_sub(1),
            (Key::Faster, false) => self.step = (self.step + 1).min(STEPS.len() - 1),
            (Key::Slower, false) => self.step = self.step.saturating_sub(1),
            (Key::Mode, _) => self.is_continuous = !self.is_continuous,
            (Key::Move { .. } | Key::Stop | Key::Leave, _) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;

    #[test]
    fn the_smallest_step_is_of_the_size_of_the_machine() {
        let files = [
            (DEFAULT_CONFIG, 1e-5),
            (include_str!("../../../tests/data/telescope_m2.toml"), 1e-6),
            (include_str!("../../../tests/data/piezo.toml"), 1e-8),
        ];
        for (text, step) in files {
            let mut pace = JogPace::new(&Config::parse(text, "a test").unwrap());
            [Key::Mode, Key::Slower, Key::Slower, Key::Slower].into_iter().for_each(|key| pace.press(key));
            let [.., z] = pace.pace().along(5, 1.0);
            assert!((z - step).abs() < 1e-9 * step, "{step}: {z}");
        }
    }
}
