//! Pose and twist of the platform from a valid measurement, by forward kinematics that follows the motion
//! since home, or since the pose of another sensor.
//!
//! Other poses have the same leg lengths (assembly modes). Home is on the right side of every singularity,
//! and forward kinematics follows the pose from there without a gap. If the platform may have crossed a
//! singularity, its assembly mode is uncertain: forces are disabled until an operator has inspected the
//! platform and sent `clear`.

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::parameters::Parameters;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::inputs::Measurement;
use crate::control::signals::limits::{Limit, LimitSet};
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;
use crate::model::forward_kinematics::{Outcome, Tracker, TrackingResult};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::kinematic_state::KinematicState;
use crate::model::rigid::{Pose, Twist};
use crate::model::sensitivity::Sensitivity;
use crate::model::task::TaskState;
use nalgebra::Vector6;

/// Most Newton steps per cycle under control. One step covers far more than a cycle's motion; after a gap in
/// the measurements several may be needed.
const MAX_NEWTON_STEPS_PER_CYCLE: u32 = 8;

/// Condition above which the assembly mode may become uncertain, or `limits.condition` if that is less.
/// There, a change of pose longer than a trusted step, within which forward kinematics has one solution, may
/// have crossed a singularity. Below it the singularity is too far away to be crossed between two
/// measurements.
const MAX_CERTAIN_CONDITION: f64 = 300.0;

/// Pose and twist of the platform at the instant of a measurement, and how near they are to a singularity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlatformState {
    /// Measured pose by forward kinematics: R, and C \[m\], in the base frame.
    pub pose: Pose,
    /// Measured omega \[rad/s\] and v \[m/s\], base axes.
    pub twist: Twist,
    /// Condition of the pose, see [`crate::model::sensitivity`].
    pub condition: f64,
    /// Time to a singular pose if the motion continues \[s\]; infinite if it leads to none.
    pub time_to_singularity_s: f64,
}

/// A measurement with the state of the platform computed from it.
pub(in crate::control) struct Located<'a> {
    pub measurement: &'a Measurement,
    /// Rates of the legs, measured or estimated \[m/s\].
    pub rate_m_s: [f64; LEGS],
    pub platform: PlatformState,
}

/// Determinant at the last measurement, from which the time to a singularity is extrapolated.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct SingularityApproach {
    /// Time stamp of the last measurement \[ns\].
    time_ns: u64,
    determinant: f64,
    time_to_singularity: f64,
}

/// Second stage of the cycle: follows the pose of the platform.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct Localization {
    tracker: Tracker,
    /// Whether the pose was followed from home on without a gap.
    is_tracked_from_home: bool,
    approach: Option<SingularityApproach>,
    /// Why the assembly mode is uncertain, until cleared.
    assembly_mode_fault: Option<Diagnostic>,
}

impl Localization {
    /// Starts at the home pose.
    pub fn new(constants: &Constants) -> Self {
        Self {
            tracker: Tracker::new(constants.machine(), *constants.home.pose()),
            is_tracked_from_home: false,
            approach: None,
            assembly_mode_fault: None,
        }
    }

    /// Locates the platform at the instant of a measurement, in a bounded number of steps of forward
    /// kinematics.
    pub fn locate<'a>(
        &mut self,
        cycle: &Cycle<'_>,
        measurement: &'a Measurement,
        rate_m_s: [f64; LEGS],
    ) -> Result<Located<'a>, Diagnostic> {
        self.assembly_mode_fault.map_or(Ok(()), Err)?;
        let Cycle { constants, state, .. } = *cycle;
        let (machine, parameters) = (constants.machine(), &constants.parameters);
        if let Some(x) = measurement.pose.as_ref().filter(|_| !state.has_control()) {
            self.follow_external(constants, x, &measurement.length_m);
        }
        let start = *self.tracker.pose();
        let start_length = self.tracker.kinematic_state().lengths(machine);
        let mut tracked = self.tracker.advance(machine, &measurement.length_m).0;
        for _ in 1..if state.has_control() { MAX_NEWTON_STEPS_PER_CYCLE } else { 1 } {
            if tracked == TrackingResult::Approaching {
                tracked = self.tracker.advance(machine, &measurement.length_m).0;
            }
        }
        let is_uncertain = self.is_tracked_from_home
            && match tracked {
                TrackingResult::NotConverged => self.tracker.outcome() == Outcome::NearSingular,
                _ => self.is_assembly_mode_uncertain(constants, &start),
            };
        if is_uncertain {
            return Err(self.fail_assembly_mode(parameters));
        }
        match tracked {
            TrackingResult::Found => self.is_tracked_from_home = true,
            TrackingResult::Approaching if state.has_control() => {
                return Err(self.jump_diagnostic(constants, &start_length, &measurement.length_m));
            }
            TrackingResult::Approaching => return Err(DiagnosticCode::FindingPose.into()),
            TrackingResult::NotConverged => {
                self.is_tracked_from_home = false;
                self.restart(&constants.home);
                return Err(DiagnosticCode::PoseNotFound.into());
            }
        }
        let kinematic_state = self.tracker.kinematic_state();
        let twist = kinematic_state.twist(machine, &rate_m_s).ok_or(DiagnosticCode::SingularPose)?;
        let Sensitivity { condition, determinant, .. } = *kinematic_state.sensitivity();
        let time_to_singularity_s = self.time_to_singularity(measurement.time_ns, determinant);
        let pose = *self.tracker.pose();
        Ok(Located {
            measurement,
            rate_m_s,
            platform: PlatformState { pose, twist, condition, time_to_singularity_s },
        })
    }

    /// Twist of the platform at given leg rates \[m/s\]; `None` at a singular pose.
    pub fn twist_of(&self, constants: &Constants, rate_m_s: &Vector6<f64>) -> Option<Twist> {
        self.tracker.kinematic_state().twist(constants.machine(), &(*rate_m_s).into())
    }

    /// Ends an assembly mode fault: an operator has inspected the platform.
    pub fn clear_assembly_mode_fault(&mut self, home: &KinematicState) {
        if self.assembly_mode_fault.take().is_some() {
            self.restart(home);
        }
    }

    /// Whether the condition of the pose is within `max_condition`.
    pub fn check_condition(&self, max_condition: f64, active: &mut LimitSet) -> Result<(), Diagnostic> {
        let condition = self.tracker.kinematic_state().sensitivity().condition;
        if active.check(Limit::Condition, condition / max_condition) {
            return Ok(());
        }
        Err(self.near_singular(max_condition))
    }

    /// Diagnostic of a pose that is not singular, but whose condition exceeds `max_condition`.
    pub fn near_singular(&self, max_condition: f64) -> Diagnostic {
        let condition = self.tracker.kinematic_state().sensitivity().condition;
        Diagnostic::new(DiagnosticCode::NearSingular, condition, max_condition)
    }

    /// Restarts at home, the only pose whose assembly mode is known.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    fn restart(&mut self, home: &KinematicState) {
        self.tracker.restart(home);
    }

    /// Restarts forward kinematics at an external pose that has the measured lengths in another assembly mode.
    #[inline(never)]
    fn follow_external(&mut self, constants: &Constants, x: &[f64; 6], length: &[f64; LEGS]) {
        let (machine, pose) = (constants.machine(), TaskState::at_rest(*x).motion().pose);
        let fits = |(one, other): (&f64, &f64)| (one - other).abs() <= constants.parameters.pose_tolerance_m;
        let trusted_step = self.tracker.kinematic_state().sensitivity().trusted_step;
        if machine.joints.distance(self.tracker.pose(), &pose) > trusted_step
            && leg_lengths(machine, &pose).iter().zip(length).all(fits)
        {
            self.tracker.restart(&KinematicState::new(machine, pose));
        }
    }

    /// Whether the platform may have crossed a singularity. Poses beyond one have the same lengths as poses
    /// before it, and forward kinematics cannot distinguish them. Near one the assembly mode is uncertain if
    /// the change of pose is so long that the next measurement may belong to the other branch.
    fn is_assembly_mode_uncertain(&self, constants: &Constants, start: &Pose) -> bool {
        let kinematic_state = self.tracker.kinematic_state();
        let Sensitivity { condition, trusted_step, .. } = *kinematic_state.sensitivity();
        condition > assembly_mode_condition_bound(&constants.parameters)
            && constants.machine().joints.distance(start, kinematic_state.pose()) > trusted_step
    }

    fn fail_assembly_mode(&mut self, parameters: &Parameters) -> Diagnostic {
        self.is_tracked_from_home = false;
        let condition = self.tracker.kinematic_state().sensitivity().condition;
        let bound = assembly_mode_condition_bound(parameters);
        *self.assembly_mode_fault.insert(Diagnostic::new(DiagnosticCode::SingularPose, condition, bound))
    }

    /// Diagnostic of lengths that forward kinematics does not reach within a cycle. Its bound is the largest
    /// change of a length that it reached.
    fn jump_diagnostic(
        &self,
        constants: &Constants,
        start: &[f64; LEGS],
        measured: &[f64; LEGS],
    ) -> Diagnostic {
        let largest_change =
            |to: &[f64; LEGS]| to.iter().zip(start).map(|(to, start)| (to - start).abs()).fold(0.0, f64::max);
        let reached = largest_change(&self.tracker.kinematic_state().lengths(constants.machine()));
        Diagnostic::new(DiagnosticCode::MeasurementJumped, largest_change(measured), reached)
    }

    /// Time to a singularity \[s\], by linear extrapolation of the determinant, which is linear in time near
    /// a singular pose.
    fn time_to_singularity(&mut self, time_ns: u64, determinant: f64) -> f64 {
        let time_to_singularity = match self.approach {
            Some(last) if last.time_ns == time_ns => return last.time_to_singularity,
            Some(last) => {
                let dt = seconds_between(last.time_ns, time_ns);
                determinant * dt / (last.determinant - determinant)
            }
            None => f64::INFINITY,
        };
        let time_to_singularity = if time_to_singularity > 0.0 { time_to_singularity } else { f64::INFINITY };
        self.approach = Some(SingularityApproach { time_ns, determinant, time_to_singularity });
        time_to_singularity
    }
}

fn assembly_mode_condition_bound(parameters: &Parameters) -> f64 {
    parameters.max_condition.min(MAX_CERTAIN_CONDITION)
}
