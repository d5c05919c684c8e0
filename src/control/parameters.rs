//! Parameters of a controller, and all that stays constant while it runs.

use super::disturbance_monitor::DisturbanceBounds;
use super::drive_response::least_disturbance;
use super::estimator::covariance::NoiseModel;
use super::estimator::input_matrix::InputMatrix;
use super::estimator::{EstimatorConstants, FrozenLegBounds, Readings};
use super::law::Law;
use super::limits::Limits;
use super::standstill::window_s;
use super::supervisor::AfterStop;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::inverse_geometry::universal_sine;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use nalgebra::Vector6;

/// Parameters that a deployment chooses for a controller. Times are in nanoseconds, like the clock.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    /// Time from one cycle to the next \[ns\]; each force is held this long.
    pub period_ns: u64,
    /// Control law with its gains.
    pub law: Law,
    /// What the gains of the estimator follow from.
    pub noise: NoiseModel,
    /// Errors of the readings of lengths.
    pub readings: Readings,
    /// From the release to the instant at which its force begins to act \[ns\].
    pub force_delay_ns: u64,
    /// Which terms of the dynamics are evaluated. Inertia must be one of them: the law commands an
    /// acceleration, and without inertia there would be no feedback.
    pub fidelity: Fidelity,
    /// Of every reference.
    pub limits: Limits,
    /// Where setpoints may be; `None` is without bounds.
    pub envelope: Option<Envelope>,
    /// Largest condition of the pose, see [`crate::model::sensitivity`].
    pub condition: f64,
    /// Largest change of a force \[N/s\].
    pub force_rate: f64,
    /// Reaction to a setpoint that the limits do not allow to follow.
    pub on_violation: ViolationPolicy,
    /// Acceleration that feedback may add to the limits, as a ratio of them.
    pub feedback_scale: f64,
    /// Change of the payload under control that is no fault \[kg\]; `None`: the default of the machine.
    pub payload_change_kg: Option<f64>,
    /// Sudden disturbance that is no impact \[m/s^2\]; `None` is the default, which follows from the limit of acceleration.
    pub disturbance_step: Option<f64>,
    /// Distance that the reference keeps from the ends of the stroke \[m\].
    pub stroke_margin: f64,
    /// Largest velocity error while active \[m/s\].
    pub following_velocity: f64,
    /// Largest angular velocity error while active \[rad/s\].
    pub following_angular_velocity: f64,
    /// Goal of the stop of a platform that lost its setpoint.
    pub after_loss: AfterStop,
    /// Largest position error at which control may begin \[m\].
    pub engage_position: f64,
    /// Largest orientation error at which control may begin \[rad\].
    pub engage_orientation: f64,
    /// Largest position error while active \[m\].
    pub following_position: f64,
    /// Largest orientation error while active \[rad\].
    pub following_orientation: f64,
    /// Age from which on a setpoint counts as lost.
    pub setpoint_timeout_ns: u64,
    /// Age from which on a measurement counts as lost.
    pub measured_timeout_ns: u64,
    /// Longest wait for drives that are not ready when control begins \[ns\].
    pub ready_timeout_ns: u64,
    /// Largest difference of a length from that of a pose measured by another sensor \[m\].
    pub pose_tolerance: f64,
    /// Largest age of a measurement that arrives: the loop is stable if all are as old.
    pub max_measured_age_ns: u64,
    /// Longest time between two cycles of a daemon that runs, also without messages \[ns\].
    pub longest_pause_ns: u64,
}

impl Parameters {
    /// The period \[s\].
    pub(super) fn period_s(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }

    /// Longest extrapolation of a setpoint \[s\]: until the first cycle that finds it too old.
    pub(super) fn max_extrapolation_s(&self) -> f64 {
        self.setpoint_timeout_ns.saturating_add(self.period_ns) as f64 * 1e-9
    }
}

/// Reaction to a setpoint that the limits do not allow to follow, `[setpoint] on_violation`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViolationPolicy {
    /// The platform comes to rest, which is a fault. For trajectories that were checked before.
    #[default]
    Stop,
    /// The platform follows as near as the limits allow, without a fault. For people, joysticks and simulators.
    Limit,
}

/// Range of the setpoint: lowest and highest X.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub struct Envelope {
    /// Lowest value of each coordinate of X \[rad\], \[m\].
    pub lowest: [f64; 6],
    /// Highest value of each coordinate of X \[rad\], \[m\].
    pub highest: [f64; 6],
}

/// Part of the way from the condition at home to its limit that the reference uses.
const CONDITION_SHARE: f64 = 0.85;
/// Least sine of the angle between a leg and the first axis of its universal joint, 6 degrees: fewer than any joint leaves.
/// The moment of the leg's spin grows with the inverse of the third power; there it still changes by less than itself in a
/// cycle of 10 ms.
const MIN_UNIVERSAL_SINE: f64 = 0.1;
/// The same as a ratio of that at home, for machines whose legs are as near to the axes there.
const MIN_UNIVERSAL_SINE_PER_HOME: f64 = 0.5;

/// Machine model, parameters and home pose: constant while the controller runs.
#[derive(Clone, Debug)]
pub struct Constants {
    /// Inverse dynamics of the machine.
    pub dynamics: InverseDynamics,
    /// Choices of the deployment.
    pub parameters: Parameters,
    /// At home.
    pub home: KinematicState,
    /// Largest distance of a joint on the platform from C \[m\].
    pub arm: f64,
    /// Acceleration of the platform by what the law commands.
    pub input_matrix: InputMatrix,
    /// Of the estimator under control.
    pub estimator: EstimatorConstants,
    /// Square of the least disturbance that may be a force that a drive does not deliver; infinite where the law leaves forces to feedback.
    pub least_missing_squared: f64,
    /// Changes of the disturbance that are no fault.
    pub disturbance_bounds: DisturbanceBounds,
    /// What equal readings of one leg allow.
    pub(super) frozen_leg: FrozenLegBounds,
    /// Window in which lengths alone show rest \[s\].
    pub(super) rest_window_s: f64,
    /// Of the estimator of the rates of the legs.
    pub leg_rates: EstimatorConstants,
    /// Largest condition of the reference: below that of the platform, for the following error.
    pub reference_condition: f64,
    /// Least sine of the angle between a leg and the first axis of its universal joint, of the reference.
    pub universal_sine: f64,
}

impl Constants {
    /// Evaluates them.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let home = KinematicState::new(machine, machine.home_pose());
        let arms = machine.joints.triples.unpack_vectors(&machine.joints.platform);
        let arm = arms.iter().map(nalgebra::Vector3::norm).fold(0.0, f64::max);
        let at_home = home.sensitivity().condition;
        let reference_condition = at_home + CONDITION_SHARE * (parameters.condition - at_home);
        let sine_at_home = universal_sine(machine, home.pose());
        let universal_sine = MIN_UNIVERSAL_SINE.min(MIN_UNIVERSAL_SINE_PER_HOME * sine_at_home);
        let NoiseModel { bandwidth, period_s, .. } = parameters.noise;
        let lengths_only = NoiseModel { bandwidth, period_s, rate_noise_ratio: None };
        let input_matrix = InputMatrix::at_home(machine, &parameters.law, parameters.fidelity);
        let Law { saturation, compensates_disturbance, .. } = &parameters.law;
        let disturbance = input_matrix.largest_disturbance(saturation);
        let acts_on_legs = parameters.law.mode.acts_on_legs();
        let least_missing = least_disturbance(
            &input_matrix.acceleration_by_force(machine, home.pose()),
            if acts_on_legs { 1.0 } else { arm },
            machine.actuator.max_force,
        );
        let expects_forces = parameters.law.mode.includes_inertia();
        let unbounded = Vector6::repeat(f64::INFINITY);
        let disturbance_bounds = DisturbanceBounds::new(
            machine,
            &parameters,
            &input_matrix,
            least_missing,
            if acts_on_legs { 1.0 } else { arm },
        );
        Self {
            disturbance_bounds,
            dynamics: InverseDynamics::new(machine),
            input_matrix,
            least_missing_squared: if expects_forces { least_missing * least_missing } else { f64::INFINITY },
            frozen_leg: FrozenLegBounds::new(
                parameters.law.position.stiffness,
                machine.actuator.max_force,
                period_s,
            ),
            estimator: EstimatorConstants::new(
                parameters.noise,
                parameters.readings,
                if *compensates_disturbance { disturbance } else { unbounded },
                parameters.limits.position.acceleration
                    + parameters.law.acceleration_left_to_feedback(&parameters.limits, arm, &disturbance),
            ),
            rest_window_s: window_s(&parameters),
            leg_rates: EstimatorConstants::new(lengths_only, parameters.readings, unbounded, f64::INFINITY),
            parameters,
            home,
            arm,
            reference_condition,
            universal_sine,
        }
    }

    /// Length by which angles of the error become distances \[m\]; errors of legs have no angles.
    pub(super) fn error_arm(&self) -> f64 {
        if self.parameters.law.mode.acts_on_legs() { 1.0 } else { self.arm }
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        self.dynamics.machine()
    }
}
