//! Tests of the assessment of a cycle: each finding alone decides.

use crate::control::controller::verify_start;
use crate::control::supervision::assessment::{Evidence, assess, update_arrival};
use crate::control::supervision::supervisor::Findings;
use crate::control::tests::*;

/// Inputs of an assessment. By default there is no finding.
struct Scene {
    input: Input,
    status: Result<(), Diagnostic>,
    kind: SetpointKind,
    error: Option<PoseError>,
    feedback: FeedbackLimiter,
    sensor_or_drive_fault: Option<Diagnostic>,
    disturbance_diagnostic: Option<Diagnostic>,
    reports: [Result<(), Diagnostic>; 2],
    is_ready: bool,
    twist: Option<Twist>,
    is_located: bool,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            input: Input::default(),
            status: Ok(()),
            kind: SetpointKind::Motion,
            error: Some(PoseError::default()),
            feedback: FeedbackLimiter::default(),
            sensor_or_drive_fault: None,
            disturbance_diagnostic: None,
            reports: [Ok(()); 2],
            is_ready: true,
            twist: Some(Twist::default()),
            is_located: true,
        }
    }
}

/// Diagnostic that no check of an assessment creates itself.
const FOUND: Diagnostic =
    Diagnostic { code: DiagnosticCode::SetpointEnded, value: 3.0, bound: 2.0, index: 4 };

impl Scene {
    fn assess(&self, state: State) -> Findings {
        let machine = machine(&mut RandomVectors::new(61));
        let constants = Constants::new(&machine, parameters(&machine));
        let pose = *constants.home.pose();
        let cycle = Cycle { constants: &constants, release_ns: 0, state };
        let task = TaskState::at_rest(machine.home);
        let motion = SetpointMotion::new(Setpoint { kind: self.kind, ..Setpoint::motion(0, task) });
        let setpoint = ValidatedSetpoint {
            valid: Some(&motion),
            target: Some(Target::Motion(&motion)),
            follow_check: self.status,
            active_limits: LimitSet::default(),
            keeps_limits: true,
        };
        let free_motion =
            self.twist.map(|twist| Motion { pose, twist, acceleration: Acceleration::default() });
        let free_motion = free_motion.ok_or(DiagnosticCode::PlatformMoving.into());
        let mut reference = ReferenceGenerator::new(&constants);
        let localization = Localization::new(&constants);
        let measurement = Measurement::default();
        let located = self.is_located.then(|| located(&measurement, pose, Twist::default())).ok_or(FOUND);
        let start = verify_start(&cycle, &localization, &mut reference, &located, free_motion);
        let evidence = Evidence {
            input: &self.input,
            setpoint: &setpoint,
            localization: located.map(drop),
            error: self.error.as_ref(),
            feedback: &self.feedback,
            sensor_or_drive_fault: self.sensor_or_drive_fault.as_ref(),
            disturbance_diagnostic: self.disturbance_diagnostic.as_ref(),
            drive_and_pose_checks: &self.reports,
            is_ready: self.is_ready,
            start,
            may_be_frozen: false,
        };
        assess(&cycle, &evidence, &localization, &reference, &mut LimitSet::default(), &mut None)
    }

    fn tracking(&self, state: State) -> Option<DiagnosticCode> {
        self.assess(state).tracking.err().map(|found| found.code)
    }

    /// Codes of the start and of the engagement, on standby.
    fn beginning(&self) -> [Option<DiagnosticCode>; 2] {
        let Findings { start, engagement, .. } = self.assess(State::Standby);
        [start, engagement].map(|result| result.err().map(|found| found.code))
    }
}

/// Error along one axis, in one of its four parts.
fn error(part: usize, size: f64) -> PoseError {
    let mut error = PoseError::default();
    let PoseError { pose, twist } = &mut error;
    let parts = [&mut pose.linear, &mut pose.angular, &mut twist.linear, &mut twist.angular];
    parts.into_iter().nth(part).unwrap().y = size;
    error
}

#[test]
fn each_finding_alone_ends_the_tracking() {
    const CONTROLLED: [State; 4] = [State::Engaging, State::Active, State::Stopping, State::Parking];
    for state in CONTROLLED {
        assert_eq!(Scene::default().tracking(state), None);
        assert_eq!(Scene { error: None, ..Scene::default() }.tracking(state), None);
        let found = Some(FOUND.code);
        for reports in [[Err(FOUND), Ok(())], [Ok(()), Err(FOUND)]] {
            assert_eq!(Scene { reports, ..Scene::default() }.tracking(state), found);
        }
        assert_eq!(Scene { sensor_or_drive_fault: Some(FOUND), ..Scene::default() }.tracking(state), found);
        assert_eq!(Scene { disturbance_diagnostic: Some(FOUND), ..Scene::default() }.tracking(state), found);
        // A stop for a disturbance hides no reason to brake.
        let impact = Some(DiagnosticCode::Impact.into());
        let following = Some(DiagnosticCode::FollowingError);
        let far = Some(error(0, 0.06));
        let both = Scene { disturbance_diagnostic: impact, error: far, ..Scene::default() };
        assert_eq!(both.tracking(state), following);
        let input = Input { had_faulty_overrun: true, ..Input::default() };
        let late = Some(DiagnosticCode::DeadlineMissed);
        assert_eq!(Scene { input, ..Scene::default() }.tracking(state), late);
        // A setpoint matters only in states that follow it.
        let is_followed = matches!(state, State::Engaging | State::Active);
        let lost = Scene { status: Err(FOUND), ..Scene::default() };
        assert_eq!(lost.tracking(state), found.filter(|_| is_followed));
        for (part, code) in [
            (0, DiagnosticCode::FollowingError),
            (1, DiagnosticCode::FollowingError),
            (2, DiagnosticCode::VelocityError),
            (3, DiagnosticCode::VelocityError),
        ] {
            let bound = if part < 2 { 0.05 } else { 0.3 };
            let found = |share: f64| {
                Scene { error: Some(error(part, share * bound)), ..Scene::default() }.tracking(state)
            };
            assert_eq!((found(0.99), found(1.01)), (None, Some(code)), "{part}");
            assert_eq!(found(f64::NAN), Some(code), "{part}: no number in one part alone");
        }
        let mut feedback = FeedbackLimiter::default();
        let machine = machine(&mut RandomVectors::new(61));
        let constants = Constants::new(&machine, parameters(&machine));
        let cycle = Cycle { constants: &constants, release_ns: 0, state };
        for _ in 0..102 {
            feedback.limit(&cycle, &Acceleration::default(), &CommandedAcceleration(Vector6::repeat(1e3)));
        }
        let saturated = Some(DiagnosticCode::FeedbackSaturated);
        assert_eq!(Scene { feedback, ..Scene::default() }.tracking(state), saturated);
    }
    // Without control nothing is tracked.
    let found = Scene { sensor_or_drive_fault: Some(FOUND), ..Scene::default() };
    assert_eq!(found.tracking(State::Standby), None);
}

#[test]
fn each_finding_alone_prevents_control() {
    assert_eq!(Scene::default().beginning(), [None; 2]);
    let both = |code: DiagnosticCode| [Some(code); 2];
    assert_eq!(Scene { reports: [Ok(()), Err(FOUND)], ..Scene::default() }.beginning(), both(FOUND.code));
    let two = Publishers { used_pid: 7, ignored_pid_or_0: 8 };
    let input = Input { measured_publishers: two, ..Input::default() };
    let code = DiagnosticCode::TwoMeasuredSources;
    assert_eq!(Scene { input, ..Scene::default() }.beginning(), both(code));
    for (other_poses, code) in
        [(1, DiagnosticCode::OtherPoses), (Input::SEARCHING, DiagnosticCode::FindingPose)]
    {
        let input = Input { other_poses, ..Input::default() };
        assert_eq!(Scene { input, ..Scene::default() }.beginning(), both(code));
    }
    // The report of a drive has precedence over the status of the setpoint.
    let reports = [Err(DiagnosticCode::MeasurementLost.into()), Ok(())];
    let scene = Scene { reports, status: Err(FOUND), ..Scene::default() };
    assert_eq!(scene.beginning(), both(DiagnosticCode::MeasurementLost));
    // The engagement reports the first reason.
    assert_eq!(Scene { input, status: Err(FOUND), ..Scene::default() }.beginning(), both(code));
    let input = Input { setpoint_publishers: two, ..Input::default() };
    let code = DiagnosticCode::TwoSetpointSources;
    assert_eq!(Scene { input, ..Scene::default() }.beginning(), [None, Some(code)]);
    assert_eq!(Scene { status: Err(FOUND), ..Scene::default() }.beginning(), [None, Some(FOUND.code)]);
    let code = DiagnosticCode::PlatformMoving;
    assert_eq!(Scene { twist: None, ..Scene::default() }.beginning(), both(code));
    let fast = Twist { linear: Vector3::x() * 2.0, ..Twist::default() };
    assert_eq!(Scene { twist: Some(fast), ..Scene::default() }.beginning(), both(code));
    let lost = Scene { is_located: false, ..Scene::default() };
    assert_eq!(lost.assess(State::Standby).localization, Err(FOUND));
    let without = Scene { error: None, ..Scene::default() };
    assert_eq!(without.beginning(), [None, Some(DiagnosticCode::NoSetpoint)]);
}

#[test]
fn control_begins_on_a_motion_within_the_tolerance_and_on_any_target() {
    let machine = machine(&mut RandomVectors::new(61));
    let law = parameters(&machine).law;
    let (shift, turn) = (law.position.kp_per_s2.sqrt(), law.orientation.kp_per_s2.sqrt());
    for (part, wn) in [(0, 1.0), (1, 1.0), (2, shift), (3, turn)] {
        for kind in [SetpointKind::Motion, SetpointKind::Target] {
            let found = |share: f64| {
                let error = Some(error(part, share * 0.01 * wn));
                Scene { error, kind, ..Scene::default() }.beginning()[1]
            };
            let too_far = (kind == SetpointKind::Motion).then_some(DiagnosticCode::SetpointTooFar);
            assert_eq!((found(0.99), found(1.01)), (None, too_far), "{part} {kind:?}");
        }
    }
}

#[test]
fn engaging_ends_on_the_setpoint_once_the_drives_are_ready() {
    for (state, is_ready, has_ended) in [
        (State::Engaging, true, true),
        (State::Engaging, false, false),
        (State::Parking, true, true),
        (State::Parking, false, true),
        (State::Stopping, false, true),
        (State::Active, true, false),
        (State::Standby, true, false),
    ] {
        assert_eq!(Scene { is_ready, ..Scene::default() }.assess(state).has_ended, has_ended, "{state:?}");
    }
}

#[test]
fn engaging_ends_a_second_after_the_reference_was_near() {
    for (policy, after_leaving) in [(ViolationPolicy::Stop, false), (ViolationPolicy::Limit, true)] {
        let mut since_ns = None;
        let mut at = |ratio: f64, now_ms: u64| update_arrival(ratio, policy, now_ms * MS, &mut since_ns);
        assert!(!at(1.1, 0) && at(0.05, 1) && !at(0.06, 2) && !at(1.0, 1000) && at(1.0, 1001), "{policy:?}");
        assert!(!at(f64::NAN, 0) || policy == ViolationPolicy::Limit);
        assert_eq!((at(1.1, 1002), at(1.0, 1003)), (after_leaving, after_leaving), "{policy:?}");
    }
}

/// A platform at rest near a singular pose is no platform that moves.
#[test]
fn a_start_near_a_singular_pose_is_refused_as_such() {
    let machine = machine(&mut RandomVectors::new(61));
    let mut constants = Constants::new(&machine, parameters(&machine));
    constants.max_reference_condition = 1.0;
    let (pose, condition) = (*constants.home.pose(), constants.home.sensitivity().condition);
    let cycle = Cycle { constants: &constants, release_ns: 0, state: State::Standby };
    let (measurement, twist) = (Measurement::default(), Twist::default());
    let platform = PlatformState { pose, twist, condition, time_to_singularity_s: f64::INFINITY };
    let located = Ok(Located { measurement: &measurement, rate_m_s: [0.0; LEGS], platform });
    let mut reference = ReferenceGenerator::new(&constants);
    let motion = Motion { pose, twist, acceleration: Acceleration::default() };
    let start = verify_start(&cycle, &Localization::new(&constants), &mut reference, &located, Ok(motion));
    assert_eq!(start, Err(Diagnostic::new(DiagnosticCode::NearSingular, condition, 1.0)));
}
