//! Linear systems in double-double arithmetic: 32 digits, so that at any condition up to 1e14 the solution
//! is exact to more digits than f64 has.

use core::ops::{Add, Div, Mul, Sub};

use nalgebra::{Matrix6, Vector6};

/// A number as the unevaluated sum of two f64 (Dekker 1971; products by fused multiply-add).
#[derive(Clone, Copy, Debug)]
pub struct Double {
    high: f64,
    low: f64,
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Double {
    /// `a + b` without error.
    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let b_rounded = high - a;
        Self { high, low: (a - (high - b_rounded)) + (b - b_rounded) }
    }

    pub fn value(self) -> f64 {
        self.high + self.low
    }
}

impl Add for Double {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        let (high, low) = (Self::sum(self.high, b.high), Self::sum(self.low, b.low));
        let once = Self::sum(high.high, high.low + low.high);
        Self::sum(once.high, once.low + low.low)
    }
}

impl Sub for Double {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + Self { high: -b.high, low: -b.low }
    }
}

impl Mul for Double {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        let high = self.high * b.high;
        let low = self.high.mul_add(b.high, -high) + (self.high * b.low + self.low * b.high);
        Self::sum(high, low)
    }
}

impl Div for Double {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let first = self.high / b.high;
        let rest = self - b * first.into();
        let second = rest.high / b.high;
        let rest = rest - b * second.into();
        Self::sum(first, second) + (rest.high / b.high).into()
    }
}

/// x of `a x = b`, by elimination with complete pivoting; the elements of `a` and `b` are taken as exact.
pub fn solve(a: &Matrix6<f64>, b: &Vector6<f64>) -> Vector6<f64> {
    let mut a: [[Double; 7]; 6] =
        core::array::from_fn(|i| core::array::from_fn(|j| if j < 6 { a[(i, j)] } else { b[i] }.into()));
    let mut order: [usize; 6] = core::array::from_fn(|j| j);
    for k in 0..6 {
        let rest = (k..6).flat_map(|i| (k..6).map(move |j| (i, j)));
        let (row, column) =
            rest.max_by(|x, y| a[x.0][x.1].high.abs().total_cmp(&a[y.0][y.1].high.abs())).unwrap();
        a.swap(k, row);
        a.iter_mut().for_each(|row| row.swap(k, column));
        order.swap(k, column);
        let pivot = a[k];
        for row in a.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(pivot).skip(k).for_each(|(x, p)| *x = *x - factor * p);
        }
    }
    let mut x = [Double::from(0.0); 6];
    for i in (0..6).rev() {
        let known = (i + 1..6).fold(a[i][6], |rest, j| rest - a[i][j] * x[j]);
        x[i] = known / a[i][i];
    }
    let mut solution = Vector6::zeros();
    order.iter().zip(x).for_each(|(leg, x)| solution[*leg] = x.value());
    solution
}

/// Hilbert's matrix, condition 1.5e7, scaled to integers: products with integers are exact.
#[test]
fn the_reference_is_exact() {
    let hilbert = Matrix6::from_fn(|i, j| 27720.0 / (i + j + 1) as f64);
    let x = Vector6::new(1.0, -2.0, 3.0, 1000.0, 5.0, -7.0);
    assert!((solve(&hilbert, &(hilbert * x)) - x).amax() < 1e-20);
    // 1 + 2^-80 is no f64, but here it counts.
    let mut tilted = Matrix6::identity();
    let tiny = 2f64.powi(-40);
    tilted.fixed_view_mut::<2, 2>(0, 0).copy_from(&nalgebra::Matrix2::new(1.0 + tiny, 1.0, 1.0, 1.0 - tiny));
    let found = solve(&tilted, &Vector6::new(tiny, 0.0, 0.0, 0.0, 0.0, 0.0));
    // Determinant -2^-80.
    assert_eq!((found[0], found[1]), (-(1.0 - tiny) / tiny, 1.0 / tiny));
}
