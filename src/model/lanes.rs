//! Six legs as the lanes of one SIMD vector.
//!
//! This is today's form of the paper's parallel algorithm: one processor per leg becomes one lane per
//! leg. Eight lanes hold two triples of legs, each with a lane of padding that repeats the triple's first
//! leg, so that it never divides by zero; nobody reads it:
//!
//! ```text
//! lane   0    1    2    3       4    5    6    7
//! leg   a    b    c   (a)      d    e    f   (d)          chosen per machine, see Triples
//! ```
//!
//! Within a triple, determinants and inverses of 3 x 3 matrices are cross products of rotated lanes, which
//! is what `super::balance` lives on. Everything is generic over the instruction set and over the
//! precision (f64 or f32), and is inlined into the one function that was dispatched for both.

use core::borrow::Borrow;
use core::ops::{Add, Div, Mul, Neg, Sub};

use fearless_simd::{Simd, f32x4, f32x8, f64x4, f64x8, prelude::*};
use nalgebra::{Matrix3, RealField, Vector3};

use super::machine::LEGS;

/// One number per lane in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Lane(pub [f64; 8]);

/// A constant of the machine, one number per lane, ready for either precision: converting it anew for
/// each evaluation would cost more than single precision saves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Constant {
    double: Lane,
    single: [f32; 8],
}

impl Constant {
    /// With the first lane of padding set to `value`.
    pub(super) fn with_padding(&self, value: f64) -> Self {
        let [a, b, c, _, d, e, f, g] = self.double.0;
        Lane([a, b, c, value, d, e, f, g]).into()
    }
}

impl From<Lane> for Constant {
    fn from(double: Lane) -> Self {
        Self { double, single: double.0.map(|value| value as f32) }
    }
}

impl Borrow<Lane> for Constant {
    fn borrow(&self) -> &Lane {
        &self.double
    }
}

/// Which leg is in which lane: two triples of legs, the first in lanes 0..2, the second in lanes 4..6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triples {
    /// Lane of each leg.
    lanes: [usize; LEGS],
}

impl Triples {
    /// The ten ways to split six legs in two, by the partners of the first leg.
    const ALL: [Self; 10] = [
        Self { lanes: [0, 1, 2, 4, 5, 6] },
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

    /// The split whose first triple spans the largest volume: of these directions of the legs, the three
    /// that resist a force best go first.
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

    /// One number per leg to lanes.
    #[inline(always)]
    pub fn pack(&self, legs: &[f64; LEGS]) -> Lane {
        let mut lane = [0.0; 8];
        for (index, value) in self.lanes.iter().zip(legs) {
            if let Some(slot) = lane.get_mut(index % 8) {
                *slot = *value;
            }
        }
        let [a, b, c, _, d, e, f, _] = lane;
        Lane([a, b, c, a, d, e, f, d])
    }

    /// The same number for every leg, in whatever lane, and others for the padding.
    pub(super) fn uniform(leg: f64, [first, second]: [f64; 2]) -> Constant {
        Lane([leg, leg, leg, first, leg, leg, leg, second]).into()
    }

    /// Lanes to one number per leg.
    #[inline(always)]
    pub fn unpack(&self, lane: &impl Borrow<Lane>) -> [f64; LEGS] {
        let lane = lane.borrow();
        // The remainder tells the compiler that there is nothing to check.
        self.lanes.map(|index| lane.0.get(index % 8).copied().unwrap_or_default())
    }

    /// Six 3-vectors to three lanes: x, y, z.
    pub fn pack_vectors(&self, legs: &[Vector3<f64>; LEGS]) -> [Lane; 3] {
        [self.pack(&legs.map(|v| v.x)), self.pack(&legs.map(|v| v.y)), self.pack(&legs.map(|v| v.z))]
    }

    /// Three lanes back to six 3-vectors.
    pub fn unpack_vectors(&self, [x, y, z]: &[impl Borrow<Lane>; 3]) -> [Vector3<f64>; LEGS] {
        let (x, y, z) = (self.unpack(x.borrow()), self.unpack(y.borrow()), self.unpack(z.borrow()));
        let mut legs = [Vector3::zeros(); LEGS];
        for (leg, ((x, y), z)) in legs.iter_mut().zip(x.into_iter().zip(y).zip(z)) {
            *leg = Vector3::new(x, y, z);
        }
        legs
    }
}

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
        }
    };
}

reals!(f64x8, f64x4, f32x8, f32x4);
precision!(f64, f64x8, f64x4, |constant| constant.double.0);
precision!(f32, f32x8, f32x4, |constant| constant.single);

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

    #[inline(always)]
    pub fn map<W>(self, f: impl Fn(V) -> W) -> Lanes3<W> {
        Lanes3 { x: f(self.x), y: f(self.y), z: f(self.z) }
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
    /// Sum over the three legs of a triple, per component; the padding does not count.
    #[inline(always)]
    pub fn sum_legs<S: Simd>(self) -> Vector3<f64>
    where
        F: Four<S>,
    {
        let sum = |value: F| value.legs().into_iter().sum();
        Vector3::new(sum(self.x), sum(self.y), sum(self.z))
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
