"""Messages of hexad, by `hexad messages --language python`."""

import ctypes
import zlib
from ctypes import c_double, c_uint32, c_uint64

STATE_OFF = 0
STATE_STANDBY = 1
STATE_ENGAGING = 2
STATE_ACTIVE = 3
STATE_STOPPING = 4
STATE_PARKING = 5
STATE_FAULT = 6
REQUEST_ENGAGE = 1
REQUEST_CLEAR = 2
REQUEST_PARK = 3
REQUEST_STOP = 4
REQUEST_OFF = 5
REQUEST_ESTOP = 6
SETPOINT_KIND_MOTION = 0
SETPOINT_KIND_POSE = 1
SETPOINT_KIND_TARGET = 2
DIAGNOSTIC_NONE = 0
DIAGNOSTIC_NO_MEASUREMENT = 1
DIAGNOSTIC_NO_SETPOINT = 2
DIAGNOSTIC_FINDING_POSE = 3
DIAGNOSTIC_SETPOINT_TOO_FAR = 4
DIAGNOSTIC_SETPOINT_ENDED = 5
DIAGNOSTIC_DAEMON_ENDING = 6
DIAGNOSTIC_READY_TO_ENGAGE = 7
DIAGNOSTIC_OPERATOR_REQUEST = 8
DIAGNOSTIC_INVALID_IN_STATE = 9
DIAGNOSTIC_PLATFORM_MOVING = 10
DIAGNOSTIC_HOLDING_POSE = 11
DIAGNOSTIC_TWO_MEASURED_SOURCES = 12
DIAGNOSTIC_TWO_SETPOINT_SOURCES = 13
DIAGNOSTIC_REST_NOT_SHOWN = 14
DIAGNOSTIC_DRIVES_TOO_WEAK = 15
DIAGNOSTIC_WITHOUT_SETPOINTS = 16
DIAGNOSTIC_OTHER_POSES = 17
DIAGNOSTIC_SETPOINT_LOST = 100
DIAGNOSTIC_MEASUREMENT_LOST = 101
DIAGNOSTIC_SETPOINT_NOT_FINITE = 102
DIAGNOSTIC_MEASUREMENT_NOT_FINITE = 103
DIAGNOSTIC_POSE_NOT_FOUND = 104
DIAGNOSTIC_MEASUREMENT_JUMPED = 105
DIAGNOSTIC_SINGULAR_POSE = 106
DIAGNOSTIC_FORCE_NOT_FINITE = 107
DIAGNOSTIC_FOLLOWING_ERROR = 108
DIAGNOSTIC_DEADLINE_MISSED = 109
DIAGNOSTIC_EMERGENCY_STOP = 110
DIAGNOSTIC_SETPOINT_OUT_OF_REACH = 111
DIAGNOSTIC_SETPOINT_JUMPED = 112
DIAGNOSTIC_LENGTH_OUT_OF_STROKE = 113
DIAGNOSTIC_RATE_INCONSISTENT = 114
DIAGNOSTIC_SETPOINT_TOO_FAST = 115
DIAGNOSTIC_SETPOINT_OUT_OF_ENVELOPE = 116
DIAGNOSTIC_SETPOINT_STAMP_INVALID = 117
DIAGNOSTIC_MEASUREMENT_STAMP_INVALID = 118
DIAGNOSTIC_NEAR_SINGULAR = 119
DIAGNOSTIC_RATE_JUMPED = 120
DIAGNOSTIC_SETPOINT_KIND_INVALID = 121
DIAGNOSTIC_SETPOINT_BEYOND_LIMITS = 124
DIAGNOSTIC_SENSOR_FROZEN = 125
DIAGNOSTIC_MEASUREMENT_IMPLAUSIBLE = 126
DIAGNOSTIC_MEASUREMENT_TOO_OLD = 127
DIAGNOSTIC_STAMP_CLOCK_INVALID = 128
DIAGNOSTIC_EXTERNAL_POSE_MISMATCH = 129
DIAGNOSTIC_DRIVE_NOT_READY = 130
DIAGNOSTIC_DRIVE_FAULT = 131
DIAGNOSTIC_DRIVE_FORCE_MISSING = 132
DIAGNOSTIC_DAEMON_HELD = 133
DIAGNOSTIC_OSCILLATION = 134
DIAGNOSTIC_PAYLOAD_CHANGED = 135
DIAGNOSTIC_IMPACT = 136
DIAGNOSTIC_DISTURBANCE_LASTING = 137
DIAGNOSTIC_DRIVE_BUS_FAILED = 138
DIAGNOSTIC_VELOCITY_ERROR = 122
DIAGNOSTIC_FEEDBACK_SATURATED = 123
LIMIT_BIT_FORCE = 0
LIMIT_BIT_FORCE_RATE = 1
LIMIT_BIT_STROKE = 2
LIMIT_BIT_LEG_RATE = 3
LIMIT_BIT_ENVELOPE = 4
LIMIT_BIT_VELOCITY = 5
LIMIT_BIT_ACCELERATION = 6
LIMIT_BIT_JERK = 7
LIMIT_BIT_FOLLOWING = 8
LIMIT_BIT_CONDITION = 9
LIMIT_BIT_COMPENSATION = 10


class Message(ctypes.Structure):
    """Base of all messages; `topic` is the last part of the topic's name, `schema` the version."""

    topic = ""
    schema = 0

    def is_intact(self):
        """Whether the checksum, if there is one, is the CRC-32 of the bytes before it."""
        field = getattr(type(self), "checksum", None)
        return field is None or self.checksum == zlib.crc32(bytes(self)[: field.offset])


class Header(ctypes.Structure):
    """First field of every message; the publisher fills it in."""

    _fields_ = [
        ("schema", c_uint32),  # Version of the message: of its fields and their meaning.
        ("reserved", c_uint32),  # Zero.
        ("epoch", c_uint64),  # Identifies one life of the publisher: its CLOCK_MONOTONIC start time. The latest life takes precedence; one that begins in the future is ignored. [ns]
        ("sequence", c_uint64),  # Number of the message in this life, from 1.
        ("time_ns", c_uint64),  # CLOCK_MONOTONIC instant at which the content holds. [ns]
    ]

    @staticmethod
    def type_name():
        return "hexad_header"


class Setpoint(Message):
    """Desired motion of the platform: X = alpha, beta, gamma, x, y, z and its derivatives."""

    topic = "setpoint"
    schema = 7
    _fields_ = [
        ("header", Header),  # Schema version, publisher, sequence number and time stamp.
        ("kind", c_uint64),  # 0: X, X' and X'' of a motion; 1: X alone, samples of a motion; 2: X alone, a pose to move to and hold.
        ("x", c_double * 6),  # X. [rad, m]
        ("x_rate", c_double * 6),  # X'. [rad/s, m/s]
        ("x_accel", c_double * 6),  # X''. [rad/s^2, m/s^2]
        ("target_speed", c_double),  # Share of the limits of autonomous motions with which a target is approached, up to 1; 0 is all of them.
    ]

    @staticmethod
    def type_name():
        return "hexad_setpoint"


class Measured(Message):
    """Measured leg lengths and rates, and optionally a measured pose."""

    topic = "measured"
    schema = 7
    _fields_ = [
        ("header", Header),  # Schema version, publisher, sequence number and time stamp.
        ("length_m", c_double * 6),  # L. [m]
        ("length_rate_m_s", c_double * 6),  # L'; used if `rates_valid`. [m/s]
        ("pose_valid", c_uint32),  # 1 if `x` and `twist` are those of a sensor of their own (a tracker, a second encoder), with which the daemon compares the lengths; 2 if they are the truth of a simulator, for those who record; else 0.
        ("rates_valid", c_uint32),  # 1 if `length_rate_m_s` is filled in by a sensor of its own, else 0. The daemon then estimates the rates: it does so better than a driver that takes differences of lengths.
        ("x", c_double * 6),  # X. [rad, m]
        ("twist", c_double * 6),  # omega, then v, base axes. [rad/s, m/s]
        ("drive_valid", c_uint32),  # What of the drives is filled in, a sum: 1 `drive_enabled`, 2 `brake_open`, 4 `drive_fault`, 8 `force_n`.
        ("drive_enabled", c_uint32),  # A bit for each drive that is enabled, the lowest for leg 1.
        ("brake_open", c_uint32),  # A bit for each brake that is open.
        ("drive_fault", c_uint32),  # A bit for each drive with a fault. Bit 6: the bus to the drives failed, and the lengths are no measurement.
        ("force_n", c_double * 6),  # Forces that act; positive pushes the platform away from the base. [N]
    ]

    @staticmethod
    def type_name():
        return "hexad_measured"


class Force(Message):
    """Actuator forces of one cycle. A driver brakes at a message that is not `valid`, and when its own watchdog has seen no applicable message for too long. A message is applicable only if schema and checksum are right, the sequence number increases and `time_ns` is neither in the future nor too old."""

    topic = "force"
    schema = 5
    _fields_ = [
        ("header", Header),  # Schema version, publisher, sequence number and time stamp.
        ("force_n", c_double * 6),  # Gamma; positive pushes the platform away from the base. Zero unless valid. [N]
        ("valid", c_uint32),  # 1 if the forces may be applied, else 0.
        ("state", c_uint32),  # Number of the `State`.
        ("diagnostic_code", c_uint32),  # Number of the `DiagnosticCode` of the state.
        ("active_limits", c_uint32),  # Bits of the `Limit`s that this cycle has reached, or nearly.
        ("release_ns", c_uint64),  # Instant for which the forces were computed: the cycle's release, or with external release the time of the measurement that released it. [ns]
        ("checksum", c_uint32),  # CRC-32 (of zlib, PNG, Ethernet) of the bytes before it.
        ("reserved", c_uint32),  # Zero.
    ]

    @staticmethod
    def type_name():
        return "hexad_force"


class Diagnostic(ctypes.Structure):
    """Diagnostic: what happened, with the number that was found and its bound."""

    _fields_ = [
        ("code", c_uint32),  # Number of the `DiagnosticCode`.
        ("index", c_uint32),  # Leg or axis, from 1; 0 if it concerns neither.
        ("value", c_double),  # In the unit of the code; 0 if the code has no number.
        ("bound", c_double),  # What `value` is compared with.
    ]

    @staticmethod
    def type_name():
        return "hexad_diagnostic"


class LoopCounters(ctypes.Structure):
    """Totals of the cyclic loop since start."""

    _fields_ = [
        ("cycles", c_uint64),  # Cycles run.
        ("late_wakeups", c_uint64),  # Cycles that woke later than the configured threshold.
        ("overruns", c_uint64),  # Cycles still computing at their next release.
        ("skipped", c_uint64),  # Release instants for which no cycle was run.
        ("caught_up", c_uint64),  # Cycles run at once because their release had passed.
        ("records_lost", c_uint64),  # Cycle records lost because the queue to the log thread was full.
        ("allocations", c_uint64),  # Calls of the real-time thread to the allocator since its first cycle: zero, or something is wrong.
    ]

    @staticmethod
    def type_name():
        return "hexad_loop_counters"


class RejectionCounts(ctypes.Structure):
    """Messages that a subscriber rejected, by reason."""

    _fields_ = [
        ("schema", c_uint64),  # Of another schema.
        ("other_publisher", c_uint64),  # Of another publisher than the one that counts: its last ones, or of one that publishes beside it.
        ("repeated", c_uint64),  # Received before, or unreadable.
        ("damaged", c_uint64),  # With a wrong checksum, or of a publisher that begins in the future.
    ]

    @staticmethod
    def type_name():
        return "hexad_rejection_counts"


class IoCounters(ctypes.Structure):
    """Totals of the daemon's I/O thread since start."""

    _fields_ = [
        ("allocations", c_uint64),  # Calls of the I/O thread to the allocator: a peer connected or disappeared.
        ("rejected", RejectionCounts),  # Messages rejected on all topics that the daemon subscribes to.
    ]

    @staticmethod
    def type_name():
        return "hexad_io_counters"


class Status(Message):
    """State of the daemon, published every cycle."""

    topic = "status"
    schema = 7
    _fields_ = [
        ("header", Header),  # Schema version, publisher, sequence number and time stamp.
        ("state", c_uint32),  # Number of the `State`.
        ("active_limits", c_uint32),  # Bits of the `Limit`s that this cycle has reached, or nearly.
        ("diagnostic", Diagnostic),  # Why the state is not active, or soon will not be.
        ("request_epoch", c_uint64),  # The largest number once a request was carried out or refused.
        ("request_sequence", c_uint64),  # Number that identifies that request.
        ("request_diagnostic", Diagnostic),  # Why that request was refused; code 0 if it was carried out.
        ("pose_valid", c_uint32),  # 1 if the fields from `x` to `time_to_singularity_s` are valid.
        ("error_valid", c_uint32),  # 1 if `position_error_m` and `orientation_error_rad` are valid.
        ("x", c_double * 6),  # Measured pose as X, by forward kinematics. [rad, m]
        ("twist", c_double * 6),  # Measured omega, then v, base axes. [rad/s, m/s]
        ("condition", c_double),  # Condition of that pose.
        ("time_to_singularity_s", c_double),  # Time until a singular pose if the platform continues its motion; infinite if none is ahead. [s]
        ("position_error_m", c_double * 3),  # C_d - C. [m]
        ("orientation_error_rad", c_double * 3),  # log(R_d R^T). [rad]
        ("wrench_error", c_double * 6),  # Torque about C, then force, base axes, of the actuators minus that of the control law: zero unless forces are limited. [N m, N]
        ("missed_measurements", c_uint64),  # Cycles under control without a new valid measurement.
        ("missed_setpoints", c_uint64),  # Cycles under control without a new valid setpoint.
        ("counters", LoopCounters),  # Counters of the real-time thread.
        ("io", IoCounters),  # Counters of the I/O thread.
        ("in_position", c_uint32),  # 1 while the platform follows a setpoint that does not change, and has been within the tolerance of it for the settling time (`[in_position]`).
        ("setpoint_error_valid", c_uint32),  # 1 if `setpoint_position_error_m` and `setpoint_orientation_error_rad` are valid.
        ("setpoint_position_error_m", c_double * 3),  # C of the setpoint minus C. [m]
        ("setpoint_orientation_error_rad", c_double * 3),  # log(R_setpoint R^T). [rad]
        ("limits_scale", c_double),  # `limits.scale` in force.
    ]

    @staticmethod
    def type_name():
        return "hexad_status"


class Times(ctypes.Structure):
    """Distribution of a time, from a histogram of three digits. All zero where nothing was recorded."""

    _fields_ = [
        ("count", c_uint64),  # Number of values.
        ("min", c_uint64),  # [ns]
        ("mean", c_uint64),  # [ns]
        ("p50", c_uint64),  # [ns]
        ("p90", c_uint64),  # [ns]
        ("p99", c_uint64),  # [ns]
        ("p999", c_uint64),  # [ns]
        ("p9999", c_uint64),  # [ns]
        ("max", c_uint64),  # [ns]
    ]

    @staticmethod
    def type_name():
        return "hexad_times"


class LoopTimes(ctypes.Structure):
    """Distributions of the times of the cycles in one span."""

    _fields_ = [
        ("wakeup_ns", Times),  # Release to the first instruction of the cycle.
        ("compute_ns", Times),  # First instruction of the cycle to its output.
        ("measured_age_ns", Times),  # Age of the measurement at the release.
        ("end_to_end_ns", Times),  # Release to the force message sent.
    ]

    @staticmethod
    def type_name():
        return "hexad_loop_times"


class WorstCycle(ctypes.Structure):
    """One of the worst cycles since start, ranked by wake-up and compute time together. The last three fields cover the 20 ms around it, observed from outside the real-time thread."""

    _fields_ = [
        ("cycle", c_uint64),  # Number of the cycle, from 1; 0 beyond the end of the list.
        ("due_ns", c_uint64),  # CLOCK_MONOTONIC instant at which it was due. [ns]
        ("wakeup_ns", c_uint64),  # [ns]
        ("compute_ns", c_uint64),  # [ns]
        ("io_late", c_uint32),  # 1 if it used the inputs of the cycle before.
        ("involuntary_switches", c_uint32),  # Times the kernel took the processor from the real-time thread.
        ("page_faults", c_uint32),  # Page faults of the real-time thread.
        ("steal_ms", c_uint32),  # Time the host took from the processor, in the 10 ms steps that Linux counts. [ms]
    ]

    @staticmethod
    def type_name():
        return "hexad_worst_cycle"


class Statistics(Message):
    """Timing of the loop, published every second of real time."""

    topic = "statistics"
    schema = 1
    _fields_ = [
        ("header", Header),  # Schema version, publisher, sequence number and time stamp.
        ("window", LoopTimes),  # The last complete second.
        ("total", LoopTimes),  # Since start.
        ("worst", WorstCycle * 8),  # Since start, the worst first.
    ]

    @staticmethod
    def type_name():
        return "hexad_statistics"
