//! The control law: six accelerations from six errors, and what they become in each mode.
//!
//! ```text
//! asked = Kp e + Kd e' + d          e, e': errors and their rates; d: the observer's, see below
//! ```
//!
//! | mode | errors | force |
//! | --- | --- | --- |
//! | [`ComputedTorque`](ControlMode::ComputedTorque) | of the pose | inverse dynamics at the present pose and twist, accelerating with `desired + asked` |
//! | [`FeedforwardJointPd`](ControlMode::FeedforwardJointPd) | of the legs | inverse dynamics of the desired motion + `m_i asked_i` |
//! | [`GravityJointPd`](ControlMode::GravityJointPd) | of the legs | weight at the desired pose + `m_i asked_i` |
//! | [`JointPd`](ControlMode::JointPd) | of the legs | `m_i asked_i` |
//!
//! Errors of the pose: `e_p = C_d - C` and `e_R = log(R_d R^T)`, a rotation vector in base axes, never angles.
//! Errors of the legs: desired lengths and rates, by inverse geometry, minus measured ones. No law on legs
//! needs forward kinematics, weight included: it is taken at the desired pose, which has no noise. Supervision
//! (following error, condition, stopping, parking) goes by the measured pose in every mode. Legs know no angles:
//! their gains are those of the position. What `m_i` is: [`super::leg_masses`].
//!
//! Two instants meet here. The error is taken at the instant of the measurement, where both sides are
//! known. The force is needed for the middle of the interval in which it will be held, about a period
//! later. Mixing them would make every delay look like a tracking error of speed times delay. So the
//! error is carried over unchanged, and "the present" is where the platform will be if the error stays as
//! it is: the desired motion at that later instant, displaced by minus the error.
//!
//! # Observer
//!
//! What the model does not know, a payload or friction, shows in what becomes of an error: by the law alone it
//! would obey `e'' + Kd e' + Kp e = 0`. What is left of that sum is a disturbance, and d follows it:
//!
//! ```text
//! d' = L (e'' + Kd e' + Kp e)       integrated: d = L (e' + Kd e + Kp * integral of e), no e'' is needed
//! (s + L) (s^2 + Kd s + Kp) = 0     the loop with it
//! ```
//!
//! So the error becomes that of the law alone times `s / (s + L)`: nothing at rest, about `w / L` of it at a
//! frequency w below L. An integral alone, `L Kp` times that of e, does the same at rest, but takes damping from
//! the loop instead of adding a pole: it is of use to a twentieth of the bandwidth, too slow for a load that moves.
//! On the fast scene of `motion_base` (`tests/closed_loop/modes.rs`), a fifth heavier than modelled, the RMS error is
//! 261 um with neither, 52 um with such an integral, 4.7 um with an observer as fast as the loop. It is off by default: what is stiffer against payloads is so against
//! people too. d goes on only while no force is limited, and never beyond a share of the acceleration limits: no
//! wind-up.

use nalgebra::Vector6;

use super::gains::Gains;
use super::leg_masses::LegMasses;
use super::limits::Limits;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Gravity;
use crate::model::inverse_geometry::{LegMotion, leg_motion};
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};
use crate::model::task::TaskState;

/// From errors to forces; see the table above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ControlMode {
    #[default]
    ComputedTorque,
    FeedforwardJointPd,
    GravityJointPd,
    JointPd,
}

impl ControlMode {
    /// From the one that knows most to the one that knows nothing.
    pub const ALL: [Self; 4] =
        [Self::ComputedTorque, Self::FeedforwardJointPd, Self::GravityJointPd, Self::JointPd];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::ComputedTorque => "computed_torque",
            Self::FeedforwardJointPd => "feedforward_joint_pd",
            Self::GravityJointPd => "gravity_joint_pd",
            Self::JointPd => "joint_pd",
        }
    }

    /// Whether its errors are those of the legs.
    pub fn acts_on_legs(self) -> bool {
        self != Self::ComputedTorque
    }
}

/// Everything that decides how fast errors vanish.
#[derive(Clone, Copy, Debug)]
pub struct Law {
    pub mode: ControlMode,
    /// Of the position, and of the legs.
    pub position: Gains,
    pub orientation: Gains,
    /// L \[1/s\]; 0 is without.
    pub observer: f64,
    /// The mass that each drive moves \[kg\].
    pub leg_mass: Vector6<f64>,
    /// The most that the observer may ask for: \[rad/s^2\] and \[m/s^2\], or of each leg.
    pub reach: Vector6<f64>,
}

/// Largest part of the acceleration limit that the observer may ask for: what it removes is a payload or a
/// friction unknown to the model, and what is more than that is a collision.
const OBSERVER_SHARE: f64 = 0.5;

/// What feedback acts on, desired minus measured: angles and positions, or lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    pub value: Vector6<f64>,
    /// Its time derivative.
    pub rate: Vector6<f64>,
}

/// Desired minus measured, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingError {
    /// `[e_R; e_p]` \[rad\], \[m\].
    pub pose: Twist,
    /// `[omega_d - omega; v_d - v]` \[rad/s\], \[m/s\].
    pub twist: Twist,
}

impl TrackingError {
    /// The error at one instant.
    pub fn new(desired: &Motion, pose: &Pose, twist: &Twist) -> Self {
        Self {
            pose: pose.displacement_to(&desired.pose),
            twist: Twist {
                angular: desired.twist.angular - twist.angular,
                linear: desired.twist.linear - twist.linear,
            },
        }
    }
}

impl From<&TrackingError> for Deviation {
    fn from(error: &TrackingError) -> Self {
        Self { value: error.pose.vector(), rate: error.twist.vector() }
    }
}

impl From<&Deviation> for TrackingError {
    fn from(deviation: &Deviation) -> Self {
        Self { pose: Twist::from_vector(&deviation.value), twist: Twist::from_vector(&deviation.rate) }
    }
}

impl Deviation {
    /// Of the legs.
    pub fn of_legs(machine: &Machine, desired: &Motion, length: &[f64; LEGS], rate: &[f64; LEGS]) -> Self {
        let LegMotion { length: desired, rate: desired_rate, .. } = leg_motion(machine, desired);
        Self {
            value: Vector6::from(desired) - Vector6::from(*length),
            rate: Vector6::from(desired_rate) - Vector6::from(*rate),
        }
    }
}

/// The disturbance, as the acceleration that cancels it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observer {
    acceleration: Vector6<f64>,
    /// `e' + Kd e` of the next deviation if nothing disturbs; `None` if nobody can say.
    expected: Option<Vector6<f64>>,
}

impl Observer {
    /// Learns from what has become of the last deviation, and says what is asked for because of this one.
    pub fn asks(&mut self, law: &Law, deviation: &Deviation, dt: f64) -> Vector6<f64> {
        let (stiffness, damping) = law.gains();
        let Deviation { value, rate } = deviation;
        let pull = value.component_mul(&stiffness);
        let led = rate + value.component_mul(&damping);
        if let Some(expected) = self.expected {
            let learnt = self.acceleration + (led - expected) * law.observer;
            self.acceleration = learnt.sup(&-law.reach).inf(&law.reach);
        }
        self.expected = Some(led - pull * dt);
        pull + rate.component_mul(&damping) + self.acceleration
    }

    /// What was asked for does not happen, or the reference is another from now on.
    pub fn expect_nothing(&mut self) {
        self.expected = None;
    }
}

impl Law {
    /// `observer` as \[1/s\].
    pub fn new(
        machine: &Machine,
        mode: ControlMode,
        [position, orientation]: [Gains; 2],
        observer: f64,
        limits: &Limits,
    ) -> Self {
        let leg_mass = LegMasses::at_home(machine).mass;
        let most = |share_of: f64| OBSERVER_SHARE * share_of;
        let (angular, linear) = (most(limits.orientation.acceleration), most(limits.position.acceleration));
        let mut reach = Vector6::repeat(linear);
        match mode {
            ControlMode::ComputedTorque => reach.fixed_rows_mut::<3>(0).fill(angular),
            // Here also the weight is unknown.
            ControlMode::JointPd => {
                let home = TaskState::at_rest(machine.home).motion();
                let weight = InverseDynamics::new(machine).forces::<Gravity>(&home).unwrap_or_default();
                reach += Vector6::from(weight).abs().component_div(&leg_mass);
            }
            ControlMode::FeedforwardJointPd | ControlMode::GravityJointPd => {}
        }
        Self { mode, position, orientation, observer, leg_mass, reach }
    }

    /// Kp and Kd of every deviation.
    fn gains(&self) -> (Vector6<f64>, Vector6<f64>) {
        let Self { position, orientation, .. } = self;
        let first = if self.mode.acts_on_legs() { position } else { orientation };
        let all = |first: f64, second: f64| Vector6::new(first, first, first, second, second, second);
        (all(first.stiffness, position.stiffness), all(first.damping, position.damping))
    }

    /// `Kp e + Kd e'`
    pub fn feedback(&self, deviation: &Deviation) -> Vector6<f64> {
        let (stiffness, damping) = self.gains();
        deviation.value.component_mul(&stiffness) + deviation.rate.component_mul(&damping)
    }

    /// The deviation after `dt` seconds without a measurement, if the platform does what the law asks for:
    /// `e'' = -Kd e' - Kp e`, by one step of the semi-implicit Euler method, stable at these gains.
    pub fn predicted(&self, deviation: &Deviation, dt: f64) -> Deviation {
        let rate = deviation.rate - self.feedback(deviation) * dt;
        Deviation { value: deviation.value + rate * dt, rate }
    }

    /// The motion whose inverse dynamics are the forces of computed torque: where the platform will be at the
    /// instant of `desired` if `error` stays as it is, with the acceleration `asked` for.
    pub fn command(&self, desired: &Motion, error: &TrackingError, asked: &Vector6<f64>) -> Motion {
        let (e, e_rate) = (&error.pose, &error.twist);
        let Acceleration { angular, linear } = Acceleration::from_vector(asked);
        Motion {
            pose: desired.pose.displaced(&Twist { angular: -e.angular, linear: -e.linear }),
            twist: Twist {
                angular: desired.twist.angular - e_rate.angular,
                linear: desired.twist.linear - e_rate.linear,
            },
            acceleration: Acceleration {
                angular: desired.acceleration.angular + angular,
                linear: desired.acceleration.linear + linear,
            },
        }
    }

    /// The forces of the drives on their own for the accelerations `asked` for.
    pub fn leg_forces(&self, asked: &Vector6<f64>) -> [f64; LEGS] {
        asked.component_mul(&self.leg_mass).into()
    }
}
