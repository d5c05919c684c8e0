//! From wherever the platform stands into a scene, and to rest at its end.
//!
//! ```text
//! hold at the present pose | minimum-jerk move to the scene's start | settle | scene | settle
//! ```

use nalgebra::Vector6;

use super::minimum_jerk::{PEAK_RATE, rise, straight_move};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::machine::Machine;
use crate::model::task::TaskState;

/// Seconds to stand still before the approach, before and after the scene.
const SETTLE_S: f64 = 0.5;

/// Fastest leg of the approach, as a share of what the actuators can do: nobody is surprised.
const APPROACH_RATE_SHARE: f64 = 0.2;

/// When what begins, in seconds from the start.
#[derive(Clone, Copy, Debug)]
pub struct Timeline {
    from: Vector6<f64>,
    to: Vector6<f64>,
    approach: f64,
    scene: f64,
}

impl Timeline {
    /// From rest at `from` into a scene of `scene` seconds that starts at rest at `to`.
    pub fn new(machine: &Machine, from: &Vector6<f64>, to: &Vector6<f64>, scene: f64) -> Self {
        let lengths = |x: &Vector6<f64>| {
            Vector6::from(leg_lengths(machine, &TaskState::at_rest((*x).into()).motion().pose))
        };
        let way = (lengths(to) - lengths(from)).amax();
        let approach = PEAK_RATE * way / (APPROACH_RATE_SHARE * machine.actuator.max_rate);
        // Shorter than this an approach of a fraction of a millimetre would be a jerk.
        Self { from: *from, to: *to, approach: approach.max(SETTLE_S), scene }
    }

    /// With an approach of so many seconds at least.
    pub fn with_shortest_approach(self, seconds: f64) -> Self {
        Self { approach: self.approach.max(seconds), ..self }
    }

    /// Seconds from the start to the scene's first instant.
    pub fn motion_start(&self) -> f64 {
        2.0 * SETTLE_S + self.approach
    }

    /// Seconds from the start to the end of everything.
    pub fn end(&self) -> f64 {
        self.motion_start() + self.scene + SETTLE_S
    }

    /// X, X', X'' at `t`, given the scene as a function of its own time; that function is only asked
    /// within \[0, duration\].
    pub fn at(&self, t: f64, scene: impl FnOnce(f64) -> TaskState) -> TaskState {
        let scene_time = t - self.motion_start();
        if scene_time < 0.0 {
            return straight_move(&self.from, &self.to, &rise(t - SETTLE_S, self.approach));
        }
        if scene_time <= self.scene {
            return scene(scene_time);
        }
        TaskState { xd: Vector6::zeros(), xdd: Vector6::zeros(), ..scene(self.scene) }
    }
}
