//! Result of `hexad check`: one struct for the text and for `--json`.

use serde::Serialize;

use super::limits::{ExceedableRange, MotionLimits, Tolerances, exceedable_ranges};
use hexad_core::control::constants::Constants;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::inverse_dynamics;
use hexad_core::model::fidelity::{Exact, Fidelity};
use hexad_core::model::inverse_geometry::{leg_directions, leg_lengths};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::assembly_modes::other_modes;
use hexad_machine::analysis::clearance::Clearance;
use hexad_machine::analysis::gravity_cone::ConeHolding;
use hexad_machine::analysis::other_pose_search::OtherPoseSearch;
use hexad_machine::config::control_loops::{ControlLoop, longest_stable_age_s, loops};
use hexad_machine::config::deployment::default_limits::{DerivedLimit, derived_limits};
use hexad_machine::config::examination::Examination;
use hexad_machine::config::{Config, Violation};
use hexad_machine::text::numbers::MotionDigits;

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
const SCHEMA: u32 = 1;
/// Rest poses that are searched for other permitted poses: a tenth of a second. `hexad workspace` searches more.
const SEARCHED_POSES: usize = 100;

/// Findings, and the machine at home, at rest. Numbers that do not exist are null in JSON.
#[derive(Clone, Debug, Serialize)]
pub struct CheckReport {
    pub schema: u32,
    pub machine: String,
    /// Whether the machine can be run: no errors.
    pub is_valid: bool,
    pub errors: Vec<Violation>,
    pub warnings: Vec<Violation>,
    pub legs: Vec<LegAtHome>,
    /// Digits of the lengths in the text.
    #[serde(skip)]
    pub digits: MotionDigits,
    /// Frobenius condition: 6 is best, infinite is singular.
    pub condition: f64,
    /// `limits.condition`.
    pub condition_limit: f64,
    pub rate_hz: f64,
    /// Largest motion between two measurements for which the pose is certain.
    pub certain_step_m: f64,
    pub certain_step_rad: f64,
    /// Other poses with the same lengths, and the nearest.
    pub other_poses: usize,
    /// Those of them that the joints permit: a start at home asks in which the platform stands.
    pub permitted_other_poses: usize,
    pub nearest_pose: Option<OtherPose>,
    /// Other permitted poses of rest poses.
    pub other_pose_search: OtherPoseSearch,
    /// Limits that the reference keeps.
    pub motion_limits: MotionLimits,
    /// Ranges of `[envelope]` that are below them.
    pub exceedable_ranges: Vec<ExceedableRange>,
    /// Largest errors and ages.
    pub tolerances: Tolerances,
    /// Default limits that are less than usual, because the drives cannot give more.
    pub derived_limits: Vec<DerivedLimit>,
    pub control_mode: &'static str,
    pub estimator_hz: f64,
    pub compensates_disturbances: bool,
    /// Largest changes of payload and disturbance that are no fault; null if any is allowed.
    pub payload_change_kg: f64,
    pub disturbance_step_m_s2: f64,
    /// Force that every leg can get whichever way it moves, and `actuator.max_force_n`.
    pub available_force_n: f64,
    pub max_force_n: f64,
    /// Friction of a leg that the checks permit beyond the model.
    pub friction_uncertainty_n: f64,
    /// Slowest and fastest mode of legs with separate control.
    pub leg_modes_hz: Option<[f64; 2]>,
    pub loops: Vec<LoopMargins>,
    /// Largest age of measurements with which the loops are stable.
    pub stable_age_s: f64,
    /// Forces under gravity in any direction of `--gravity-cone`.
    pub gravity_cone: Option<ConeHolding>,
    /// Largest pole of the platform under constant forces within `condition_limit`.
    pub held_pole_per_s: f64,
}

/// A leg at home.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LegAtHome {
    pub length_m: f64,
    pub to_shortest_m: f64,
    pub to_longest_m: f64,
    /// Static force; none at a singular pose.
    pub force_n: Option<f64>,
    /// Its share of the limit.
    pub force_ratio: Option<f64>,
    /// Angle between the leg and the first axis of its universal joint.
    pub joint_axis_deg: f64,
}

/// Another pose with the same lengths.
#[derive(Clone, Debug, Serialize)]
pub struct OtherPose {
    pub text: String,
    /// Whether it may be confused with home at start-up.
    pub is_confusable: bool,
}

/// Margins of a control loop.
#[derive(Clone, Debug, Serialize)]
pub struct LoopMargins {
    pub name: &'static str,
    pub bandwidth_hz: f64,
    pub delay_periods: f64,
    pub largest_stable_hz: f64,
    pub gain_margin: f64,
    pub longest_delay_periods: f64,
    #[serde(skip)]
    pub text: String,
}

impl CheckReport {
    /// Evaluates the model at home, at rest.
    pub fn new(config: &Config, examination: &Examination) -> Self {
        let Config { name, machine, deployment, .. } = config;
        let (control, limits) = (&deployment.control, &deployment.limits);
        let kinematic_state = KinematicState::new(machine, machine.home_pose());
        let sensitivity = kinematic_state.sensitivity();
        let others = other_modes(machine, &kinematic_state);
        let root = |gain: f64| gain.sqrt() * control.position_bandwidth_hz;
        let masses = &control.leg_masses;
        let leg_modes_hz = [root(masses.softest_mode_gain_ratio), root(masses.stiffest_mode_gain_ratio)];
        let constants =
            Constants::new(machine, hexad_daemon::parameters(machine, deployment, Fidelity::Exact));
        let reachable = machine.with_stroke_margin(limits.stroke_margin_m);
        let clearance = Clearance::new(&reachable, constants.max_reference_condition);
        Self {
            schema: SCHEMA,
            machine: name.clone(),
            is_valid: examination.errors.is_empty(),
            errors: examination.errors.clone(),
            warnings: examination.warnings.clone(),
            legs: legs(config),
            digits: MotionDigits::new(config.resolution()),
            condition: sensitivity.condition,
            condition_limit: limits.condition,
            rate_hz: deployment.realtime.rate_hz,
            certain_step_m: sensitivity.trusted_step * machine.joints.radius_m,
            certain_step_rad: sensitivity.trusted_step,
            other_poses: others.len(),
            permitted_other_poses: others.iter().filter(|mode| mode.is_permitted).count(),
            nearest_pose: others
                .iter()
                .find(|mode| mode.is_confusable())
                .or_else(|| others.first())
                .map(|mode| OtherPose { text: mode.to_string(), is_confusable: mode.is_confusable() }),
            other_pose_search: OtherPoseSearch::new(machine, &clearance, SEARCHED_POSES),
            motion_limits: MotionLimits::new(limits),
            exceedable_ranges: deployment
                .envelope
                .map_or_else(Vec::new, |envelope| exceedable_ranges(&envelope, &limits.in_force())),
            tolerances: Tolerances::new(deployment),
            derived_limits: derived_limits(machine, &limits.reference),
            control_mode: control.mode.name(),
            estimator_hz: control.estimator_bandwidth_hz,
            compensates_disturbances: control.compensate_disturbances,
            payload_change_kg: constants.disturbance_bounds.max_payload_change_kg,
            disturbance_step_m_s2: constants.disturbance_bounds.max_sudden_acceleration_m_s2,
            available_force_n: machine.actuator.weakest_available_force_n(),
            max_force_n: machine.actuator.max_force_n,
            friction_uncertainty_n: machine.actuator.friction_uncertainty_n,
            leg_modes_hz: control.mode.acts_on_legs().then_some(leg_modes_hz),
            loops: margins(config),
            stable_age_s: longest_stable_age_s(deployment),
            gravity_cone: examination.gravity_cone,
            held_pole_per_s: limits.held_pole_per_s,
        }
    }
}

fn legs(config: &Config) -> Vec<LegAtHome> {
    let machine = &config.machine;
    let (motion, actuator) = (TaskState::at_rest(machine.home).motion(), &machine.actuator);
    let axes = machine.joints.triples.unpack_vectors(&machine.joints.universal_axis);
    let forces = inverse_dynamics::<Exact>(machine, &motion).map_or([None; LEGS], |forces| forces.map(Some));
    let lengths = leg_lengths(machine, &motion.pose);
    let directions = leg_directions(machine, &motion.pose);
    let angles = axes.iter().zip(&directions).map(|(u, n)| u.cross(n).norm().atan2(u.dot(n)).to_degrees());
    let values = lengths.into_iter().zip(forces).zip(angles);
    let leg = |((length_m, force_n), joint_axis_deg): (_, f64)| LegAtHome {
        length_m,
        to_shortest_m: length_m - actuator.min_length_m,
        to_longest_m: actuator.max_length_m - length_m,
        force_n,
        force_ratio: force_n.map(|force: f64| force.abs() / actuator.weakest_available_force_n()),
        joint_axis_deg,
    };
    values.map(leg).collect()
}

fn margins(config: &Config) -> Vec<LoopMargins> {
    let of_loop = |control_loop: ControlLoop| LoopMargins {
        name: control_loop.name,
        bandwidth_hz: control_loop.bandwidth_hz,
        delay_periods: control_loop.sampled.delay_periods,
        largest_stable_hz: control_loop.largest_stable_hz(),
        gain_margin: control_loop.sampled.gain_margin(),
        longest_delay_periods: control_loop.sampled.longest_delay(),
        text: control_loop.to_string(),
    };
    loops(&config.deployment).into_iter().map(of_loop).collect()
}
