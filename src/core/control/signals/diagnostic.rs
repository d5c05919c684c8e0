//! Diagnostics: the reason why the platform is not under control, with the value that a check found and its
//! bound.
//!
//! The failing check creates the [`Diagnostic`]. State machine, status message and command line pass it on
//! unchanged. Its `Display` is for people and is never called in the cycle.

use core::fmt;
use serde::{Deserialize, Serialize};

/// How the controller responds to a fault while the platform is under control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Not a fault.
    None,
    /// Decelerates to rest under control; then forces are disabled.
    Stop,
    /// Disables the forces at once; brakes close. Control cannot be trusted.
    Brake,
}

/// Meaning of the value of a diagnostic, and source of its bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// The code has no value.
    None,
    /// A quantity with a unit, compared with a bound in the same unit.
    Absolute {
        /// Name of the quantity.
        quantity: &'static str,
        /// Unit of value and bound; empty for a number without unit.
        unit: &'static str,
        /// "exceeds" if there is one bound, "is outside" if there are two.
        relation: &'static str,
        /// Source of the bound: a key of the configuration, or words.
        bound: &'static str,
    },
    /// Value and bound are the IDs of two processes: of the one whose messages are used, and of the other.
    Processes,
    /// A quantity as a multiple of its bound.
    Ratio {
        /// Name of the quantity.
        quantity: &'static str,
        /// Source of the bound, which is 1 in this ratio.
        bound: &'static str,
    },
}

const fn absolute(
    quantity: &'static str,
    unit: &'static str,
    relation: &'static str,
    bound: &'static str,
) -> Comparison {
    Comparison::Absolute { quantity, unit, relation, bound }
}

const fn ratio(quantity: &'static str, bound: &'static str) -> Comparison {
    Comparison::Ratio { quantity, bound }
}

const NO_NUMBER: Comparison = Comparison::None;

/// Remedy of a code that requires no action of the operator.
const NO_REMEDY: &str = "nothing";

/// Comparison of a leg length with the stroke.
const STROKE: Comparison = absolute(
    "leg length",
    "m",
    "is outside",
    "the stroke (actuator.min_length_m to actuator.max_length_m), whose bound is",
);

macro_rules! reaction {
    (None) => {
        "no change"
    };
    (Stop) => {
        "controlled stop, then fault"
    };
    (Brake) => {
        "forces disabled: fault"
    };
}

macro_rules! codes {
    ($(
        $(#[doc = $doc:literal])* $([$default:ident])?
        $variant:ident = $number:literal, $reaction:ident, $comparison:expr, $name:literal, $remedy:literal;
    )*) => {
        /// Code of a diagnostic: the reason why the platform is not under control, or soon will not be. A
        /// code below 100 is no fault.
        ///
        /// | number | meaning | reaction | remedy |
        /// | --- | --- | --- | --- |
        $(#[doc = concat!("| ", $number, " | ", $name, " | ", reaction!($reaction), " | ", $remedy, " |")])*
        #[allow(rustdoc::broken_intra_doc_links, reason = "remedies name sections of the configuration: [limits]")]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[repr(u32)]
        pub enum DiagnosticCode { $($(#[doc = $doc])* $(#[$default])? $variant = $number,)* }

        impl DiagnosticCode {
            /// Every code, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// Event in words.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// What it means, in whole sentences.
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$variant => concat!($($doc),*),)* }
            }

            /// Action of the operator.
            pub fn remedy(self) -> &'static str {
                match self { $(Self::$variant => $remedy,)* }
            }

            /// The quantity that was compared, and the source of its bound.
            pub fn comparison(self) -> Comparison {
                match self { $(Self::$variant => $comparison,)* }
            }

            /// How the controller responds. It is a chain of comparisons and no `match`, because the cycle
            /// calls it: the unused numbers of a jump table would be traps in the machine code of the cycle.
            pub fn reaction(self) -> Reaction {
                $(if self == Self::$variant {
                    return Reaction::$reaction;
                })*
                Reaction::Brake
            }
        }
    };
}

codes! {
    /// Nothing prevents control.
    [default] None = 0, None, NO_NUMBER, "none", "nothing";
    /// No measurement has arrived yet.
    NoMeasurement = 1, None, NO_NUMBER, "no measurement", "start the driver or the plant";
    /// No setpoint has arrived yet.
    NoSetpoint = 2, None, NO_NUMBER, "no setpoint", "start a setpoint source, then engage";
    /// Forward kinematics approaches the measured lengths, a bounded step per cycle.
    FindingPose = 3, None, NO_NUMBER, "finding the pose", "wait";
    /// The setpoint differs from the platform by more than `control.engage_*`, in pose or in velocity.
    SetpointTooFar = 4, None,
        ratio("the difference between setpoint and platform", "the tolerance control.engage_*"),
        "setpoint too far from the platform",
        "start the setpoints where the platform stands, or set setpoint.approach = true (under control engage is enough): the platform \
        then moves to them";
    /// The setpoint source ended while its setpoint was at rest.
    SetpointEnded = 5, None,
        absolute("age", "s", "exceeds", "timeouts.setpoint_ms"),
        "setpoint source ended at rest",
        "start a setpoint source, then engage";
    /// The daemon is ending.
    DaemonEnding = 6, None, NO_NUMBER, "daemon stopping", "nothing";
    /// Control may begin; the controller waits for the request `engage`.
    ReadyToEngage = 7, None, NO_NUMBER, "ready to engage", "engage";
    /// An operator requested this state.
    OperatorRequest = 8, None, NO_NUMBER, "requested by the operator", "nothing";
    /// The request cannot be carried out in this state.
    InvalidInState = 9, None, NO_NUMBER, "not possible in this state", "see the table of states";
    /// The platform moves, and no stop within every limit was verified for its motion.
    PlatformMoving = 10, None,
        NO_NUMBER,
        "the platform moves, and no stop within every limit was verified",
        "wait until the platform stands";
    /// Without setpoints the platform holds its pose, because `[setpoint] on_violation` is `limit`.
    HoldingPose = 11, None,
        absolute("age of the setpoint", "s", "exceeds", "timeouts.setpoint_ms"),
        "no setpoints: the platform holds its pose",
        "start a setpoint source";
    /// Two processes publish measurements; control does not begin before one of them ends.
    TwoMeasuredSources = 12, None, Comparison::Processes, "two sources of measurements", "end one of them";
    /// Two processes publish setpoints; control does not begin before one of them ends.
    TwoSetpointSources = 13, None, Comparison::Processes, "two sources of setpoints", "end one of them";
    /// The driver sends no rates, and the lengths do not show that the platform stands.
    RestNotShown = 14, None,
        absolute(
            "joint speed by the lengths",
            "m/s",
            "exceeds",
            "the largest speed of a platform that stands,",
        ),
        "the lengths do not show that the platform stands",
        "wait until it stands; a start in motion needs measured rates; [measured] length_noise_m sets for \
        how long the lengths are watched";
    /// The drives cannot hold the platform here, or cannot stop its motion.
    DrivesTooWeak = 15, None,
        NO_NUMBER,
        "the drives are too weak for this pose, or for a stop from this motion",
        "move the platform towards home without hexad; check actuator.max_force_n and the payload in the \
        machine file";
    /// Without setpoints the platform held its pose for `control.lost_hold_s`: it parks or stops.
    WithoutSetpoints = 16, None,
        absolute("age of the setpoint", "s", "exceeds", "timeouts.setpoint_ms and control.lost_hold_s, together"),
        "no setpoints: control ends",
        "find out why the source sends no setpoints";
    /// The assembly mode is ambiguous: the joints permit more than one pose with the measured leg lengths.
    OtherPoses = 17, None,
        absolute("number of other poses", "", "exceeds", "the number that allows control,"),
        "another pose has the measured leg lengths",
        "inspect the platform; hexad engage lists the poses, and hexad engage --pose N selects one; or publish an external pose (pose_valid = 1)";
    /// Setpoints stopped arriving while the setpoint was in motion.
    SetpointLost = 100, Stop,
        absolute("age", "s", "exceeds", "timeouts.setpoint_ms"),
        "setpoint lost in motion",
        "find out why the source sends no setpoints, or sends them late";
    /// Measurements stopped arriving.
    MeasurementLost = 101, Brake,
        absolute("age", "s", "exceeds", "timeouts.measured_ms"),
        "measurement lost",
        "find out why the driver sends no measurements, or sends them late";
    /// A setpoint contained a number that is not finite.
    SetpointNotFinite = 102, Stop, NO_NUMBER, "setpoint not finite", "correct the setpoint source";
    /// A measurement contained a number that is not finite.
    MeasurementNotFinite = 103, Brake,
        NO_NUMBER,
        "measurement not finite",
        "check the encoders and the driver";
    /// Forward kinematics did not converge on the measured lengths.
    PoseNotFound = 104, Brake,
        NO_NUMBER,
        "pose not found from lengths",
        "compare the lengths with the machine file";
    /// The measured lengths changed by more than the actuators can move.
    MeasurementJumped = 105, Brake,
        absolute("change of length", "m", "exceeds", "the change plausible at actuator.max_rate_m_s,"),
        "measured lengths jumped",
        "check the encoders and the driver";
    /// The pose is singular: no forces balance the load. Or the platform may have crossed a singularity: its
    /// assembly mode is uncertain.
    SingularPose = 106, Brake,
        absolute("condition", "", "exceeds", "the bound beyond which the assembly mode is uncertain,"),
        "singular pose, or assembly mode uncertain",
        "move the platform by hand to the side of the home pose, then clear";
    /// A force was not finite.
    ForceNotFinite = 107, Brake, NO_NUMBER, "force not finite", "report this bug of hexad";
    /// The platform deviated from its reference by more than `control.following_*`.
    FollowingError = 108, Brake,
        ratio("the following error", "the limit control.following_*"),
        "following error too large",
        "check for a collision, a payload, a drive without force";
    /// Cycles were missed, and `realtime.on_overrun` is `fault`.
    DeadlineMissed = 109, Stop,
        NO_NUMBER,
        "deadline missed",
        "see the worst cycles in the status; hexad doctor";
    /// An operator's emergency stop.
    EmergencyStop = 110, Brake, NO_NUMBER, "emergency stop", "clear when it is safe";
    /// A setpoint beyond the stroke of a leg, or too fast to come to rest within it.
    SetpointOutOfReach = 111, Stop,
        STROKE,
        "setpoint beyond the stroke of a leg, or without room to stop",
        "correct the trajectory";
    /// A setpoint that does not continue the previous one: X, X' and X'' are inconsistent.
    SetpointJumped = 112, Stop,
        ratio("the deviation from the continuation of the previous setpoint", "the tolerance"),
        "setpoint jumped",
        "send X, X' and X'' of one smooth motion";
    /// A measured length beyond the stroke of the leg.
    LengthOutOfStroke = 113, Brake,
        STROKE,
        "measured length beyond the stroke",
        "check the encoders, compare with the machine file";
    /// A measured rate that is not the derivative of the lengths.
    RateInconsistent = 114, Brake,
        absolute("difference between length and integrated rate", "m", "exceeds", "the tolerance"),
        "measured rate inconsistent with the lengths",
        "check the units and signs of the driver";
    /// A setpoint faster than `[limits]` or the legs allow.
    SetpointTooFast = 115, Stop,
        ratio("the setpoint", "the limit in [limits], or actuator.max_rate_m_s"),
        "setpoint beyond a limit of velocity, acceleration or jerk",
        "correct the trajectory, or [limits]";
    /// A setpoint outside of `[envelope]`.
    SetpointOutOfEnvelope = 116, Stop,
        absolute("coordinate", "rad or m", "is outside", "[envelope], whose bound is"),
        "setpoint outside of the envelope",
        "correct the trajectory, or [envelope]";
    /// A setpoint whose time stamp is too old, in the future, or not later than the previous setpoint's.
    SetpointStampInvalid = 117, Stop,
        absolute("age", "s", "is outside", "the range of timeouts.setpoint_ms around now,"),
        "setpoint with an invalid time stamp",
        "stamp with CLOCK_MONOTONIC";
    /// A measurement whose time stamp is too old, in the future, or earlier than the previous measurement's.
    MeasurementStampInvalid = 118, Brake,
        absolute(
            "age",
            "s",
            "is outside",
            "the range from a tenth of a period ahead to timeouts.measured_ms, whose bound is",
        ),
        "measurement with an invalid time stamp",
        "stamp with the CLOCK_MONOTONIC instant of sampling";
    /// The pose is so near a singular one that its condition exceeds `limits.condition`, or the motion could
    /// be stopped only at such a pose.
    NearSingular = 119, Stop,
        absolute("condition", "", "exceeds", "the bound by limits.condition,"),
        "near a singular pose, or without room to stop before one",
        "keep away from this pose; hexad check";
    /// The measured rates changed faster than actuators can.
    RateJumped = 120, Brake,
        absolute("change of rate", "m/s", "exceeds", "the plausible change,"),
        "measured rates jumped",
        "check for a collision; check the encoders and the driver";
    /// A setpoint of an unknown kind, or of poses alone under `on_violation = "stop"`.
    SetpointKindInvalid = 121, Stop,
        absolute("kind", "", "exceeds", "the largest that [setpoint] on_violation allows,"),
        "kind of the setpoint not allowed",
        "send X, X' and X'', or set [setpoint] on_violation to limit";
    /// The limits kept the reference from following the setpoint within the tolerance `control.engage_*`.
    SetpointBeyondLimits = 124, Stop,
        ratio("the distance of the reference from the setpoint", "the tolerance control.engage_*"),
        "setpoint beyond the limits of a motion that can be stopped",
        "correct the trajectory, or [limits], or set [setpoint] on_violation to limit";
    /// The readings of a leg stayed the same to the last bit while its reference moved.
    SensorFrozen = 125, Brake,
        absolute(
            "motion of the reference since the reading changed last",
            "m",
            "exceeds",
            "the bound for a working sensor,",
        ),
        "sensor frozen",
        "check the encoder of this leg and the driver";
    /// The length of a leg differs from the prediction by the model, the forces and earlier measurements.
    MeasurementImplausible = 126, Brake,
        absolute(
            "difference between measured and predicted length",
            "m",
            "exceeds",
            "the bound for noise and disturbances,",
        ),
        "measured length not as predicted",
        "check the encoder and the drive of this leg; check for a collision; [measured] length_noise_m";
    /// A measurement was so old on arrival that the loop would be unstable if all were as old.
    MeasurementTooOld = 127, Brake,
        absolute("age", "s", "exceeds", "the age at which the loop stays stable (hexad check),"),
        "measurement too old for the loop",
        "shorten the way from the sensors to the daemon, or lower the bandwidths";
    /// The time stamps of the measurements, which release the cycles, do not advance with the daemon's clock.
    StampClockInvalid = 128, Brake,
        absolute(
            "deviation of the clock of the stamps",
            "s",
            "is outside",
            "timeouts.measured_ms, ahead or behind:",
        ),
        "time stamps do not advance with the clock",
        "stamp each measurement with the instant of sampling; check the clock of the drives";
    /// A measured length differs from the length at the pose that another sensor measures.
    ExternalPoseMismatch = 129, Brake,
        absolute(
            "difference between the measured length and the length at the external pose",
            "m",
            "exceeds",
            "measured.pose_tolerance_m",
        ),
        "lengths differ from the external pose",
        "home this leg again; check its scale, the machine file and the external sensor";
    /// A drive did not become ready after control began, or did not stay ready.
    DriveNotReady = 130, Brake,
        absolute(
            "time without enabled drive and open brake",
            "s",
            "exceeds",
            "drive.ready_timeout_ms, or 20 ms once all drives were ready:",
        ),
        "drive not ready",
        "enable the drive and check its brake";
    /// A drive reports a fault.
    DriveFault = 131, Brake, NO_NUMBER, "drive reports a fault", "see the display of the drive";
    /// The actual force of a drive differs from the command, by the driver's report or by the motion of the
    /// platform.
    DriveForceMissing = 132, Brake,
        absolute(
            "difference between actual and commanded force",
            "N",
            "exceeds",
            "the bound for noise and friction,",
        ),
        "actual force not as commanded",
        "check the drive of this leg";
    /// The daemon did not run for so long that its last measurement is too old: it was stopped, or the host
    /// took the processor.
    DaemonHeld = 133, Brake,
        absolute("time without a cycle", "s", "exceeds", "timeouts.measured_ms"),
        "daemon did not run",
        "find out what stopped the daemon or took its processor; hexad doctor";
    /// The platform oscillates about its reference.
    Oscillation = 134, Brake,
        absolute("amplitude", "m", "exceeds", "the amplitude that the motion explains,"),
        "the platform oscillates",
        "check [drive] delay_us and friction ([actuator] coulomb_friction_n), then the time stamps and the drives; lower the bandwidths";
    /// The payload changed under control.
    PayloadChanged = 135, Stop,
        absolute("change", "kg", "is outside", "limits.payload_change_kg:"),
        "payload changed",
        "look for a payload that fell off or was added, then clear; legs that had just turned around: \
         state their friction ([actuator] coulomb_friction_n, friction_uncertainty_n); limits.payload_change_kg";
    /// Something struck the platform.
    Impact = 136, Stop,
        absolute("sudden disturbance", "m/s^2", "exceeds", "limits.disturbance_step_m_s2"),
        "impact",
        "check for a collision, then clear; limits.disturbance_step_m_s2";
    /// A sudden disturbance as large as an impact does not end.
    DisturbanceLasting = 137, Brake,
        absolute("duration", "s", "exceeds", "the longest duration of an impact,"),
        "sudden disturbance that lasts",
        "check for a collision; check all drives; limits.disturbance_step_m_s2";
    /// The driver reports that its bus to the drives failed: frames are lost, or a drive is missing. It has stopped all drives,
    /// and the lengths of its messages are no measurement.
    DriveBusFailed = 138, Brake, NO_NUMBER, "the bus to the drives failed",
        "see the log of the driver; check cables and power of the drives and the load of the computer, then clear";
    /// The velocity of the platform deviated from its reference by more than `control.following_velocity_*`.
    VelocityError = 122, Brake,
        ratio("the velocity error", "the limit control.following_velocity_*"),
        "velocity error too large",
        "check for a collision, a drive without force, a payload; after a leg turned around, \
         friction ([actuator] coulomb_friction_n); control.following_velocity_*";
    /// Feedback was limited by `limits.feedback_scale` for too long: the platform does not follow, or a
    /// sensor is wrong.
    FeedbackSaturated = 123, Brake,
        absolute("time of saturation", "s", "exceeds", "the longest time allowed,"),
        "feedback saturated",
        "check for a collision, a payload, a drive without force, gravity's direction; if status names disturbance \
         compensation, limits.acceleration_*, of which half is compensated; limits.feedback_scale";
}

impl DiagnosticCode {
    /// Whether the code is a fault: it ends control until it is cleared.
    pub fn is_fault(self) -> bool {
        self as u32 >= 100
    }

    /// Whether a platform under control holds its pose for this reason: without setpoints, or with distant ones after that.
    pub fn holds_pose(self) -> bool {
        self == Self::HoldingPose || self == Self::SetpointTooFar
    }

    /// Reads the number of a message.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.iter().copied().find(|code| *code as u32 == number)
    }
}

/// Result of a check: what happened, the value that was found and its bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// Event that the check found, with its reaction and remedy.
    pub code: DiagnosticCode,
    /// Value that the check found, in the unit of [`DiagnosticCode::comparison`]. It is 0, like `bound`, if
    /// the code has no value.
    pub value: f64,
    /// Bound that `value` was compared with, in the same unit.
    pub bound: f64,
    /// Leg or axis, from 1; 0 if the code concerns neither.
    pub index: u32,
}

impl Diagnostic {
    /// Diagnostic with the value found and its bound.
    pub fn new(code: DiagnosticCode, value: f64, bound: f64) -> Self {
        Self { code, value, bound, index: 0 }
    }

    /// The diagnostic for a leg or an axis, counted from 0.
    pub fn at(self, index: usize) -> Self {
        Self { index: index as u32 + 1, ..self }
    }
}

impl From<DiagnosticCode> for Diagnostic {
    fn from(code: DiagnosticCode) -> Self {
        Self { code, ..Self::default() }
    }
}

/// Sentence that says what happened, the value with its unit and bound, leg or axis, and what to do.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { code, value, bound, index } = self;
        write!(f, "{}", code.name())?;
        if code.comparison() == Comparison::None && *index != 0 {
            write!(f, ": leg {index}")?;
        }
        if *value != 0.0 || *bound != 0.0 {
            let part = if *code == DiagnosticCode::SetpointOutOfEnvelope { "axis" } else { "leg" };
            let place = |f: &mut fmt::Formatter<'_>| match index {
                0 => Ok(()),
                _ => write!(f, " of {part} {index}"),
            };
            let (value, bound) = (Rounded(*value), Rounded(*bound));
            match code.comparison() {
                Comparison::None => {}
                Comparison::Processes => {
                    write!(f, ": process {value} is used, process {bound} is ignored")?;
                }
                Comparison::Absolute { quantity, unit, relation, bound: source } => {
                    let space = if unit.is_empty() { "" } else { " " };
                    write!(f, ": {quantity} {value}{space}{unit}")?;
                    place(f)?;
                    write!(f, " {relation} {source} {bound}{space}{unit}")?;
                }
                Comparison::Ratio { quantity, bound: source } => {
                    write!(f, ": {quantity}")?;
                    place(f)?;
                    write!(f, " is {value} times {source}")?;
                }
            }
        }
        if code.remedy() == NO_REMEDY { Ok(()) } else { write!(f, "; {}", code.remedy()) }
    }
}

/// A number to six significant digits, without trailing zeros.
struct Rounded(f64);

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = self;
        let mut scale = 1.0;
        while value.abs() * scale < 1e5 && scale < 1e9 {
            scale *= 10.0;
        }
        let scaled = value * scale;
        if !(scaled.abs() < 1e15) {
            return write!(f, "{value}");
        }
        let half = if scaled < 0.0 { -0.5 } else { 0.5 };
        write!(f, "{}", (scaled + half) as i64 as f64 / scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagnostic_without_a_value_names_its_leg() {
        let text = Diagnostic::from(DiagnosticCode::MeasurementNotFinite).at(2).to_string();
        assert_eq!(text, "measurement not finite: leg 3; check the encoders and the driver");
    }

    #[test]
    fn a_lost_source_may_be_late_as_well() {
        for code in [DiagnosticCode::MeasurementLost, DiagnosticCode::SetpointLost] {
            assert!(code.remedy().contains("or sends them late"), "{code:?}");
        }
    }

    #[test]
    fn every_fault_has_a_number_from_100_on_and_a_reaction() {
        for code in DiagnosticCode::ALL {
            assert_eq!(code.is_fault(), code.reaction() != Reaction::None, "{code:?}");
            assert_eq!(DiagnosticCode::from_number(*code as u32), Some(*code));
        }
    }
}
