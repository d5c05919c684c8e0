//! The built-in motions: displacements from home with consistent X, X', X''.
//!
//! Every motion fades in and out with the minimum-jerk window, so that it begins and ends at rest at
//! home. Amplitudes follow the machine: its size first, then [`fit`] shrinks the motion until stroke, rate
//! and force have reserve at a thousand samples. Limits of a deployment and singular poses between samples are not
//! checked here.

use core::f64::consts::TAU;
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;

use nalgebra::Vector6;

use super::minimum_jerk::{rise, scaled_by_profile, straight_move, window};
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Exact;
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::Machine;
use crate::model::task::TaskState;

/// Time a motion takes to fade in, and out again \[s\].
const FADE_S: f64 = 1.0;

/// Amplitude in position as a share of the platform's radius before fitting: 0.1 m for a 0.5 m platform.
const POSITION_OVER_RADIUS: f64 = 0.2;

/// Amplitude in each angle before fitting \[rad\]: 6 degrees.
const ANGLE_AMPLITUDE_RAD: f64 = 0.105;

/// Share of stroke, rate and force a fitted motion may use.
const USABLE_SHARE: f64 = 0.8;

crate::named! {
    /// A named motion.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum BuiltInMotion {
        /// Rest at home.
        Settle => "settle",
        /// Minimum-jerk moves along every axis.
        MinimumJerk => "minimum-jerk",
        /// A sine on every axis.
        Sines => "sines",
        /// A circle at constant orientation.
        Circle => "circle",
        /// A spatial curve, as in section 8 of the paper.
        // The paper's own curve is only in a figure; this one replaces it.
        Paper => "paper",
    }
}

impl BuiltInMotion {
    /// What the platform does, for a help text.
    pub fn description(self) -> &'static str {
        match self {
            Self::Settle => "Rest at home",
            Self::MinimumJerk => "Minimum-jerk moves along every axis in turn, there and back",
            Self::Sines => "A sine of its own frequency on every axis",
            Self::Circle => "A circle at constant orientation, in the plane of the second and third axis",
            Self::Paper => {
                "A spatial curve at the constant orientation 15, 10, 5 degrees, like the paper's section 8"
            }
        }
    }
}

/// Built-in motion of a given duration and size about the home pose of a machine.
///
/// ```
/// use hexad_core::motion::built_in::{BuiltInMotion, fit};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let motion = fit(&machine, BuiltInMotion::Sines, 6.0);
/// let (start, middle) = (motion.at(0.0), motion.at(2.7));
/// assert_eq!((start.x, start.xd.norm()), (machine.home.into(), 0.0));
/// assert!((middle.x - start.x).norm() > 0.01 && middle.xd.norm() > 0.01);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FittedMotion {
    /// Its shape.
    pub motion: BuiltInMotion,
    /// Duration \[s\].
    pub duration_s: f64,
    /// Amplitude in position \[m\].
    pub position_amplitude_m: f64,
    /// Amplitude in angle as a share of the motion's nominal angles.
    pub angle_share: f64,
    home: Vector6<f64>,
}

impl FittedMotion {
    /// X, X', X'' at `t_s` seconds after the start; at rest at home outside \[0, duration\].
    pub fn at(&self, t_s: f64) -> TaskState {
        let mut state = match self.motion {
            BuiltInMotion::Settle => TaskState::default(),
            BuiltInMotion::MinimumJerk => self.moves(t_s),
            BuiltInMotion::Sines => self.faded(t_s, &self.sines(t_s)),
            BuiltInMotion::Circle => self.faded(t_s, &self.circle(t_s)),
            BuiltInMotion::Paper => self.faded(t_s, &self.paper(t_s)),
        };
        state.x += self.home;
        state
    }

    /// The same motion with a share of its amplitude.
    pub fn smaller(&self, share: f64) -> Self {
        Self {
            position_amplitude_m: share * self.position_amplitude_m,
            angle_share: share * self.angle_share,
            ..*self
        }
    }

    fn faded(&self, t: f64, d: &TaskState) -> TaskState {
        // A motion too short for both fades is all fade.
        scaled_by_profile(d, &window(t, self.duration_s, FADE_S.min(0.5 * self.duration_s)))
    }

    fn amplitude(&self, angle: f64) -> Vector6<f64> {
        let (a, p) = (angle * self.angle_share, self.position_amplitude_m);
        Vector6::new(a, a, a, p, p, p)
    }

    fn sines(&self, t: f64) -> TaskState {
        // No two alike, none a multiple of another within the usual ten seconds.
        let omega = Vector6::new(0.47, 0.59, 0.71, 0.53, 0.61, 0.43) * TAU;
        let amplitude = self.amplitude(ANGLE_AMPLITUDE_RAD);
        harmonic(&amplitude, &omega, &Vector6::zeros(), t)
    }

    fn circle(&self, t: f64) -> TaskState {
        let p = self.position_amplitude_m;
        let phase = Vector6::new(0.0, 0.0, 0.0, 0.0, 0.25 * TAU, 0.0);
        harmonic(&Vector6::new(0.0, 0.0, 0.0, 0.0, p, p), &Vector6::repeat(0.5 * TAU), &phase, t)
    }

    fn paper(&self, t: f64) -> TaskState {
        let p = self.position_amplitude_m;
        let omega = Vector6::new(0.0, 0.0, 0.0, 0.25, 0.5, 0.5) * TAU;
        let phase = Vector6::new(0.0, 0.0, 0.0, 0.0, 0.25 * TAU, 0.0);
        let mut state = harmonic(&Vector6::new(0.0, 0.0, 0.0, 0.5 * p, p, p), &omega, &phase, t);
        state.x += Vector6::new(15.0, 10.0, 5.0, 0.0, 0.0, 0.0).map(f64::to_radians) * self.angle_share;
        state
    }

    /// Twelve moves: along each axis out and back, the angles first.
    fn moves(&self, t: f64) -> TaskState {
        let each = self.duration_s / 12.0;
        let number = (t / each).floor().clamp(0.0, 11.0);
        let axis = (number * 0.5).floor() as usize;
        let away = Vector6::ith(axis.min(5), 1.0).component_mul(&self.amplitude(ANGLE_AMPLITUDE_RAD));
        let s = rise(t - number * each, each);
        if number % 2.0 == 0.0 {
            straight_move(&Vector6::zeros(), &away, &s)
        } else {
            straight_move(&away, &Vector6::zeros(), &s)
        }
    }
}

/// `amplitude sin(omega t + phase)` per coordinate.
fn harmonic(amplitude: &Vector6<f64>, omega: &Vector6<f64>, phase: &Vector6<f64>, t: f64) -> TaskState {
    let angle = omega * t + phase;
    let (sin, cos) = (angle.map(f64::sin), angle.map(f64::cos));
    TaskState {
        x: amplitude.component_mul(&sin),
        xd: amplitude.component_mul(omega).component_mul(&cos),
        xdd: -amplitude.component_mul(omega).component_mul(omega).component_mul(&sin),
    }
}

/// The motion at its nominal size, or shrunk until stroke, rates and forces keep a reserve of a fifth.
pub fn fit(machine: &Machine, motion: BuiltInMotion, duration_s: f64) -> FittedMotion {
    let sized = |share: f64| FittedMotion {
        motion,
        duration_s,
        position_amplitude_m: share * POSITION_OVER_RADIUS * machine.joints.radius_m,
        angle_share: share,
        home: machine.home.into(),
    };
    // Each step takes a fifth: 40 of them reach 1e-4 of the size, which no valid machine needs.
    let model = InverseDynamics::new(machine);
    let mut share = 1.0;
    for _ in 0..40 {
        if has_reserve(&model, &sized(share)) {
            break;
        }
        share *= 0.8;
    }
    sized(share)
}

/// Whether stroke, rates and forces keep their reserve, on a thousand samples.
fn has_reserve(model: &InverseDynamics, fitted: &FittedMotion) -> bool {
    const SAMPLES: u32 = 1000;
    (0..=SAMPLES)
        .all(|k| keeps_reserve(model, &fitted.at(fitted.duration_s * f64::from(k) / f64::from(SAMPLES))))
}

/// Whether stroke, rates and forces keep a reserve of a fifth at one state; false at a singular pose.
pub fn keeps_reserve(model: &InverseDynamics, state: &TaskState) -> bool {
    let (machine, motion) = (model.machine(), state.motion());
    let actuator = &machine.actuator;
    let margin = 0.5 * (1.0 - USABLE_SHARE) * actuator.stroke();
    let legs = leg_motion(machine, &motion);
    legs.length_m.iter().all(|length| actuator.margin(*length) >= margin)
        && legs.rate_m_s.iter().all(|rate| rate.abs() <= USABLE_SHARE * actuator.max_rate_m_s)
        && model
            .forces::<Exact>(&motion)
            .is_some_and(|f| f.iter().all(|f| f.abs() <= USABLE_SHARE * actuator.weakest_available_force_n()))
}
