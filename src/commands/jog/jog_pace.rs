//! Velocity or step of a jog by keys.

use super::keys::Key;
use hexad_core::control::signals::limits::DerivativeLimits;
use hexad_machine::config::Config;
use hexad_machine::text::numbers::last_digits;
use hexad_machine::text::units::MotionUnits;

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

/// Choice of the pace. Translation and rotation have a velocity and a step each.
#[derive(Clone, Debug)]
pub struct JogPace {
    pub units: MotionUnits,
    is_continuous: bool,
    /// Of translation, in metres, and of rotation, in radians.
    kinds: [KindPace; 2],
}

/// Velocity and step of translation or of rotation.
#[derive(Clone, Copy, Debug)]
struct KindPace {
    /// Largest velocity per second.
    largest: f64,
    /// The last digit that is shown.
    digit: f64,
    share: usize,
    step: usize,
}

impl KindPace {
    fn press(&mut self, is_continuous: bool, is_faster: bool) {
        let (choice, count) = match is_continuous {
            true => (&mut self.share, SHARES.len()),
            false => (&mut self.step, STEPS.len()),
        };
        *choice = if is_faster { (*choice + 1).min(count - 1) } else { choice.saturating_sub(1) };
    }

    fn value(&self, is_continuous: bool) -> f64 {
        let (factor, choices, choice) = match is_continuous {
            true => (self.largest, &SHARES[..], self.share),
            false => (self.digit, &STEPS[..], self.step),
        };
        factor * choices.get(choice).copied().unwrap_or_default()
    }
}

impl JogPace {
    /// Continuous motion of a machine. Steps are round in these units.
    pub fn new(config: &Config, units: MotionUnits) -> Self {
        let limits = config.deployment.limits.in_force();
        let [angle, .., position] = last_digits(config.resolution(), units);
        let kind = |limits_of: &DerivativeLimits, power: i32, (_, factor): (&str, f64)| KindPace {
            largest: limits.autonomous_scale * limits_of.velocity,
            digit: factor * 10.0_f64.powi(power),
            share: FIRST_SHARE,
            step: FIRST_STEP,
        };
        let position = kind(&limits.position, position, units.length);
        let kinds = [position, kind(&limits.orientation, angle, units.angle)];
        Self { units, is_continuous: true, kinds }
    }

    pub fn pace(&self) -> Pace {
        let values = self.kinds.map(|kind| kind.value(self.is_continuous));
        if self.is_continuous { Pace::Continuous(values) } else { Pace::Step(values) }
    }

    /// Changes the pace by a key.
    pub fn press(&mut self, key: Key) {
        let [translation, rotation] = &mut self.kinds;
        match key {
            Key::Translation { is_faster } => translation.press(self.is_continuous, is_faster),
            Key::Rotation { is_faster } => rotation.press(self.is_continuous, is_faster),
            Key::Mode => self.is_continuous = !self.is_continuous,
            Key::Move { .. } | Key::Stop | Key::Leave => {}
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
            let mut pace = JogPace::new(&Config::parse(text, "a test").unwrap(), MotionUnits::default());
            let slower = Key::Translation { is_faster: false };
            [Key::Mode, slower, slower, slower].into_iter().for_each(|key| pace.press(key));
            let [.., z] = pace.pace().along(5, 1.0);
            assert!((z - step).abs() < 1e-9 * step, "{step}: {z}");
        }
    }

    /// Of a person who lowers the step of one, the step of the other stays.
    #[test]
    fn translation_and_rotation_are_chosen_apart() {
        let config = Config::parse(include_str!("../../../tests/data/piezo.toml"), "a test").unwrap();
        let mut pace = JogPace::new(&config, MotionUnits::read("nm,arcsec").unwrap());
        let faster = [Key::Translation { is_faster: true }, Key::Rotation { is_faster: true }];
        let slower = [Key::Translation { is_faster: false }, Key::Rotation { is_faster: false }];
        for mode in ["continuous", "steps"] {
            for (kind, keys) in [faster, slower].into_iter().flat_map(|keys| keys.into_iter().enumerate()) {
                let (Pace::Continuous(before) | Pace::Step(before)) = pace.pace();
                pace.press(keys);
                let (Pace::Continuous(after) | Pace::Step(after)) = pace.pace();
                assert_ne!(before[kind], after[kind], "{mode}: {keys:?}");
                assert_eq!(before[1 - kind], after[1 - kind], "{mode}: {keys:?}");
            }
            pace.press(Key::Mode);
        }
        pace.press(Key::Mode);
        let Pace::Step([position, angle]) = pace.pace() else { panic!("steps") };
        // Round in the units of the screen.
        let arcsec = angle.to_degrees() * 3600.0;
        assert!((position - 1e-6).abs() < 1e-15 && (arcsec - 1.0).abs() < 1e-9, "{position} {arcsec}");
    }
}
