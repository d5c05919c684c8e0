//! Quantities of a pose shown in a map, and the round thresholds between its colours.

use hexad_machine::analysis::pose_quality::PoseQuality;

/// Largest number of colour bands.
pub const MAX_BANDS: usize = 10;
/// Least width of the worst band as a share of the range, so that two thresholds have different texts.
const MIN_BAND_SHARE: f64 = 0.05;
/// Ratio of the ends of a range beyond which its bands have equal ratios.
const MIN_RATIO_FOR_RATIOS: f64 = 8.0;

/// Quantity of a pose in a map.
#[derive(Clone, Copy)]
pub struct Quantity {
    /// Name with the unit.
    pub label: &'static str,
    pub value: fn(&PoseQuality) -> f64,
    pub better: Better,
    /// Worst value that has a colour.
    pub worst: f64,
    /// Largest worst force of a pose with a colour.
    pub max_force: f64,
}

/// Sense of a quantity: which values are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    Higher,
    Lower,
}

impl Quantity {
    /// Margin of a pose from a threshold; negative if it is worse.
    pub fn margin(&self, quality: &PoseQuality, threshold: f64) -> f64 {
        match self.better {
            Better::Higher => (self.value)(quality) - threshold,
            Better::Lower => threshold - (self.value)(quality),
        }
    }

    /// Thresholds from the worst to the best. Some pose is beyond each. Empty if no pose is good enough.
    pub fn thresholds<'a>(&self, qualities: impl Iterator<Item = &'a PoseQuality> + Clone) -> Vec<f64> {
        let good = |quality: &&PoseQuality| self.margin(quality, self.worst) >= 0.0;
        let values = qualities.clone().filter(good).map(self.value).filter(|value| value.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        match self.better {
            _ if low > high => vec![],
            Better::Higher => [self.worst].into_iter().chain(round_numbers(0.0, high)).collect(),
            Better::Lower => {
                let worst = if qualities.clone().all(|quality| good(&quality)) { high } else { self.worst };
                let mut numbers = round_numbers(low, worst);
                numbers.retain(|number| worst - number > MIN_BAND_SHARE * (worst - low));
                numbers.push(worst);
                numbers.reverse();
                numbers
            }
        }
    }
}

/// Round numbers between two numbers, in order, fewer than [`MAX_BANDS`].
fn round_numbers(low: f64, high: f64) -> Vec<f64> {
    let within = |number: &f64| low < *number && *number < high;
    let by_ratio = |leads: &[f64], stride: usize| -> Vec<f64> {
        let powers = (low.log10().floor() as i32..=high.log10().ceil() as i32).step_by(stride);
        powers
            .flat_map(|power| leads.iter().map(move |lead| lead * 10f64.powi(power)))
            .filter(within)
            .collect()
    };
    let by_step = |lead: f64| -> Vec<f64> {
        let step = lead * 10f64.powi(((high - low) / MAX_BANDS as f64).log10().floor() as i32);
        let count = ((high - low) / step).min(100.0) as i32 + 1;
        (0..=count).map(|k| ((low / step).floor() + f64::from(k)) * step).filter(within).collect()
    };
    let few = |numbers: &Vec<f64>| numbers.len() < MAX_BANDS;
    if low > 0.0 && high / low > MIN_RATIO_FOR_RATIOS {
        let leads: [&[f64]; 3] = [&[1.0, 1.5, 2.0, 3.0, 5.0, 7.0], &[1.0, 2.0, 5.0], &[1.0, 3.0]];
        let fine = leads.into_iter().map(|leads| by_ratio(leads, 1)).find(few);
        fine.or_else(|| (1..).map(|stride| by_ratio(&[1.0], stride)).find(few)).unwrap_or_default()
    } else {
        [1.0, 2.0, 5.0, 10.0, 20.0].into_iter().map(by_step).find(few).unwrap_or_default()
    }
}

/// Thresholds as text, with the fewest digits from three on with which they differ.
pub fn distinct_texts(thresholds: &[f64]) -> Vec<String> {
    let texts = |digits| thresholds.iter().map(|x| plain(*x, digits)).collect::<Vec<_>>();
    let differ = |texts: &Vec<String>| texts.windows(2).all(|pair| pair.first() != pair.last());
    (3..=17).map(texts).find(differ).unwrap_or_default()
}

/// Number with at most so many digits.
pub fn plain(x: f64, digits: usize) -> String {
    // The worst threshold of a quantity that must be above zero.
    if x.abs() < 1e-300 {
        "0".into()
    } else {
        format!("{}", format!("{x:.*e}", digits - 1).parse().unwrap_or(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::model::random::Random;

    #[test]
    fn numbers_are_round_and_few() {
        assert_eq!(round_numbers(0.0, 0.249), [0.05, 0.1, 0.15000000000000002, 0.2]);
        assert_eq!(round_numbers(6.1, 99.0), [7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 70.0]);
        assert!(round_numbers(3.0, 3.0).is_empty());
        for exponent in -12..12 {
            for (low, high) in [(0.0, 1.0), (0.01, 1.0), (0.3, 0.31), (1e-12, 1e6), (-3.0, 5.0)] {
                let scale = 10f64.powi(exponent);
                let numbers = round_numbers(low * scale, high * scale);
                assert!((2..MAX_BANDS).contains(&numbers.len()), "{numbers:?} of {high} times {scale}");
                assert!(numbers.is_sorted());
            }
        }
        assert_eq!([0.15000000000000002, 100.0, 1234.0].map(|x| plain(x, 3)), ["0.15", "100", "1230"]);
    }

    #[test]
    fn thresholds_differ_as_text_over_twelve_decades() {
        let mut random = Random::new(2);
        for k in 0..5000 {
            let low = 10f64.powf(12.0 * random.uniform() - 6.0);
            let high = low * (1.0 + 10f64.powf(8.0 * random.uniform() - 6.0));
            let worst = if k % 2 == 0 { 0.7 * low } else { 1.5 * high };
            let [lower, higher] = [(Better::Lower, worst), (Better::Higher, 0.0)].map(|(better, worst)| {
                let max_force = f64::INFINITY;
                let value = |quality: &PoseQuality| quality.condition;
                let quantity = Quantity { label: "", value, better, worst, max_force };
                let quality = |condition| PoseQuality {
                    condition,
                    stroke_margin_m: 1.0,
                    determinant: 1.0,
                    worst_force_n: 1.0,
                    payload_kg: 1.0,
                };
                distinct_texts(&quantity.thresholds([quality(low), quality(high)].iter()))
            });
            for texts in [lower, higher] {
                let all: std::collections::BTreeSet<_> = texts.iter().collect();
                assert!(all.len() == texts.len() && !texts.concat().contains('e'), "{texts:?}");
            }
        }
    }
}
