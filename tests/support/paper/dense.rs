//! One leg as a serial robot of two links and three joints, its global matrices written out
//! (paper, eq. 13-33, 53-82).
//!
//! Global: over the links of one leg, link 1 (cylinder) first. Spatial vectors are [angular; linear] in leg
//! axes; link 1 refers to A, link 2 (rod) to its own centre of mass.
//!
//! ```text
//! P^    = [ U p~ ; 0 U ]          from one point to the next, p between them
//! P     = [ U -P^_21 ; 0 U ]      12 x 12        P^T V = H q',   V = P^-T H q'
//! H     = diag(H_1, H_2)          12 x 3         joint axes
//! W     = diag(W_1, W_2)          12 x 9         H^T W = 0, W^T W = U: directions the joints do not allow
//! I     = diag(I_1, I_2)          12 x 12        spatial inertias
//! beta  = [ 0 P^_B2^T ]           6 x 12         J_B = beta P^-T H, its linear rows are J_Bv
//! M     = H^T P^-1 I P^-T H                                                                  (73)
//! V'    = P^-T (H q'' + velocity terms),  v0' = -g
//! F     = P^-1 (I V' + velocity terms),   C + G = H^T F for q'' = 0                          (74)-(82)
//! ```

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3};

use super::form::{Form, Inertia};
use super::kinematics::{Joint, Leg};
use super::machine::{Link, Machine};

pub type Global = SMatrix<f64, 12, 12>;
pub type GlobalVector = SVector<f64, 12>;

/// The global matrices of one leg at one instant.
#[derive(Clone, Debug)]
pub struct Dense {
    pub p: Global,
    pub h: SMatrix<f64, 12, 3>,
    pub w: SMatrix<f64, 12, 9>,
    pub i: Global,
    pub beta: SMatrix<f64, 6, 12>,
    /// p_21, from A to the centre of mass of the rod.
    between: Vector3<f64>,
    /// From the reference point of each link to its centre of mass.
    offset: [Vector3<f64>; 2],
    mass: [f64; 2],
    /// dI/dL of both links together, transverse.
    inertia_slope: f64,
}

impl Dense {
    pub fn new(machine: &Machine, leg: &Leg, joint: &Joint) -> Self {
        let (cylinder, rod) = (&machine.cylinder, &machine.rod);
        let along = |distance: f64| Vector3::new(distance, 0.0, 0.0);
        let between = along(leg.length - rod.center_of_mass);
        let offset = [along(cylinder.center_of_mass), Vector3::zeros()];

        let mut p = Global::identity();
        p.fixed_view_mut::<6, 6>(0, 6).copy_from(&-propagation(&between));
        let mut h = SMatrix::<f64, 12, 3>::zeros();
        h.fixed_view_mut::<3, 3>(0, 0).copy_from(&joint.angular);
        h[(9, 2)] = 1.0;
        let mut i = Global::zeros();
        i.fixed_view_mut::<6, 6>(0, 0).copy_from(&spatial_inertia(cylinder, &offset[0], leg.length));
        i.fixed_view_mut::<6, 6>(6, 6).copy_from(&spatial_inertia(rod, &offset[1], leg.length));
        let mut beta = SMatrix::<f64, 6, 12>::zeros();
        beta.fixed_view_mut::<6, 6>(0, 6).copy_from(&propagation(&along(rod.center_of_mass)).transpose());
        Self {
            p,
            h,
            w: complement(&joint.angular),
            i,
            beta,
            between,
            offset,
            mass: [cylinder.mass, rod.mass],
            inertia_slope: cylinder.transverse_inertia.slope(leg.length)
                + rod.transverse_inertia.slope(leg.length),
        }
    }

    /// (73)
    pub fn mass_matrix(&self) -> Matrix3<f64> {
        let p_inverse = self.p.try_inverse().unwrap();
        self.h.transpose() * p_inverse * self.i * p_inverse.transpose() * self.h
    }

    /// J_B, from q' to the spatial velocity of the leg's end B, leg axes.
    pub fn jacobian(&self) -> SMatrix<f64, 6, 3> {
        self.beta * self.p.try_inverse().unwrap().transpose() * self.h
    }

    /// J_Bv, its linear rows.
    pub fn jacobian_linear(&self) -> Matrix3<f64> {
        self.jacobian().fixed_rows::<3>(3).into()
    }

    /// (74)-(82): joint torques and force for any q'', by Newton-Euler.
    pub fn newton_euler(&self, joint: &Joint, accel: &Vector3<f64>, gravity: &Vector3<f64>) -> Vector3<f64> {
        let omega = joint.omega();
        let turned = |r: &Vector3<f64>| omega.cross(&omega.cross(r));
        let sliding = Vector3::new(joint.rate.z, 0.0, 0.0);
        let bias = global(
            joint.angular_rate * joint.rate,
            -gravity,
            Vector3::zeros(),
            turned(&self.between) + omega.cross(&sliding) * 2.0,
        );
        let p_inverse = self.p.try_inverse().unwrap();
        let v_rate = p_inverse.transpose() * (self.h * accel + bias);
        let gyroscopic = |at: usize| omega.cross(&(self.i.fixed_view::<3, 3>(at, at) * omega));
        let velocity_terms = global(
            gyroscopic(0),
            turned(&self.offset[0]) * self.mass[0],
            gyroscopic(6),
            turned(&self.offset[1]) * self.mass[1],
        );
        self.h.transpose() * p_inverse * (self.i * v_rate + velocity_terms)
    }

    /// (87): `D = M q'' + C + G`, gravity in leg axes.
    pub fn load(&self, joint: &Joint, gravity: &Vector3<f64>, form: &Form) -> Vector3<f64> {
        let d = self.mass_matrix() * joint.accel + self.newton_euler(joint, &Vector3::zeros(), gravity);
        match form.inertia {
            Inertia::Instantaneous => d,
            Inertia::Varying => d + self.varying_inertia(joint),
        }
    }

    /// `dI/dt omega` about the transverse axes and `-1/2 dI/dL omega^2` along the leg.
    fn varying_inertia(&self, joint: &Joint) -> Vector3<f64> {
        let omega = joint.omega().component_mul(&Vector3::new(0.0, 1.0, 1.0));
        let along = Vector3::new(0.0, 0.0, -0.5 * self.inertia_slope * omega.norm_squared());
        joint.angular.tr_mul(&(omega * (self.inertia_slope * joint.rate.z))) + along
    }
}

/// `P^ = [ U p~ ; 0 U ]`
fn propagation(p: &Vector3<f64>) -> Matrix6<f64> {
    let mut matrix = Matrix6::identity();
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&p.cross_matrix());
    matrix
}

/// `[ I_G - m s~ s~, m s~ ; -m s~, m U ]`: spatial inertia about a point, the centre of mass at s from it.
fn spatial_inertia(link: &Link, s: &Vector3<f64>, length: f64) -> Matrix6<f64> {
    let transverse = link.transverse_inertia.at(length);
    let i_g = Matrix3::from_diagonal(&Vector3::new(link.axial_inertia, transverse, transverse));
    let m_s = s.cross_matrix() * link.mass;
    let mut inertia = Matrix6::from_diagonal_element(link.mass);
    inertia.fixed_view_mut::<3, 3>(0, 0).copy_from(&(i_g - m_s * s.cross_matrix()));
    inertia.fixed_view_mut::<3, 3>(0, 3).copy_from(&m_s);
    inertia.fixed_view_mut::<3, 3>(3, 0).copy_from(&-m_s);
    inertia
}

/// W: link 1 may not turn about what is normal to both joint axes, nor move; link 2 only slides along x.
fn complement(angular: &Matrix3<f64>) -> SMatrix<f64, 12, 9> {
    let mut w = SMatrix::<f64, 12, 9>::zeros();
    let normal = Vector3::from(angular.column(0)).cross(&angular.column(1)).normalize();
    w.fixed_view_mut::<3, 1>(0, 0).copy_from(&normal);
    for (column, row) in [3, 4, 5, 6, 7, 8, 10, 11].into_iter().enumerate() {
        w[(row, column + 1)] = 1.0;
    }
    w
}

fn global(
    angular_1: Vector3<f64>,
    linear_1: Vector3<f64>,
    angular_2: Vector3<f64>,
    linear_2: Vector3<f64>,
) -> GlobalVector {
    let parts = [angular_1, linear_1, angular_2, linear_2];
    GlobalVector::from_iterator(parts.iter().flat_map(|part| part.iter().copied()))
}
