//! Whether the coordinates of C keep a margin from the ends of their ranges, with one coordinate in each
//! lane.

use fearless_simd::{Simd, f64x4, prelude::*};
use nalgebra::Vector3;

use crate::control::parameters::Envelope;
use crate::control::reference::proof::angle_ranges::MARGIN_CAP_RATIO;
use crate::control::reference::proof::padding::{Padded, padded};

/// Ranges of the coordinates of C \[m\]. The fourth range is zero and contains the zero of a padded vector.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct PositionEnvelope {
    lowest: Padded,
    highest: Padded,
    /// Largest margin that is required from each end.
    margin_cap_m: Padded,
}

impl PositionEnvelope {
    /// Ranges of an envelope.
    pub fn new(Envelope { lowest: [.., x0, y0, z0], highest: [.., x1, y1, z1] }: &Envelope) -> Self {
        let (low, high) = (Vector3::new(*x0, *y0, *z0), Vector3::new(*x1, *y1, *z1));
        let margin_cap_m = (high - low) * MARGIN_CAP_RATIO;
        Self { lowest: padded(&low), highest: padded(&high), margin_cap_m: padded(&margin_cap_m) }
    }

    /// Whether each coordinate of both positions keeps a margin from the ends of its range. The margin is at
    /// most [`MARGIN_CAP_RATIO`] of the width.
    #[inline(always)]
    pub fn contain<S: Simd>(
        &self,
        simd: S,
        positions_m: [&Vector3<f64>; 2],
        margin_m: &Vector3<f64>,
    ) -> bool {
        let load = |lanes: Padded| f64x4::load_array(simd, lanes);
        let [first, second] = positions_m.map(|position| load(padded(position)));
        let room = (first.min(second) - load(self.lowest)).min(load(self.highest) - first.max(second));
        room.simd_ge(load(padded(margin_m)).min(load(self.margin_cap_m))).all_true()
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    /// At each end of each coordinate either position alone decides. A narrow range keeps a quarter of its
    /// width.
    #[test]
    fn each_end_is_kept_by_both_positions() {
        let envelope =
            Envelope { lowest: [9.0, 9.0, 9.0, -1.0, 1.0, 0.0], highest: [9.0, 9.0, 9.0, 2.0, 3.0, 1e-3] };
        let ranges = PositionEnvelope::new(&envelope);
        let middle = Vector3::new(0.5, 2.0, 5e-4);
        let slacks = [0.3, 0.1, 0.1];
        let kept = [0.3, 0.1, 2.5e-4];
        let contain = |positions: [&Vector3<f64>; 2]| dispatch!(Level::new(), simd => ranges.contain(simd, positions, &slacks.into()));
        for axis in 0..3 {
            let (low, high) = (envelope.lowest[3 + axis], envelope.highest[3 + axis]);
            for (share, is_contained) in [(1.01, true), (0.99, false)] {
                for coordinate in [low + share * kept[axis], high - share * kept[axis]] {
                    let mut moved = middle;
                    moved[axis] = coordinate;
                    for positions in [[&moved, &middle], [&middle, &moved], [&moved; 2]] {
                        assert_eq!(contain(positions), is_contained, "{axis} {coordinate}");
                    }
                }
            }
        }
    }
}
