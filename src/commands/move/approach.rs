//! Duration of the approach to the beginning of a motion.

use nalgebra::Vector6;

use hexad_core::control::signals::limits::{DerivativeLimits, Limits};
use hexad_core::motion::minimum_jerk::shortest_duration;

/// Share of each limit that the approach uses. The rest is for angles that change at the same time and add
/// up.
const APPROACH_SHARE: f64 = 0.5;

/// Duration \[s\] of an approach that keeps the limits, in any direction.
pub(super) fn unhurried_approach_s(limits: &Limits, from: &Vector6<f64>, to: &Vector6<f64>) -> f64 {
    let way = to - from;
    // The rotation is at most the sum of its angles.
    let angle = way.fixed_rows::<3>(0).abs().sum();
    let shortest = |way: f64, limits: &DerivativeLimits| {
        let DerivativeLimits { velocity, acceleration, jerk } = limits.scaled(APPROACH_SHARE);
        shortest_duration(way, [velocity, acceleration, jerk])
    };
    shortest(angle, &limits.orientation).max(shortest(way.fixed_rows::<3>(3).norm(), &limits.position))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use hexad_core::model::task::TaskState;
    use hexad_core::motion::timeline::Timeline;
    use hexad_daemon::precheck::Precheck;
    use hexad_machine::config::Config;

    /// Long approach with large angles, under limits of which each is active once. A quarter of the duration
    /// would exceed them.
    #[test]
    fn the_approach_keeps_the_limits() {
        for tight in
            ["velocity_m_s = 0.02", "acceleration_m_s2 = 0.02", "jerk_m_s3 = 0.05", "jerk_rad_s3 = 0.1"]
        {
            let config = Config::parse(&format!("{DEFAULT_CONFIG}\n[limits]\n{tight}\n"), "a test").unwrap();
            let home = Vector6::from(config.machine.home);
            let from = home + Vector6::new(0.08, -0.1, 0.09, 0.06, 0.05, -0.04);
            let precheck = Precheck::new(&config);
            let refused = |share: f64| {
                let duration_s =
                    share * unhurried_approach_s(&config.deployment.limits.reference, &from, &home);
                let timeline =
                    Timeline::new(&config.machine, &from, &home, 1.0).with_shortest_approach(duration_s);
                let at = |t| timeline.at(t, |_| TaskState::at_rest(config.machine.home));
                // In one piece, because a new start would hide any lag of the reference.
                precheck.refusal(at, [0.0, timeline.motion_start_s()])
            };
            assert!(refused(1.0).is_none(), "{tight}: {:?}", refused(1.0));
            assert!(refused(0.25).is_some(), "{tight}");
        }
    }
}
