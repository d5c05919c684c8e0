//! Clearance of sets of poses: every leg within its stroke and away from the first axis of its universal joint, on home's side
//! of singular poses, no condition beyond a limit, and drives that can hold the platform.
//! Proved for a whole cell of poses at once, not sampled: a singular surface has no thickness and passes between any
//! samples.
//!
//! The parameters of a pose are three angles, one after the other about the axes `e` that the ones before left, and three
//! displacements. From the middle of a cell they go at most `h` away. With arms `b` from C, `a = |b|`, moments
//! `m = b x n`, `d` the largest displacement of C, `t` the largest rotation, `t'` of the axes themselves, and `s = d + a t`
//! the largest displacement of a joint:
//!
//! ```text
//! t^2 = (h1 + h3)^2 + h2^2        t'^2 = h1 h2 + (h1 + h2) h3        g = sum |e . m| h + sum |n| h
//! L - L0  <=  g + (s^2 / (L0 - s) + a (t^2 + t'^2)) / 2              Taylor, with the largest L''
//! L - L0  >= -g - a (t^2 + t'^2) / 2
//! |n - n0| <= q = s / sqrt(L0 (L0 - s))
//! |N - N0|^2 <= D^2 = sum of q^2 + (a' / r)^2 (t + q)^2              arms a' from the mean of the joints
//! |N^-1| <= B / (1 - f),  B = |N0^-1|,  f = B D                      where f < 1: no pose is singular
//! condition = |N| |N^-1| <= min(|N0| + D, sqrt 12) B / (1 - f)       Frobenius norms throughout
//! ```
//!
//! Where that bound is too large, by Taylor: `f = sum of |N0^-1 dN_k| h_k + B F / 2`, `dN_k` the derivative of N along a parameter
//! and `F^2` the sum of squares of the second derivatives of the columns along any path through the cell:
//!
//! ```text
//! |n''| <= (a (t^2 + t'^2) + 3 s^2 / l) / l,  l = L0 - s       |m''| / r <= (a' / r) (t^2 + t'^2 + 2 t s / l + |n''|)
//! ```
//!
//! Sine of the angle to the axis of a universal joint: at least that at the centre less q. Force that holds the platform: see
//! `model::force_changes`.
//!
//! Cells that cover a region around home and all pass have the sign of home's determinant everywhere.
//!
//! Rounding, 1e-15 of the lengths, is not accounted for. Collisions of legs and joint angles are not part of it.

use nalgebra::{Matrix6, Vector3};

use super::gravity_cone::GravityCone;
use super::region_shape::{PoseCell, RegionShape, turned};
use hexad_core::control::constants::{MAX_HOLDING_SHARE, least_universal_sine};
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::conditioning::Conditioning;
use hexad_core::model::force_changes::{ForceChangeBounds, LargestMotion};
use hexad_core::model::inverse_geometry::{leg_lengths, universal_sine};
use hexad_core::model::inverse_jacobian::{leg_wrenches, scaled_wrenches};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Pose;
use hexad_core::model::sensitivity::MAX_LEG_WRENCHES_NORM;

/// Smallest usual share of the linear part in the bound of a change. Only the computing time depends on it.
const MIN_LINEAR_SHARE: f64 = 0.1;

/// Limit of the workspace that a pose violates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkspaceLimit {
    /// A leg, counted from 0, is shorter than its stroke allows.
    LegTooShort(usize),
    /// A leg, counted from 0, is longer than its stroke allows.
    LegTooLong(usize),
    /// The pose is beyond a singular pose.
    Singular,
    /// The condition exceeds its limit.
    Condition,
    /// A leg is too near to the first axis of its universal joint.
    UniversalJoint,
    /// A leg, counted from 0, needs too much force to hold the platform.
    HoldingForce(usize),
}

/// Machine with the limits of its workspace.
#[derive(Clone, Debug)]
pub struct Clearance<'a> {
    machine: &'a Machine,
    home: Pose,
    home_determinant: f64,
    largest_condition: f64,
    least_universal_sine: f64,
    gravity: GravityCone,
    dynamics: InverseDynamics,
    force_changes: ForceChangeBounds,
    /// Lengths of the arms of the joints on the platform: from C, and from their mean in radii.
    arms: [(f64, f64); LEGS],
    /// The joints on the platform and their mean, in platform axes.
    joints: [Vector3<f64>; LEGS],
    mean: Vector3<f64>,
}

impl<'a> Clearance<'a> {
    /// The limits of a machine around home, with the largest condition that is allowed.
    pub fn new(machine: &'a Machine, largest_condition: f64) -> Self {
        let home = machine.home_pose();
        let joints = &machine.joints;
        let platform = joints.triples.unpack_vectors(&joints.platform);
        let mean = platform.iter().sum::<Vector3<f64>>() / LEGS as f64;
        let at_home = KinematicState::new(machine, home);
        Self {
            machine,
            home,
            home_determinant: at_home.sensitivity().determinant,
            least_universal_sine: least_universal_sine(machine, &at_home),
            gravity: GravityCone::new(machine.gravity_m_s2, 0.0),
            dynamics: InverseDynamics::new(machine),
            force_changes: ForceChangeBounds::new(machine),
            largest_condition,
            arms: platform.map(|arm| (arm.norm(), (arm - mean).norm() / joints.radius_m)),
            joints: platform,
            mean,
        }
    }

    /// The same limits under gravity in any direction within so much of the machine's.
    pub fn in_cone(self, half_angle_rad: f64) -> Self {
        Self { gravity: GravityCone::new(self.machine.gravity_m_s2, half_angle_rad), ..self }
    }

    /// The leg nearest to an end of its stroke at the middle of a cell, and its distance from that end \[m\]. C can
    /// move by that along the leg, and no length changes by more than C moves: this is the largest ball within the stroke at
    /// this orientation.
    pub fn margin(&self, shape: &RegionShape, cell: &PoseCell) -> (f64, WorkspaceLimit) {
        let actuator = &self.machine.actuator;
        let ends = |(leg, length): (usize, f64)| {
            [
                (length - actuator.min_length_m, WorkspaceLimit::LegTooShort(leg)),
                (actuator.max_length_m - length, WorkspaceLimit::LegTooLong(leg)),
            ]
        };
        let lengths = leg_lengths(self.machine, &self.pose(shape, &cell.middle));
        let nearer = |a: (f64, WorkspaceLimit), b: (f64, WorkspaceLimit)| if b.0 < a.0 { b } else { a };
        lengths
            .into_iter()
            .enumerate()
            .flat_map(ends)
            .fold((f64::INFINITY, WorkspaceLimit::Condition), nearer)
    }

    /// The limit violated at the middle of a cell, with the size there, if the middle belongs to the family.
    pub fn violation(&self, shape: &RegionShape, cell: &PoseCell) -> Option<(f64, WorkspaceLimit)> {
        let size = shape.size(&PoseCell { half: [0.0; 6], ..*cell })?;
        self.violation_at(&self.pose(shape, &cell.middle)).map(|limit| (size, limit))
    }

    /// The pose of parameters.
    fn pose(&self, shape: &RegionShape, parameters: &[f64; 6]) -> Pose {
        let [a, b, c, x, y, z] = *parameters;
        let position = self.home.position + Vector3::new(x, y, z);
        let [alpha, beta, gamma, ..] = self.machine.home;
        let rotation = match shape {
            RegionShape::Ball { .. } => turned([a, b, c]) * self.home.rotation,
            RegionShape::Box { .. } => turned([alpha + a, beta + b, gamma + c]),
        };
        Pose { rotation, position }
    }

    /// The axes of the three angles, in base axes.
    fn axes(&self, shape: &RegionShape, parameters: &[f64; 6]) -> [Vector3<f64>; 3] {
        let [a, b, ..] = *parameters;
        let [alpha, beta, ..] = self.machine.home;
        let (a, b) = if let RegionShape::Box { .. } = shape { (alpha + a, beta + b) } else { (a, b) };
        let ((sin_a, cos_a), (sin_b, cos_b)) = (a.sin_cos(), b.sin_cos());
        let second = Vector3::new(0.0, cos_a, sin_a);
        [Vector3::x(), second, Vector3::new(sin_b, -sin_a * cos_b, cos_a * cos_b)]
    }

    /// The limit that a pose violates.
    pub fn violation_at(&self, pose: &Pose) -> Option<WorkspaceLimit> {
        let kinematic_state = KinematicState::new(self.machine, *pose);
        let actuator = &self.machine.actuator;
        for (leg, length) in kinematic_state.lengths(self.machine).into_iter().enumerate() {
            if !(length >= actuator.min_length_m) {
                return Some(WorkspaceLimit::LegTooShort(leg));
            }
            if !(length <= actuator.max_length_m) {
                return Some(WorkspaceLimit::LegTooLong(leg));
            }
        }
        let sensitivity = kinematic_state.sensitivity();
        if !(sensitivity.determinant * self.home_determinant > 0.0) {
            return Some(WorkspaceLimit::Singular);
        }
        if !(sensitivity.condition <= self.largest_condition) {
            return Some(WorkspaceLimit::Condition);
        }
        if !(universal_sine(self.machine, pose) >= self.least_universal_sine) {
            return Some(WorkspaceLimit::UniversalJoint);
        }
        let (leg, force) = self.gravity.largest_holding_force(&self.dynamics, pose)?;
        (!(force <= self.holding_force())).then_some(WorkspaceLimit::HoldingForce(leg))
    }

    fn holding_force(&self) -> f64 {
        MAX_HOLDING_SHARE * self.machine.actuator.weakest_available_force_n()
    }

    /// Whether a proof exists that in a cell no leg is near the first axis of its universal joint, and that the drives can hold
    /// the platform. `turned_leg`, `change` and `left` are the largest q and D, and `1 - f`.
    fn is_held(&self, pose: &Pose, turn: f64, turned_leg: f64, change: f64, left: f64) -> bool {
        let middle = Conditioning::new(self.machine, pose);
        let Some(forces) = self.gravity.holding(&self.dynamics, pose) else { return false };
        let largest = forces.into_iter().fold(0.0, f64::max);
        let norm = forces.into_iter().map(|force| force * force).sum::<f64>().sqrt();
        let (at_rest, axial_norm) = (
            self.force_changes.at_rest(turn, turned_leg),
            self.force_changes.axial_norm(&LargestMotion::default()),
        );
        let wrench = at_rest.wrench + change * (norm + axial_norm);
        middle.universal_sine - turned_leg >= self.least_universal_sine
            && largest + middle.largest_row_norm / left * wrench + at_rest.axial_n <= self.holding_force()
    }

    /// Lower bound of [`Clearance::margin`] anywhere in a cell.
    pub fn least_stroke_margin(&self, shape: &RegionShape, cell: &PoseCell) -> f64 {
        let actuator = &self.machine.actuator;
        let pose = self.pose(shape, &cell.middle);
        let wrenches = leg_wrenches(self.machine, &pose);
        let axes = self.axes(shape, &cell.middle);
        let [ha, hb, hc, hx, hy, hz] = cell.half;
        let (half, turn) = (Vector3::new(hx, hy, hz), cell.turn());
        let turns_squared = turn * turn + ha * hb + (ha + hb) * hc;
        let lengths = leg_lengths(self.machine, &pose).into_iter();
        let margins =
            lengths.zip(self.arms).zip(wrenches.column_iter()).map(|((length, (arm, _)), wrench)| {
                let moment = wrench.fixed_rows::<3>(0);
                let angular = axes.iter().zip([ha, hb, hc]).map(|(axis, half)| moment.dot(axis).abs() * half);
                let linear = angular.sum::<f64>() + wrench.fixed_rows::<3>(3).abs().dot(&half);
                let moved = half.norm() + arm * turn;
                let shortest = length - moved;
                if !(shortest > 0.0) {
                    return f64::NEG_INFINITY;
                }
                let bent = 0.5 * arm * turns_squared;
                let longest = length + linear + 0.5 * moved * moved / shortest + bent;
                (length - linear - bent - actuator.min_length_m).min(actuator.max_length_m - longest)
            });
        margins.fold(f64::INFINITY, f64::min)
    }

    /// Whether a proof exists that no pose of a cell is singular, has a condition beyond the limit or a leg near the first axis of
    /// its universal joint, and that the drives can hold the platform.
    pub fn is_regular(&self, shape: &RegionShape, cell: &PoseCell) -> bool {
        let kinematic_state = KinematicState::new(self.machine, self.pose(shape, &cell.middle));
        let [ha, hb, hc, hx, hy, hz] = cell.half;
        let (shift, turn) = (Vector3::new(hx, hy, hz).norm(), cell.turn());
        let turns_squared = turn * turn + ha * hb + (ha + hb) * hc;
        let (mut change, mut bent, mut turned_leg) = (0.0, 0.0, 0.0_f64);
        for (length, (arm, arm_share)) in kinematic_state.lengths(self.machine).into_iter().zip(self.arms) {
            let moved = shift + arm * turn;
            let shortest = length - moved;
            if !(shortest > 0.0) {
                return false;
            }
            let turned = moved / (length * shortest).sqrt();
            turned_leg = turned_leg.max(turned);
            change += turned * turned + (arm_share * (turn + turned)).powi(2);
            let second = (arm * turns_squared + 3.0 * moved * moved / shortest) / shortest;
            let second_moment = arm_share * (turns_squared + 2.0 * turn * moved / shortest + second);
            bent += second * second + second_moment * second_moment;
        }
        let (change, bent) = (change.sqrt(), 0.5 * bent.sqrt());
        let wrenches = scaled_wrenches(self.machine, kinematic_state.pose());
        let norm = wrenches.norm();
        let inverse = kinematic_state.sensitivity().condition / norm;
        let most = (norm + change).min(MAX_LEG_WRENCHES_NORM) * inverse / self.largest_condition;
        let holds = |share: f64| {
            most <= 1.0 - share && self.is_held(kinematic_state.pose(), turn, turned_leg, change, 1.0 - share)
        };
        // The second bound takes ten times as long: only where it can succeed.
        holds(inverse * change)
            || most <= 1.0 - inverse * (bent + change * MIN_LINEAR_SHARE)
                && self
                    .linear_change(shape, cell, &kinematic_state, &wrenches)
                    .is_some_and(|linear| holds(linear + inverse * bent))
    }

    /// Sum of `|N0^-1 dN_k| h_k`; none at a singular pose.
    fn linear_change(
        &self,
        shape: &RegionShape,
        cell: &PoseCell,
        kinematic_state: &KinematicState,
        wrenches: &Matrix6<f64>,
    ) -> Option<f64> {
        let joints = &self.machine.joints;
        let inverse = wrenches.try_inverse()?;
        let rotation = kinematic_state.pose().rotation;
        let lengths = kinematic_state.lengths(self.machine);
        let zero = Vector3::zeros();
        let turns = self.axes(shape, &cell.middle).map(|axis| (axis, zero));
        let shifts = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| (zero, axis));
        let mut sum = 0.0;
        for ((turn, shift), half) in turns.into_iter().chain(shifts).zip(cell.half) {
            let mut derivative = Matrix6::zeros();
            for (((mut column, wrench), length), joint) in
                derivative.column_iter_mut().zip(wrenches.column_iter()).zip(lengths).zip(&self.joints)
            {
                let direction: Vector3<f64> = wrench.fixed_rows::<3>(3).into();
                let (arm, from_mean) = (rotation * joint, rotation * (joint - self.mean));
                let moved = shift + turn.cross(&arm);
                let turned = (moved - direction * direction.dot(&moved)) / length;
                let moment = turn.cross(&from_mean).cross(&direction) + from_mean.cross(&turned);
                column.fixed_rows_mut::<3>(0).copy_from(&(moment / joints.radius_m));
                column.fixed_rows_mut::<3>(3).copy_from(&turned);
            }
            sum += (inverse * derivative).norm() * half;
        }
        Some(sum)
    }
}
