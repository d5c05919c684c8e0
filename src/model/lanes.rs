//! Six legs as the lanes of one SIMD vector.
//!
//! This is today's form of the paper's parallel algorithm: one processor per leg becomes one lane per
//! leg. Lanes 6 and 7 repeat legs 1 and 2, so that they never divide by zero; nobody reads them.
//! [`Lanes3`] is a 3-vector per leg. Everything is generic over the instruction set `S` and inlined into
//! the one function that was dispatched for it.

use core::ops::{Add, Mul, Sub};

use fearless_simd::{Simd, f64x8, prelude::*};
use nalgebra::{Matrix3, Matrix3x6, RowVector6, Vector3};

use super::machine::LEGS;

/// One number per leg in memory; two lanes of padding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Lane(pub [f64; 8]);

impl Lane {
    /// Six 3-vectors to three lanes: x, y, z.
    pub fn pack(legs: &[Vector3<f64>; LEGS]) -> [Self; 3] {
        core::array::from_fn(|axis| {
            let mut lane = Self::default();
            for (slot, leg) in lane.0.iter_mut().zip(legs.iter().cycle()) {
                *slot = leg.as_slice().get(axis).copied().unwrap_or_default();
            }
            lane
        })
    }

    /// The six legs' numbers.
    #[inline(always)]
    pub fn legs(&self) -> [f64; LEGS] {
        let [a, b, c, d, e, f, ..] = self.0;
        [a, b, c, d, e, f]
    }

    /// Three lanes back to six 3-vectors.
    pub fn unpack(lanes: &[Self; 3]) -> [Vector3<f64>; LEGS] {
        let [x, y, z] = lanes.map(|lane| RowVector6::from(lane.legs()));
        let columns = Matrix3x6::from_rows(&[x, y, z]);
        core::array::from_fn(|i| columns.column(i).into())
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> f64x8<S> {
        f64x8::load_array_ref(simd, &self.0)
    }

    #[inline(always)]
    pub(super) fn store<S: Simd>(value: f64x8<S>) -> Self {
        Self(value.to_array())
    }
}

/// Sum over the six legs; the padding does not count.
#[inline(always)]
pub(super) fn sum_legs<S: Simd>(value: f64x8<S>) -> f64 {
    Lane::store(value).legs().iter().sum()
}

/// A 3-vector per leg.
#[derive(Clone, Copy)]
pub(super) struct Lanes3<S: Simd> {
    pub x: f64x8<S>,
    pub y: f64x8<S>,
    pub z: f64x8<S>,
}

impl<S: Simd> Lanes3<S> {
    /// A different vector for each leg.
    #[inline(always)]
    pub fn load(simd: S, [x, y, z]: &[Lane; 3]) -> Self {
        Self { x: x.load(simd), y: y.load(simd), z: z.load(simd) }
    }

    /// The same vector for every leg.
    #[inline(always)]
    pub fn splat(simd: S, v: &Vector3<f64>) -> Self {
        Self { x: f64x8::splat(simd, v.x), y: f64x8::splat(simd, v.y), z: f64x8::splat(simd, v.z) }
    }

    /// `m self`, the same matrix for every leg.
    #[inline(always)]
    pub fn transformed(self, simd: S, m: &Matrix3<f64>) -> Self {
        let row = |a: f64, b: f64, c: f64| {
            let (a, b, c) = (f64x8::splat(simd, a), f64x8::splat(simd, b), f64x8::splat(simd, c));
            a.mul_add(self.x, b.mul_add(self.y, c * self.z))
        };
        Self { x: row(m.m11, m.m12, m.m13), y: row(m.m21, m.m22, m.m23), z: row(m.m31, m.m32, m.m33) }
    }

    #[inline(always)]
    pub fn dot(self, b: Self) -> f64x8<S> {
        self.x.mul_add(b.x, self.y.mul_add(b.y, self.z * b.z))
    }

    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        Self {
            x: self.y.mul_sub(b.z, self.z * b.y),
            y: self.z.mul_sub(b.x, self.x * b.z),
            z: self.x.mul_sub(b.y, self.y * b.x),
        }
    }

    /// `self + s b`
    #[inline(always)]
    pub fn plus_scaled(self, s: f64x8<S>, b: Self) -> Self {
        Self { x: s.mul_add(b.x, self.x), y: s.mul_add(b.y, self.y), z: s.mul_add(b.z, self.z) }
    }

    /// Back to memory.
    #[inline(always)]
    pub fn store(self) -> [Lane; 3] {
        [Lane::store(self.x), Lane::store(self.y), Lane::store(self.z)]
    }

    /// Sum over the six legs.
    #[inline(always)]
    pub fn sum_legs(self) -> Vector3<f64> {
        Vector3::new(sum_legs(self.x), sum_legs(self.y), sum_legs(self.z))
    }
}

impl<S: Simd> Add for Lanes3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { x: self.x + b.x, y: self.y + b.y, z: self.z + b.z }
    }
}

impl<S: Simd> Sub for Lanes3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { x: self.x - b.x, y: self.y - b.y, z: self.z - b.z }
    }
}

impl<S: Simd> Mul<f64x8<S>> for Lanes3<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f64x8<S>) -> Self {
        Self { x: self.x * s, y: self.y * s, z: self.z * s }
    }
}
