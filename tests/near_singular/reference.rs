//! Linear systems to more digits than f64 has, at any condition up to 1e13: LU, refined by residuals that have twice the digits
//! (Wilkinson 1963).

use super::*;

/// `a + b`, and what its rounding takes away (Knuth 1969).
fn sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let b_rounded = sum - a;
    [sum, (a - (sum - b_rounded)) + (b - b_rounded)]
}

/// x of `a x = b`, rounded once; the elements of `a` and `b` are taken as exact.
pub fn solve(a: &Matrix6<f64>, b: &Vector6<f64>) -> Vector6<f64> {
    let factors = a.full_piv_lu();
    let (mut x, mut rest) = (Vector6::zeros(), Vector6::zeros());
    for _ in 0..40 {
        let residual = Vector6::from_fn(|i, _| {
            let (mut high, mut low) = (b[i], 0.0);
            for j in 0..6 {
                let product = -a[(i, j)] * x[j];
                let [sum, error] = sum(high, product);
                low += error + (-a[(i, j)]).mul_add(x[j], -product) - a[(i, j)] * rest[j];
                high = sum;
            }
            high + low
        });
        let step = factors.solve(&residual).unwrap();
        for i in 0..6 {
            [x[i], rest[i]] = sum(x[i], rest[i] + step[i]);
        }
        if step.amax() <= 1e-17 * x.amax() {
            return x;
        }
    }
    panic!("the refinement does not converge: {a}");
}

/// Hilbert's matrix, condition 1.5e7, scaled to integers: products with integers are exact. And a determinant of -2^-42.
#[test]
fn the_reference_is_exact() {
    let hilbert = Matrix6::from_fn(|i, j| 27720.0 / (i + j + 1) as f64);
    let x = Vector6::new(1.0, -2.0, 3.0, 1000.0, 5.0, -7.0);
    assert_eq!(solve(&hilbert, &(hilbert * x)), x);
    let mut tilted = Matrix6::identity();
    let tiny = 2f64.powi(-21);
    tilted.fixed_view_mut::<2, 2>(0, 0).copy_from(&nalgebra::Matrix2::new(1.0 + tiny, 1.0, 1.0, 1.0 - tiny));
    let found = solve(&tilted, &Vector6::new(tiny, 0.0, 0.0, 0.0, 0.0, 0.0));
    assert_eq!((found[0], found[1]), (-(1.0 - tiny) / tiny, 1.0 / tiny));
}
