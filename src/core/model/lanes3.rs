//! Vector algebra of the legs: one 3-vector per lane.

use core::ops::{Add, Mul, Sub};

use fearless_simd::{Simd, SimdBase, SimdCombine, SimdSplit, f64x4, f64x8};
use nalgebra::{Matrix3, Vector3};

use super::lanes::{LaneArithmetic, Triple};
use super::triples::LegLanes;

/// One 3-vector per lane.
#[derive(Clone, Copy)]
pub(super) struct Lanes3<V> {
    pub x: V,
    pub y: V,
    pub z: V,
}

impl<V: LaneArithmetic> Lanes3<V> {
    /// Dot product `self . b`.
    #[inline(always)]
    pub fn dot(self, b: Self) -> V {
        self.x.fused_mul_add(b.x, self.y.fused_mul_add(b.y, self.z * b.z))
    }

    /// Cross product `self x b`.
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        Self {
            x: self.y.fused_mul_sub(b.z, self.z * b.y),
            y: self.z.fused_mul_sub(b.x, self.x * b.z),
            z: self.x.fused_mul_sub(b.y, self.y * b.x),
        }
    }

    /// Sum `self + s b`.
    #[inline(always)]
    pub fn plus_scaled(self, s: V, b: Self) -> Self {
        Self {
            x: s.fused_mul_add(b.x, self.x),
            y: s.fused_mul_add(b.y, self.y),
            z: s.fused_mul_add(b.z, self.z),
        }
    }

    /// Difference `self - s b`.
    #[inline(always)]
    pub fn minus_scaled(self, s: V, b: Self) -> Self {
        self.plus_scaled(-s, b)
    }

    /// Product `m self`, with the same matrix in all lanes.
    #[inline(always)]
    pub fn transformed<S: Simd>(self, simd: S, m: &Matrix3<f64>) -> Self
    where
        V: SimdBase<S, Element = f64>,
    {
        let column = |x, y, z| Self { x: V::splat(simd, x), y: V::splat(simd, y), z: V::splat(simd, z) };
        (column(m.m13, m.m23, m.m33) * self.z)
            .plus_scaled(self.y, column(m.m12, m.m22, m.m32))
            .plus_scaled(self.x, column(m.m11, m.m21, m.m31))
    }

    /// Vector rotated by Cayley's rotation of `2 u`: `v + k (u x v + u x (u x v))`, `k = 2 / (1 + u.u)`.
    #[inline(always)]
    pub fn cayley_rotated(self, u: Self, k: V) -> Self {
        let once = u.cross(self);
        self.plus_scaled(k, once + u.cross(once))
    }

    /// Same vector in all lanes.
    #[inline(always)]
    pub fn splat<S: Simd>(simd: S, v: &Vector3<f64>) -> Self
    where
        V: SimdBase<S, Element = f64>,
    {
        Self { x: V::splat(simd, v.x), y: V::splat(simd, v.y), z: V::splat(simd, v.z) }
    }
}

impl<S: Simd> Lanes3<f64x8<S>> {
    /// Loads one vector per leg.
    #[inline(always)]
    pub fn load(simd: S, [x, y, z]: &[LegLanes; 3]) -> Self {
        Self { x: x.load(simd), y: y.load(simd), z: z.load(simd) }
    }

    /// Stores one vector per leg.
    #[inline(always)]
    pub fn store(self) -> [LegLanes; 3] {
        [self.x.into(), self.y.into(), self.z.into()]
    }

    /// Splits into the two triples.
    #[inline(always)]
    pub fn split(self) -> (Lanes3<f64x4<S>>, Lanes3<f64x4<S>>) {
        let ((x0, x1), (y0, y1), (z0, z1)) = (self.x.split(), self.y.split(), self.z.split());
        (Lanes3 { x: x0, y: y0, z: z0 }, Lanes3 { x: x1, y: y1, z: z1 })
    }

    /// Sum of the two triples, lane by lane.
    #[inline(always)]
    pub fn folded(self) -> Lanes3<f64x4<S>> {
        let (first, second) = self.split();
        first + second
    }
}

impl<S: Simd> Lanes3<f64x4<S>> {
    /// Vector of the next leg, in each lane.
    #[inline(always)]
    pub fn next(self) -> Self {
        Self { x: self.x.next(), y: self.y.next(), z: self.z.next() }
    }

    /// Vector of the previous leg, in each lane.
    #[inline(always)]
    pub fn previous(self) -> Self {
        Self { x: self.x.previous(), y: self.y.previous(), z: self.z.previous() }
    }

    /// Vector of each leg, in all lanes.
    #[inline(always)]
    pub fn broadcasts(self) -> [Self; 3] {
        let ([x0, x1, x2], [y0, y1, y2], [z0, z1, z2]) =
            (broadcasts(self.x), broadcasts(self.y), broadcasts(self.z));
        [Self { x: x0, y: y0, z: z0 }, Self { x: x1, y: y1, z: z1 }, Self { x: x2, y: y2, z: z2 }]
    }

    /// Sum of all four lanes, in all lanes.
    #[inline(always)]
    pub fn total(self) -> Self {
        Self { x: self.x.total(), y: self.y.total(), z: self.z.total() }
    }

    /// Copies the four lanes to both triples.
    #[inline(always)]
    pub fn doubled(self) -> Lanes3<f64x8<S>> {
        Lanes3 { x: self.x.combine(self.x), y: self.y.combine(self.y), z: self.z.combine(self.z) }
    }

    /// Vector in the first lane.
    #[inline(always)]
    pub fn first(self) -> Vector3<f64> {
        Vector3::new(self.x.first(), self.y.first(), self.z.first())
    }

    /// Sum over all four lanes, per component.
    #[inline(always)]
    pub fn sum(self) -> Vector3<f64> {
        let sum = |value: f64x4<S>| value.to_array().into_iter().sum();
        Vector3::new(sum(self.x), sum(self.y), sum(self.z))
    }
}

/// Value of each leg, in all lanes.
#[inline(always)]
pub(super) fn broadcasts<S: Simd>(v: f64x4<S>) -> [f64x4<S>; 3] {
    [v.broadcast::<0>(), v.broadcast::<1>(), v.broadcast::<2>()]
}

impl<V: LaneArithmetic> Add for Lanes3<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { x: self.x + b.x, y: self.y + b.y, z: self.z + b.z }
    }
}

impl<V: LaneArithmetic> Sub for Lanes3<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { x: self.x - b.x, y: self.y - b.y, z: self.z - b.z }
    }
}

impl<V: LaneArithmetic> Mul<V> for Lanes3<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: V) -> Self {
        Self { x: self.x * s, y: self.y * s, z: self.z * s }
    }
}
