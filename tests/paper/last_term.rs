//! Item 2: the last term of (43), (45), the leg's angular acceleration from the motion of B.
//!
//! ```text
//! (37)   omega  = R_b L~ R_b^T v_B / L^2
//! d/dt   omega' = R_b L~ R_b^T (a_B - omega x v_B) / L^2  +  R_b L'~ L~ R_b^T omega / L^2
//! ```
//!
//! L and L' stand for the vectors `[L 0 0]`, `[L' 0 0]` where they wear a tilde. The last term is
//! `-J_Bv^-1 J_Bv'` on the angular velocity. It is an acceleration only with `L^2`: any other power gives
//! another motion in another unit of length. How the print is wrong beyond its units is not known here, so
//! the two nearest powers and the opposite sign stand for it.

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::common::paper::dense::Dense;
use super::common::paper::force::forces;
use super::common::paper::form::{Form, LastTerm, PAPER};
use super::common::paper::kinematics::{Leg, State, angular_acceleration, joint, legs, platform, tilde_x};
use super::common::paper::machine::Machine;
use super::errata::{assert_printed_fails, assert_worth, every_leg};
use super::vectors::{ROUNDING, errors, load, no_spin};

const RIGHT: LastTerm = LastTerm { sign: 1.0, power: 2 };
const OPPOSITE: LastTerm = LastTerm { sign: -1.0, power: 2 };
const LENGTH: LastTerm = LastTerm { sign: 1.0, power: 1 };
const CUBED: LastTerm = LastTerm { sign: 1.0, power: 3 };

#[test]
fn item_2_last_term_of_43_and_45() {
    let with = |last_term| Form { last_term, ..PAPER };
    let stated = [
        ("fried2008", [2.32e-3, 3.38e-3, 1.69e-2]),
        ("tsai2000", [5.43e-4, 8.13e-4, 4.61e-3]),
        ("tabletop", [1.03e-4, 1.67e-4, 1.05e-3]),
    ];
    assert_printed_fails("2: L instead of L^2", [with(LENGTH), PAPER], no_spin, &stated);
    let stated = [
        ("fried2008", [1.87e-3, 2.71e-3, 1.31e-2]),
        ("tsai2000", [4.09e-4, 6.13e-4, 3.34e-3]),
        ("tabletop", [1.07e-3, 1.72e-3, 1.04e-2]),
    ];
    assert_printed_fails("2: L^3 instead of L^2", [with(CUBED), PAPER], no_spin, &stated);
    let stated = [
        ("fried2008", [2.28e-2, 3.27e-2, 1.63e-1]),
        ("tsai2000", [3.81e-3, 5.84e-3, 4.43e-2]),
        ("tabletop", [2.28e-4, 3.70e-4, 2.33e-3]),
    ];
    assert_printed_fails("2: opposite sign", [with(OPPOSITE), PAPER], no_spin, &stated);
}

#[test]
fn item_2_the_corrected_last_term_is_the_derivative_of_37() {
    let case = load("fried2008");
    let omega = |leg: &Leg| tilde_x(leg.length) * leg.velocity / leg.length.powi(2);
    let error = |last: LastTerm| {
        let values = every_leg(&case, |row, i, leg| {
            let h = 1e-5;
            let in_base = |t: f64| {
                let leg = legs(&case.machine, &platform(&row.state.after(t)))[i];
                leg.axes * omega(&leg)
            };
            let measured = leg.axes.tr_mul(&((in_base(h) - in_base(-h)) / (2.0 * h)));
            let (ours, _) = angular_acceleration(leg, &omega(leg), last);
            (ours - measured).norm()
        });
        errors(values)
    };
    let right = error(RIGHT);
    right.assert_within(1e-7, "derivative of (37)");
    let wrong = error(OPPOSITE);
    assert_worth("2: opposite sign, rad/s^2", "fried2008", wrong, [5.79e-1, 7.46e-1, 2.77e0]);
    let wrong = error(LENGTH);
    assert_worth("2: L instead of L^2, rad/s^2", "fried2008", wrong, [5.64e-2, 7.57e-2, 3.22e-1]);
}

#[test]
fn item_2_the_corrected_last_term_is_the_derivative_of_the_inverse_jacobian() {
    let case = load("fried2008");
    every_leg(&case, |_, _, leg| {
        let h = 1e-3;
        let at = |t: f64| {
            let later = Leg { length: leg.length + leg.velocity.x * t, ..*leg };
            Dense::new(&case.machine, &later, &joint(&later, &PAPER)).jacobian_linear()
        };
        // J_Bv is linear in L, so this difference is exact but for rounding.
        let jacobian_rate = (at(h) - at(-h)) / (2.0 * h);
        let mapping: Matrix3<f64> = -at(0.0).try_inverse().unwrap() * jacobian_rate;
        let term = tilde_x(leg.velocity.x) * tilde_x(leg.length) / leg.length.powi(2);
        let rotations: Matrix2<f64> = mapping.fixed_view::<2, 2>(0, 0) - term.fixed_view::<2, 2>(1, 1);
        assert!(rotations.amax() < 1e-12, "{mapping} {term}");
        let transverse = Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0));
        assert!((term + transverse * (leg.velocity.x / leg.length)).amax() < 1e-14);
    });
}

/// The same machine with millimetres for metres: forces come out in mN.
fn in_millimetres(machine: &Machine) -> Machine {
    let mut scaled = machine.clone();
    scaled.gravity *= 1e3;
    scaled.platform.center_of_mass *= 1e3;
    scaled.platform.inertia *= 1e6;
    for joints in &mut scaled.joints {
        joints.base *= 1e3;
        joints.platform *= 1e3;
    }
    for link in [&mut scaled.cylinder, &mut scaled.rod] {
        link.center_of_mass *= 1e3;
        link.axial_inertia *= 1e6;
        link.transverse_inertia.constant *= 1e6;
        link.transverse_inertia.reference_length *= 1e3;
    }
    scaled.drive.coulomb_friction *= 1e3;
    scaled
}

#[test]
fn item_2_only_the_corrected_last_term_does_not_depend_on_the_unit_of_length() {
    let case = load("fried2008");
    let machine = in_millimetres(&case.machine);
    let difference = |last_term: LastTerm| {
        let form = Form { last_term, ..PAPER };
        errors(case.rows.iter().flat_map(|row| {
            let mut state: State = row.state;
            for part in [&mut state.x, &mut state.xd, &mut state.xdd] {
                part.fixed_rows_mut::<3>(3).scale_mut(1e3);
            }
            let metres = forces(&case.machine, &row.state, &form);
            let millimetres = forces(&machine, &state, &form) / 1e3;
            <[f64; 6]>::from((millimetres - metres) / row.no_spin.amax())
        }))
    };
    assert!(difference(RIGHT).max < ROUNDING);
    assert_worth("2: L, millimetres for metres", "fried2008", difference(LENGTH), [1.37e1, 1.956e1, 9.72e1]);
    assert_worth(
        "2: L^3, millimetres for metres",
        "fried2008",
        difference(CUBED),
        [9.55e-3, 1.373e-2, 6.85e-2],
    );
}
