//! Free parameters of the identification, such that every value of them is a machine that can be built.
//!
//! | free parameter | stands for |
//! | --- | --- |
//! | 0-9 | platform: logarithm of its mass, Cholesky factor of its pseudo-inertia |
//! | 10-12 | cylinder: logarithms of centre of mass, transverse and axial inertia, relative to the file |
//! | 13-16 | rod: the same, mass first |
//! | 17 | reflected mass |
//! | 18-23, 24-29, 30-35 | viscous and Coulomb friction, load friction, of each leg |
//! | 36-41 | logarithm of the force scale of each leg |
//! | 42-51 | payload: the same as of the platform |
//!
//! The pseudo-inertia of a body, with its second moments S, first moments h and mass m, is positive definite exactly if
//! some distribution of positive mass has them (Wensing, Kim, Slotine, 2018). So is `U U^T` for every triangle U (Rucker,
//! Wensing, 2022):
//!
//! ```text
//! [ S   h ]                    [ d1  s12  s13  t1 ]
//! [ h^T m ] = U U^T  U = exp a [ 0   d2   s23  t2 ]      S = tr(I) / 2 - I
//!                              [ 0   0    d3   t3 ]
//!                              [ 0   0    0    1  ]
//! ```
//!
//! so `m = exp 2a` and t is the centre of mass. The sources have the logarithms of d, too. But of a flat plate or a point mass they
//! are infinite, and the search would not leave a small size.

use nalgebra::{Matrix3, SVector, Vector3, Vector6};

use super::equations::{BODY_PARAMETER_COUNT, LOSS_INDEX, PAYLOAD, SCALE, Unknowns};
use hexad_core::model::LEGS;
use hexad_core::model::machine::{Link, Machine, Platform};
use hexad_core::model::regressor::{DYNAMIC_PARAMETER_COUNT, dynamic_parameters};

/// First parameter of each group.
const CYLINDER: usize = BODY_PARAMETER_COUNT;
const ROD: usize = CYLINDER + 3;
const REFLECTED: usize = ROD + 4;
const VISCOUS: usize = REFLECTED + 1;
const COULOMB: usize = VISCOUS + LEGS;
const LOAD: usize = COULOMB + LEGS;
pub(super) const LOG_SCALE_INDEX: usize = LOAD + LEGS;
const LOG_PAYLOAD: usize = LOG_SCALE_INDEX + LEGS;
/// Number of free parameters.
pub(super) const FREE_PARAMETER_COUNT: usize = LOG_PAYLOAD + BODY_PARAMETER_COUNT;

/// Free parameters.
pub(super) type Free = SVector<f64, FREE_PARAMETER_COUNT>;

/// Deviations of the prior: how far a machine may be from its file. Ratios, or logarithms of them.
const MASS_RATIO: f64 = 0.3;
const SHAPE_RATIO: f64 = 0.3;
const REFLECTED_RATIO: f64 = 0.5;
/// Of the largest force.
const FRICTION_RATIO: f64 = 0.03;
const LOAD_FRICTION: f64 = 0.05;
const FORCE_SCALE_RATIO: f64 = 0.1;
/// Of the mass of the platform: reflected mass where the file has none, and a payload before anything is known of it.
const REFLECTED_PER_PLATFORM: f64 = 0.02;
const PAYLOAD_PER_PLATFORM: f64 = 0.05;
/// Deviation of the logarithm of a payload's mass; its size, that size's deviation and the deviation of its place over the radius of
/// the platform.
const PAYLOAD_MASS_LOG: f64 = 3.0;
const PAYLOAD_SIZE: f64 = 0.2;
const PAYLOAD_SIZE_DEVIATION: f64 = 0.4;
const PAYLOAD_PLACE: f64 = 2.0;
/// Second moment that a body has at least, as a share of its largest: a flat plate has none across.
const LEAST_MOMENT: f64 = 1e-5;

/// Platform, links and drives of a machine, and a payload.
#[derive(Clone, Debug)]
pub(super) struct Bodies {
    pub machine: Machine,
    pub payload: Platform,
}

/// Map from free parameters to machines, about the machine of a file.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    file: Machine,
    /// Those of the file, and how far from them a machine may be.
    pub prior: Free,
    pub deviation: Free,
}

impl Parameters {
    /// Parameters about a machine.
    pub fn new(file: &Machine) -> Self {
        let (actuator, radius, mass) = (&file.actuator, file.joints.radius_m, file.platform.mass_kg);
        let guess = {
            let size = (PAYLOAD_SIZE * radius).powi(2);
            let mass_kg = PAYLOAD_PER_PLATFORM * mass;
            Platform {
                mass_kg,
                center_of_mass_m: Vector3::zeros(),
                inertia: Matrix3::identity() * (mass_kg * size),
            }
        };
        let mut prior = Free::zeros();
        prior.fixed_rows_mut::<BODY_PARAMETER_COUNT>(0).copy_from(&cholesky_parameters(&file.platform));
        prior.fixed_rows_mut::<1>(REFLECTED).fill(actuator.reflected_mass_kg);
        for (first, values) in [
            (VISCOUS, actuator.viscous_friction_n_s_m),
            (COULOMB, actuator.coulomb_friction_n),
            (LOAD, actuator.load_friction_share),
            (LOG_SCALE_INDEX, actuator.force_scale.map(f64::ln)),
        ] {
            prior.fixed_rows_mut::<LEGS>(first).copy_from(&Vector6::from(values));
        }
        prior.fixed_rows_mut::<BODY_PARAMETER_COUNT>(LOG_PAYLOAD).copy_from(&cholesky_parameters(&guess));

        let mut deviation = Free::repeat(SHAPE_RATIO);
        // A flat plate may be thick: each size may be off by a share of the largest.
        let size = prior.fixed_rows::<3>(1).amax();
        for (first, mass_log, size, place) in [
            (0, MASS_RATIO, SHAPE_RATIO * size, SHAPE_RATIO * radius),
            (LOG_PAYLOAD, PAYLOAD_MASS_LOG, PAYLOAD_SIZE_DEVIATION * radius, PAYLOAD_PLACE * radius),
        ] {
            deviation.row_mut(first).fill(0.5 * mass_log);
            deviation.fixed_rows_mut::<6>(first + 1).fill(size);
            deviation.fixed_rows_mut::<3>(first + 7).fill(place);
        }
        let reflected = REFLECTED_RATIO * actuator.reflected_mass_kg + REFLECTED_PER_PLATFORM * mass;
        let dry = FRICTION_RATIO * actuator.max_force_n;
        for (first, count, value) in [
            (REFLECTED, 1, reflected),
            (VISCOUS, LEGS, dry / actuator.max_rate_m_s),
            (COULOMB, LEGS, dry),
            (LOAD, LEGS, LOAD_FRICTION),
            (LOG_SCALE_INDEX, LEGS, FORCE_SCALE_RATIO),
        ] {
            deviation.rows_mut(first, count).fill(value);
        }
        // What a file states itself may be off by half.
        for leg in VISCOUS..LOG_SCALE_INDEX {
            let (stated, mut row) = (prior.row(leg).x, deviation.row_mut(leg));
            row.add_scalar_mut(0.5 * stated);
        }
        Self { file: file.clone(), prior, deviation }
    }

    /// Holds all parameters except the payload's.
    pub fn hold_machine(&mut self) {
        self.deviation.fixed_rows_mut::<LOG_PAYLOAD>(0).scale_mut(HELD);
    }

    /// The nearest parameters with no negative friction.
    pub fn within_bounds(&self, mut free: Free) -> Free {
        free.rows_mut(REFLECTED, LOG_SCALE_INDEX - REFLECTED).apply(|value| *value = value.max(0.0));
        free
    }

    /// Machine and payload of these parameters.
    pub fn bodies(&self, free: &Free) -> Bodies {
        let mut machine = self.file.clone();
        let body = |first: usize| body(free.fixed_rows::<BODY_PARAMETER_COUNT>(first).into_owned());
        machine.platform = body(0);
        let actuator = &self.file.actuator;
        let [min, max] = [actuator.min_length_m, actuator.max_length_m];
        let logs = free.fixed_rows::<3>(CYLINDER);
        machine.cylinder = scaled(&self.file.cylinder, 0.0, &logs.into_owned(), [min, max]);
        let (mass, logs) = (free.row(ROD).x, free.fixed_rows::<3>(ROD + 1));
        machine.rod = scaled(&self.file.rod, mass, &logs.into_owned(), [min, max]);
        let legs = |first: usize| free.fixed_rows::<LEGS>(first).into_owned().into();
        let actuator = &mut machine.actuator;
        actuator.reflected_mass_kg = free.row(REFLECTED).x;
        (actuator.viscous_friction_n_s_m, actuator.coulomb_friction_n) = (legs(VISCOUS), legs(COULOMB));
        actuator.load_friction_share = legs(LOAD);
        actuator.force_scale = legs(LOG_SCALE_INDEX).map(f64::exp);
        Bodies { machine, payload: body(LOG_PAYLOAD) }
    }

    /// Unknowns of the equations.
    pub fn unknowns(&self, free: &Free) -> Unknowns {
        let Bodies { machine, payload } = self.bodies(free);
        let actuator = &machine.actuator;
        let loss =
            actuator.force_scale.iter().zip(&actuator.load_friction_share).map(|(scale, load)| scale * load);
        let mut unknowns = Unknowns::zeros();
        unknowns.fixed_rows_mut::<DYNAMIC_PARAMETER_COUNT>(0).copy_from(&dynamic_parameters(&machine));
        unknowns.fixed_rows_mut::<LEGS>(SCALE).copy_from(&Vector6::from(actuator.force_scale));
        unknowns.fixed_rows_mut::<LEGS>(LOSS_INDEX).copy_from(&Vector6::from_iterator(loss));
        let payload = dynamic_parameters(&Machine { platform: payload, ..machine });
        unknowns
            .fixed_rows_mut::<BODY_PARAMETER_COUNT>(PAYLOAD)
            .copy_from(&payload.fixed_rows::<BODY_PARAMETER_COUNT>(0));
        unknowns
    }
}

/// Factor on the deviation of a parameter that is held.
const HELD: f64 = 1e-6;

/// A link with other mass, centre of mass and inertias: logarithms of their ratios.
fn scaled(link: &Link, mass: f64, logs: &Vector3<f64>, ends: [f64; 2]) -> Link {
    let mut scaled = link.clone();
    let [center, across, along]: [f64; 3] = (*logs).into();
    scaled.mass_kg *= mass.exp();
    scaled.center_of_mass_m *= center.exp();
    scaled.axial_inertia_kg_m2 *= along.exp();
    // Across, a link has at least half of its axial inertia at every length.
    let inertia = &link.transverse_inertia;
    let least = ends.map(|length| {
        inertia.constant_kg_m2 + inertia.quadratic_kg * (length - inertia.reference_length_m).powi(2)
    });
    let excess = least.into_iter().chain([inertia.constant_kg_m2]).fold(f64::INFINITY, f64::min)
        - 0.5 * link.axial_inertia_kg_m2;
    scaled.transverse_inertia.constant_kg_m2 +=
        excess * (across.exp() - 1.0) + 0.5 * (scaled.axial_inertia_kg_m2 - link.axial_inertia_kg_m2);
    scaled
}

/// Body of Cholesky parameters.
fn body(parameters: SVector<f64, BODY_PARAMETER_COUNT>) -> Platform {
    let [a, d1, d2, d3, s12, s23, s13, t1, t2, t3]: [f64; BODY_PARAMETER_COUNT] = parameters.into();
    let triangle = Matrix3::new(d1, s12, s13, 0.0, d2, s23, 0.0, 0.0, d3);
    let mass_kg = (2.0 * a).exp();
    // About the centre of mass the columns of t drop out.
    let moments = triangle * triangle.transpose() * mass_kg;
    let inertia = Matrix3::identity() * moments.trace() - moments;
    Platform { mass_kg, center_of_mass_m: Vector3::new(t1, t2, t3), inertia }
}

/// Cholesky parameters of a body.
pub(super) fn cholesky_parameters(body: &Platform) -> SVector<f64, BODY_PARAMETER_COUNT> {
    let moments = (Matrix3::identity() * (0.5 * body.inertia.trace()) - body.inertia) / body.mass_kg;
    let moments = moments + Matrix3::identity() * (LEAST_MOMENT * moments.trace());
    // An upper triangle: the lower one of the reversed axes.
    let reversed = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    let lower =
        (reversed * moments * reversed).cholesky().map_or(Matrix3::identity(), |cholesky| cholesky.l());
    let u = reversed * lower * reversed;
    let [x, y, z]: [f64; 3] = body.center_of_mass_m.into();
    let a = 0.5 * body.mass_kg.ln();
    SVector::from([a, u.m11, u.m22, u.m33, u.m12, u.m23, u.m13, x, y, z])
}
