//! Path of a played motion: its timeline, and the point at which it continues after a pause.

use super::trajectory::Trajectory;
use hexad_core::control::signals::limits::Limits;
use hexad_core::model::task::TaskState;
use hexad_core::motion::timeline::Timeline;
use hexad_daemon::rate_change::RateChange;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use hexad_core::motion::built_in::BuiltInMotion;
    use hexad_daemon::precheck::Precheck;
    use hexad_machine::config::Config;

    /// At every instant of a motion near its limits, the daemon's own rules accept the path to rest and the
    /// continuation.
    #[test]
    fn the_daemon_follows_a_slowdown_from_anywhere_and_on() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let seconds = 4.0;
        let trajectory = Trajectory::built_in(&config, BuiltInMotion::Sines, seconds).unwrap();
        let at = |t: f64| trajectory.at(t.min(seconds));
        let limits = &config.deployment.limits.reference;
        let mut longest: f64 = 0.0;
        for k in 1..40 {
            let began_s = seconds * f64::from(k) / 40.0;
            let slowdown = RateChange::to_rest(began_s, limits, at);
            longest = longest.max(slowdown.duration_s);
            let paused_s = slowdown.own_time_s(slowdown.duration_s);
            let speedup = RateChange::from_rest(paused_s, limits, at);
            longest = longest.max(speedup.duration_s);
            let rest_s = began_s + slowdown.duration_s;
            let path = |t: f64| match t {
                _ if t < began_s => at(t),
                _ if t < rest_s + 0.1 => slowdown.at(t - began_s, at),
                _ => speedup.at(t - rest_s - 0.1, at),
            };
            let end_s = rest_s + 0.1 + speedup.duration_s;
            let refusal = Precheck::new(&config).refusal(path, [0.0, end_s + 0.1]);
            let on_s = speedup.own_time_s(speedup.duration_s + 0.25);
            assert!((on_s - paused_s - 0.5 * speedup.duration_s - 0.25).abs() < 1e-12, "{on_s}");
            assert!(refusal.is_none(), "from {began_s}: {refusal:?}");
            let rest = slowdown.at(slowdown.duration_s, at);
            assert!(rest.xd.amax() == 0.0 && rest.xdd.amax() < 1e-12, "{rest:?}");
            assert!((rest.x - at(began_s + 0.5 * slowdown.duration_s).x).amax() < 1e-12, "on the path");
        }
        assert!(longest < 3.0, "{longest} s");
    }

    #[test]
    fn derivatives_belong_to_the_path() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let trajectory = Trajectory::built_in(&config, BuiltInMotion::Sines, 4.0).unwrap();
        let changes = [false, true].map(|is_rising| RateChange { began_s: 1.0, duration_s: 1.5, is_rising });
        let h = 1e-5;
        for (change, k) in changes.into_iter().flat_map(|change| (1..30).map(move |k| (change, k))) {
            let path = |t: f64| change.at(t, |t| trajectory.at(t));
            let t = 0.05 * f64::from(k);
            let (a, b, c) = (path(t - h), path(t), path(t + h));
            assert!(((c.x - a.x) / (2.0 * h) - b.xd).amax() < 1e-6);
            assert!(((c.xd - a.xd) / (2.0 * h) - b.xdd).amax() < 1e-4);
        }
    }
}
