//! From task coordinates to the joints of a leg (paper, eq. 1-5, 13-27, 37-45).
//!
//! ```text
//! R    = Rx(alpha) Ry(beta) Rz(gamma)      omega = E phi'      omega' = E phi'' + E' phi'           (1)
//! R_b  = R_u Ry(beta) Rz(gamma)            leg axes in base axes; x along the leg, R_u's y axis is u  (2)
//! w    = R_b^T v_B = J_Bv q'               J_Bv = x (d theta)^T - L~ H_w                           (25)
//! q'   = J_Bv^-1 w                         w' = R_b^T (a_B - omega_leg x v_B)                  (37), (39)
//! q''  = J_Bv^-1 (w' - J_Bv' q')                                                              (43), (45)
//! ```
//!
//! `H_w` takes the joint rates q' = [beta' gamma' theta'] to the leg's angular velocity in leg axes.
//! Undefined where the leg is along u: cos(gamma) = 0.

use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};

use super::form::{Form, LastTerm, Rates};
use super::machine::Machine;

/// X, X', X''.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub x: Vector6<f64>,
    pub xd: Vector6<f64>,
    pub xdd: Vector6<f64>,
}

impl State {
    /// Along the path with constant X''.
    pub fn after(&self, t: f64) -> Self {
        Self { x: self.x + self.xd * t + self.xdd * (0.5 * t * t), xd: self.xd + self.xdd * t, xdd: self.xdd }
    }
}

/// Motion of the mobile platform, base axes.
#[derive(Clone, Copy, Debug)]
pub struct Platform {
    pub rotation: Matrix3<f64>,
    pub position: Vector3<f64>,
    pub omega: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub omega_rate: Vector3<f64>,
    pub accel: Vector3<f64>,
}

/// (1) and its derivatives.
pub fn platform(state: &State) -> Platform {
    let part = |v: &Vector6<f64>, at: usize| Vector3::from(v.fixed_rows::<3>(at));
    let (angle, rate, second) = (part(&state.x, 0), part(&state.xd, 0), part(&state.xdd, 0));
    let rx = rotation(Vector3::x_axis(), angle.x);
    let rx_ry = rx * rotation(Vector3::y_axis(), angle.y);
    let (e1, e2, e3) = (Vector3::x(), Vector3::from(rx.column(1)), Vector3::from(rx_ry.column(2)));
    let e = Matrix3::from_columns(&[e1, e2, e3]);
    let e2_rate = (e1 * rate.x).cross(&e2);
    let e3_rate = (e1 * rate.x + e2 * rate.y).cross(&e3);
    let e_rate = Matrix3::from_columns(&[Vector3::zeros(), e2_rate, e3_rate]);
    Platform {
        rotation: rx_ry * rotation(Vector3::z_axis(), angle.z),
        position: part(&state.x, 3),
        omega: e * rate,
        velocity: part(&state.xd, 3),
        omega_rate: e * second + e_rate * rate,
        accel: part(&state.xdd, 3),
    }
}

/// A leg's pose, and the velocity and acceleration of its end B.
#[derive(Clone, Copy, Debug)]
pub struct Leg {
    /// R_b.
    pub axes: Matrix3<f64>,
    /// The second angle of the universal joint.
    pub gamma: f64,
    pub length: f64,
    /// b = R CB, base axes.
    pub arm: Vector3<f64>,
    /// A and B, base axes.
    pub ends: [Vector3<f64>; 2],
    /// R_b^T v_B
    pub velocity: Vector3<f64>,
    /// R_b^T a_B
    pub accel: Vector3<f64>,
}

/// (2)-(5) for the six legs.
pub fn legs(machine: &Machine, p: &Platform) -> [Leg; 6] {
    machine.joints.map(|joints| {
        let arm = p.rotation * joints.platform;
        let end = p.position + arm;
        let s = end - joints.base;
        let from_universal = universal_frame(&joints.universal_axis);
        // n = R_u [cos beta cos gamma, sin gamma, -sin beta cos gamma]
        let n = from_universal.tr_mul(&s) / s.norm();
        let (beta, gamma) = ((-n.z).atan2(n.x), n.y.atan2(n.x.hypot(n.z)));
        let axes = from_universal * rotation(Vector3::y_axis(), beta) * rotation(Vector3::z_axis(), gamma);
        let velocity = p.velocity + p.omega.cross(&arm);
        let accel = p.accel + p.omega_rate.cross(&arm) + p.omega.cross(&p.omega.cross(&arm));
        Leg {
            axes,
            gamma,
            length: s.norm(),
            arm,
            ends: [joints.base, end],
            velocity: axes.tr_mul(&velocity),
            accel: axes.tr_mul(&accel),
        }
    })
}

/// Joint coordinates' rates, in the sense of a [`Rates`].
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// q' = [beta' gamma' theta']
    pub rate: Vector3<f64>,
    /// q''
    pub accel: Vector3<f64>,
    /// H_w: q' to the leg's angular velocity in leg axes.
    pub angular: Matrix3<f64>,
    /// H_w'
    pub angular_rate: Matrix3<f64>,
}

impl Joint {
    /// Angular velocity of the leg, leg axes.
    pub fn omega(&self) -> Vector3<f64> {
        self.angular * self.rate
    }
}

/// (37)-(45) of one leg.
pub fn joint(leg: &Leg, form: &Form) -> Joint {
    let printed = Matrix3::new(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    if form.rates == Rates::Angular {
        let omega = tilde_x(leg.length) * leg.velocity / leg.length.powi(2);
        let (omega_rate, length_accel) = angular_acceleration(leg, &omega, form.last_term);
        return Joint {
            rate: Vector3::new(omega.y, omega.z, leg.velocity.x),
            accel: Vector3::new(omega_rate.y, omega_rate.z, length_accel),
            angular: printed,
            angular_rate: Matrix3::zeros(),
        };
    }
    let (sin, cos) = leg.gamma.sin_cos();
    // The first axis, u, in leg axes; the second is their z axis.
    let angular = Matrix3::new(sin, 0.0, 0.0, cos, 0.0, 0.0, 0.0, 1.0, 0.0);
    let along = Vector3::x() * Vector3::z().transpose();
    let jacobian = along - tilde_x(leg.length) * angular;
    let inverse = jacobian.try_inverse().unwrap();
    let rate = inverse * leg.velocity;
    let angular_rate = Matrix3::new(cos, 0.0, 0.0, -sin, 0.0, 0.0, 0.0, 0.0, 0.0) * rate.y;
    let jacobian_rate = -tilde_x(rate.z) * angular - tilde_x(leg.length) * angular_rate;
    let relative = leg.accel - (angular * rate).cross(&leg.velocity);
    let accel = inverse * (relative - jacobian_rate * rate);
    if form.rates == Rates::EulerAsAngular {
        return Joint { rate, accel, angular: printed, angular_rate: Matrix3::zeros() };
    }
    Joint { rate, accel, angular, angular_rate }
}

/// (43), (45) in leg axes: the leg's angular acceleration and theta'', without spin.
///
/// (37) is `omega = L~ w / L^2`. Its derivative in leg axes is `L~ w' / L^2 - L'~ w / L^2`, and by
/// `w = L' - L~ omega` (L and L' along x) the second term is `+ L'~ L~ omega / L^2`: it is
/// `-J_Bv^-1 J_Bv'` applied to the angular velocity, that is `-(L' / L) omega`.
pub fn angular_acceleration(leg: &Leg, omega: &Vector3<f64>, last: LastTerm) -> (Vector3<f64>, f64) {
    let relative = leg.accel - omega.cross(&leg.velocity);
    let last_term = tilde_x(leg.velocity.x) * tilde_x(leg.length) * omega / leg.length.powi(last.power);
    let first_term = tilde_x(leg.length) * relative / leg.length.powi(2);
    (first_term + last_term * last.sign, relative.x)
}

/// `[value 0 0]~`
pub fn tilde_x(value: f64) -> Matrix3<f64> {
    Vector3::new(value, 0.0, 0.0).cross_matrix()
}

fn rotation(axis: nalgebra::Unit<Vector3<f64>>, angle: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(&axis, angle).into_inner()
}

/// R_u: axes fixed in the base with u as y axis; the identity for the paper's `u = [0 1 0]`.
fn universal_frame(u: &Vector3<f64>) -> Matrix3<f64> {
    let other = if u.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = (other - u * u.dot(&other)).normalize();
    Matrix3::from_columns(&[x, *u, x.cross(u)])
}
