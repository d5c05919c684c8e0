//! The true motion of the platform under control, measured on the plant and compared with every limit.
//!
//! The controller's own view is not used: pose, twist and acceleration are those of the simulated platform, at each
//! release and at each change of the forces. Only the reference is the controller's, as it is judged too.

use hexad::control::law::gains::Gains;
use hexad::control::parameters::Parameters;
use hexad::control::signals::limits::DerivativeLimits;
use hexad::control::signals::state::State;
use hexad::model::LEGS;
use hexad::model::inverse_geometry::{leg_lengths, leg_motion};
use hexad::model::kinematic_state::KinematicState;
use hexad::model::machine::Machine;
use hexad::model::rigid::{Acceleration, Motion, Pose};
use hexad::model::task::task_coordinates;
use hexad::plant::forward_dynamics::ForwardDynamics;
use hexad::plant::simulator::{Brakes, Simulator};

use super::angle_between;
use super::extremes::{Extremes, Quantity};

/// A force is held for a period while the reference's acceleration changes with the jerk J: the velocity differs from the
/// reference's by up to this times J h^2, whatever the control law. 0.1 mm/s at 1 kHz, 12 mm/s at 100 Hz, by default.
const HELD_FORCE_RATIO: f64 = 0.25;
/// Forces that arrive d later than the controller knows: the velocity differs from the reference's by up to this times d A. The
/// platform keeps each acceleration for d longer, from -A to A, and feedback, which learns of it late, adds as much: found, not proved.
const LATE_FORCE_RATIO: f64 = 4.0;
/// Distance by which the true pose may leave the envelope \[m\]: the following error of a plant without flaws.
pub const ENVELOPE_ALLOWANCE_M: f64 = 50e-6;
/// The same for an angle \[rad\].
pub const ENVELOPE_ALLOWANCE_RAD: f64 = 100e-6;
/// Longest period whose acceleration is measured at its beginning alone: it changes by what a few millimetres per second
/// change of the velocity terms.
const LONGEST_EVEN_HOLD_NS: u64 = 1_000_000;
/// Part of the stroke by which the reference may be farther beyond a bound than where control began, or between knots.
const ROOM_RATIO: f64 = 5e-5;
/// Unit of the margin of a machine whose stroke margin is smaller \[m\].
const SMALLEST_MARGIN_M: f64 = 1e-4;

/// Measures the true motion of one platform.
#[derive(Clone, Debug)]
pub struct Meter {
    pub extremes: Extremes,
    /// Largest true velocity and acceleration of C while under control.
    pub fastest_m_s: f64,
    pub hardest_m_s2: f64,
    /// Periods under control.
    pub cycles: u64,
    /// Speed of the fastest leg before it met its end stop \[m/s\].
    pub impact_m_s: Option<f64>,
    /// By how much later than the controller knows the forces arrive \[s\].
    pub late_s: f64,
    parameters: Parameters,
    machine: Machine,
    dynamics: ForwardDynamics,
    /// For the present release, of the cycle before.
    expected: Option<Motion>,
    state: State,
    last_leg_rate: f64,
    beyond: Beyond,
}

/// How far the platform is beyond its bounds since control began: brakes may have left it there, and from then on it may
/// only come nearer.
#[derive(Clone, Copy, Debug, Default)]
struct Beyond {
    /// Of each coordinate of X.
    envelope: [f64; 6],
    /// Of the stroke less its margin \[m\].
    stroke_m: f64,
}

impl Meter {
    /// `plant` is the simulated machine.
    pub fn new(machine: &Machine, parameters: &Parameters, plant: &Machine) -> Self {
        Self {
            extremes: Extremes::default(),
            fastest_m_s: 0.0,
            hardest_m_s2: 0.0,
            cycles: 0,
            impact_m_s: None,
            late_s: 0.0,
            parameters: *parameters,
            machine: machine.clone(),
            dynamics: ForwardDynamics::new(plant),
            expected: None,
            state: State::Off,
            last_leg_rate: 0.0,
            beyond: Beyond::default(),
        }
    }

    /// The true motion at a release, under the force of the cycle before.
    pub fn at_release(&mut self, simulator: &Simulator, force: Option<&[f64; LEGS]>, now_ns: u64) {
        self.check_end_stop(simulator, now_ns);
        let (Some(force), Brakes::Open) = (force, simulator.brakes()) else {
            let pose = &simulator.state().pose;
            let envelope = self.envelope_excess(pose).map(|excess| excess.max(0.0));
            let stroke_m = self.margin_excess(&leg_lengths(&self.machine, pose)).max(0.0);
            self.beyond = Beyond { envelope, stroke_m };
            return;
        };
        self.cycles += 1;
        let state = simulator.state();
        let still = Motion { pose: state.pose, twist: state.twist, acceleration: Acceleration::default() };
        let legs = leg_motion(&self.machine, &still);
        self.last_leg_rate = legs.rate_m_s.iter().fold(0.0, |fastest, rate| fastest.max(rate.abs()));
        let [angular, linear] = [&self.parameters.limits.orientation, &self.parameters.limits.position]
            .map(|limits| held_velocity(&self.parameters, limits));
        let held = linear + angular * self.machine.joints.radius_m;
        let leg_rate = (self.last_leg_rate - held) / self.machine.actuator.max_rate_m_s;
        self.extremes.add(Quantity::LegRate, leg_rate, now_ns);
        self.extremes.add(Quantity::Stroke, self.margin_used(&legs.length_m), now_ns);
        let condition = KinematicState::new(&self.machine, state.pose).sensitivity().condition;
        self.extremes.add(Quantity::Condition, condition / self.parameters.max_condition, now_ns);
        if self.parameters.envelope.is_some() {
            let excess = self.envelope_excess(&state.pose);
            self.extremes.add(Quantity::Envelope, self.farther_beyond(&excess), now_ns);
        }
        if let Some(expected) = self.expected {
            self.check_distance(&expected.pose, &state.pose, now_ns);
        }
        if self.parameters.period_ns > LONGEST_EVEN_HOLD_NS {
            self.at_force(simulator, Some(force), now_ns);
        } else {
            self.check_velocity(simulator, now_ns);
        }
    }

    /// The true velocity, and the acceleration under a force.
    pub fn at_force(&mut self, simulator: &Simulator, force: Option<&[f64; LEGS]>, now_ns: u64) {
        self.check_end_stop(simulator, now_ns);
        let (Some(force), None) = (force, self.impact_m_s) else { return };
        self.check_velocity(simulator, now_ns);
        let state = simulator.state();
        let limits = &self.parameters.limits;
        let (angular, linear) = (&limits.orientation, &limits.position);
        let not_a_number = Acceleration { angular: [f64::NAN; 3].into(), linear: [f64::NAN; 3].into() };
        let acceleration =
            self.dynamics.acceleration(&state.pose, &state.twist, force).unwrap_or(not_a_number);
        let share = 1.0 + self.parameters.feedback_scale;
        let (alpha, a) = (acceleration.angular.norm(), acceleration.linear.norm());
        self.hardest_m_s2 = self.hardest_m_s2.max(a);
        self.extremes.add(Quantity::Acceleration, a / (share * linear.acceleration), now_ns);
        self.extremes.add(Quantity::AngularAcceleration, alpha / (share * angular.acceleration), now_ns);
    }

    fn check_velocity(&mut self, simulator: &Simulator, now_ns: u64) {
        let (limits, twist) = (&self.parameters.limits, &simulator.state().twist);
        let (omega, v) = (twist.angular.norm(), twist.linear.norm());
        self.fastest_m_s = self.fastest_m_s.max(v);
        let ratio = |velocity: f64, limits: &DerivativeLimits| {
            let late = LATE_FORCE_RATIO * self.late_s * limits.acceleration;
            (velocity - held_velocity(&self.parameters, limits) - late) / limits.velocity
        };
        self.extremes.add(Quantity::Velocity, ratio(v, &limits.position), now_ns);
        self.extremes.add(Quantity::AngularVelocity, ratio(omega, &limits.orientation), now_ns);
    }

    /// The reference for the next release, in the state of the cycle that gave it.
    pub fn expect(&mut self, reference: Option<Motion>, state: State, next_release_ns: u64) {
        let next = reference.filter(|_| state.has_control());
        let before = core::mem::replace(&mut self.expected, next);
        self.state = state;
        let Some(next) = next else { return };
        self.check_reference(&next, before.as_ref(), next_release_ns);
    }

    fn check_reference(&mut self, next: &Motion, before: Option<&Motion>, at_ns: u64) {
        let limits = &self.parameters.limits;
        let larger = |angular: f64, linear: f64| angular.max(linear);
        let velocity = larger(
            next.twist.angular.norm() / limits.orientation.velocity,
            next.twist.linear.norm() / limits.position.velocity,
        );
        let acceleration = larger(
            next.acceleration.angular.norm() / limits.orientation.acceleration,
            next.acceleration.linear.norm() / limits.position.acceleration,
        );
        self.extremes.add(Quantity::ReferenceVelocity, velocity, at_ns);
        self.extremes.add(Quantity::ReferenceAcceleration, acceleration, at_ns);
        if let Some(before) = before {
            let period_s = self.parameters.period_ns as f64 * 1e-9;
            let jerk = larger(
                (next.acceleration.angular - before.acceleration.angular).norm() / limits.orientation.jerk,
                (next.acceleration.linear - before.acceleration.linear).norm() / limits.position.jerk,
            );
            self.extremes.add(Quantity::ReferenceJerk, jerk / period_s, at_ns);
        }
        let room_m = self.beyond.stroke_m + ROOM_RATIO * self.machine.actuator.stroke();
        let excess_m = self.margin_excess(&leg_lengths(&self.machine, &next.pose));
        self.extremes.add(Quantity::ReferenceStroke, (excess_m - room_m) / self.margin_unit_m(), at_ns);
    }

    fn check_distance(&mut self, expected: &Pose, actual: &Pose, now_ns: u64) {
        let quantity = if self.state == State::Engaging { Quantity::Engaging } else { Quantity::Following };
        let position = (actual.position - expected.position).norm() / self.parameters.following_position_m;
        let orientation =
            angle_between(&actual.rotation, &expected.rotation) / self.parameters.following_orientation_rad;
        self.extremes.add(quantity, position.max(orientation), now_ns);
    }

    fn check_end_stop(&mut self, simulator: &Simulator, now_ns: u64) {
        if self.impact_m_s.is_none() && matches!(simulator.brakes(), Brakes::EndStop { .. }) {
            self.impact_m_s = Some(self.last_leg_rate);
            self.extremes.add(Quantity::Stroke, 1.0 + 1e-3 + self.last_leg_rate, now_ns);
        }
    }

    /// Distance of each coordinate beyond the envelope; negative inside.
    fn envelope_excess(&self, pose: &Pose) -> [f64; 6] {
        let Some(envelope) = &self.parameters.envelope else { return [f64::NEG_INFINITY; 6] };
        let x = task_coordinates(pose, &self.machine.home);
        core::array::from_fn(|axis| (envelope.lowest[axis] - x[axis]).max(x[axis] - envelope.highest[axis]))
    }

    /// Largest distance beyond the envelope, or beyond where control began, over what is allowed.
    fn farther_beyond(&self, excess: &[f64; 6]) -> f64 {
        let Parameters { limits, law, .. } = &self.parameters;
        // A difference of velocity goes on for the time constant of the loop.
        let held = |limits: &DerivativeLimits, gains: &Gains| {
            held_velocity(&self.parameters, limits) / gains.kp_per_s2.sqrt()
        };
        let angle = ENVELOPE_ALLOWANCE_RAD + held(&limits.orientation, &law.orientation);
        let distance = ENVELOPE_ALLOWANCE_M + held(&limits.position, &law.position);
        let room_m = ROOM_RATIO * self.machine.actuator.stroke();
        let farther = excess.iter().enumerate().map(|(axis, excess)| {
            let (allowed, room) =
                if axis < 3 { (angle, room_m / self.machine.joints.radius_m) } else { (distance, room_m) };
            let began = self.beyond.envelope[axis];
            (excess - began - if began > 0.0 { room } else { 0.0 }) / allowed
        });
        farther.fold(f64::NEG_INFINITY, f64::max)
    }

    /// 0 at the margin that the reference keeps, 1 at the end of the stroke.
    fn margin_used(&self, lengths: &[f64; LEGS]) -> f64 {
        self.margin_excess(lengths) / self.margin_unit_m()
    }

    /// Part of the margin that is used \[m\]; negative outside of it.
    fn margin_excess(&self, lengths: &[f64; LEGS]) -> f64 {
        let margins = lengths.map(|length| self.machine.actuator.margin(length));
        self.parameters.stroke_margin_m - margins.into_iter().fold(f64::INFINITY, f64::min)
    }

    fn margin_unit_m(&self) -> f64 {
        self.parameters.stroke_margin_m.max(SMALLEST_MARGIN_M)
    }
}

/// By how much the velocity may differ from the reference's because a force is held for a period.
fn held_velocity(parameters: &Parameters, limits: &DerivativeLimits) -> f64 {
    let period_s = parameters.period_ns as f64 * 1e-9;
    HELD_FORCE_RATIO * limits.jerk * period_s * period_s
}
