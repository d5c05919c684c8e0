//! A 3-vector per lane: the vector algebra of the legs.

use core::ops::{Add, Mul, Sub};

use fearless_simd::Simd;
use nalgebra::{Matrix3, RealField, Vector3};

use super::lanes::{Eight, Four, Reals};
use super::triples::{Constant, Lane};

/// A 3-vector per lane.
#[derive(Clone, Copy)]
pub(super) struct Lanes3<V> {
    pub x: V,
    pub y: V,
    pub z: V,
}

impl<V: Reals> Lanes3<V> {
    #[inline(always)]
    pub fn dot(self, b: Self) -> V {
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
    pub fn plus_scaled(self, s: V, b: Self) -> Self {
        Self { x: s.mul_add(b.x, self.x), y: s.mul_add(b.y, self.y), z: s.mul_add(b.z, self.z) }
    }

    /// `self - s b`
    #[inline(always)]
    pub fn minus_scaled(self, s: V, b: Self) -> Self {
        self.plus_scaled(-s, b)
    }

    /// `m self`, the same matrix in all lanes; `spread` takes a number there.
    #[inline(always)]
    pub fn transformed<T: RealField + Copy>(self, m: &Matrix3<T>, spread: impl Fn(T) -> V) -> Self {
        let column = |x, y, z| Self { x: spread(x), y: spread(y), z: spread(z) };
        (column(m.m13, m.m23, m.m33) * self.z)
            .plus_scaled(self.y, column(m.m12, m.m22, m.m32))
            .plus_scaled(self.x, column(m.m11, m.m21, m.m31))
    }
}

impl<V> Lanes3<V> {
    /// A different vector in each lane.
    #[inline(always)]
    pub fn constant<S: Simd>(simd: S, [x, y, z]: &[Constant; 3]) -> Self
    where
        V: Eight<S>,
    {
        Self { x: V::constant(simd, x), y: V::constant(simd, y), z: V::constant(simd, z) }
    }

    /// The same vector in all lanes.
    #[inline(always)]
    pub fn spread<S: Simd>(simd: S, v: &Vector3<V::Scalar>) -> Self
    where
        V: Eight<S>,
    {
        Self { x: V::spread(simd, v.x), y: V::spread(simd, v.y), z: V::spread(simd, v.z) }
    }

    /// Back to memory.
    #[inline(always)]
    pub fn store<S: Simd>(self) -> [Lane; 3]
    where
        V: Eight<S>,
    {
        [self.x.store(), self.y.store(), self.z.store()]
    }

    /// The two triples.
    #[inline(always)]
    pub fn halves<S: Simd>(self) -> (Lanes3<V::Half>, Lanes3<V::Half>)
    where
        V: Eight<S>,
    {
        let ((x0, x1), (y0, y1), (z0, z1)) = (self.x.halves(), self.y.halves(), self.z.halves());
        (Lanes3 { x: x0, y: y0, z: z0 }, Lanes3 { x: x1, y: y1, z: z1 })
    }

    /// Four lanes with the same sum.
    #[inline(always)]
    pub fn folded<S: Simd>(self) -> Lanes3<V::Half>
    where
        V: Eight<S>,
    {
        let (first, second) = self.halves();
        first + second
    }
}

impl<F> Lanes3<F> {
    /// The next leg's vector in each lane.
    #[inline(always)]
    pub fn next<S: Simd>(self, simd: S) -> Self
    where
        F: Four<S>,
    {
        Self { x: self.x.next(simd), y: self.y.next(simd), z: self.z.next(simd) }
    }

    /// The vector of the leg before in each lane.
    #[inline(always)]
    pub fn previous<S: Simd>(self, simd: S) -> Self
    where
        F: Four<S>,
    {
        Self { x: self.x.previous(simd), y: self.y.previous(simd), z: self.z.previous(simd) }
    }

    /// The sum of all four lanes, in all lanes.
    #[inline(always)]
    pub fn total<S: Simd>(self, simd: S) -> Self
    where
        F: Four<S>,
    {
        Self { x: self.x.total(simd), y: self.y.total(simd), z: self.z.total(simd) }
    }

    /// Twice, for both triples.
    #[inline(always)]
    pub fn doubled<S: Simd, V: Eight<S, Half = F>>(self) -> Lanes3<V>
    where
        F: Four<S>,
    {
        Lanes3 { x: V::join(self.x, self.x), y: V::join(self.y, self.y), z: V::join(self.z, self.z) }
    }

    /// The vector in the first lane.
    #[inline(always)]
    pub fn first<S: Simd>(self) -> Vector3<f64>
    where
        F: Four<S>,
    {
        Vector3::new(self.x.first(), self.y.first(), self.z.first())
    }

    /// Sum over all four lanes, per component.
    #[inline(always)]
    pub fn sum<S: Simd>(self) -> Vector3<f64>
    where
        F: Four<S>,
    {
        let sum = |value: F| value.lanes().into_iter().sum();
        Vector3::new(sum(self.x), sum(self.y), sum(self.z))
    }
}

impl<V: Reals> Add for Lanes3<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { x: self.x + b.x, y: self.y + b.y, z: self.z + b.z }
    }
}

impl<V: Reals> Sub for Lanes3<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { x: self.x - b.x, y: self.y - b.y, z: self.z - b.z }
    }
}

impl<V: Reals> Mul<V> for Lanes3<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: V) -> Self {
        Self { x: self.x * s, y: self.y * s, z: self.z * s }
    }
}
