//! The rows of the table: every fault, and what becomes of it in every state.

use hexad::control::signals::diagnostic::DiagnosticCode::{
    self, DaemonHeld, DeadlineMissed, DisturbanceLasting, DriveBusFailed, DriveFault, DriveForceMissing,
    DriveNotReady, EmergencyStop, ExternalPoseMismatch, HoldingPose, Impact, LengthOutOfStroke,
    MeasurementImplausible, MeasurementJumped, MeasurementLost, MeasurementNotFinite,
    MeasurementStampInvalid, MeasurementTooOld, OperatorRequest, Oscillation, PayloadChanged,
    RateInconsistent, RateJumped, ReadyToEngage, SensorFrozen, SetpointBeyondLimits, SetpointEnded,
    SetpointJumped, SetpointLost, SetpointNotFinite, SetpointOutOfEnvelope, SetpointOutOfReach,
    SetpointStampInvalid, SetpointTooFast, StampClockInvalid, VelocityError,
};
use hexad::control::signals::state::State;

use super::cells::Cell::{self, Brake, End, Full, Idle, On, Path, Stop};
use super::cells::{
    ACCELERATED, AT_FORCE_LIMIT, Bounds, ENDLESS, EVERYWHERE, FULL_STOP, GENTLE, LATE, LATE_STOP, LOAD,
    LOADED, LONG, MISSED, OFF_TO_THE_END, OUT_OF_THE_BRAKES, PARKED_OUT_OF_THE_BRAKES, PARKS, PULLED, Row,
    SHAKEN, STRUCK, SWITCHED_OFF, TOO_FAR, UNSEEN, unusable_measurement, unusable_setpoint, wrong_in_motion,
};
use super::disturbances::{host, machine, measurements, operator, reports, setpoints, together};
use super::sequences;

/// Engaged, without a fault, and never on the setpoint.
const NEVER_ACTIVE: Cell = Path(&[]);
const ENGAGES: Cell = Full(&[(State::Engaging, DiagnosticCode::None), (State::Active, DiagnosticCode::None)]);
const PARKS_AGAIN: Cell = Full(&[
    (State::Stopping, OperatorRequest),
    (State::Parking, OperatorRequest),
    (State::Off, OperatorRequest),
]);
const PARKS_AFTER_ESTOP: Cell = Full(&[
    (State::Fault, EmergencyStop),
    (State::Stopping, OperatorRequest),
    (State::Parking, OperatorRequest),
    (State::Off, OperatorRequest),
]);

/// First it looks like an impact.
const STRUCK_IMPLAUSIBLE: Cell = Path(&[(State::Stopping, Impact), (State::Fault, MeasurementImplausible)]);
const STRUCK_FOR_LONG: Cell = Path(&[(State::Stopping, Impact), (State::Fault, DisturbanceLasting)]);

/// In the columns: standby, engaging, active at rest, active in motion, stopping, parking, fault.
#[rustfmt::skip]
pub const ROWS: &[Row] = &[
    ("nothing", |_| {}, LONG, EVERYWHERE),
    // Measurements.
    ("measurements end", measurements::end, GENTLE, unusable_measurement(MeasurementLost)),
    ("measurements pause for 10 ms", measurements::pause_10_ms, LONG, EVERYWHERE),
    ("measurements pause for 30 ms", measurements::pause_30_ms, GENTLE, [
        On, Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost),
        Brake(MeasurementLost), Brake(MeasurementLost), On,
    ]),
    ("lengths NaN", measurements::nan_length, GENTLE, unusable_measurement(MeasurementNotFinite)),
    ("one rate NaN, once", measurements::nan_rate_once, LONG, EVERYWHERE),
    ("rates infinite", measurements::infinite_rate, GENTLE, unusable_measurement(MeasurementNotFinite)),
    ("a leg's length jumps by 20 mm", measurements::jump_20_mm, GENTLE, [
        TOO_FAR, Brake(MeasurementJumped), Brake(MeasurementJumped), Brake(MeasurementJumped),
        Brake(MeasurementJumped), Brake(MeasurementJumped), On,
    ]),
    ("a leg's length jumps by 20 mm, once", measurements::jump_20_mm_once, LONG, EVERYWHERE),
    ("a leg's length slips by 1 mm", measurements::slip_1_mm, UNSEEN, [
        On, Brake(RateInconsistent), Brake(RateInconsistent), Brake(MeasurementImplausible),
        Brake(MeasurementImplausible), Brake(MeasurementImplausible), On,
    ]),
    ("lengths and rates frozen", measurements::freeze, GENTLE, [
        On, Brake(SensorFrozen), On, Brake(MeasurementImplausible), Brake(MeasurementImplausible),
        Brake(MeasurementImplausible), On,
    ]),
    ("a length beyond the stroke", measurements::out_of_stroke, GENTLE,
        unusable_measurement(LengthOutOfStroke)),
    ("rates of the wrong sign", measurements::rates_of_wrong_sign, LONG, [
        On, On, On, Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), On,
    ]),
    ("rates in mm/s", measurements::rates_in_mm, GENTLE, [
        On, Brake(RateJumped), On, Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), On,
    ]),
    ("rates zero", measurements::rates_zero, LONG, [
        On, On, On, Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), On,
    ]),
    ("measurements stamped 1 s ago", measurements::stamps_1_s_old, GENTLE,
        unusable_measurement(MeasurementStampInvalid)),
    ("measurements stamped 1 s ahead", measurements::stamps_1_s_ahead, GENTLE,
        unusable_measurement(MeasurementStampInvalid)),
    ("measurements stamped 0", measurements::stamps_of_nothing, GENTLE,
        unusable_measurement(MeasurementStampInvalid)),
    ("measurements' stamps run backward", measurements::stamps_run_backward, GENTLE,
        unusable_measurement(MeasurementStampInvalid)),
    ("counts of 1 um, noise of 1 mm/s", measurements::noise_of_encoders, ENDLESS, EVERYWHERE),
    ("rates filtered with 5 ms", measurements::filtered_rates, LONG, EVERYWHERE),
    ("measurements older than the loop stands", measurements::older_than_the_loop_stands, GENTLE,
        unusable_measurement(MeasurementTooOld)),
    ("stamps at half of the clock's speed", measurements::stamps_at_half_speed, GENTLE, [
        On, Brake(StampClockInvalid), Brake(StampClockInvalid), Brake(StampClockInvalid),
        Brake(StampClockInvalid), Brake(StampClockInvalid), On,
    ]),
    // What a driver reports beside lengths.
    ("an external pose 2 mm beside the lengths", reports::external_pose_beside, GENTLE, [
        Idle(State::Standby, ExternalPoseMismatch), Brake(ExternalPoseMismatch),
        Brake(ExternalPoseMismatch), Brake(ExternalPoseMismatch), Brake(ExternalPoseMismatch),
        Brake(ExternalPoseMismatch), On,
    ]),
    ("a drive reports that it is disabled", reports::drive_disabled, GENTLE, [
        On, Brake(DriveNotReady), Brake(DriveNotReady), Brake(DriveNotReady), Brake(DriveNotReady),
        Brake(DriveNotReady), On,
    ]),
    ("a drive reports a fault", reports::drive_fault, GENTLE, [
        Idle(State::Standby, DriveFault), Brake(DriveFault), Brake(DriveFault), Brake(DriveFault),
        Brake(DriveFault), Brake(DriveFault), On,
    ]),
    ("the bus to the drives fails", reports::bus_failed, GENTLE, unusable_measurement(DriveBusFailed)),
    ("a drive reports half of its force", reports::half_of_a_force, GENTLE, [
        On, Brake(DriveForceMissing), Brake(DriveForceMissing), Brake(DriveForceMissing),
        Brake(DriveForceMissing), Brake(DriveForceMissing), On,
    ]),
    // Setpoints.
    ("setpoints end", setpoints::end, GENTLE, [
        Idle(State::Standby, SetpointEnded), End(SetpointEnded), End(SetpointEnded), Stop(SetpointLost),
        On, On, On,
    ]),
    ("setpoints pause for 30 ms", setpoints::pause_30_ms, LONG, EVERYWHERE),
    ("setpoints repeated with fresh stamps", setpoints::freeze, GENTLE,
        wrong_in_motion(SetpointBeyondLimits)),
    ("X NaN", setpoints::nan_x, GENTLE, unusable_setpoint(SetpointNotFinite)),
    ("X NaN, once", setpoints::nan_x_once, LONG, EVERYWHERE),
    ("X'' infinite", setpoints::infinite_xdd, GENTLE, unusable_setpoint(SetpointNotFinite)),
    ("X jumps by 10 mm", setpoints::jump_10_mm, GENTLE, [
        TOO_FAR, Stop(SetpointJumped), Stop(SetpointJumped), Stop(SetpointJumped), On, On, On,
    ]),
    ("X jumps by 10 mm, once", setpoints::jump_10_mm_once, LONG, EVERYWHERE),
    ("X, X', X'' zero", setpoints::all_zero, GENTLE, unusable_setpoint(SetpointOutOfEnvelope)),
    ("X' zero", setpoints::without_rates, GENTLE, wrong_in_motion(SetpointJumped)),
    ("X' in mm/s", setpoints::rates_in_mm, GENTLE, wrong_in_motion(SetpointTooFast)),
    ("X' of the wrong sign", setpoints::rates_of_wrong_sign, GENTLE, wrong_in_motion(SetpointJumped)),
    ("X' of another motion", setpoints::rate_while_standing, GENTLE, [
        TOO_FAR, Stop(SetpointJumped), Stop(SetpointJumped), Stop(SetpointJumped), On, On, On,
    ]),
    ("X'' zero", setpoints::without_accelerations, LONG, EVERYWHERE),
    ("X'' of another motion", setpoints::acceleration_while_standing, LONG, [
        On, NEVER_ACTIVE, On, On, On, On, On,
    ]),
    ("too fast", setpoints::too_fast, GENTLE, unusable_setpoint(SetpointTooFast)),
    ("too strong an acceleration", setpoints::too_strong, GENTLE, unusable_setpoint(SetpointTooFast)),
    ("a step of acceleration", setpoints::step_of_acceleration, Bounds { jerk: 1.1, ..LATE }, [
        Idle(State::Standby, SetpointTooFast),
        Path(&[(State::Active, DiagnosticCode::None), (State::Stopping, SetpointTooFast), (State::Fault, SetpointTooFast)]),
        Stop(SetpointTooFast), Stop(SetpointBeyondLimits), On, On, On,
    ]),
    ("smoothly to the end of the stroke", setpoints::run_out_of_stroke, LONG, [
        Idle(State::Standby, SetpointOutOfReach), LATE_STOP, Stop(SetpointBeyondLimits),
        Stop(SetpointBeyondLimits), On, On, On,
    ]),
    ("beyond the stroke", setpoints::beyond_stroke, GENTLE, unusable_setpoint(SetpointOutOfReach)),
    ("out of the envelope", setpoints::out_of_envelope, GENTLE, unusable_setpoint(SetpointOutOfEnvelope)),
    ("setpoints stamped 1 s ago", setpoints::stamps_1_s_old, GENTLE, unusable_setpoint(SetpointStampInvalid)),
    ("setpoints stamped 1 s ahead", setpoints::stamps_1_s_ahead, GENTLE,
        unusable_setpoint(SetpointStampInvalid)),
    ("setpoints' stamps run backward", setpoints::stamps_run_backward, GENTLE,
        unusable_setpoint(SetpointStampInvalid)),
    ("two sources at once", setpoints::second_source, LONG, [TOO_FAR, On, On, On, On, On, On]),
    ("100 Hz, stamps off by 0.2 ms", setpoints::slow_and_jittery, LONG, EVERYWHERE),
    // The operator.
    ("estop", operator::estop, GENTLE, [FULL_STOP; 7]),
    ("off", operator::off, GENTLE, [
        SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, SWITCHED_OFF, On,
    ]),
    ("stop", operator::stop, GENTLE, [
        On, End(OperatorRequest), End(OperatorRequest), End(OperatorRequest), On, End(OperatorRequest),
        On,
    ]),
    ("park", operator::park, LONG, [
        PARKS, PARKS, PARKS, PARKS,
        Path(&[(State::Parking, OperatorRequest), (State::Off, OperatorRequest)]), On, On,
    ]),
    ("clear", operator::clear, LONG, [On, On, On, On, On, On, TOO_FAR]),
    ("engage", operator::engage, LONG, [
        Path(&[(State::Engaging, DiagnosticCode::None), (State::Active, DiagnosticCode::None)]), On, On,
        On, On, On, On,
    ]),
    ("engage far away", operator::engage_far_away, GENTLE, [
        TOO_FAR, Stop(SetpointJumped), Stop(SetpointJumped), On, On, On, On,
    ]),
    // The machine.
    ("collision", machine::collision, GENTLE, [
        On, Brake(SensorFrozen), On, Brake(RateJumped), Brake(RateJumped), Brake(RateJumped), On,
    ]),
    ("the drives brake by themselves", machine::braked, GENTLE, [
        On, Brake(SensorFrozen), On, STRUCK_IMPLAUSIBLE, STRUCK_FOR_LONG, STRUCK_FOR_LONG, On,
    ]),
    ("a leg without force", machine::leg_without_force, Bounds { jerk: 1.12, rest_s: 0.25, ..GENTLE }, [
        On, Brake(VelocityError), Brake(DriveForceMissing), Brake(DriveForceMissing),
        Brake(DriveForceMissing), Brake(DriveForceMissing), On,
    ]),
    ("a load of a tenth of the platform", machine::load_of_a_tenth, PULLED, [
        On, On, On, On, Stop(PayloadChanged), On, On,
    ]),
    ("a load of a fifth of the platform", machine::load_of_a_fifth, LOADED, [
        On, On, On, Stop(PayloadChanged), Stop(PayloadChanged), Stop(PayloadChanged), On,
    ]),
    ("struck with 1 g for 10 ms", machine::struck, STRUCK, [
        On, On, Stop(Impact), Stop(Impact), Stop(Impact), Stop(Impact), On,
    ]),
    ("a drive shakes by a tenth at 30 Hz", machine::shaking_drive, SHAKEN, [
        On, Path(&[(State::Active, DiagnosticCode::None), (State::Fault, DriveForceMissing)]),
        Brake(Oscillation), Brake(DriveForceMissing), Brake(DriveForceMissing), Brake(DriveForceMissing), On,
    ]),
    ("a load of ten platforms", machine::load_of_ten, LOAD, [
        On, Brake(MeasurementImplausible), Stop(Impact), STRUCK_IMPLAUSIBLE, STRUCK_IMPLAUSIBLE,
        STRUCK_IMPLAUSIBLE, On,
    ]),
    // The host.
    ("deadline missed", host::deadline_missed, GENTLE, [
        On, Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed),
        Stop(DeadlineMissed), On,
    ]),
    ("daemon held for 1 s", host::held_1_s, GENTLE, [
        On, Brake(DaemonHeld), Brake(DaemonHeld), Brake(DaemonHeld), Brake(DaemonHeld), Brake(DaemonHeld),
        On,
    ]),
    ("daemon held for 5 ms", host::held_5_ms, MISSED, EVERYWHERE),
    ("daemon restarted", host::restarted, GENTLE, [
        On, Idle(State::Standby, ReadyToEngage), Idle(State::Standby, ReadyToEngage), TOO_FAR, TOO_FAR,
        TOO_FAR, TOO_FAR,
    ]),
    // Two at once.
    ("setpoints end, then measurements", together::setpoint_ends_then_measurement, GENTLE, [
        Idle(State::Off, MeasurementLost), End(SetpointEnded), End(SetpointEnded),
        Path(&[(State::Stopping, SetpointLost), (State::Fault, MeasurementLost)]),
        Brake(MeasurementLost), Brake(MeasurementLost), On,
    ]),
    ("both end", together::both_end, GENTLE, unusable_measurement(MeasurementLost)),
    ("NaN in both", together::nan_in_both, GENTLE, unusable_measurement(MeasurementNotFinite)),
    ("X jumps and a deadline is missed", together::setpoint_jumps_and_deadline_missed, GENTLE, [
        TOO_FAR, Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed), Stop(DeadlineMissed),
        Stop(DeadlineMissed), On,
    ]),
    ("estop without measurements", together::estop_without_measurement, GENTLE, [FULL_STOP; 7]),
    ("off without measurements", together::off_without_measurement, GENTLE, [
        SWITCHED_OFF, Brake(MeasurementLost), Brake(MeasurementLost), Brake(MeasurementLost),
        Brake(MeasurementLost), Brake(MeasurementLost), On,
    ]),
    ("collision and setpoints end", together::collision_and_setpoint_ends, GENTLE, [
        Idle(State::Standby, SetpointEnded), Brake(SensorFrozen), End(SetpointEnded), Brake(RateJumped),
        Brake(RateJumped), Brake(RateJumped), On,
    ]),
    ("the drives brake and setpoints end", together::braked_and_setpoint_ends, GENTLE, [
        Idle(State::Standby, SetpointEnded), Brake(SensorFrozen), End(SetpointEnded), STRUCK_IMPLAUSIBLE,
        STRUCK_FOR_LONG, STRUCK_FOR_LONG, On,
    ]),
    ("stop every 10 ms", together::stop_every_10_ms, GENTLE, [
        On, End(OperatorRequest), End(OperatorRequest), End(OperatorRequest), On, End(OperatorRequest),
        On,
    ]),
    ("estop, then engage", together::estop_then_engage, GENTLE, [FULL_STOP; 7]),
    // One after the other.
    ("off, and engage 3 ms later", sequences::off_then_engage, OUT_OF_THE_BRAKES, [
        ENGAGES, ENGAGES, ENGAGES, ENGAGES, ENGAGES, OFF_TO_THE_END, On,
    ]),
    ("off, and park 10 ms later", sequences::off_then_park, PARKED_OUT_OF_THE_BRAKES, [
        PARKS_AGAIN, PARKS_AGAIN, PARKS_AGAIN, PARKS_AGAIN, PARKS_AGAIN, PARKS_AGAIN, On,
    ]),
    ("estop, then clear, and park 10 ms later", sequences::estop_clear_park, PARKED_OUT_OF_THE_BRAKES, [
        PARKS_AFTER_ESTOP, PARKS_AFTER_ESTOP, PARKS_AFTER_ESTOP, PARKS_AFTER_ESTOP, PARKS_AFTER_ESTOP,
        PARKS_AFTER_ESTOP, PARKS_AGAIN,
    ]),
    ("the source ends while it accelerates", sequences::ends_while_accelerating, ACCELERATED, [
        Idle(State::Standby, SetpointLost),
        Path(&[(State::Active, DiagnosticCode::None), (State::Stopping, SetpointLost), (State::Fault, SetpointLost)]),
        Stop(SetpointLost), Stop(SetpointLost), On, On, On,
    ]),
];

const HOLDS: Cell = Path(&[(State::Engaging, HoldingPose)]);
/// And is still on its way onto the setpoint a second later.
const HOLDS_AND_CLOSES: Cell =
    Path(&[(State::Engaging, HoldingPose), (State::Engaging, DiagnosticCode::None)]);
const HOLDS_AND_GOES_ON: Cell = Path(&[
    (State::Engaging, HoldingPose),
    (State::Engaging, DiagnosticCode::None),
    (State::Active, DiagnosticCode::None),
]);

/// Under `on_violation = "limit"`: no setpoint is a fault, and what the platform feels is the same.
#[rustfmt::skip]
pub const ROWS_UNDER_LIMIT: &[Row] = &[
    ("nothing", |_| {}, LONG, EVERYWHERE),
    ("setpoints end", setpoints::end, GENTLE, [
        Idle(State::Standby, SetpointEnded), HOLDS, HOLDS, HOLDS, On, On, On,
    ]),
    ("the source ends while it accelerates", sequences::ends_while_accelerating, ACCELERATED, [
        Idle(State::Standby, SetpointLost),
        Path(&[(State::Active, DiagnosticCode::None), (State::Engaging, HoldingPose)]), HOLDS, HOLDS, On,
        On, On,
    ]),
    ("setpoints end, and go on 5 cm beside", sequences::end_and_go_on_elsewhere,
        Bounds { rest_s: f64::INFINITY, ..AT_FORCE_LIMIT }, [
            TOO_FAR, HOLDS_AND_CLOSES, HOLDS_AND_GOES_ON, HOLDS_AND_CLOSES, On, On, On,
        ]),
    ("setpoints repeated with fresh stamps", setpoints::freeze, LONG, EVERYWHERE),
    ("X NaN", setpoints::nan_x, GENTLE, [
        Idle(State::Standby, SetpointNotFinite), HOLDS, HOLDS, HOLDS, On, On, On,
    ]),
    ("X jumps by 10 mm", setpoints::jump_10_mm, LONG, [TOO_FAR, On, On, On, On, On, On]),
    ("X' of another motion", setpoints::rate_while_standing, LONG, [
        TOO_FAR, NEVER_ACTIVE, On, On, On, On, On,
    ]),
    ("too fast", setpoints::too_fast, Bounds { rest_s: f64::INFINITY, ..AT_FORCE_LIMIT }, [
        TOO_FAR, NEVER_ACTIVE, On, On, On, On, On,
    ]),
    ("too strong an acceleration", setpoints::too_strong, LONG, [On, NEVER_ACTIVE, On, On, On, On, On]),
    // Pressed against the stroke's end for ever, it creeps along there by less than a millimetre per second.
    ("smoothly to the end of the stroke", setpoints::run_out_of_stroke, ENDLESS, [
        TOO_FAR, On, On, On, On, On, On,
    ]),
    ("beyond the stroke", setpoints::beyond_stroke, LONG, [TOO_FAR, NEVER_ACTIVE, On, On, On, On, On]),
    ("out of the envelope", setpoints::out_of_envelope, LONG, [TOO_FAR, NEVER_ACTIVE, On, On, On, On, On]),
    ("two sources at once", setpoints::second_source, ENDLESS, [TOO_FAR, NEVER_ACTIVE, On, On, On, On, On]),
    ("measurements end", measurements::end, GENTLE, unusable_measurement(MeasurementLost)),
    ("estop", operator::estop, GENTLE, [FULL_STOP; 7]),
    ("stop", operator::stop, GENTLE, [
        On, End(OperatorRequest), End(OperatorRequest), End(OperatorRequest), On, End(OperatorRequest),
        On,
    ]),
];
