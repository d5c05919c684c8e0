//! From the legs and the platform to the active forces, and the energy they change (paper, eq. 9, 87-97).
//!
//! ```text
//! J^-1  = rows [ (n_i x BiC)^T  n_i^T ], legs 6..1                                           (9)
//! phi_i = -J_Bv^-T D_i + n_i Gamma_i                 force of leg i on the platform          (87)
//! F     = [ I_C omega' + omega x I_C omega + m c x (v' - g) ;
//!           m (v' + omega' x c + omega x (omega x c) - g) ]     c = CG, torque about C       (88)-(93)
//! Gamma = J^T (F + sum_i [ b_i~ ; U ] J_Bv^-T D_i)   legs 6..1                               (97)
//! ```
//!
//! The drives' own share (reflected mass, friction) is not in the paper; the vectors include it.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::dense::Dense;
use super::form::{EXACT, Form};
use super::kinematics::{Leg, Platform, State, joint, legs, platform};
use super::machine::Machine;

/// Gamma with the drives' share, legs 1..6 \[N\].
pub fn forces(machine: &Machine, state: &State, form: &Form) -> Vector6<f64> {
    let p = platform(state);
    let legs = legs(machine, &p);
    let mut wrench = platform_wrench(machine, &p, form);
    for leg in &legs {
        wrench += at_c(&leg.arm, &end_load(machine, leg, form));
    }
    // Gamma = J^T wrench, by solving with J^-T.
    let reversed = inverse_jacobian(&legs).transpose().lu().solve(&wrench).unwrap();
    let gamma = Vector6::from_iterator(reversed.iter().rev().copied());
    gamma + drives(machine, &legs)
}

/// (9): rows from leg 6 to leg 1.
pub fn inverse_jacobian(legs: &[Leg; 6]) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    for (mut row, leg) in matrix.row_iter_mut().zip(legs.iter().rev()) {
        let n = Vector3::from(leg.axes.column(0));
        let moment = n.cross(&-leg.arm);
        row.copy_from(&Vector6::from_iterator(moment.iter().chain(&n).copied()).transpose());
    }
    matrix
}

/// `J_Bv^-T D` in base axes: what moves the leg, at its end B, Gamma included.
fn end_load(machine: &Machine, leg: &Leg, form: &Form) -> Vector3<f64> {
    let joint = joint(leg, form);
    let dense = Dense::new(machine, leg, &joint);
    let d = dense.load(&joint, &leg.axes.tr_mul(&machine.gravity), form);
    leg.axes * dense.jacobian_linear().transpose().lu().solve(&d).unwrap()
}

/// `[ b~ ; U ] f`
pub fn at_c(b: &Vector3<f64>, f: &Vector3<f64>) -> Vector6<f64> {
    stack(&b.cross(f), f)
}

/// (88)-(93): the wrench about C that the platform's motion needs.
pub fn platform_wrench(machine: &Machine, p: &Platform, form: &Form) -> Vector6<f64> {
    let body = &machine.platform;
    let c = p.rotation * body.center_of_mass;
    let i_g = p.rotation * body.inertia * p.rotation.transpose();
    let steiner = if form.parallel_axis { -c.cross_matrix().pow(2) * body.mass } else { Matrix3::zeros() };
    let i_c = i_g + steiner;
    let at_origin = p.accel - machine.gravity * form.platform_gravity;
    let centrifugal = p.omega.cross(&p.omega.cross(&c)) * form.centrifugal;
    let force = (at_origin + p.omega_rate.cross(&c) + centrifugal) * body.mass;
    let torque = i_c * p.omega_rate + p.omega.cross(&(i_c * p.omega)) + c.cross(&at_origin) * body.mass;
    stack(&torque, &force)
}

fn drives(machine: &Machine, legs: &[Leg; 6]) -> Vector6<f64> {
    let drive = &machine.drive;
    Vector6::from_iterator(legs.iter().map(|leg| {
        let joint = joint(leg, &EXACT);
        let (rate, accel) = (joint.rate.z, joint.accel.z);
        drive.reflected_mass * accel + drive.viscous_friction * rate + drive.coulomb_friction * rate.signum()
    }))
}

/// L' of the six legs.
pub fn leg_rates(machine: &Machine, state: &State) -> Vector6<f64> {
    Vector6::from_iterator(legs(machine, &platform(state)).iter().map(|leg| leg.velocity.x))
}

/// Kinetic and potential energy \[J\], drives not counted; kinetic energy of the legs by (73).
pub fn energy(machine: &Machine, state: &State, form: &Form) -> f64 {
    let p = platform(state);
    let body = &machine.platform;
    let c = p.rotation * body.center_of_mass;
    let speed = (p.velocity + p.omega.cross(&c)).norm();
    let turning = p.rotation.tr_mul(&p.omega);
    let mut sum = 0.5 * (body.mass * speed * speed + turning.dot(&(body.inertia * turning)));
    let mut moment = (p.position + c) * body.mass;
    for leg in &legs(machine, &p) {
        let joint = joint(leg, form);
        sum += 0.5 * joint.rate.dot(&(Dense::new(machine, leg, &joint).mass_matrix() * joint.rate));
        let n = leg.axes.column(0);
        moment += (leg.ends[0] + n * machine.cylinder.center_of_mass) * machine.cylinder.mass;
        moment += (leg.ends[1] - n * machine.rod.center_of_mass) * machine.rod.mass;
    }
    sum - machine.gravity.dot(&moment)
}

fn stack(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
}
