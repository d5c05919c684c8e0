//! What the platform is to do, at any instant: the reference of each state, and the way from one to the next.

use nalgebra::Vector3;

use super::{Controller, KnownError, Located, Measurement, Parameters, Reference, seconds_between};
use crate::control::doubt::Aim;
use crate::control::law::{Deviation, Observer, TrackingError};
use crate::control::limits::Limits;
use crate::control::reference::Segment;
use crate::control::state::State;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// A share of the engage tolerances that is led onto; below, it is a matter of stamps and rounding.
const SMALLEST_TAKEOVER: f64 = 0.05;

impl Controller {
    pub(super) fn setpoint_at(&self, instant_ns: u64) -> Option<Motion> {
        Some(self.carried(self.setpoint.good.as_ref()?, instant_ns))
    }

    /// A setpoint, carried on or back no longer than it may be.
    pub(super) fn carried(&self, aim: &Aim, instant_ns: u64) -> Motion {
        if instant_ns == aim.setpoint.time_ns {
            return aim.motion;
        }
        let longest = self.parameters.longest_carried_s();
        // On the motion: angles are no way to go near their lock, where their rates have no bound.
        aim.motion.after(seconds_between(aim.setpoint.time_ns, instant_ns).max(-longest).min(longest))
    }

    /// What the platform is to do at an instant; without control, what the setpoint says.
    pub(super) fn reference_at(&self, instant_ns: u64) -> Option<Motion> {
        match &self.reference {
            Reference::Setpoint => self.setpoint_at(instant_ns),
            Reference::OntoSetpoint(segment) => {
                Some(segment.displace(&self.setpoint_at(instant_ns)?, instant_ns))
            }
            Reference::From(pose, segment) => Some(segment.displace(&resting(pose), instant_ns)),
        }
    }

    /// Reference minus measured, at the instant of the measurement; while there is no new one, what becomes of
    /// it by the law.
    pub(super) fn error(&mut self, at: &Located) -> Option<TrackingError> {
        let Parameters { law, period_ns, .. } = &self.parameters;
        let known = match self.known_error.filter(|known| known.time_ns == at.time_ns) {
            Some(known) => {
                let after = |deviation: &Deviation| law.predicted(deviation, *period_ns as f64 * 1e-9);
                let error = TrackingError::from(&after(&Deviation::from(&known.error)));
                KnownError { error, acted_on: after(&known.acted_on), ..known }
            }
            None => {
                let desired = self.reference_at(at.time_ns)?;
                let error = TrackingError::new(&desired, &at.pose, &at.twist);
                let mut acted_on = Deviation::from(&error);
                if law.mode.acts_on_legs() {
                    let Measurement { length, rate, .. } = self.measurement.good?;
                    acted_on = Deviation::of_legs(self.model.machine(), &desired, &length, &rate);
                }
                KnownError { time_ns: at.time_ns, error, acted_on }
            }
        };
        self.known_error = Some(known).filter(|_| self.mode.state.controls());
        Some(known.error)
    }

    pub(super) fn arrived(&self, instant_ns: u64) -> bool {
        match &self.reference {
            Reference::Setpoint => true,
            Reference::OntoSetpoint(segment) | Reference::From(_, segment) => segment.ended(instant_ns),
        }
    }

    /// After a gap a setpoint may be, within what is believed, elsewhere than the one before it led to: where
    /// following it at once would be a jerk beyond the limit, the platform is led there.
    #[inline(never)]
    pub(super) fn bridge(&mut self, present: &Motion, now_ns: u64) {
        let Some(next) = self.reference_at(now_ns) else { return };
        let Parameters { period_ns, law, limits, .. } = &self.parameters;
        let error = TrackingError::new(present, &next.pose, &next.twist);
        // What messages a little late or early make is no takeover, and must not begin a motion anew.
        if self.away(&error) < SMALLEST_TAKEOVER {
            return;
        }
        let asked = law.feedback(&Deviation::from(&error));
        let command = law.command(present, &error, &asked).acceleration;
        let longest = *period_ns as f64 * 1e-9;
        let step = |command: Vector3<f64>, next: Vector3<f64>| (command - next).norm();
        if step(command.linear, next.acceleration.linear) > limits.position.jerk * longest
            || step(command.angular, next.acceleration.angular) > limits.orientation.jerk * longest
        {
            // As hard as a stop: what lags behind is off the path that somebody planned.
            self.reference = self.onto_setpoint(present, now_ns, 1.0);
            self.observer.expect_nothing();
        }
    }

    /// From a motion onto the setpoint, with a share of the limits.
    fn onto_setpoint(&self, from: &Motion, instant_ns: u64, share: f64) -> Reference {
        let Some(base) = self.setpoint_at(instant_ns) else { return Reference::Setpoint };
        let away = base.pose.displacement_to(&from.pose);
        let rate = Twist::from_vector(&(from.twist.vector() - base.twist.vector()));
        let acceleration =
            Acceleration::from_vector(&(from.acceleration.vector() - base.acceleration.vector()));
        Reference::OntoSetpoint(Segment::vanishing(
            instant_ns,
            &away,
            &rate,
            &acceleration,
            &Limits { own_share: share, ..self.parameters.limits },
        ))
    }

    /// Begins the motion of the state just entered.
    pub(super) fn enter(&mut self, before: State, at: &Located, release_ns: u64) {
        let limits = &self.parameters.limits;
        // Without control the platform stands, or coasts; what it accelerates with is not measured.
        let present = self.reference_at(release_ns).filter(|_| before.controls());
        let present = present.unwrap_or_else(|| Motion { twist: at.twist, ..resting(&at.pose) });
        if before.controls() {
            self.observer.expect_nothing();
        } else {
            // The payload may be another.
            self.observer = Observer::default();
        }
        self.reference = match self.mode.state {
            State::Engaging => self.onto_setpoint(
                &Motion { twist: at.twist, ..resting(&at.pose) },
                at.time_ns,
                limits.own_share,
            ),
            State::Stopping => {
                let segment = Segment::to_rest(release_ns, &present.twist, &present.acceleration, limits);
                Reference::From(present.pose, segment)
            }
            State::Parking => {
                let home = *self.home.pose();
                let away = home.displacement_to(&present.pose);
                let Motion { twist: rate, acceleration, .. } = present;
                Reference::From(home, Segment::vanishing(release_ns, &away, &rate, &acceleration, limits))
            }
            State::Off | State::Standby | State::Active | State::Fault => Reference::Setpoint,
        };
    }
}

fn resting(pose: &Pose) -> Motion {
    Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() }
}
