//! Units of one leg: encoder counts and length, torque in thousandths of the rated and force. Knows no bus.

use std::f64::consts::TAU;

/// Encoder, gear, screw and motor of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegUnits {
    /// Of the motor.
    pub counts_per_rev: f64,
    /// Of the position that the encoder counts, single-turn and multi-turn together: it wraps at this range.
    pub position_bits: u32,
    /// Revolutions of the motor for one of the screw.
    pub gear: f64,
    /// Travel for one revolution of the screw \[m\].
    pub lead_m: f64,
    /// Of gear and screw, motor to leg.
    pub efficiency: f64,
    /// 1 if increasing counts and positive torque lengthen the leg, else -1.
    pub sign: f64,
    /// Length at count 0 \[m\].
    pub offset_m: f64,
    /// \[N m\]
    pub rated_torque_n_m: f64,
}

impl LegUnits {
    /// Travel for one count \[m\], with its sign.
    pub fn metres_per_count(&self) -> f64 {
        self.sign * self.lead_m / (self.counts_per_rev * self.gear)
    }

    /// Travel in which each length has a reading of its own \[m\].
    pub fn range_m(&self) -> f64 {
        self.metres_per_count().abs() * 2f64.powi(self.position_bits as i32)
    }

    /// Force for a thousandth of the rated torque \[N\], with its sign.
    pub fn newtons_per_permille(&self) -> f64 {
        self.sign * 1e-3 * self.rated_torque_n_m * TAU * self.gear * self.efficiency / self.lead_m
    }

    /// Length at a count \[m\].
    pub fn length_m(&self, counts: i64) -> f64 {
        self.offset_m + counts as f64 * self.metres_per_count()
    }

    /// Nearest count of a length.
    pub fn counts(&self, length_m: f64) -> i64 {
        ((length_m - self.offset_m) / self.metres_per_count()).round() as i64
    }
}

/// Counts of an encoder, continued across the ends of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter {
    counts: i64,
    bits: u32,
}

impl Counter {
    /// A counter at a count, of an encoder of 1 to 32 bits.
    pub fn new(counts: i64, bits: u32) -> Self {
        Self { counts, bits }
    }

    /// The count that agrees with a reading and is at most half the range away. Bits of the reading beyond those of the encoder
    /// have no meaning: some drives extend the sign into them, others zeros.
    pub fn continued(self, reading: i32) -> Self {
        let unused = i64::BITS - self.bits;
        let change = i64::from(reading).wrapping_sub(self.counts) << unused >> unused;
        Self { counts: self.counts + change, ..self }
    }

    /// The count.
    pub fn counts(self) -> i64 {
        self.counts
    }
}

/// Torque commands of one drive, whole thousandths. The rounding error of a command is added to the next one, so that the mean
/// torque is exact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueRounding {
    error: f64,
}

impl TorqueRounding {
    /// The command for a force; beyond `max_permille` it is limited, and nothing is carried.
    pub fn command(&mut self, force_n: f64, units: &LegUnits, max_permille: i16) -> i16 {
        let bound = f64::from(max_permille);
        let wanted = force_n / units.newtons_per_permille() + self.error;
        let command = wanted.round().clamp(-bound, bound);
        self.error = (wanted - command).clamp(-0.5, 0.5);
        command as i16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEG: LegUnits = LegUnits {
        counts_per_rev: 1_048_576.0,
        position_bits: 32,
        gear: 2.0,
        lead_m: 0.02,
        efficiency: 0.9,
        sign: -1.0,
        offset_m: 1.5,
        rated_torque_n_m: 24.0,
    };

    #[test]
    fn lengths_and_forces_follow_from_screw_and_gear() {
        // Two revolutions of the motor are one of the screw, and this encoder counts down as the leg lengthens.
        assert!((LEG.length_m(-2 * 1_048_576) - 1.52).abs() < 1e-15);
        assert_eq!(LEG.counts(1.52), -2 * 1_048_576);
        // Work of one revolution of the motor: tau 2 pi efficiency = F lead / gear.
        let work = 0.024 * TAU * 0.9;
        assert!((LEG.newtons_per_permille() * -0.01 - work).abs() < 1e-12);
    }

    #[test]
    fn a_counter_follows_every_motion_of_less_than_half_its_range() {
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 16
        };
        for _ in 0..10_000 {
            let bits = 8 + (random() % 25) as u32;
            let (range, mut counts) = (1i64 << bits, random() as i64 - (1 << 47));
            let mut counter = Counter::new(counts, bits);
            for _ in 0..20 {
                counts += (random() as i64).rem_euclid(range) - range / 2;
                let zero_extended = counts.rem_euclid(range);
                let sign_extended =
                    if zero_extended >= range / 2 { zero_extended - range } else { zero_extended };
                let other_bits = counts;
                for reading in [zero_extended, sign_extended, other_bits] {
                    assert_eq!(counter.continued(reading as i32).counts(), counts, "{bits} bits, {reading}");
                }
                counter = counter.continued(zero_extended as i32);
            }
        }
    }

    #[test]
    fn the_mean_torque_is_exact() {
        let (mut rounding, mut sum) = (TorqueRounding::default(), 0.0);
        let wanted = 123.37;
        for _ in 0..1000 {
            let command = rounding.command(wanted * LEG.newtons_per_permille(), &LEG, 3000);
            assert!((f64::from(command) - wanted).abs() < 1.0);
            sum += f64::from(command);
        }
        assert!((sum / 1000.0 - wanted).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn a_limited_torque_leaves_nothing_to_be_carried() {
        let mut rounding = TorqueRounding::default();
        for _ in 0..100 {
            assert_eq!(rounding.command(1e9, &LEG, 3000), -3000);
        }
        assert!(rounding.command(0.0, &LEG, 3000).abs() <= 1);
    }
}
