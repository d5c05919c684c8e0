//! Six legs as the lanes of one SIMD vector, laid out as [`super::triples`] says.
//!
//! This is today's form of the paper's parallel algorithm: one processor per leg becomes one lane per leg.
//! Within a triple, determinants and inverses of 3 x 3 matrices are cross products of rotated lanes, which
//! is what `super::balance` lives on. Everything is generic over the instruction set and over the
//! precision (f64 or f32), and is inlined into the one function that was dispatched for both.

use core::ops::{Add, Div, Mul, Neg, Sub};

use fearless_simd::{Simd, f32x4, f32x8, f64x4, f64x8, prelude::*};
use nalgebra::RealField;

use super::triples::{Constant, Lane};

/// Arithmetic on all lanes of a vector.
pub(super) trait Reals:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// `self a + b`, fused where the CPU can.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `self a - b`, fused where the CPU can.
    fn mul_sub(self, a: Self, b: Self) -> Self;
    fn sqrt(self) -> Self;
    fn max(self, b: Self) -> Self;
    fn min(self, b: Self) -> Self;
}

/// Eight lanes: all legs.
pub(super) trait Eight<S: Simd>: Reals {
    /// One number.
    type Scalar: RealField + Copy + Default;
    /// One triple.
    type Half: Four<S, Scalar = Self::Scalar>;
    /// A constant in all lanes.
    fn splat(simd: S, value: f64) -> Self;
    /// A number in all lanes.
    fn spread(simd: S, value: Self::Scalar) -> Self;
    fn load(simd: S, lane: &Lane) -> Self;
    fn constant(simd: S, constant: &Constant) -> Self;
    fn store(self) -> Lane;
    fn halves(self) -> (Self::Half, Self::Half);
    fn join(first: Self::Half, second: Self::Half) -> Self;
}

/// Four lanes: one triple, and a lane of padding.
pub(super) trait Four<S: Simd>: Reals {
    /// One number.
    type Scalar: RealField + Copy + Default;
    /// A constant in all lanes.
    fn splat(simd: S, value: f64) -> Self;
    /// A number in all lanes.
    fn spread(simd: S, value: Self::Scalar) -> Self;
    fn load(simd: S, values: [f64; 4]) -> Self;
    /// In each lane, the next leg of the triple: `[1 2 0 -]`.
    fn next(self, simd: S) -> Self;
    /// In each lane, the leg before: `[2 0 1 -]`.
    fn previous(self, simd: S) -> Self;
    /// The sum of all four lanes, in all lanes.
    fn total(self, simd: S) -> Self;
    /// All four lanes.
    fn lanes(self) -> [f64; 4];
    /// One leg's number in all lanes.
    fn broadcast<const LEG: usize>(self, simd: S) -> Self;
    /// Three triples, a vector for each i over the lanes j, to a vector for each j over the lanes i.
    fn transposed(simd: S, rows: [Self; 3]) -> [Self; 3];
    /// The triple's three numbers.
    fn legs(self) -> [f64; 3];
    /// The number in the first lane.
    fn first(self) -> f64;
}

macro_rules! reals {
    ($($vector:ident),*) => {$(
        impl<S: Simd> Reals for $vector<S> {
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                SimdFloat::mul_add(self, a, b)
            }
            #[inline(always)]
            fn mul_sub(self, a: Self, b: Self) -> Self {
                SimdFloat::mul_sub(self, a, b)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                SimdFloat::sqrt(self)
            }
            #[inline(always)]
            fn max(self, b: Self) -> Self {
                SimdBase::max(self, b)
            }
            #[inline(always)]
            fn min(self, b: Self) -> Self {
                SimdBase::min(self, b)
            }
        }
    )*};
}

macro_rules! precision {
    ($scalar:ty, $eight:ident, $four:ident, $constant:expr) => {
        impl<S: Simd> Eight<S> for $eight<S> {
            type Scalar = $scalar;
            type Half = $four<S>;
            #[inline(always)]
            fn spread(simd: S, value: $scalar) -> Self {
                SimdBase::splat(simd, value)
            }
            #[inline(always)]
            fn splat(simd: S, value: f64) -> Self {
                SimdBase::splat(simd, value as $scalar)
            }
            #[inline(always)]
            fn load(simd: S, lane: &Lane) -> Self {
                SimdBase::load_array(simd, lane.0.map(|value| value as $scalar))
            }
            #[inline(always)]
            fn constant(simd: S, constant: &Constant) -> Self {
                let lanes: fn(&Constant) -> [$scalar; 8] = $constant;
                SimdBase::load_array(simd, lanes(constant))
            }
            #[inline(always)]
            fn store(self) -> Lane {
                Lane(self.to_array().map(f64::from))
            }
            #[inline(always)]
            fn halves(self) -> (Self::Half, Self::Half) {
                self.split()
            }
            #[inline(always)]
            fn join(first: Self::Half, second: Self::Half) -> Self {
                first.combine(second)
            }
        }

        impl<S: Simd> Four<S> for $four<S> {
            type Scalar = $scalar;
            #[inline(always)]
            fn spread(simd: S, value: $scalar) -> Self {
                SimdBase::splat(simd, value)
            }
            #[inline(always)]
            fn splat(simd: S, value: f64) -> Self {
                SimdBase::splat(simd, value as $scalar)
            }
            #[inline(always)]
            fn load(simd: S, values: [f64; 4]) -> Self {
                SimdBase::load_array(simd, values.map(|value| value as $scalar))
            }
            #[inline(always)]
            fn next(self, simd: S) -> Self {
                let [a, b, c, _] = self.to_array();
                SimdBase::load_array(simd, [b, c, a, b])
            }
            #[inline(always)]
            fn previous(self, simd: S) -> Self {
                let [a, b, c, _] = self.to_array();
                SimdBase::load_array(simd, [c, a, b, c])
            }
            #[inline(always)]
            fn broadcast<const LEG: usize>(self, simd: S) -> Self {
                let [a, b, c, _] = self.to_array();
                SimdBase::splat(
                    simd,
                    if LEG == 0 {
                        a
                    } else if LEG == 1 {
                        b
                    } else {
                        c
                    },
                )
            }
            #[inline(always)]
            fn total(self, simd: S) -> Self {
                let [a, b, c, d] = self.to_array();
                let pairs = self + <Self as SimdBase<S>>::load_array(simd, [c, d, a, b]);
                let [a, b, c, d] = pairs.to_array();
                pairs + <Self as SimdBase<S>>::load_array(simd, [b, a, d, c])
            }
            #[inline(always)]
            fn lanes(self) -> [f64; 4] {
                self.to_array().map(f64::from)
            }
            #[inline(always)]
            fn transposed(simd: S, rows: [Self; 3]) -> [Self; 3] {
                let [[a, b, c, _], [d, e, f, _], [g, h, i, _]] = rows.map(|row| row.to_array());
                [[a, d, g, a], [b, e, h, b], [c, f, i, c]].map(|column| SimdBase::load_array(simd, column))
            }
            #[inline(always)]
            fn legs(self) -> [f64; 3] {
                let [a, b, c, _] = self.to_array();
                [a.into(), b.into(), c.into()]
            }
            #[inline(always)]
            fn first(self) -> f64 {
                let [a, ..] = self.to_array();
                a.into()
            }
        }
    };
}

reals!(f64x8, f64x4, f32x8, f32x4);
precision!(f64, f64x8, f64x4, |constant| constant.double.0);
precision!(f32, f32x8, f32x4, |constant| constant.single);
