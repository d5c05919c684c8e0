//! Constants of a running controller: the machine, the parameters, and the values derived from both.

use nalgebra::Vector6;

use crate::control::law::Law;
use crate::control::law::estimator::EstimatorConstants;
use crate::control::law::estimator::covariance::NoiseModel;
use crate::control::law::input_matrix::InputMatrix;
use crate::control::monitoring::disturbance_monitor::DisturbanceBounds;
use crate::control::monitoring::frozen_sensors::FrozenLegBounds;
use crate::control::monitoring::weighting::least_missing_force_acceleration;
use crate::control::parameters::Parameters;
use crate::control::sensing::standstill::window_s;
use crate::model::active_forces::InverseDynamics;
use crate::model::force_changes::ForceChangeBounds;
use crate::model::inverse_geometry::universal_sine;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;

/// Largest force that holding the platform may take, as a share of the force that every leg can get: in the envelope, and
/// wherever the reference goes. The rest is for motion, friction and feedback.
pub const MAX_HOLDING_SHARE: f64 = 0.9;
/// Share of the range from the condition at home to its limit that the reference may use.
const REFERENCE_CONDITION_RANGE_SHARE: f64 = 0.85;
/// Least sine of the angle between a leg and the first axis of its universal joint: 6 degrees, less than any
/// joint allows. The moment of the leg's spin grows with the inverse third power of the sine. At this angle
/// the moment still changes by less than itself in a cycle of 10 ms.
const MIN_UNIVERSAL_SINE: f64 = 0.1;
/// Least sine as a ratio of the sine at home, for machines whose legs are that near to the axes at home.
const MIN_UNIVERSAL_SINE_PER_HOME: f64 = 0.5;

/// Machine model, parameters and home pose; constant while the controller runs.
#[derive(Clone, Debug)]
pub struct Constants {
    /// Inverse dynamics of the machine.
    pub dynamics: InverseDynamics,
    /// Parameters, chosen by the deployment.
    pub parameters: Parameters,
    /// Kinematic state at home.
    pub home: KinematicState,
    /// Largest distance of a joint on the platform from C \[m\].
    pub arm_m: f64,
    /// Matrix from the acceleration that the law commands to the acceleration of the platform.
    pub acceleration_by_command: InputMatrix,
    /// Constants of the estimator under control.
    pub estimator: EstimatorConstants,
    /// Square of the least disturbance that may come from a force that a drive does not deliver; infinite if
    /// the law leaves forces to feedback.
    pub least_missing_acceleration_squared_m2_s4: f64,
    /// Changes of the disturbance that are no fault.
    pub disturbance_bounds: DisturbanceBounds,
    /// Bounds on equal readings of one leg.
    pub(super) frozen_leg: FrozenLegBounds,
    /// Length of the window in which lengths alone show rest \[s\].
    pub(super) rest_window_s: f64,
    /// Constants of the estimator of the leg rates.
    pub leg_rate_estimator: EstimatorConstants,
    /// Largest condition of the reference. It is below the platform's limit, to leave room for the following
    /// error.
    pub max_reference_condition: f64,
    /// Least sine of the angle between a leg and the first axis of its universal joint, for the reference.
    pub least_universal_sine: f64,
    /// Bounds on changes of the drives' forces.
    pub(super) force_changes: ForceChangeBounds,
}

impl Constants {
    /// Computes the constants of a machine with its parameters.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let home = KinematicState::new(machine, machine.home_pose());
        let arms = machine.joints.triples.unpack_vectors(&machine.joints.platform);
        let arm_m = arms.iter().map(nalgebra::Vector3::norm).fold(0.0, f64::max);
        let NoiseModel { bandwidth_rad_s, period_s, .. } = parameters.noise;
        let lengths_only = NoiseModel { bandwidth_rad_s, period_s, rate_noise_ratio: None };
        let Law { mode, leg_masses, max_compensated_acceleration, .. } = &parameters.law;
        let acceleration_by_command = InputMatrix::at_home(machine, *mode, leg_masses, parameters.fidelity);
        let disturbance =
            acceleration_by_command.largest_compensable_disturbance(max_compensated_acceleration);
        let limits = parameters.unscaled_limits();
        let feedback_only =
            parameters.law.max_leg_acceleration_without_feedforward(&limits, arm_m, &disturbance);
        let angle_weighting_radius_m = if mode.acts_on_legs() { 1.0 } else { arm_m };
        let by_force = acceleration_by_command.acceleration_by_force(machine, home.pose());
        let least_missing = least_missing_force_acceleration(
            &by_force,
            angle_weighting_radius_m,
            machine.actuator.weakest_available_force_n(),
        );
        let least_missing_acceleration_squared =
            if mode.includes_inertia() { least_missing * least_missing } else { f64::INFINITY };
        let unbounded = Vector6::repeat(f64::INFINITY);
        let disturbance_bounds =
            DisturbanceBounds::new(machine, &parameters, &acceleration_by_command, angle_weighting_radius_m);
        Self {
            disturbance_bounds,
            dynamics: InverseDynamics::new(machine),
            acceleration_by_command,
            least_missing_acceleration_squared_m2_s4: least_missing_acceleration_squared,
            frozen_leg: FrozenLegBounds::new(parameters.law.position.kp_per_s2, &machine.actuator, period_s),
            estimator: EstimatorConstants::new(
                parameters.noise,
                parameters.reading_errors,
                if parameters.law.compensates_disturbance { disturbance } else { unbounded },
                limits.position.acceleration + feedback_only,
            ),
            rest_window_s: window_s(&parameters),
            leg_rate_estimator: EstimatorConstants::new(
                lengths_only,
                parameters.reading_errors,
                unbounded,
                f64::INFINITY,
            ),
            parameters,
            arm_m,
            max_reference_condition: max_reference_condition(&home, parameters.max_condition),
            least_universal_sine: least_universal_sine(machine, &home),
            force_changes: ForceChangeBounds::new(machine),
            home,
        }
    }

    /// Length that converts angles of the error to distances \[m\]; 1 for errors of legs, which have no
    /// angles.
    pub(super) fn angle_weighting_radius_m(&self) -> f64 {
        if self.parameters.law.mode.acts_on_legs() { 1.0 } else { self.arm_m }
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        self.dynamics.machine()
    }
}

/// Largest condition of the reference: a part of the way from that at home to the limit of the platform.
pub fn max_reference_condition(home: &KinematicState, max_condition: f64) -> f64 {
    let at_home = home.sensitivity().condition;
    at_home + REFERENCE_CONDITION_RANGE_SHARE * (max_condition - at_home)
}

/// Least sine of the angle between a leg and the first axis of its universal joint that the reference keeps.
pub fn least_universal_sine(machine: &Machine, home: &KinematicState) -> f64 {
    MIN_UNIVERSAL_SINE.min(MIN_UNIVERSAL_SINE_PER_HOME * universal_sine(machine, home.pose()))
}
