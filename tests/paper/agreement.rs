//! The oracle itself: it agrees with the vectors, with the mass matrix as well as with the recursion of Newton and Euler.

use super::vectors::{ROUNDING, exact, load, no_spin};
use super::*;

#[test]
fn the_equations_agree_with_every_vector_with_spin_and_without() {
    for name in MACHINES {
        let case = load(name);
        case.error(&EXACT, exact).assert_within(ROUNDING, name);
        case.error(&PAPER, no_spin).assert_within(ROUNDING, &format!("{name} without spin"));
    }
}

#[test]
fn the_mass_matrix_is_newton_euler_for_one_acceleration_after_another() {
    let case = load("scattered");
    for (form, row) in [EXACT, PAPER].iter().flat_map(|form| case.rows.iter().map(move |row| (form, row))) {
        for leg in legs(&case.machine, &platform(&row.state)) {
            let joint = joint(&leg, form);
            let dense = Dense::new(&case.machine, &leg, &joint);
            let gravity = leg.axes.tr_mul(&case.machine.gravity);
            let at = |accel: Vector3<f64>| dense.newton_euler(&joint, &accel, &gravity);
            let rest = at(Vector3::zeros());
            let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|unit| at(unit) - rest);
            let m = dense.mass_matrix();
            assert!((m - Matrix3::from_columns(&columns)).amax() < 1e-11 * m.amax());
            assert!((m - m.transpose()).amax() < 1e-14 * m.amax());
            assert!(m.cholesky().is_some());
        }
    }
}
