//! Path of a played motion: its timeline, and the point at which it continues after a pause.

use super::rate_change::RateChange;
use super::trajectory::Trajectory;
use crate::control::signals::limits::Limits;
use crate::model::task::TaskState;
use crate::motion::timeline::Timeline;

/// Timeline played from its beginning, or from rest at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    timeline: Timeline,
    resumed: Option<RateChange>,
}

impl Path {
    /// Path from the beginning of a timeline.
    pub fn new(timeline: Timeline) -> Self {
        Self { timeline, resumed: None }
    }

    /// Path that continues from rest at an instant of this path \[s\].
    pub fn resumed(&self, at_s: f64, limits: &Limits, trajectory: &Trajectory) -> Self {
        let of_timeline = |t: f64| self.timeline.at(t, |t| trajectory.at(t));
        let rise = RateChange::from_rest(self.timeline_s(at_s), limits, of_timeline);
        Self { timeline: self.timeline, resumed: Some(rise) }
    }

    /// X, X', X'' at a time since its beginning \[s\].
    pub fn at(&self, t: f64, trajectory: &Trajectory) -> TaskState {
        let of_timeline = |t: f64| self.timeline.at(t, |t| trajectory.at(t));
        self.resumed.map_or_else(|| of_timeline(t), |rise| rise.at(t, of_timeline))
    }

    /// Whether it has ended at a time since its beginning \[s\].
    pub fn has_ended(&self, t: f64) -> bool {
        self.timeline_s(t) > self.timeline.end()
    }

    fn timeline_s(&self, t: f64) -> f64 {
        self.resumed.map_or(t, |rise| rise.own_time_s(t))
    }
}
