//! Triples: assignment of the legs to lanes, and values per lane in memory.
//!
//! Eight lanes hold two triples of legs. Each triple has a lane of padding, which repeats the first leg of
//! the triple so that it never divides by zero. [`super::leg`] puts the platform's mass into the first lane
//! of padding.
//!
//! ```text
//! lane   0    1    2    3       4    5    6    7
//! leg    a    b    c   (a)      d    e    f   (d)         chosen per machine, see Triples::best
//! ```

use fearless_simd::{Simd, SimdBase, f64x8};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::LEGS;

/// One value per leg in memory, in lane order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[repr(align(64))]
pub struct LegLanes(pub [f64; 8]);

impl LegLanes {
    /// Copy with the first lane of padding set to `value`.
    pub(super) fn with_padding(&self, value: f64) -> Self {
        let [a, b, c, _, d, e, f, g] = self.0;
        Self([a, b, c, value, d, e, f, g])
    }

    /// Loads the lanes.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> f64x8<S> {
        f64x8::load_array(simd, self.0)
    }
}

/// Stores the lanes.
impl<S: Simd> From<f64x8<S>> for LegLanes {
    #[inline(always)]
    fn from(lanes: f64x8<S>) -> Self {
        Self(lanes.to_array())
    }
}

/// Assignment of the six legs to lanes: the first triple in lanes 0..2, the second in lanes 4..6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triples {
    /// Lane of each leg.
    lanes: [usize; LEGS],
}

impl Triples {
    /// Legs that are already in the order of their lanes.
    pub(super) const LANE_ORDER: Self = Self { lanes: [0, 1, 2, 4, 5, 6] };

    /// The ten ways to split six legs in two triples, by the partners of the first leg.
    const ALL: [Self; 10] = [
        Self::LANE_ORDER,
        Self { lanes: [0, 1, 4, 2, 5, 6] },
        Self { lanes: [0, 1, 4, 5, 2, 6] },
        Self { lanes: [0, 1, 4, 5, 6, 2] },
        Self { lanes: [0, 4, 1, 2, 5, 6] },
        Self { lanes: [0, 4, 1, 5, 2, 6] },
        Self { lanes: [0, 4, 1, 5, 6, 2] },
        Self { lanes: [0, 4, 5, 1, 2, 6] },
        Self { lanes: [0, 4, 5, 1, 6, 2] },
        Self { lanes: [0, 4, 5, 6, 1, 2] },
    ];

    /// Split whose first triple spans the largest volume, for given leg directions.
    pub fn best(directions: &[Vector3<f64>; LEGS]) -> Self {
        let volume = |triples: &Self| {
            let [x, y, z] = triples.pack_vectors(directions).map(|lane| lane.0);
            let ([x0, x1, x2, ..], [y0, y1, y2, ..], [z0, z1, z2, ..]) = (x, y, z);
            Matrix3::new(x0, x1, x2, y0, y1, y2, z0, z1, z2).determinant().abs()
        };
        let swapped = |triples: Self| Self { lanes: triples.lanes.map(|lane| (lane + 4) % 8) };
        let all = Self::ALL.into_iter().chain(Self::ALL.into_iter().map(swapped));
        all.max_by(|a, b| volume(a).total_cmp(&volume(b))).unwrap_or(Self::ALL[0])
    }

    /// Parity of the lane order as a permutation of the legs: 1 if even, -1 if odd.
    pub(super) fn parity(&self) -> f64 {
        let pairs = self.lanes.iter().enumerate();
        let behind =
            pairs.map(|(k, lane)| self.lanes.iter().skip(k + 1).filter(|later| *later < lane).count());
        if behind.sum::<usize>() % 2 == 0 { 1.0 } else { -1.0 }
    }

    /// Converts one value per leg to lanes.
    #[inline(always)]
    pub fn pack(&self, legs: &[f64; LEGS]) -> LegLanes {
        let mut lane = [0.0; 8];
        for (index, value) in self.lanes.iter().zip(legs) {
            if let Some(slot) = lane.get_mut(index % 8) {
                *slot = *value;
            }
        }
        let [a, b, c, _, d, e, f, _] = lane;
        LegLanes([a, b, c, a, d, e, f, d])
    }

    /// Same value for all legs, `padding` in the first lane of padding, 0 in the second.
    pub(super) fn uniform(leg: f64, padding: f64) -> LegLanes {
        LegLanes([leg, leg, leg, padding, leg, leg, leg, 0.0])
    }

    /// Converts lanes to one value per leg.
    #[inline(always)]
    pub fn unpack(&self, lane: &LegLanes) -> [f64; LEGS] {
        // The remainder lets the compiler omit the bounds check.
        self.lanes.map(|index| lane.0.get(index % 8).copied().unwrap_or_default())
    }

    /// Converts six 3-vectors to three lane arrays: x, y, z.
    pub fn pack_vectors(&self, legs: &[Vector3<f64>; LEGS]) -> [LegLanes; 3] {
        [self.pack(&legs.map(|v| v.x)), self.pack(&legs.map(|v| v.y)), self.pack(&legs.map(|v| v.z))]
    }

    /// Converts three lane arrays to six 3-vectors.
    pub fn unpack_vectors(&self, [x, y, z]: &[LegLanes; 3]) -> [Vector3<f64>; LEGS] {
        let (x, y, z) = (self.unpack(x), self.unpack(y), self.unpack(z));
        let mut legs = [Vector3::zeros(); LEGS];
        for (leg, ((x, y), z)) in legs.iter_mut().zip(x.into_iter().zip(y).zip(z)) {
            *leg = Vector3::new(x, y, z);
        }
        legs
    }
}
