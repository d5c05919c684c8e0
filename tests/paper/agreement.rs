//! The oracle itself: it agrees with the vectors, and its matrices are what they say they are.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::common::MACHINES;
use super::common::paper::dense::Dense;
use super::common::paper::form::{EXACT, Form, PAPER};
use super::common::paper::kinematics::{Leg, State, joint, legs, platform};
use super::vectors::{Case, ROUNDING, exact, load, no_spin};

#[test]
fn the_corrected_equations_agree_with_every_vector() {
    for name in MACHINES {
        let case = load(name);
        case.error(&EXACT, exact).assert_within(ROUNDING, name);
    }
}

#[test]
fn the_paper_without_spin_agrees_with_every_vector_without_spin() {
    for name in MACHINES {
        let case = load(name);
        case.error(&PAPER, no_spin).assert_within(ROUNDING, &format!("{name} without spin"));
    }
}

fn each_leg(case: &Case, form: &Form, mut check: impl FnMut(&State, usize, &Leg, &Dense)) {
    for row in &case.rows {
        for (i, leg) in legs(&case.machine, &platform(&row.state)).iter().enumerate() {
            check(&row.state, i, leg, &Dense::new(&case.machine, leg, &joint(leg, form)));
        }
    }
}

/// V of both links by differences of where they are, leg axes: no joint coordinate is used.
fn velocity_by_differences(case: &Case, state: &State, i: usize) -> SVector<f64, 12> {
    let h = 1e-4;
    let at = |t: f64| legs(&case.machine, &platform(&state.after(t)))[i];
    let (before, now, after) = (at(-h), at(0.0), at(h));
    let turned: Matrix3<f64> = now.axes.transpose() * (after.axes - before.axes) / (2.0 * h);
    let angular =
        Vector3::new(turned.m32 - turned.m23, turned.m13 - turned.m31, turned.m21 - turned.m12) / 2.0;
    let center = |leg: &Leg| leg.ends[1] - leg.axes.column(0) * case.machine.rod.center_of_mass;
    let linear = now.axes.tr_mul(&(center(&after) - center(&before))) / (2.0 * h);
    let parts = [angular, Vector3::zeros(), angular, linear];
    SVector::from_iterator(parts.iter().flat_map(|part| part.iter().copied()))
}

#[test]
fn propagation_of_joint_rates_gives_the_velocities_of_the_links() {
    for name in ["scattered", "fried2008"] {
        let case = load(name);
        each_leg(&case, &EXACT, |state, i, leg, dense| {
            let rate = joint(leg, &EXACT).rate;
            let v = dense.p.transpose().try_inverse().unwrap() * dense.h * rate;
            let measured = velocity_by_differences(&case, state, i);
            assert!((v - measured).amax() < 1e-6, "{name}: {v} {measured}");
            // What the joints do not allow does not happen.
            assert!((dense.w.transpose() * dense.p.transpose() * measured).amax() < 1e-6, "{name}");
            // J_B takes the joint rates to the motion of B.
            assert!((dense.jacobian_linear() * rate - leg.velocity).amax() < 1e-14, "{name}");
        });
    }
}

#[test]
fn h_and_w_are_orthogonal_complements() {
    for form in [EXACT, PAPER] {
        each_leg(&load("scattered"), &form, |_, _, _, dense| {
            assert!((dense.h.transpose() * dense.w).amax() < 1e-14);
            assert!((dense.h.transpose() * dense.h - Matrix3::identity()).amax() < 1e-14);
            assert!((dense.w.transpose() * dense.w - SMatrix::<f64, 9, 9>::identity()).amax() < 1e-14);
        });
    }
}

#[test]
fn the_mass_matrix_is_newton_euler_for_one_acceleration_after_another() {
    for form in [EXACT, PAPER] {
        let case = load("scattered");
        each_leg(&case, &form, |_, _, leg, dense| {
            let joint = joint(leg, &form);
            let gravity = leg.axes.tr_mul(&case.machine.gravity);
            let at = |accel: Vector3<f64>| dense.newton_euler(&joint, &accel, &gravity);
            let rest = at(Vector3::zeros());
            let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|unit| at(unit) - rest);
            let m = dense.mass_matrix();
            assert!((m - Matrix3::from_columns(&columns)).amax() < 1e-11 * m.amax());
            assert!((m - m.transpose()).amax() < 1e-14 * m.amax());
            assert!(m.cholesky().is_some());
        });
    }
}
