//! Whether coordinates of C keep a distance from the ends of their ranges, a coordinate in each lane.

use fearless_simd::{Simd, f64x4, prelude::*};
use nalgebra::Vector3;

use super::angle_ranges::MAX_SLACK_RATIO;
use crate::control::parameters::Envelope;

/// Three coordinates and a zero, which is within a range of zeros.
type Lanes = [f64; 4];

/// Ranges of the coordinates of C \[m\].
#[derive(Clone, Copy, Debug)]
pub(super) struct PositionRanges {
    lowest: Lanes,
    highest: Lanes,
    /// Most slack that is kept from each end.
    slack: Lanes,
}

impl PositionRanges {
    /// Those of an envelope.
    pub fn new(Envelope { lowest: [.., x0, y0, z0], highest: [.., x1, y1, z1] }: &Envelope) -> Self {
        let (low, high) = (Vector3::new(*x0, *y0, *z0), Vector3::new(*x1, *y1, *z1));
        let slack = (high - low) * MAX_SLACK_RATIO;
        Self { lowest: padded(&low), highest: padded(&high), slack: padded(&slack) }
    }

    /// Whether each coordinate of both positions has a distance from the ends of its range, or a part of it that is narrower.
    #[inline(always)]
    pub fn contain<S: Simd>(&self, simd: S, positions: [&Vector3<f64>; 2], slack: &Vector3<f64>) -> bool {
        let load = |lanes: Lanes| f64x4::load_array(simd, lanes);
        let [first, second] = positions.map(|position| load(padded(position)));
        let room = (first.min(second) - load(self.lowest)).min(load(self.highest) - first.max(second));
        room.simd_ge(load(padded(slack)).min(load(self.slack))).all_true()
    }
}

fn padded(v: &Vector3<f64>) -> Lanes {
    [v.x, v.y, v.z, 0.0]
}
