//! Number of other poses that have the measured leg lengths, shared by the search, the control socket and the real-time thread. The
//! real-time thread never waits for it.

use core::fmt;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hexad_core::control::signals::inputs::{Input, Measurement};
use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::task_coordinates;

/// Change of a length, as a share of it, beyond which the platform is no longer where it was looked at.
const MOVED_SHARE: f64 = 1e-3;

/// A loss of the pose for less than this \[ns\], with the same pose after it within this \[m\], \[rad\], changes nothing.
const MOMENT_NS: u64 = 200_000_000;
const SAME_POSE: f64 = 1e-3;

/// `gained_ns` while the pose is unknown.
const NO_POSE: u64 = u64::MAX;

/// Result of the search, with the selection of an operator.
#[derive(Debug, Default)]
pub struct PoseGate {
    /// Number of the times that a pose was found anew, and [`Input::other_poses`].
    word: AtomicU64,
    /// Release of the first cycle with the present pose \[ns\].
    gained_ns: AtomicU64,
    /// X of the pose that an operator has selected, until a cycle reads it.
    chosen: [AtomicU64; 6],
    is_chosen: AtomicBool,
    /// The list for operators.
    poses: Mutex<Poses>,
}

/// The estimated pose of the platform, then the others with the same lengths. Each list has new numbers, so that a selection refers to
/// the list that the operator has seen.
#[derive(Clone, Debug, Default)]
struct Poses {
    home: [f64; 6],
    lengths: [f64; LEGS],
    poses: Vec<Pose>,
    first_number: usize,
}

impl PoseGate {
    /// Nothing is known yet.
    pub fn new() -> Self {
        let gate = Self::default();
        gate.word.store(word(0, Input::SEARCHING), Ordering::Release);
        gate.gained_ns.store(NO_POSE, Ordering::Release);
        gate
    }

    /// The number of the pose that a cycle has found, and of the others; `None` if the cycle is older.
    pub fn present(&self, release_ns: u64) -> Option<(u32, u32)> {
        let now = parts(self.word.load(Ordering::Acquire));
        (release_ns >= self.gained_ns.load(Ordering::Acquire)).then_some(now)
    }

    /// Whether there is a pose of which it is not known yet whether it is the only one.
    pub fn is_searching(&self) -> bool {
        let has_pose = self.gained_ns.load(Ordering::Acquire) != NO_POSE;
        has_pose && parts(self.word.load(Ordering::Acquire)).1 == Input::SEARCHING
    }

    /// Sets the number of other poses unless the pose was lost since.
    pub fn decide(&self, found: u32, others: u32) {
        let is_same = |now| (parts(now).0 == found).then_some(word(found, others));
        // Else it is searched again.
        let _ = self.word.fetch_update(Ordering::AcqRel, Ordering::Acquire, is_same);
    }

    /// The same for a search, unless it was decided meanwhile.
    pub fn end_search(&self, found: u32, others: u32) {
        let (searching, ended) = (word(found, Input::SEARCHING), word(found, others));
        let _ = self.word.compare_exchange(searching, ended, Ordering::AcqRel, Ordering::Acquire);
    }

    /// Selects the pose with this number. The error is the reason for a refusal.
    pub fn choose(&self, number: usize, measurement: Option<&Measurement>) -> Result<(), String> {
        let (found, others) = parts(self.word.load(Ordering::Acquire));
        let list = self.list_in_force().clone();
        if others == 0 || others == Input::SEARCHING || list.poses.is_empty() {
            return Err("there is no pose to select: no other pose has the measured lengths, or the search is in progress".into());
        }
        let Some(pose) = number.checked_sub(list.first_number).and_then(|k| list.poses.get(k)) else {
            return Err(format!("no pose {number}; {list}"));
        };
        let moved = |(one, other): (&f64, &f64)| (one - other).abs() > MOVED_SHARE * other;
        if measurement.is_none_or(|now| now.length_m.iter().zip(&list.lengths).any(moved)) {
            self.decide(found, Input::SEARCHING);
            return Err(
                "the platform has moved since the poses were listed; repeat hexad engage without --pose"
                    .into(),
            );
        }
        if number == list.first_number {
            self.decide(found, 0);
        } else {
            let x = task_coordinates(pose, &list.home);
            self.chosen.iter().zip(x).for_each(|(bits, x)| bits.store(x.to_bits(), Ordering::Relaxed));
            self.is_chosen.store(true, Ordering::Release);
            // Until a cycle has shown it.
            self.decide(found, Input::SEARCHING);
        }
        Ok(())
    }

    /// Replaces the list; the estimated pose is the first. Returns it as text.
    pub fn list(&self, machine: &Machine, poses: Vec<Pose>) -> String {
        let lengths = poses.first().map(|here| leg_lengths(machine, here)).unwrap_or_default();
        let mut list = self.list_in_force();
        let first_number = (list.first_number + list.poses.len()).max(1);
        *list = Poses { home: machine.home, lengths, poses, first_number };
        list.to_string()
    }

    /// The list as text.
    pub fn poses(&self) -> String {
        self.list_in_force().to_string()
    }

    fn list_in_force(&self) -> MutexGuard<'_, Poses> {
        self.poses.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// End of the gate in the real-time thread.
pub struct PoseWatch {
    gate: Arc<PoseGate>,
    /// Release \[ns\] and pose of the last cycle that had one.
    last: Option<(u64, Pose)>,
    has_pose: bool,
}

impl PoseWatch {
    /// Nothing was seen yet.
    pub fn new(gate: Arc<PoseGate>) -> Self {
        Self { gate, last: None, has_pose: false }
    }

    /// Sets the number of other poses in the input of a cycle. A selected pose becomes its external pose.
    pub fn apply_search_result(&self, input: &mut Input) {
        input.other_poses = parts(self.gate.word.load(Ordering::Acquire)).1;
        if let Some(measurement) = &mut input.measurement
            && self.gate.is_chosen.swap(false, Ordering::Acquire)
        {
            let bits = self.gate.chosen.each_ref();
            measurement.pose = Some(bits.map(|bits| f64::from_bits(bits.load(Ordering::Relaxed))));
        }
    }

    /// Requests a new search if the pose was lost, except after a short loss without motion, in which no platform changes its assembly
    /// mode.
    pub fn end_cycle(&mut self, release_ns: u64, pose: Option<Pose>) {
        let gate = &self.gate;
        if let Some(pose) = pose.filter(|_| !self.has_pose) {
            let is_same = self.last.is_some_and(|(last_ns, last)| {
                let way = last.displacement_to(&pose);
                let is_near = way.linear.norm() < SAME_POSE && way.angular.norm() < SAME_POSE;
                is_near && release_ns.saturating_sub(last_ns) < MOMENT_NS
            });
            if !is_same {
                let (found, _) = parts(gate.word.load(Ordering::Relaxed));
                gate.word.store(word(found.wrapping_add(1), Input::SEARCHING), Ordering::Release);
            }
            gate.gained_ns.store(release_ns, Ordering::Release);
        } else if pose.is_none() && self.has_pose {
            gate.gained_ns.store(NO_POSE, Ordering::Release);
        }
        self.has_pose = pose.is_some();
        self.last = pose.map(|pose| (release_ns, pose)).or(self.last);
    }
}

fn word(found: u32, others: u32) -> u64 {
    u64::from(found) << 32 | u64::from(others)
}

fn parts(word: u64) -> (u32, u32) {
    ((word >> 32) as u32, word as u32)
}

impl fmt::Display for Poses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((taken, others)) = self.poses.split_first() else { return Ok(()) };
        let x = task_coordinates(taken, &self.home);
        write!(f, "pose {} (estimated): X = {x:.3?}", self.first_number)?;
        for (number, other) in (self.first_number + 1..).zip(others) {
            let way = taken.displacement_to(other);
            let (shift, turn): ([f64; 3], _) = (way.linear.into(), way.angular.norm().to_degrees());
            write!(f, "; pose {number}: shifted from it by {shift:+.3?} m, rotated by {turn:.1} deg")?;
        }
        Ok(())
    }
}
