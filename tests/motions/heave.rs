//! Motions along the vertical through home, as far as the legs reach.

use hexad::control::parameters::Parameters;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::machine::Machine;
use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::{Profile, rise, shortest_duration};
use nalgebra::Vector3;

/// Part of a limit that a motion within the limits uses.
pub const SHARE: f64 = 0.9;
/// Distance that the ends of the vertical keep from the end of a stroke \[m\], beyond the stroke margin.
const RESERVE_M: f64 = 0.005;
/// Resolution of the ends \[m\].
const STEP_M: f64 = 0.001;
/// Farthest end that is looked for \[m\].
const FARTHEST_M: f64 = 1.0;
/// Time in which a sine grows to its full amplitude \[s\].
pub const FADE_S: f64 = 2.0;

/// The vertical through home.
#[derive(Clone, Copy, Debug)]
pub struct Heave {
    home: [f64; 6],
    up: Vector3<f64>,
    /// Lowest and highest offset from home \[m\].
    pub range: [f64; 2],
}

impl Heave {
    pub fn new(machine: &Machine, parameters: &Parameters) -> Self {
        let up = -machine.gravity_m_s2.normalize();
        let reaches = |offset: f64| {
            let mut pose = machine.home_pose();
            pose.position += up * offset;
            let margins = leg_lengths(machine, &pose).map(|length| machine.actuator.margin(length));
            margins.iter().all(|margin| *margin > parameters.stroke_margin_m + RESERVE_M)
                && KinematicState::new(machine, pose).sensitivity().condition < 0.5 * parameters.max_condition
        };
        let end = |sign: f64| {
            let mut offset = 0.0;
            while offset < FARTHEST_M && reaches(sign * (offset + STEP_M)) {
                offset += STEP_M;
            }
            sign * offset
        };
        Self { home: machine.home, up, range: [end(-1.0), end(1.0)] }
    }

    /// At an offset with its derivatives.
    pub fn at(&self, [s, v, a]: [f64; 3]) -> TaskState {
        let mut task = TaskState::at_rest(self.home);
        for axis in 0..3 {
            let up = self.up[axis];
            task.x[3 + axis] += up * s;
            task.xd[3 + axis] = up * v;
            task.xdd[3 + axis] = up * a;
        }
        task
    }

    pub fn middle(&self) -> f64 {
        0.5 * (self.range[0] + self.range[1])
    }

    /// Middles of sines that turn at the lowest end, halfway and at the highest end.
    pub fn middles(&self, amplitude: f64) -> [f64; 3] {
        [self.range[0] + amplitude, self.middle(), self.range[1] - amplitude]
    }

    /// A move of minimum jerk from rest to rest.
    pub fn moving(&self, [from, to]: [f64; 2], duration_s: f64, t: f64) -> TaskState {
        let Profile { value_share: s, rate_per_s, accel_per_s2 } = rise(t, duration_s);
        let d = to - from;
        self.at([from + d * s, d * rate_per_s, d * accel_per_s2])
    }

    /// A sine about an offset that grows from rest.
    pub fn sine(&self, middle: f64, amplitude: f64, omega: f64, t: f64) -> TaskState {
        let Profile { value_share: s, rate_per_s, accel_per_s2 } = rise(t, FADE_S);
        let (sin, cos) = (omega * t).sin_cos();
        let (x, v, a) = (sin, omega * cos, -omega * omega * sin);
        self.at([
            middle + amplitude * s * x,
            amplitude * (s * v + rate_per_s * x),
            amplitude * (s * a + 2.0 * rate_per_s * v + accel_per_s2 * x),
        ])
    }
}

/// Duration of a move of minimum jerk that uses a share of the limits.
pub fn duration_s(parameters: &Parameters, machine: &Machine, distance: f64) -> f64 {
    let limits = &parameters.limits.position;
    let velocity = limits.velocity.min(machine.actuator.max_rate_m_s);
    shortest_duration(distance, [velocity, limits.acceleration, limits.jerk].map(|limit| SHARE * limit))
}

/// Amplitude of a sine that uses a share of the limits, and at most half of the range.
pub fn amplitude(parameters: &Parameters, machine: &Machine, heave: &Heave, omega: f64) -> f64 {
    let limits = &parameters.limits.position;
    let velocity = limits.velocity.min(machine.actuator.max_rate_m_s);
    let within = (velocity / omega).min(limits.acceleration / omega.powi(2)).min(limits.jerk / omega.powi(3));
    (SHARE * within).min(0.5 * (heave.range[1] - heave.range[0]))
}
