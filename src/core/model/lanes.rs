//! Lanes: six legs in one SIMD vector, in the layout of [`super::triples`].
//!
//! This is the present form of the paper's parallel algorithm: one lane per leg instead of one processor per
//! leg. Within a triple, determinants and inverses of 3 x 3 matrices are cross products of rotated lanes, as
//! `super::factorization` uses them. All code is generic over the instruction set and is inlined into the
//! function dispatched for it.
//!
//! Double precision only. f32 lanes were measured (2026-11-21, exact model, ns per evaluation, f32 against
//! f64): 68.8 against 66.6 on one processor with AVX-512; 60.7 against 73.4 with AVX2 and 90.9 against 142
//! with SSE2 on another. f32 is not faster on every instruction set, and its errors are 4e-7 of the largest
//! force instead of 1e-15.

use core::ops::{Add, Mul, Neg, Sub};

use fearless_simd::{Simd, f64x4, f64x8, prelude::*};

use super::fused;

/// Arithmetic on all lanes of a vector of any width.
pub(super) trait LaneArithmetic:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// `self a + b`, rounded once except on SSE4.2, see `super::fused`.
    fn fused_mul_add(self, a: Self, b: Self) -> Self;
    /// `self a - b`, rounded once except on SSE4.2, see `super::fused`.
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

/// One triple of legs in four lanes; the last lane is padding.
pub(super) trait Triple: Sized {
    /// Next leg of the triple, in each lane: `[1 2 0 -]`.
    fn next(self) -> Self;
    /// Previous leg of the triple, in each lane: `[2 0 1 -]`.
    fn previous(self) -> Self;
    /// Sum of all four lanes, in all lanes.
    fn total(self) -> Self;
    /// Value of one leg, in all lanes.
    fn broadcast<const LEG: usize>(self) -> Self;
    /// Transpose: rows i over the lanes j become rows j over the lanes i.
    fn transposed(rows: [Self; 3]) -> [Self; 3];
    /// Values of the three legs.
    fn legs(self) -> [f64; 3];
    /// Value in the first lane.
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

/// Smallest value of the six legs.
#[inline(always)]
pub(super) fn least_of_legs<S: Simd>(lanes: f64x8<S>) -> f64 {
    let (first, second) = lanes.split();
    let [a, b, c] = first.min(second).legs();
    a.min(b).min(c)
}
