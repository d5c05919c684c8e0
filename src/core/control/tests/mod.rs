//! Tests of the stages of control, and what all unit tests of control share: a machine, parameters, random vectors.

pub(in crate::control) use nalgebra::{Matrix3, Vector3, Vector6};

pub(in crate::control) use crate::control::constants::Constants;
pub(in crate::control) use crate::control::cycle::Cycle;
pub(in crate::control) use crate::control::law::error_tracker::{ErrorTracker, setpoint_error};
pub(in crate::control) use crate::control::law::estimator::ReadingErrors;
pub(in crate::control) use crate::control::law::estimator::covariance::NoiseModel;
pub(in crate::control) use crate::control::law::feedback_limiter::FeedbackLimiter;
pub(in crate::control) use crate::control::law::gains::Gains;
pub(in crate::control) use crate::control::law::leg_masses::LegMasses;
pub(in crate::control) use crate::control::law::{ControlMode, Law};
pub(in crate::control) use crate::control::parameters::{Parameters, ViolationPolicy};
pub(in crate::control) use crate::control::reference::ReferenceGenerator;
pub(in crate::control) use crate::control::sensing::localization::{Localization, Located, PlatformState};
pub(in crate::control) use crate::control::setpoint::motion::SetpointMotion;
pub(in crate::control) use crate::control::setpoint::pose_samples::PoseSamples;
pub(in crate::control) use crate::control::setpoint::target::{Target, at_rest};
pub(in crate::control) use crate::control::setpoint::validated::ValidatedSetpoint;
pub(in crate::control) use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
pub(in crate::control) use crate::control::signals::errors::{CommandedAcceleration, PoseError};
pub(in crate::control) use crate::control::signals::inputs::{
    Input, Measurement, Publishers, Setpoint, SetpointKind,
};
pub(in crate::control) use crate::control::signals::limits::{DerivativeLimits, Limit, LimitSet, Limits};
pub(in crate::control) use crate::control::signals::pair::Pair;
pub(in crate::control) use crate::control::signals::state::{AfterStop, State};
pub(in crate::control) use crate::control::tests::random_vectors::RandomVectors;
pub(in crate::control) use crate::model::LEGS;
pub(in crate::control) use crate::model::fidelity::{Exact, Fidelity, Gravity};
pub(in crate::control) use crate::model::inverse_geometry::leg_lengths;
pub(in crate::control) use crate::model::kinematic_state::KinematicState;
pub(in crate::control) use crate::model::machine::{
    Actuator, Joints, Link, Machine, Platform, TransverseInertia, at_most_256_bits,
};
pub(in crate::control) use crate::model::rigid::{Acceleration, Motion, Pose, Twist, exp};
pub(in crate::control) use crate::model::task::{TaskState, task_coordinates};

mod assessment;
mod feedback;
mod force_limits;
mod free_motion;
mod measurements;
pub(in crate::control) mod random_vectors;
mod setpoints;
mod tracking;

/// A millisecond \[ns\].
pub(in crate::control) const MS: u64 = 1_000_000;

pub(in crate::control) const LIMITS: Limits = Limits {
    position: DerivativeLimits { velocity: 1.0, acceleration: 6.0, jerk: 150.0 },
    orientation: DerivativeLimits { velocity: 1.2, acceleration: 8.0, jerk: 200.0 },
    autonomous_scale: 0.3,
};

/// Machine of about two metres with pairs of joints, more or less scattered.
pub(in crate::control) fn machine(samples: &mut RandomVectors) -> Machine {
    let scatter = 0.1 * samples.uniform();
    let mut ring = |radius: f64, offset: f64, spread: f64| {
        core::array::from_fn(|leg| {
            let side = if leg % 2 == 0 { -spread } else { spread };
            let angle = (leg / 2) as f64 * core::f64::consts::TAU / 3.0 + offset + side;
            let moved = Vector3::from_fn(|_, _| scatter * (2.0 * samples.uniform() - 1.0));
            Vector3::new(radius * angle.cos(), radius * angle.sin(), 0.0) + moved
        })
    };
    let base: [Vector3<f64>; LEGS] = ring(1.4, core::f64::consts::FRAC_PI_3, 0.9);
    let platform: [Vector3<f64>; LEGS] = ring(0.8, core::f64::consts::FRAC_PI_3, 0.2);
    let home = Pose { rotation: Matrix3::identity(), position: Vector3::new(0.0, 0.0, 1.5) };
    let link = Link {
        mass_kg: 10.0,
        center_of_mass_m: 0.4,
        axial_inertia_kg_m2: 0.1,
        transverse_inertia: TransverseInertia {
            constant_kg_m2: 1.0,
            quadratic_kg: 0.0,
            reference_length_m: 0.0,
        },
    };
    Machine {
        gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
        platform: Platform {
            mass_kg: 200.0,
            center_of_mass_m: Vector3::zeros(),
            inertia: Matrix3::identity() * 40.0,
        },
        joints: Joints::new(&base, &platform, &[Vector3::y(); LEGS], &home),
        cylinder: link.clone(),
        rod: link,
        actuator: Actuator {
            min_length_m: 0.9,
            max_length_m: 2.6,
            max_rate_m_s: 1.0,
            max_force_n: 1e4,
            reflected_mass_kg: 0.0,
            viscous_friction_n_s_m: [0.0; LEGS],
            coulomb_friction_n: [0.0; LEGS],
            load_friction_share: [0.0; LEGS],
            force_scale: [1.0; LEGS],
            friction_uncertainty_n: 0.0,
            coulomb_smoothing_m_s: Actuator::COULOMB_SMOOTHING_M_S,
        },
        home: [0.0, 0.0, 0.0, 0.0, 0.0, 1.5],
        max_rotation_rad: 0.5,
        level: at_most_256_bits(fearless_simd::Level::new()),
    }
}

pub(in crate::control) fn parameters(machine: &Machine) -> Parameters {
    let gains = Gains::new(8.0, 1.0);
    Parameters {
        period_ns: 1_000_000,
        law: Law::new(
            machine,
            ControlMode::default(),
            Pair { angular: gains, linear: gains },
            LegMasses::at_home(machine),
            false,
            &LIMITS,
        ),
        noise: NoiseModel { bandwidth_rad_s: 50.0, rate_noise_ratio: None, period_s: 1e-3 },
        reading_errors: ReadingErrors::default(),
        force_delay_ns: 0,
        fidelity: Fidelity::Exact,
        limits: LIMITS,
        limits_scale: 1.0,
        approach: false,
        envelope: None,
        max_condition: 60.0,
        force_rate_n_s: 1e6,
        on_violation: ViolationPolicy::Stop,
        feedback_scale: 0.5,
        payload_change_kg: None,
        disturbance_step_m_s2: None,
        stroke_margin_m: 0.0,
        following_velocity_m_s: 0.3,
        following_angular_velocity_rad_s: 0.3,
        after_loss: AfterStop::default(),
        lost_hold_ns: 10_000_000_000,
        holds_on_return: false,
        engage_position_m: 0.01,
        engage_orientation_rad: 0.01,
        following_position_m: 0.05,
        following_orientation_rad: 0.05,
        setpoint_timeout_ns: 20_000_000,
        measured_timeout_ns: 10_000_000,
        max_age_at_arrival_ns: 10_000_000,
        ready_timeout_ns: 500_000_000,
        pose_tolerance_m: 5e-4,
        longest_cycle_gap_ns: 10_000_000,
    }
}

/// Constants of a random machine, with parameters as above.
pub(in crate::control) fn random_constants(samples: &mut RandomVectors) -> Constants {
    let machine = machine(samples);
    Constants::new(&machine, parameters(&machine))
}

/// Platform at a pose, far from singular ones, by a measurement.
pub(in crate::control) fn located(measurement: &Measurement, pose: Pose, twist: Twist) -> Located<'_> {
    let platform = PlatformState { pose, twist, condition: 2.0, time_to_singularity_s: f64::INFINITY };
    Located { measurement, rate_m_s: [0.0; LEGS], platform }
}

/// Pose around home. The legs are within the stroke, and the condition is below the reference's limit.
pub(in crate::control) fn pose(samples: &mut RandomVectors, constants: &Constants) -> Pose {
    let Pose { rotation, position } = *constants.home.pose();
    loop {
        let pose =
            Pose { rotation: exp(&samples.vector(0.6)) * rotation, position: position + samples.vector(0.4) };
        let condition = KinematicState::new(constants.machine(), pose).sensitivity().condition;
        let is_within = leg_lengths(constants.machine(), &pose)
            .iter()
            .all(|length| constants.machine().actuator.contains(*length));
        if is_within && condition < constants.max_reference_condition {
            return pose;
        }
    }
}

/// Last value at which a test holds, between `holds` and `fails`.
pub(in crate::control) fn bisected(mut holds: f64, mut fails: f64, mut test: impl FnMut(f64) -> bool) -> f64 {
    for _ in 0..40 {
        let middle = 0.5 * (holds + fails);
        if test(middle) { holds = middle } else { fails = middle }
    }
    holds
}
