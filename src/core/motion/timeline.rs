//! Timeline of a played motion: the approach from the present pose, the motion, and standstill at its end.
//!
//! ```text
//! hold at the present pose | minimum-jerk move to the motion's start | settle | motion | settle
//! ```
//!
//! The approach is straight in task coordinates; whether its path is free is not checked here.

use nalgebra::Vector6;

use super::minimum_jerk::{PEAK_RATE_RATIO, rise, straight_move};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::machine::Machine;
use crate::model::task::TaskState;

/// Standstill before the approach, before and after the motion \[s\].
const SETTLE_S: f64 = 0.5;

/// Rate of the fastest leg in the approach as a share of the actuators' limit: slow enough to step aside.
const APPROACH_RATE_SHARE: f64 = 0.2;

/// Timeline of one motion: hold, approach, settle, motion, settle.
///
/// ```
/// use hexad_core::{model::task::TaskState, motion::timeline::Timeline};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let home = TaskState::at_rest(machine.home);
/// let above = TaskState { x: home.x + nalgebra::Vector6::ith(5, 0.05), ..home };
/// let timeline = Timeline::new(&machine, &home.x, &above.x, 4.0);
/// assert_eq!(timeline.at(0.0, |_| above), home);
/// assert!((timeline.at(timeline.motion_start_s() - 1e-6, |_| above).x - above.x).amax() < 1e-9);
/// assert_eq!(timeline.end(), timeline.motion_start_s() + 4.0 + 0.5);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Timeline {
    from: Vector6<f64>,
    to: Vector6<f64>,
    approach_s: f64,
    motion_s: f64,
}

impl Timeline {
    /// From rest at `from` into a motion of `motion_s` seconds that starts at rest at `to`.
    pub fn new(machine: &Machine, from: &Vector6<f64>, to: &Vector6<f64>, motion_s: f64) -> Self {
        let lengths = |x: &Vector6<f64>| {
            Vector6::from(leg_lengths(machine, &TaskState::at_rest((*x).into()).motion().pose))
        };
        let way = (lengths(to) - lengths(from)).amax();
        let approach_s = PEAK_RATE_RATIO * way / (APPROACH_RATE_SHARE * machine.actuator.max_rate_m_s);
        // Shorter than this an approach of a fraction of a millimetre would be a jerk.
        Self { from: *from, to: *to, approach_s: approach_s.max(SETTLE_S), motion_s }
    }

    /// The same with an approach of at least `shortest_s`.
    pub fn with_shortest_approach(self, shortest_s: f64) -> Self {
        Self { approach_s: self.approach_s.max(shortest_s), ..self }
    }

    /// Start of the motion itself \[s\].
    pub fn motion_start_s(&self) -> f64 {
        2.0 * SETTLE_S + self.approach_s
    }

    /// End of the last standstill \[s\].
    pub fn end(&self) -> f64 {
        self.motion_start_s() + self.motion_s + SETTLE_S
    }

    /// X, X', X'' at `t_s`, given the motion as a function of its own time, which is evaluated only within
    /// \[0, duration\].
    pub fn at(&self, t_s: f64, motion: impl FnOnce(f64) -> TaskState) -> TaskState {
        let motion_time = t_s - self.motion_start_s();
        if motion_time < 0.0 {
            return straight_move(&self.from, &self.to, &rise(t_s - SETTLE_S, self.approach_s));
        }
        if motion_time <= self.motion_s {
            return motion(motion_time);
        }
        TaskState { xd: Vector6::zeros(), xdd: Vector6::zeros(), ..motion(self.motion_s) }
    }
}
