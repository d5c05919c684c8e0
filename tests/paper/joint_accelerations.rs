//! From X, X', X'' to the joint accelerations, with each velocity term: where the paper has (46)-(52) and (54).
//!
//! Their print is not at hand. Between their neighbours, (25)-(45) and (53), these quantities are needed, and the paper's letters for
//! them are R_abg, dB/dt and A_i. They are tested by what they do, each by a second derivation and by differences:
//!
//! ```text
//! omega = R_abg phi'            R_abg = [ x   Rx y   Rx Ry z ]            angle rates to angular velocity
//! v_B   = B q'                  B     = R_b J_Bv                          joint rates to the velocity of B, base axes
//! v_B   = T X'                  T     = [ -b~ R_abg   U ]                 task rates to the same
//! q''   = B^-1 T X'' + A_i      A_i   = B^-1 (T' X' - B' q')              acceleration of the joints for X'' = 0
//! ```
//!
//! Both derivations agree to 3e-15 for every leg of every vector of the ten machines.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::vectors::{Case, ROUNDING, load};
use hexad_support::paper::form::EXACT;
use hexad_support::paper::kinematics::{Leg, State, joint, legs, platform, tilde_x};
use hexad_support::{Errors, MACHINES};

/// Relative error of differences over [`STEP_S`]; measured 1.3e-5.
const DIFFERENCES: f64 = 5e-5;
const STEP_S: f64 = 1e-4;

/// Every leg of every row of every machine.
fn each_leg(mut check: impl FnMut(&Case, &State, usize, &Leg)) {
    for name in MACHINES {
        let case = load(name);
        for row in &case.rows {
            for (i, leg) in legs(&case.machine, &platform(&row.state)).iter().enumerate() {
                check(&case, &row.state, i, leg);
            }
        }
    }
}

/// A leg at an earlier and at a later instant of the path with constant X''.
fn neighbours(case: &Case, state: &State, i: usize) -> [Leg; 2] {
    [-STEP_S, STEP_S].map(|t| legs(&case.machine, &platform(&state.after(t)))[i])
}

/// B and dB/dt, base axes, by the product rule: `B' = R_b (omega~ J_Bv + J_Bv')`.
fn map_of_joint_rates(leg: &Leg) -> [Matrix3<f64>; 2] {
    let joint = joint(leg, &EXACT);
    let along = Vector3::x() * Vector3::z().transpose();
    let jacobian = along - tilde_x(leg.length) * joint.angular;
    let rate = -tilde_x(joint.rate.z) * joint.angular - tilde_x(leg.length) * joint.angular_rate;
    [leg.axes * jacobian, leg.axes * (joint.omega().cross_matrix() * jacobian + rate)]
}

/// R_abg and its derivative, written out in sines and cosines.
fn map_of_angle_rates(state: &State) -> [Matrix3<f64>; 2] {
    let ((sa, ca), (sb, cb)) = (state.x[0].sin_cos(), state.x[1].sin_cos());
    let (a, b) = (state.xd[0], state.xd[1]);
    let map = Matrix3::new(1.0, 0.0, sb, 0.0, ca, -sa * cb, 0.0, sa, ca * cb);
    let rate = [cb * b, -ca * cb * a + sa * sb * b, -sa * cb * a - ca * sb * b];
    [map, Matrix3::new(0.0, 0.0, rate[0], 0.0, -sa * a, rate[1], 0.0, ca * a, rate[2])]
}

#[test]
fn angle_rates_give_the_angular_velocity_and_its_derivative() {
    let (mut rounding, mut differences) = (Errors::default(), Errors::default());
    each_leg(|_, state, _, _| {
        let p = platform(state);
        let [map, map_rate] = map_of_angle_rates(state);
        let [rate, accel] = [state.xd, state.xdd].map(|x| Vector3::from(x.fixed_rows::<3>(0)));
        rounding.add((map * rate - p.omega).norm() / p.omega.norm());
        rounding.add((map * accel + map_rate * rate - p.omega_rate).norm() / p.omega_rate.norm());
        // R' = omega~ R
        let [before, after] = [-STEP_S, STEP_S].map(|t| platform(&state.after(t)).rotation);
        let turning = (after - before) / (2.0 * STEP_S) * p.rotation.transpose();
        differences.add((turning - p.omega.cross_matrix()).norm() / p.omega.norm());
    });
    rounding.assert_within(ROUNDING, "R_abg");
    differences.assert_within(DIFFERENCES, "R_abg, differences");
}

/// The second derivation: B is at `theta n`, and its second partial derivatives by the joint coordinates are products of axes.
#[test]
fn joint_rates_give_the_velocity_of_b_and_the_map_its_derivative() {
    let (mut rounding, mut differences) = (Errors::default(), Errors::default());
    each_leg(|case, state, i, leg| {
        let [map, map_rate] = map_of_joint_rates(leg);
        let joint = joint(leg, &EXACT);
        let [n, y, z] = [0, 1, 2].map(|axis| Vector3::from(leg.axes.column(axis)));
        let u = n * leg.gamma.sin() + y * leg.gamma.cos();
        let turned = u.cross(&n);
        let partials = Matrix3::from_columns(&[turned * leg.length, z.cross(&n) * leg.length, n]);
        let seconds = [
            [u.cross(&turned) * leg.length, u.cross(&y) * leg.length, turned],
            [u.cross(&y) * leg.length, -n * leg.length, y],
            [turned, y, Vector3::zeros()],
        ];
        let column = |row: &[Vector3<f64>; 3]| Matrix3::from_columns(row) * joint.rate;
        let expected = Matrix3::from_columns(&seconds.each_ref().map(column));
        rounding.add((map - partials).norm() / map.norm());
        rounding.add((map * joint.rate - leg.axes * leg.velocity).norm() / leg.velocity.norm());
        rounding.add((map_rate - expected).norm() / expected.norm());
        let [before, after] = neighbours(case, state, i).map(|leg| map_of_joint_rates(&leg)[0]);
        differences.add(((after - before) / (2.0 * STEP_S) - map_rate).norm() / expected.norm());
    });
    rounding.assert_within(ROUNDING, "B, dB/dt");
    differences.assert_within(DIFFERENCES, "dB/dt, differences");
}

/// q' and q'' by derivatives of spherical coordinates, without matrices of joints: `tan(beta) = -z / x`,
/// `tan(gamma) = y / rho` with `rho^2 = x^2 + z^2`, in axes with u as y axis.
fn of_spherical_coordinates(leg: &Leg) -> [Vector3<f64>; 2] {
    // x along rho: the leg is [rho y 0], so beta turns it by -z.
    let (sin, cos) = leg.gamma.sin_cos();
    let flat = |v: &Vector3<f64>| Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
    let [v, a] = [flat(&leg.velocity), flat(&leg.accel)];
    let (l, rho, y) = (leg.length, leg.length * cos, leg.length * sin);
    let beta = -v.z / rho;
    let rho_accel = a.x + v.z * v.z / rho;
    let gamma = (v.y * rho - y * v.x) / (l * l);
    let length = (rho * v.x + y * v.y) / l;
    let rate = Vector3::new(beta, gamma, length);
    let accel = Vector3::new(
        -(a.z + 2.0 * v.x * beta) / rho,
        (a.y * rho - y * rho_accel - 2.0 * l * length * gamma) / (l * l),
        (v.x * v.x + rho * rho_accel + v.y * v.y + y * a.y - length * length) / l,
    );
    [rate, accel]
}

#[test]
fn joint_accelerations_are_linear_in_task_accelerations_beside_their_velocity_term() {
    let (mut rounding, mut differences) = (Errors::default(), Errors::default());
    each_leg(|case, state, i, leg| {
        let p = platform(state);
        let ([angles, angles_rate], [map, map_rate]) = (map_of_angle_rates(state), map_of_joint_rates(leg));
        let (arm, inverse) = (leg.arm.cross_matrix(), map.try_inverse().unwrap());
        let arm_rate = p.omega.cross(&leg.arm).cross_matrix();
        let task = |angular: Matrix3<f64>, linear: Matrix3<f64>| {
            SMatrix::<f64, 3, 6>::from_fn(|row, column| match column {
                0..3 => angular[(row, column)],
                _ => linear[(row, column - 3)],
            })
        };
        let task_map = task(-arm * angles, Matrix3::identity());
        let task_map_rate = task(-arm_rate * angles - arm * angles_rate, Matrix3::zeros());
        let rate = inverse * task_map * state.xd;
        let velocity_term = inverse * (task_map_rate * state.xd - map_rate * rate);
        let accel = inverse * task_map * state.xdd + velocity_term;

        let [spherical_rate, spherical_accel] = of_spherical_coordinates(leg);
        let joint = joint(leg, &EXACT);
        let scale = accel.norm() + velocity_term.norm();
        for (rate_of, accel_of) in [(joint.rate, joint.accel), (spherical_rate, spherical_accel)] {
            rounding.add((rate - rate_of).norm() / rate.norm());
            rounding.add((accel - accel_of).norm() / scale);
        }
        let [before, after] = neighbours(case, state, i);
        let angle = |leg: &Leg| Vector3::new(0.0, leg.gamma, leg.length);
        let mut second = (angle(&after) - angle(leg) * 2.0 + angle(&before)) / (STEP_S * STEP_S);
        // beta from axis to axis: it has no zero of its own.
        let turn = |from: &Leg, to: &Leg| {
            let [from, to] = [from, to].map(|leg| Vector3::from(leg.axes.column(2)));
            let u = leg.axes * Vector3::new(leg.gamma.sin(), leg.gamma.cos(), 0.0);
            from.cross(&to).dot(&u).atan2(from.dot(&to))
        };
        second.x = (turn(leg, &after) - turn(&before, leg)) / (STEP_S * STEP_S);
        differences.add((second - accel).norm() / scale);
    });
    rounding.assert_within(ROUNDING, "q''");
    differences.assert_within(DIFFERENCES, "q'', differences");
}
