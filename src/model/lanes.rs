//! Six legs as the lanes of one SIMD vector, laid out as [`super::triples`] says.
//!
//! This is today's form of the paper's parallel algorithm: one processor per leg becomes one lane per leg. Within a
//! triple, determinants and inverses of 3 x 3 matrices are cross products of rotated lanes, the base of
//! `super::factorization`. Everything is generic over the instruction set and inlined into the one function that was
//! dispatched for it.
//!
//! Double precision only. Lanes of f32 were measured (exact model, ns for one evaluation, f32 against f64): 68.8 against
//! 66.6 on one processor with AVX-512; 60.7 against 73.4 with AVX2 and 90.9 against 142 with SSE2 on another. That is no
//! gain on every instruction set, for errors of 4e-7 of the largest force instead of 1e-15.

use core::ops::{Add, Mul, Neg, Sub};

use fearless_simd::{Simd, f64x4, f64x8, prelude::*};

use super::fused;

/// Arithmetic on all lanes of a vector, whatever their number.
pub(super) trait LaneArithmetic:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// `self a + b`, rounded once but on SSE4.2, see `super::fused`.
    fn fused_mul_add(self, a: Self, b: Self) -> Self;
    /// `self a - b`, rounded once but on SSE4.2, see `super::fused`.
    fn fused_mul_sub(self, a: Self, b: Self) -> Self;
}

macro_rules! lane_arithmetic {
    ($($vector:ident),*) => {$(
        impl<S: Simd> LaneArithmetic for $vector<S> {
            #[inline(always)]
            fn fused_mul_add(self, a: Self, b: Self) -> Self {
                if fused::is_native(self.simd) {
                    SimdFloat::mul_add(self, a, b)
                } else {
                    Self::load_array(self.simd, fused::mul_add(&self.to_array(), &a.to_array(), &b.to_array()))
                }
            }
            #[inline(always)]
            fn fused_mul_sub(self, a: Self, b: Self) -> Self {
                if fused::is_native(self.simd) {
                    SimdFloat::mul_sub(self, a, b)
                } else {
                    Self::load_array(self.simd, fused::mul_add(&self.to_array(), &a.to_array(), &(-b).to_array()))
                }
            }
        }
    )*};
}

lane_arithmetic!(f64x8, f64x4);

/// One triple of legs in four lanes, the last of which is padding.
pub(super) trait Triple: Sized {
    /// In each lane, the next leg of the triple: `[1 2 0 -]`.
    fn next(self) -> Self;
    /// In each lane, the previous leg of the triple: `[2 0 1 -]`.
    fn previous(self) -> Self;
    /// The sum of all four lanes, in all lanes.
    fn total(self) -> Self;
    /// One leg's number in all lanes.
    fn broadcast<const LEG: usize>(self) -> Self;
    /// Three vectors, one for each i over the lanes j, to one for each j over the lanes i.
    fn transposed(rows: [Self; 3]) -> [Self; 3];
    /// The numbers of the three legs.
    fn legs(self) -> [f64; 3];
    /// The number in the first lane.
    fn first(self) -> f64;
}

impl<S: Simd> Triple for f64x4<S> {
    #[inline(always)]
    fn next(self) -> Self {
        let [a, b, c, _] = self.to_array();
        Self::load_array(self.simd, [b, c, a, b])
    }

    #[inline(always)]
    fn previous(self) -> Self {
        let [a, b, c, _] = self.to_array();
        Self::load_array(self.simd, [c, a, b, c])
    }

    #[inline(always)]
    fn total(self) -> Self {
        let [a, b, c, d] = self.to_array();
        let pairs = self + Self::load_array(self.simd, [c, d, a, b]);
        let [a, b, c, d] = pairs.to_array();
        pairs + Self::load_array(self.simd, [b, a, d, c])
    }

    #[inline(always)]
    fn broadcast<const LEG: usize>(self) -> Self {
        let [a, b, c, _] = self.to_array();
        Self::splat(
            self.simd,
            match LEG {
                0 => a,
                1 => b,
                _ => c,
            },
        )
    }

    #[inline(always)]
    fn transposed(rows: [Self; 3]) -> [Self; 3] {
        let simd = rows[0].simd;
        let [[a, b, c, _], [d, e, f, _], [g, h, i, _]] = rows.map(|row| row.to_array());
        [[a, d, g, a], [b, e, h, b], [c, f, i, c]].map(|column| Self::load_array(simd, column))
    }

    #[inline(always)]
    fn legs(self) -> [f64; 3] {
        let [a, b, c, _] = self.to_array();
        [a, b, c]
    }

    #[inline(always)]
    fn first(self) -> f64 {
        let [a, ..] = self.to_array();
        a
    }
}

/// The least of the numbers of the six legs.
#[inline(always)]
pub(super) fn least_of_legs<S: Simd>(lanes: f64x8<S>) -> f64 {
    let (first, second) = lanes.split();
    let [a, b, c] = first.min(second).legs();
    a.min(b).min(c)
}
