//! Fused multiply-add in software: `a b + c` rounded once, bit-identical to AVX2, AVX-512 and NEON on any
//! processor.
//!
//! Two arithmetics cover all processors. AVX2, AVX-512 and NEON round a product and its sum once. SSE4.2
//! rounds twice and keeps its speed. SSE2 uses these functions. Every x86 processor has SSE2 and can
//! therefore replay any recording, about fifty times slower. Processors with nothing beyond SSE2, built
//! before 2011, use these functions in the loop as well; forces then take 5 us.
//!
//! Algorithm 9 of Graillat and Muller (Numerische Mathematik 2025, doi 10.1007/s00211-025-01487-2) with
//! Dekker's product:
//!
//! | step | result |
//! | --- | --- |
//! | `p + e = a b` | exact, by halves of the factors |
//! | `s + r = p + c` | exact |
//! | `v + w = e + r` | exact |
//! | `s + v` | `a b + c` rounded once, unless `w != 0` and `v` is `2^k` or `3 2^k` |
//!
//! In the exceptional case `v` alone decides a tie that `w` should break. `v` is then changed by an eighth of
//! itself in the direction of `w`.
//!
//! `libm::fma` has the same bits, but chooses its code through a function pointer at run time, which the proof
//! on the machine code of the loop does not follow.
//!
//! Range: identical to the instruction if `a b` and `c` are zero or from 1e-280 to 1e280, and if the result
//! is not finite. Outside this range the error is two roundings.

use fearless_simd::Simd;

use super::machine::has_native_arithmetic;

/// Whether the lanes use the processor's own multiplication and addition. It is a constant in the dispatched
/// function.
#[inline(always)]
pub(super) fn is_native<S: Simd>(simd: S) -> bool {
    has_native_arithmetic(simd.level())
}

/// Factor `2^27 + 1` that splits the 53 bits of a number into two halves.
const HALVING: f64 = 134_217_729.0;

/// Bits of the fraction except the first; all zero for `2^k` and `3 2^k`.
const REST_OF_FRACTION: u64 = (1 << 51) - 1;

const SIGN: u64 = 1 << 63;

/// Upper 26 bits of a number, and the rest.
#[inline(always)]
fn halves(a: f64) -> (f64, f64) {
    let scaled = a * HALVING;
    let upper = scaled - (scaled - a);
    (upper, a - upper)
}

/// Product `a b` and its rounding error.
#[inline(always)]
fn product(a: f64, b: f64) -> (f64, f64) {
    let ((a_upper, a_lower), (b_upper, b_lower)) = (halves(a), halves(b));
    let p = a * b;
    let error = (a_upper * b_upper - p) + a_upper * b_lower + a_lower * b_upper + a_lower * b_lower;
    (p, error)
}

/// Sum `a + b` and its rounding error.
#[inline(always)]
fn sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let of_b = s - a;
    (s, (a - (s - of_b)) + (b - of_b))
}

/// `a b + c` in each lane, rounded once. Not inlined, because the model has hundreds of calls.
#[inline(never)]
pub(super) fn mul_add<const LANES: usize>(
    a: &[f64; LANES],
    b: &[f64; LANES],
    c: &[f64; LANES],
) -> [f64; LANES] {
    let mut results = [0.0; LANES];
    for (((result, a), b), c) in results.iter_mut().zip(a).zip(b).zip(c) {
        let (p, e) = product(*a, *b);
        let (s, r) = sum(p, *c);
        let (v, w) = sum(e, r);
        let is_tie = (v.to_bits() & REST_OF_FRACTION == 0) & (w != 0.0);
        let is_opposed = (v.to_bits() ^ w.to_bits()) & SIGN != 0;
        let decided = v * if is_opposed { 0.875 } else { 1.125 };
        let v = if is_tie { decided } else { v };
        // Adding two zeros would lose the sign.
        let once = if v == 0.0 { s } else { s + v };
        // For results that are not finite, halves and errors are NaN.
        *result = if once.is_finite() { once } else { a * b + c };
    }
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random number: sign, exponent, few or many bits.
    fn number(state: &mut u64) -> f64 {
        let mut next = || {
            *state ^= *state << 13;
            *state ^= *state >> 7;
            *state ^= *state << 17;
            *state
        };
        let exponent = 1023 - 30 + next() % 60;
        let kept = next() % 53;
        let fraction = (next() >> 12) & (u64::MAX << kept);
        let zero = next() % 50 == 0;
        let sign = next() & SIGN;
        f64::from_bits(sign | if zero { 0 } else { exponent << 52 | fraction })
    }

    #[test]
    fn all_bits_are_those_of_one_rounding() {
        let mut state = 0x2545_f491_4f6c_dd1d;
        let mut rounded_twice = 0;
        for k in 0..200_000 {
            let [a, b, mut c]: [[f64; 8]; 3] =
                core::array::from_fn(|_| core::array::from_fn(|_| number(&mut state)));
            if k % 2 == 0 {
                // Nearly the product: the result is its rounding error plus a few units.
                c = core::array::from_fn(|lane| {
                    let units = f64::from((state >> (8 * lane) & 3) as u8);
                    -a[lane] * b[lane] * (1.0 + units * f64::EPSILON)
                });
            }
            let expected: [f64; 8] = core::array::from_fn(|lane| a[lane].mul_add(b[lane], c[lane]));
            let found = mul_add(&a, &b, &c);
            assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "{a:?} {b:?} {c:?}");
            rounded_twice += (0..8).filter(|lane| a[*lane] * b[*lane] + c[*lane] != expected[*lane]).count();
        }
        assert!(rounded_twice > 100_000, "{rounded_twice}");
    }

    /// `1 + 2^-53 - 2^-106`: above the tie by `v`, below it by `w`.
    #[test]
    fn a_tie_is_broken_by_the_last_error() {
        let half_unit = 0.5 * f64::EPSILON;
        for tiny in [half_unit * half_unit, -half_unit * half_unit] {
            // (1 + x)(half_unit) + 1 with small x, in both directions.
            let a = [half_unit; 8];
            let b = [1.0 + tiny.signum() * f64::EPSILON; 8];
            let expected = half_unit.mul_add(b[0], 1.0);
            assert_eq!(mul_add(&a, &b, &[1.0; 8]), [expected; 8]);
        }
    }

    #[test]
    fn what_is_not_finite_stays_so() {
        let [inf, nan] = [f64::INFINITY, f64::NAN];
        let a = [inf, -inf, nan, 1.0, 1e300, -0.0, 0.0, 1e200];
        let b = [2.0, 2.0, 1.0, 3.0, 1e300, 1.0, -1.0, -1e200];
        let c = [1.0, inf, 1.0, -inf, 1.0, -0.0, 0.0, 1.0];
        for (lane, found) in mul_add(&a, &b, &c).into_iter().enumerate() {
            let expected = a[lane].mul_add(b[lane], c[lane]);
            assert!(found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(), "{lane}");
        }
    }
}
