//! Bounds of the pose that the reference keeps: leg lengths, the envelope of X, and forces of the drives.

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::parameters::Envelope;
use crate::control::reference::proof::drive_forces::DriveForceBounds;
use crate::control::reference::proof::tolerances::{
    END_STOP_DISTANCE_PER_STROKE, RANGE_ROUNDING, START_EXCESS_PER_STROKE,
};
use crate::model::LEGS;
use crate::model::drive_loads::DriveLoads;
use crate::model::inverse_geometry::leg_lengths;
use crate::model::rigid::Pose;
use crate::model::task::task_coordinates;

/// Bounds of the leg lengths, of X and of the forces. If the platform is beyond the nominal bounds when control begins, they
/// are relaxed to its pose, so that it may return. They follow the reference back to the nominal bounds.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::control::reference) struct PoseBounds {
    /// Least leg lengths \[m\].
    pub shortest_m: [f64; LEGS],
    /// Largest leg lengths \[m\].
    pub longest_m: [f64; LEGS],
    pub envelope: Option<Envelope>,
    pub forces: DriveForceBounds,
    is_relaxed: bool,
}

impl PoseBounds {
    /// Nominal bounds: the stroke less the stroke margin at both ends, and the configured envelope.
    pub fn configured(constants: &Constants) -> Self {
        let (actuator, parameters) = (&constants.machine().actuator, &constants.parameters);
        Self {
            shortest_m: [actuator.min_length_m + parameters.stroke_margin_m; LEGS],
            longest_m: [actuator.max_length_m - parameters.stroke_margin_m; LEGS],
            envelope: parameters.envelope.map(|Envelope { lowest, highest }| Envelope {
                lowest: lowest.map(|x| x - RANGE_ROUNDING),
                highest: highest.map(|x| x + RANGE_ROUNDING),
            }),
            forces: DriveForceBounds::new(constants.machine()),
            is_relaxed: false,
        }
    }

    /// Nominal bounds, relaxed where a pose exceeds them.
    pub fn relaxed_to(constants: &Constants, pose: &Pose) -> Self {
        let mut bounds = Self::configured(constants);
        let actuator = &constants.machine().actuator;
        let [stroke_room, end_room] =
            [START_EXCESS_PER_STROKE, END_STOP_DISTANCE_PER_STROKE].map(|ratio| ratio * actuator.stroke());
        let lengths = leg_lengths(constants.machine(), pose);
        let (low_end, high_end) = (actuator.min_length_m + end_room, actuator.max_length_m - end_room);
        for (bound, length) in bounds.shortest_m.iter_mut().zip(lengths) {
            bounds.is_relaxed |= relax(bound, length, -stroke_room, low_end);
        }
        for (bound, length) in bounds.longest_m.iter_mut().zip(lengths) {
            bounds.is_relaxed |= relax(bound, length, stroke_room, high_end);
        }
        if let Some(Envelope { lowest, highest }) = &mut bounds.envelope {
            let x = task_coordinates(pose, &constants.machine().home);
            let turn_room = stroke_room / constants.machine().joints.radius_m;
            let rooms = [turn_room, turn_room, turn_room, stroke_room, stroke_room, stroke_room];
            for ((low, high), (x, room)) in lowest.iter_mut().zip(highest).zip(x.iter().zip(rooms)) {
                bounds.is_relaxed |=
                    relax(low, *x, -room, f64::NEG_INFINITY) | relax(high, *x, room, f64::INFINITY);
            }
        }
        if let Some(loads) = DriveLoads::new(&constants.dynamics, pose) {
            bounds.is_relaxed |= bounds.forces.relax_to(constants, &loads);
        }
        bounds
    }

    /// Distance by which the worst leg exceeds its bound at a pose; 0 if none does \[m\].
    pub fn length_excess_m(&self, constants: &Constants, pose: &Pose) -> f64 {
        let lengths = leg_lengths(constants.machine(), pose);
        let ends = self.shortest_m.iter().zip(&self.longest_m);
        let excesses =
            lengths.iter().zip(ends).map(|(length, (short, long))| (short - length).max(length - long));
        excesses.fold(0.0, f64::max)
    }

    /// Moves relaxed bounds inward to a pose, at most to the nominal bounds, and never outward.
    pub fn withdraw_relaxation(&mut self, constants: &Constants, pose: &Pose) {
        if !self.is_relaxed {
            return;
        }
        let around = Self::relaxed_to(constants, pose);
        let inner = |bound: &mut [f64; LEGS], other: &[f64; LEGS], pick: fn(f64, f64) -> f64| {
            bound.iter_mut().zip(other).for_each(|(bound, other)| *bound = pick(*bound, *other));
        };
        inner(&mut self.shortest_m, &around.shortest_m, f64::max);
        inner(&mut self.longest_m, &around.longest_m, f64::min);
        if let (Some(own), Some(other)) = (&mut self.envelope, &around.envelope) {
            inner(&mut own.lowest, &other.lowest, f64::max);
            inner(&mut own.highest, &other.highest, f64::min);
        }
        self.forces = self.forces.tighter_of(&around.forces);
        self.is_relaxed = around.is_relaxed;
    }
}

/// Relaxes a bound if a value exceeds it: to `room` beyond the value, but no farther than `end`, or to the
/// value itself if it is beyond `end`. The sign of `room` is the outward direction. Returns whether the value
/// exceeds the bound.
fn relax(bound: &mut f64, value: f64, room: f64, end: f64) -> bool {
    let is_beyond = (value - *bound) * room > 0.0;
    if is_beyond {
        let wanted = value + room;
        *bound = if room > 0.0 { wanted.min(end.max(value)) } else { wanted.max(end.min(value)) };
    }
    is_beyond
}
