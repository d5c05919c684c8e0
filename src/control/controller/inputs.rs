//! Which inputs count in this cycle, and the pose that they say.

use super::{Closing, Controller, Input, Located, Measurement, seconds_between};
use crate::control::doubt;
use crate::control::doubt::Aim;
use crate::control::law::TrackingError;
use crate::control::limits::Limiting;
use crate::control::state::{Cause, State, Trouble};
use crate::model::forward_kinematics::{Outcome, TrackingResult};
use crate::model::machine::LEGS;
use crate::model::rigid::Pose;
use crate::model::sensitivity::Sensitivity;

/// Trusted steps of forward kinematics in one cycle under control. One is far more than a cycle's motion; after a
/// pause of the measurements it may take some.
const STEPS: u32 = 8;

/// From this condition on (or that of the limit, if it is less) it matters how far the platform moves in one
/// measurement. Such poses are within a hundredth of the radius or of a radian of a singular one: nothing gets
/// past them between two measurements.
const DOUBTED: f64 = 300.0;

impl Controller {
    /// Takes in what can be believed. Continuity is asked for only where it can be had: of measurements that
    /// are young or control the platform, of setpoints that are followed.
    pub(super) fn doubt(&mut self, input: &Input) {
        let Self { parameters, measurement, parting, setpoint, .. } = self;
        let machine = self.model.machine();
        let now_ns = input.release_ns;
        let controls = self.mode.state.controls();
        let mut waited = [true; 2];
        if let Some(now) = input.measurement
            && measurement.newest != Some(now)
        {
            let timeout_ns = parameters.measured_timeout_ns;
            let widest = measurement.widest(now_ns, parameters.period_ns);
            let binds = |good: &Measurement| controls || now_ns.abs_diff(good.time_ns) <= timeout_ns;
            let verdict = doubt::time(Cause::MeasurementFromElsewhen, now.time_ns, now_ns, timeout_ns)
                .and_then(|()| {
                    let before = measurement.good.filter(binds);
                    let limit = &parameters.limits.position;
                    doubt::measurement(&machine.actuator, limit, &now, before.as_ref(), widest, parting)
                });
            measurement.take(now, verdict, now_ns, controls);
            waited[0] = verdict.is_err();
        }
        if let Some(now) = input.setpoint
            && setpoint.newest.map(|aim| aim.setpoint) != Some(now)
        {
            let timeout_ns = parameters.setpoint_timeout_ns;
            let widest = setpoint.widest(now_ns, parameters.period_ns);
            let follows = matches!(self.mode.state, State::Engaging | State::Active);
            let mut limiting = Limiting::default();
            let now = Aim { setpoint: now, motion: now.task.motion() };
            let verdict = doubt::time(Cause::SetpointFromElsewhen, now.setpoint.time_ns, now_ns, timeout_ns)
                .and_then(|()| {
                    let before = setpoint.good.filter(|_| follows);
                    doubt::setpoint(
                        machine,
                        parameters,
                        &self.home,
                        &now,
                        before.as_ref(),
                        widest,
                        &mut limiting,
                    )
                });
            self.setpoint_limiting = limiting;
            let gap = setpoint.good.map(|good| now.setpoint.time_ns.abs_diff(good.setpoint.time_ns));
            let after_gap = gap.is_some_and(|gap| gap > parameters.period_ns + parameters.period_ns / 2);
            let present = self.reference_at(now_ns).filter(|_| follows && after_gap);
            let verdict = verdict.and_then(|()| match present {
                Some(_) => self.takes_over(&now, now_ns),
                None => Ok(()),
            });
            waited[1] = verdict.is_err();
            self.setpoint.take(now, verdict, now_ns, follows);
            if let Some(present) = present.filter(|_| verdict.is_ok()) {
                self.bridge(&present, now_ns);
            }
        }
        let [no_measurement, no_setpoint] = waited.map(u64::from);
        self.without_measurement += u64::from(controls) * no_measurement;
        self.without_setpoint += u64::from(controls) * no_setpoint;
    }

    /// After a pause of the loop the inputs may be fresh again, but meanwhile the drives had no force and
    /// have let go: control does not go on as if nothing had been.
    pub(super) fn unbroken(&self, now_ns: u64) -> Result<(), Trouble> {
        let last = self.measurement.good.filter(|_| self.mode.state.controls());
        last.map_or(Ok(()), |last| self.is_young(&last, now_ns))
    }

    fn is_young(&self, measurement: &Measurement, now_ns: u64) -> Result<(), Trouble> {
        let timeout_ns = self.parameters.measured_timeout_ns;
        doubt::time(Cause::MeasurementLost, measurement.time_ns, now_ns, timeout_ns)
            .map_err(|lost| self.measurement.absence(lost))
    }

    /// The pose and twist of the platform, by one bounded step of forward kinematics.
    pub(super) fn locate(&mut self, release_ns: u64) -> Result<Located, Trouble> {
        let Some(measurement) = self.measurement.good else {
            return Err(self.measurement.absence(Cause::NoMeasurement));
        };
        self.is_young(&measurement, release_ns)?;
        self.astray.map_or(Ok(()), Err)?;
        let machine = self.model.machine();
        let from = self.tracker.pose;
        let controls = self.mode.state.controls();
        let before = self.tracker.kinematic_state().lengths(machine);
        let mut tracked = self.tracker.advance(machine, &measurement.length).0;
        for _ in 1..if controls { STEPS } else { 1 } {
            if tracked == TrackingResult::Approaching {
                tracked = self.tracker.advance(machine, &measurement.length).0;
            }
        }
        if tracked != TrackingResult::NotConverged && self.known && self.may_have_passed(&from) {
            return Err(self.lost());
        }
        match tracked {
            TrackingResult::Found => self.known = true,
            TrackingResult::Approaching if controls => {
                // All legs have come the same share of their way.
                let way = |(now, before): (&f64, &f64)| (now - before).abs();
                let furthest = |to: &[f64; LEGS]| to.iter().zip(&before).map(way).fold(0.0, f64::max);
                let reached = furthest(&self.tracker.kinematic_state().lengths(machine));
                return Err(Trouble::new(Cause::MeasurementJumped, furthest(&measurement.length), reached));
            }
            TrackingResult::Approaching => return Err(Cause::FindingPose.into()),
            TrackingResult::NotConverged => {
                if self.known && self.tracker.outcome() == Outcome::NearSingular {
                    return Err(self.lost());
                }
                self.known = false;
                self.walk_from_home();
                return Err(Cause::PoseNotFound.into());
            }
        }
        let pose = self.tracker.pose;
        let twist =
            self.tracker.kinematic_state().twist(machine, &measurement.rate).ok_or(Cause::SingularPose)?;
        Ok(Located { time_ns: measurement.time_ns, pose, twist })
    }

    /// Home is the one pose known to be on the right assembly mode.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub(super) fn walk_from_home(&mut self) {
        self.tracker.restart(&self.home);
    }

    /// Behind a singular pose are poses with the lengths of those before it, and forward kinematics cannot tell
    /// them apart. So near one, a platform that moves so far in one measurement that the next may be from there is
    /// not known any more.
    fn may_have_passed(&self, from: &Pose) -> bool {
        let kinematic_state = self.tracker.kinematic_state();
        let Sensitivity { condition, trusted_step, .. } = *kinematic_state.sensitivity();
        condition > self.doubted()
            && self.model.machine().joints.distance(from, kinematic_state.pose()) > trusted_step
    }

    /// Nothing that is measured tells when the platform is back: somebody has to look, and clear it.
    fn lost(&mut self) -> Trouble {
        self.known = false;
        let condition = self.tracker.kinematic_state().sensitivity().condition;
        *self.astray.insert(Trouble::new(Cause::SingularPose, condition, self.doubted()))
    }

    fn doubted(&self) -> f64 {
        self.parameters.condition.min(DOUBTED)
    }

    /// From one measurement to the next: on the way to a singular pose the determinant is at last linear.
    pub(super) fn singular_in(&mut self, time_ns: u64) -> f64 {
        let determinant = self.tracker.kinematic_state().sensitivity().determinant;
        let singular_in = match self.closing {
            Some(last) if last.time_ns == time_ns => return last.singular_in,
            Some(last) => {
                let dt = seconds_between(last.time_ns, time_ns);
                determinant * dt / (last.determinant - determinant)
            }
            None => f64::INFINITY,
        };
        let singular_in = if singular_in > 0.0 { singular_in } else { f64::INFINITY };
        self.closing = Some(Closing { time_ns, determinant, singular_in });
        singular_in
    }

    pub(super) fn fresh_setpoint(&self, release_ns: u64) -> Result<(), Trouble> {
        let Some(Aim { setpoint, .. }) = self.setpoint.good else {
            return Err(self.setpoint.absence(Cause::NoSetpoint));
        };
        let at_rest = setpoint.task.xd.amax() == 0.0 && setpoint.task.xdd.amax() == 0.0;
        let lost = if at_rest { Cause::SetpointEnded } else { Cause::SetpointLost };
        doubt::time(lost, setpoint.time_ns, release_ns, self.parameters.setpoint_timeout_ns)
            .map_err(|lost| self.setpoint.absence(lost))
    }

    /// After a gap the setpoint is near what the one before it leads to, as near as one to engage on.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    fn takes_over(&self, now: &Aim, now_ns: u64) -> Result<(), Trouble> {
        let Some(led_to) = self.setpoint_at(now_ns) else { return Ok(()) };
        let next = self.carried(now, now_ns);
        let away = self.away(&TrackingError::new(&led_to, &next.pose, &next.twist));
        if away <= 1.0 { Ok(()) } else { Err(Trouble::new(Cause::SetpointJumped, away, 1.0)) }
    }
}
