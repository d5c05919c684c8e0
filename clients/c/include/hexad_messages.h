/* Messages of hexad, by `hexad messages --language c`. */
#ifndef HEXAD_MESSAGES_H
#define HEXAD_MESSAGES_H

#include <assert.h>
#include <stdalign.h>
#include <stddef.h>
#include <stdint.h>

#define HEXAD_STATE_OFF 0u
#define HEXAD_STATE_STANDBY 1u
#define HEXAD_STATE_ENGAGING 2u
#define HEXAD_STATE_ACTIVE 3u
#define HEXAD_STATE_STOPPING 4u
#define HEXAD_STATE_PARKING 5u
#define HEXAD_STATE_FAULT 6u
#define HEXAD_REQUEST_ENGAGE 1u
#define HEXAD_REQUEST_CLEAR 2u
#define HEXAD_REQUEST_PARK 3u
#define HEXAD_REQUEST_STOP 4u
#define HEXAD_REQUEST_OFF 5u
#define HEXAD_REQUEST_ESTOP 6u
#define HEXAD_SETPOINT_KIND_MOTION 0u
#define HEXAD_SETPOINT_KIND_POSE 1u
#define HEXAD_SETPOINT_KIND_TARGET 2u
#define HEXAD_DIAGNOSTIC_NONE 0u
#define HEXAD_DIAGNOSTIC_NO_MEASUREMENT 1u
#define HEXAD_DIAGNOSTIC_NO_SETPOINT 2u
#define HEXAD_DIAGNOSTIC_FINDING_POSE 3u
#define HEXAD_DIAGNOSTIC_SETPOINT_TOO_FAR 4u
#define HEXAD_DIAGNOSTIC_SETPOINT_ENDED 5u
#define HEXAD_DIAGNOSTIC_DAEMON_ENDING 6u
#define HEXAD_DIAGNOSTIC_READY_TO_ENGAGE 7u
#define HEXAD_DIAGNOSTIC_OPERATOR_REQUEST 8u
#define HEXAD_DIAGNOSTIC_INVALID_IN_STATE 9u
#define HEXAD_DIAGNOSTIC_PLATFORM_MOVING 10u
#define HEXAD_DIAGNOSTIC_HOLDING_POSE 11u
#define HEXAD_DIAGNOSTIC_TWO_MEASURED_SOURCES 12u
#define HEXAD_DIAGNOSTIC_TWO_SETPOINT_SOURCES 13u
#define HEXAD_DIAGNOSTIC_REST_NOT_SHOWN 14u
#define HEXAD_DIAGNOSTIC_DRIVES_TOO_WEAK 15u
#define HEXAD_DIAGNOSTIC_WITHOUT_SETPOINTS 16u
#define HEXAD_DIAGNOSTIC_OTHER_POSES 17u
#define HEXAD_DIAGNOSTIC_SETPOINT_LOST 100u
#define HEXAD_DIAGNOSTIC_MEASUREMENT_LOST 101u
#define HEXAD_DIAGNOSTIC_SETPOINT_NOT_FINITE 102u
#define HEXAD_DIAGNOSTIC_MEASUREMENT_NOT_FINITE 103u
#define HEXAD_DIAGNOSTIC_POSE_NOT_FOUND 104u
#define HEXAD_DIAGNOSTIC_MEASUREMENT_JUMPED 105u
#define HEXAD_DIAGNOSTIC_SINGULAR_POSE 106u
#define HEXAD_DIAGNOSTIC_FORCE_NOT_FINITE 107u
#define HEXAD_DIAGNOSTIC_FOLLOWING_ERROR 108u
#define HEXAD_DIAGNOSTIC_DEADLINE_MISSED 109u
#define HEXAD_DIAGNOSTIC_EMERGENCY_STOP 110u
#define HEXAD_DIAGNOSTIC_SETPOINT_OUT_OF_REACH 111u
#define HEXAD_DIAGNOSTIC_SETPOINT_JUMPED 112u
#define HEXAD_DIAGNOSTIC_LENGTH_OUT_OF_STROKE 113u
#define HEXAD_DIAGNOSTIC_RATE_INCONSISTENT 114u
#define HEXAD_DIAGNOSTIC_SETPOINT_TOO_FAST 115u
#define HEXAD_DIAGNOSTIC_SETPOINT_OUT_OF_ENVELOPE 116u
#define HEXAD_DIAGNOSTIC_SETPOINT_STAMP_INVALID 117u
#define HEXAD_DIAGNOSTIC_MEASUREMENT_STAMP_INVALID 118u
#define HEXAD_DIAGNOSTIC_NEAR_SINGULAR 119u
#define HEXAD_DIAGNOSTIC_RATE_JUMPED 120u
#define HEXAD_DIAGNOSTIC_SETPOINT_KIND_INVALID 121u
#define HEXAD_DIAGNOSTIC_SETPOINT_BEYOND_LIMITS 124u
#define HEXAD_DIAGNOSTIC_SENSOR_FROZEN 125u
#define HEXAD_DIAGNOSTIC_MEASUREMENT_IMPLAUSIBLE 126u
#define HEXAD_DIAGNOSTIC_MEASUREMENT_TOO_OLD 127u
#define HEXAD_DIAGNOSTIC_STAMP_CLOCK_INVALID 128u
#define HEXAD_DIAGNOSTIC_EXTERNAL_POSE_MISMATCH 129u
#define HEXAD_DIAGNOSTIC_DRIVE_NOT_READY 130u
#define HEXAD_DIAGNOSTIC_DRIVE_FAULT 131u
#define HEXAD_DIAGNOSTIC_DRIVE_FORCE_MISSING 132u
#define HEXAD_DIAGNOSTIC_DAEMON_HELD 133u
#define HEXAD_DIAGNOSTIC_OSCILLATION 134u
#define HEXAD_DIAGNOSTIC_PAYLOAD_CHANGED 135u
#define HEXAD_DIAGNOSTIC_IMPACT 136u
#define HEXAD_DIAGNOSTIC_DISTURBANCE_LASTING 137u
#define HEXAD_DIAGNOSTIC_DRIVE_BUS_FAILED 138u
#define HEXAD_DIAGNOSTIC_VELOCITY_ERROR 122u
#define HEXAD_DIAGNOSTIC_FEEDBACK_SATURATED 123u
#define HEXAD_LIMIT_BIT_FORCE 0u
#define HEXAD_LIMIT_BIT_FORCE_RATE 1u
#define HEXAD_LIMIT_BIT_STROKE 2u
#define HEXAD_LIMIT_BIT_LEG_RATE 3u
#define HEXAD_LIMIT_BIT_ENVELOPE 4u
#define HEXAD_LIMIT_BIT_VELOCITY 5u
#define HEXAD_LIMIT_BIT_ACCELERATION 6u
#define HEXAD_LIMIT_BIT_JERK 7u
#define HEXAD_LIMIT_BIT_FOLLOWING 8u
#define HEXAD_LIMIT_BIT_CONDITION 9u
#define HEXAD_LIMIT_BIT_COMPENSATION 10u

/* First field of every message; the publisher fills it in. */
struct hexad_header {
    uint32_t schema; /* Version of the message: of its fields and their meaning. */
    uint32_t reserved; /* Zero. */
    uint64_t epoch; /* Identifies one life of the publisher: its CLOCK_MONOTONIC start time. The latest life takes precedence; one that begins in the future is ignored. [ns] */
    uint64_t sequence; /* Number of the message in this life, from 1. */
    uint64_t time_ns; /* CLOCK_MONOTONIC instant at which the content holds. [ns] */
};
static_assert(sizeof(struct hexad_header) == 32, "size");
static_assert(alignof(struct hexad_header) == 8, "alignment");
static_assert(offsetof(struct hexad_header, schema) == 0, "schema");
static_assert(offsetof(struct hexad_header, reserved) == 4, "reserved");
static_assert(offsetof(struct hexad_header, epoch) == 8, "epoch");
static_assert(offsetof(struct hexad_header, sequence) == 16, "sequence");
static_assert(offsetof(struct hexad_header, time_ns) == 24, "time_ns");

#define HEXAD_SETPOINT_TOPIC "setpoint"
#define HEXAD_SETPOINT_SCHEMA 7u
/* Desired motion of the platform: X = alpha, beta, gamma, x, y, z and its derivatives. */
struct hexad_setpoint {
    struct hexad_header header; /* Schema version, publisher, sequence number and time stamp. */
    uint64_t kind; /* 0: X, X' and X'' of a motion; 1: X alone, samples of a motion; 2: X alone, a pose to move to and hold. */
    double x[6]; /* X. [rad, m] */
    double x_rate[6]; /* X'. [rad/s, m/s] */
    double x_accel[6]; /* X''. [rad/s^2, m/s^2] */
    double target_speed; /* Share of the limits of autonomous motions with which a target is approached, up to 1; 0 is all of them. */
};
static_assert(sizeof(struct hexad_setpoint) == 192, "size");
static_assert(alignof(struct hexad_setpoint) == 8, "alignment");
static_assert(offsetof(struct hexad_setpoint, header) == 0, "header");
static_assert(offsetof(struct hexad_setpoint, kind) == 32, "kind");
static_assert(offsetof(struct hexad_setpoint, x) == 40, "x");
static_assert(offsetof(struct hexad_setpoint, x_rate) == 88, "x_rate");
static_assert(offsetof(struct hexad_setpoint, x_accel) == 136, "x_accel");
static_assert(offsetof(struct hexad_setpoint, target_speed) == 184, "target_speed");

#define HEXAD_MEASURED_TOPIC "measured"
#define HEXAD_MEASURED_SCHEMA 7u
/* Measured leg lengths and rates, and optionally a measured pose. */
struct hexad_measured {
    struct hexad_header header; /* Schema version, publisher, sequence number and time stamp. */
    double length_m[6]; /* L. [m] */
    double length_rate_m_s[6]; /* L'; used if `rates_valid`. [m/s] */
    uint32_t pose_valid; /* 1 if `x` and `twist` are those of a sensor of their own (a tracker, a second encoder), with which the daemon compares the lengths; 2 if they are the truth of a simulator, for those who record; else 0. */
    uint32_t rates_valid; /* 1 if `length_rate_m_s` is filled in by a sensor of its own, else 0. The daemon then estimates the rates: it does so better than a driver that takes differences of lengths. */
    double x[6]; /* X. [rad, m] */
    double twist[6]; /* omega, then v, base axes. [rad/s, m/s] */
    uint32_t drive_valid; /* What of the drives is filled in, a sum: 1 `drive_enabled`, 2 `brake_open`, 4 `drive_fault`, 8 `force_n`. */
    uint32_t drive_enabled; /* A bit for each drive that is enabled, the lowest for leg 1. */
    uint32_t brake_open; /* A bit for each brake that is open. */
    uint32_t drive_fault; /* A bit for each drive with a fault. Bit 6: the bus to the drives failed, and the lengths are no measurement. */
    double force_n[6]; /* Forces that act; positive pushes the platform away from the base. [N] */
};
static_assert(sizeof(struct hexad_measured) == 296, "size");
static_assert(alignof(struct hexad_measured) == 8, "alignment");
static_assert(offsetof(struct hexad_measured, header) == 0, "header");
static_assert(offsetof(struct hexad_measured, length_m) == 32, "length_m");
static_assert(offsetof(struct hexad_measured, length_rate_m_s) == 80, "length_rate_m_s");
static_assert(offsetof(struct hexad_measured, pose_valid) == 128, "pose_valid");
static_assert(offsetof(struct hexad_measured, rates_valid) == 132, "rates_valid");
static_assert(offsetof(struct hexad_measured, x) == 136, "x");
static_assert(offsetof(struct hexad_measured, twist) == 184, "twist");
static_assert(offsetof(struct hexad_measured, drive_valid) == 232, "drive_valid");
static_assert(offsetof(struct hexad_measured, drive_enabled) == 236, "drive_enabled");
static_assert(offsetof(struct hexad_measured, brake_open) == 240, "brake_open");
static_assert(offsetof(struct hexad_measured, drive_fault) == 244, "drive_fault");
static_assert(offsetof(struct hexad_measured, force_n) == 248, "force_n");

#define HEXAD_FORCE_TOPIC "force"
#define HEXAD_FORCE_SCHEMA 5u
/* Actuator forces of one cycle. A driver brakes at a message that is not `valid`, and when its own watchdog has seen no applicable message for too long. A message is applicable only if schema and checksum are right, the sequence number increases and `time_ns` is neither in the future nor too old. */
struct hexad_force {
    struct hexad_header header; /* Schema version, publisher, sequence number and time stamp. */
    double force_n[6]; /* Gamma; positive pushes the platform away from the base. Zero unless valid. [N] */
    uint32_t valid; /* 1 if the forces may be applied, else 0. */
    uint32_t state; /* Number of the `State`. */
    uint32_t diagnostic_code; /* Number of the `DiagnosticCode` of the state. */
    uint32_t active_limits; /* Bits of the `Limit`s that this cycle has reached, or nearly. */
    uint64_t release_ns; /* Instant for which the forces were computed: the cycle's release, or with external release the time of the measurement that released it. [ns] */
    uint32_t checksum; /* CRC-32 (of zlib, PNG, Ethernet) of the bytes before it. */
    uint32_t reserved; /* Zero. */
};
static_assert(sizeof(struct hexad_force) == 112, "size");
static_assert(alignof(struct hexad_force) == 8, "alignment");
static_assert(offsetof(struct hexad_force, header) == 0, "header");
static_assert(offsetof(struct hexad_force, force_n) == 32, "force_n");
static_assert(offsetof(struct hexad_force, valid) == 80, "valid");
static_assert(offsetof(struct hexad_force, state) == 84, "state");
static_assert(offsetof(struct hexad_force, diagnostic_code) == 88, "diagnostic_code");
static_assert(offsetof(struct hexad_force, active_limits) == 92, "active_limits");
static_assert(offsetof(struct hexad_force, release_ns) == 96, "release_ns");
static_assert(offsetof(struct hexad_force, checksum) == 104, "checksum");
static_assert(offsetof(struct hexad_force, reserved) == 108, "reserved");

/* Diagnostic: what happened, with the number that was found and its bound. */
struct hexad_diagnostic {
    uint32_t code; /* Number of the `DiagnosticCode`. */
    uint32_t index; /* Leg or axis, from 1; 0 if it concerns neither. */
    double value; /* In the unit of the code; 0 if the code has no number. */
    double bound; /* What `value` is compared with. */
};
static_assert(sizeof(struct hexad_diagnostic) == 24, "size");
static_assert(alignof(struct hexad_diagnostic) == 8, "alignment");
static_assert(offsetof(struct hexad_diagnostic, code) == 0, "code");
static_assert(offsetof(struct hexad_diagnostic, index) == 4, "index");
static_assert(offsetof(struct hexad_diagnostic, value) == 8, "value");
static_assert(offsetof(struct hexad_diagnostic, bound) == 16, "bound");

/* Totals of the cyclic loop since start. */
struct hexad_loop_counters {
    uint64_t cycles; /* Cycles run. */
    uint64_t late_wakeups; /* Cycles that woke later than the configured threshold. */
    uint64_t overruns; /* Cycles still computing at their next release. */
    uint64_t skipped; /* Release instants for which no cycle was run. */
    uint64_t caught_up; /* Cycles run at once because their release had passed. */
    uint64_t records_lost; /* Cycle records lost because the queue to the log thread was full. */
    uint64_t allocations; /* Calls of the real-time thread to the allocator since its first cycle: zero, or something is wrong. */
};
static_assert(sizeof(struct hexad_loop_counters) == 56, "size");
static_assert(alignof(struct hexad_loop_counters) == 8, "alignment");
static_assert(offsetof(struct hexad_loop_counters, cycles) == 0, "cycles");
static_assert(offsetof(struct hexad_loop_counters, late_wakeups) == 8, "late_wakeups");
static_assert(offsetof(struct hexad_loop_counters, overruns) == 16, "overruns");
static_assert(offsetof(struct hexad_loop_counters, skipped) == 24, "skipped");
static_assert(offsetof(struct hexad_loop_counters, caught_up) == 32, "caught_up");
static_assert(offsetof(struct hexad_loop_counters, records_lost) == 40, "records_lost");
static_assert(offsetof(struct hexad_loop_counters, allocations) == 48, "allocations");

/* Messages that a subscriber rejected, by reason. */
struct hexad_rejection_counts {
    uint64_t schema; /* Of another schema. */
    uint64_t other_publisher; /* Of another publisher than the one that counts: its last ones, or of one that publishes beside it. */
    uint64_t repeated; /* Received before, or unreadable. */
    uint64_t damaged; /* With a wrong checksum, or of a publisher that begins in the future. */
};
static_assert(sizeof(struct hexad_rejection_counts) == 32, "size");
static_assert(alignof(struct hexad_rejection_counts) == 8, "alignment");
static_assert(offsetof(struct hexad_rejection_counts, schema) == 0, "schema");
static_assert(offsetof(struct hexad_rejection_counts, other_publisher) == 8, "other_publisher");
static_assert(offsetof(struct hexad_rejection_counts, repeated) == 16, "repeated");
static_assert(offsetof(struct hexad_rejection_counts, damaged) == 24, "damaged");

/* Totals of the daemon's I/O thread since start. */
struct hexad_io_counters {
    uint64_t allocations; /* Calls of the I/O thread to the allocator: a peer connected or disappeared. */
    struct hexad_rejection_counts rejected; /* Messages rejected on all topics that the daemon subscribes to. */
};
static_assert(sizeof(struct hexad_io_counters) == 40, "size");
static_assert(alignof(struct hexad_io_counters) == 8, "alignment");
static_assert(offsetof(struct hexad_io_counters, allocations) == 0, "allocations");
static_assert(offsetof(struct hexad_io_counters, rejected) == 8, "rejected");

#define HEXAD_STATUS_TOPIC "status"
#define HEXAD_STATUS_SCHEMA 7u
/* State of the daemon, published every cycle. */
struct hexad_status {
    struct hexad_header header; /* Schema version, publisher, sequence number and time stamp. */
    uint32_t state; /* Number of the `State`. */
    uint32_t active_limits; /* Bits of the `Limit`s that this cycle has reached, or nearly. */
    struct hexad_diagnostic diagnostic; /* Why the state is not active, or soon will not be. */
    uint64_t request_epoch; /* The largest number once a request was carried out or refused. */
    uint64_t request_sequence; /* Number that identifies that request. */
    struct hexad_diagnostic request_diagnostic; /* Why that request was refused; code 0 if it was carried out. */
    uint32_t pose_valid; /* 1 if the fields from `x` to `time_to_singularity_s` are valid. */
    uint32_t error_valid; /* 1 if `position_error_m` and `orientation_error_rad` are valid. */
    double x[6]; /* Measured pose as X, by forward kinematics. [rad, m] */
    double twist[6]; /* Measured omega, then v, base axes. [rad/s, m/s] */
    double condition; /* Condition of that pose. */
    double time_to_singularity_s; /* Time until a singular pose if the platform continues its motion; infinite if none is ahead. [s] */
    double position_error_m[3]; /* C_d - C. [m] */
    double orientation_error_rad[3]; /* log(R_d R^T). [rad] */
    double wrench_error[6]; /* Torque about C, then force, base axes, of the actuators minus that of the control law: zero unless forces are limited. [N m, N] */
    uint64_t missed_measurements; /* Cycles under control without a new valid measurement. */
    uint64_t missed_setpoints; /* Cycles under control without a new valid setpoint. */
    struct hexad_loop_counters counters; /* Counters of the real-time thread. */
    struct hexad_io_counters io; /* Counters of the I/O thread. */
    uint32_t in_position; /* 1 while the platform follows a setpoint that does not change, and has been within the tolerance of it for the settling time (`[in_position]`). */
    uint32_t setpoint_error_valid; /* 1 if `setpoint_position_error_m` and `setpoint_orientation_error_rad` are valid. */
    double setpoint_position_error_m[3]; /* C of the setpoint minus C. [m] */
    double setpoint_orientation_error_rad[3]; /* log(R_setpoint R^T). [rad] */
    double limits_scale; /* `limits.scale` in force. */
};
static_assert(sizeof(struct hexad_status) == 496, "size");
static_assert(alignof(struct hexad_status) == 8, "alignment");
static_assert(offsetof(struct hexad_status, header) == 0, "header");
static_assert(offsetof(struct hexad_status, state) == 32, "state");
static_assert(offsetof(struct hexad_status, active_limits) == 36, "active_limits");
static_assert(offsetof(struct hexad_status, diagnostic) == 40, "diagnostic");
static_assert(offsetof(struct hexad_status, request_epoch) == 64, "request_epoch");
static_assert(offsetof(struct hexad_status, request_sequence) == 72, "request_sequence");
static_assert(offsetof(struct hexad_status, request_diagnostic) == 80, "request_diagnostic");
static_assert(offsetof(struct hexad_status, pose_valid) == 104, "pose_valid");
static_assert(offsetof(struct hexad_status, error_valid) == 108, "error_valid");
static_assert(offsetof(struct hexad_status, x) == 112, "x");
static_assert(offsetof(struct hexad_status, twist) == 160, "twist");
static_assert(offsetof(struct hexad_status, condition) == 208, "condition");
static_assert(offsetof(struct hexad_status, time_to_singularity_s) == 216, "time_to_singularity_s");
static_assert(offsetof(struct hexad_status, position_error_m) == 224, "position_error_m");
static_assert(offsetof(struct hexad_status, orientation_error_rad) == 248, "orientation_error_rad");
static_assert(offsetof(struct hexad_status, wrench_error) == 272, "wrench_error");
static_assert(offsetof(struct hexad_status, missed_measurements) == 320, "missed_measurements");
static_assert(offsetof(struct hexad_status, missed_setpoints) == 328, "missed_setpoints");
static_assert(offsetof(struct hexad_status, counters) == 336, "counters");
static_assert(offsetof(struct hexad_status, io) == 392, "io");
static_assert(offsetof(struct hexad_status, in_position) == 432, "in_position");
static_assert(offsetof(struct hexad_status, setpoint_error_valid) == 436, "setpoint_error_valid");
static_assert(offsetof(struct hexad_status, setpoint_position_error_m) == 440, "setpoint_position_error_m");
static_assert(offsetof(struct hexad_status, setpoint_orientation_error_rad) == 464, "setpoint_orientation_error_rad");
static_assert(offsetof(struct hexad_status, limits_scale) == 488, "limits_scale");

/* Distribution of a time, from a histogram of three digits. All zero where nothing was recorded. */
struct hexad_times {
    uint64_t count; /* Number of values. */
    uint64_t min; /* [ns] */
    uint64_t mean; /* [ns] */
    uint64_t p50; /* [ns] */
    uint64_t p90; /* [ns] */
    uint64_t p99; /* [ns] */
    uint64_t p999; /* [ns] */
    uint64_t p9999; /* [ns] */
    uint64_t max; /* [ns] */
};
static_assert(sizeof(struct hexad_times) == 72, "size");
static_assert(alignof(struct hexad_times) == 8, "alignment");
static_assert(offsetof(struct hexad_times, count) == 0, "count");
static_assert(offsetof(struct hexad_times, min) == 8, "min");
static_assert(offsetof(struct hexad_times, mean) == 16, "mean");
static_assert(offsetof(struct hexad_times, p50) == 24, "p50");
static_assert(offsetof(struct hexad_times, p90) == 32, "p90");
static_assert(offsetof(struct hexad_times, p99) == 40, "p99");
static_assert(offsetof(struct hexad_times, p999) == 48, "p999");
static_assert(offsetof(struct hexad_times, p9999) == 56, "p9999");
static_assert(offsetof(struct hexad_times, max) == 64, "max");

/* Distributions of the times of the cycles in one span. */
struct hexad_loop_times {
    struct hexad_times wakeup_ns; /* Release to the first instruction of the cycle. */
    struct hexad_times compute_ns; /* First instruction of the cycle to its output. */
    struct hexad_times measured_age_ns; /* Age of the measurement at the release. */
    struct hexad_times end_to_end_ns; /* Release to the force message sent. */
};
static_assert(sizeof(struct hexad_loop_times) == 288, "size");
static_assert(alignof(struct hexad_loop_times) == 8, "alignment");
static_assert(offsetof(struct hexad_loop_times, wakeup_ns) == 0, "wakeup_ns");
static_assert(offsetof(struct hexad_loop_times, compute_ns) == 72, "compute_ns");
static_assert(offsetof(struct hexad_loop_times, measured_age_ns) == 144, "measured_age_ns");
static_assert(offsetof(struct hexad_loop_times, end_to_end_ns) == 216, "end_to_end_ns");

/* One of the worst cycles since start, ranked by wake-up and compute time together. The last three fields cover the 20 ms around it, observed from outside the real-time thread. */
struct hexad_worst_cycle {
    uint64_t cycle; /* Number of the cycle, from 1; 0 beyond the end of the list. */
    uint64_t due_ns; /* CLOCK_MONOTONIC instant at which it was due. [ns] */
    uint64_t wakeup_ns; /* [ns] */
    uint64_t compute_ns; /* [ns] */
    uint32_t io_late; /* 1 if it used the inputs of the cycle before. */
    uint32_t involuntary_switches; /* Times the kernel took the processor from the real-time thread. */
    uint32_t page_faults; /* Page faults of the real-time thread. */
    uint32_t steal_ms; /* Time the host took from the processor, in the 10 ms steps that Linux counts. [ms] */
};
static_assert(sizeof(struct hexad_worst_cycle) == 48, "size");
static_assert(alignof(struct hexad_worst_cycle) == 8, "alignment");
static_assert(offsetof(struct hexad_worst_cycle, cycle) == 0, "cycle");
static_assert(offsetof(struct hexad_worst_cycle, due_ns) == 8, "due_ns");
static_assert(offsetof(struct hexad_worst_cycle, wakeup_ns) == 16, "wakeup_ns");
static_assert(offsetof(struct hexad_worst_cycle, compute_ns) == 24, "compute_ns");
static_assert(offsetof(struct hexad_worst_cycle, io_late) == 32, "io_late");
static_assert(offsetof(struct hexad_worst_cycle, involuntary_switches) == 36, "involuntary_switches");
static_assert(offsetof(struct hexad_worst_cycle, page_faults) == 40, "page_faults");
static_assert(offsetof(struct hexad_worst_cycle, steal_ms) == 44, "steal_ms");

#define HEXAD_STATISTICS_TOPIC "statistics"
#define HEXAD_STATISTICS_SCHEMA 1u
/* Timing of the loop, published every second of real time. */
struct hexad_statistics {
    struct hexad_header header; /* Schema version, publisher, sequence number and time stamp. */
    struct hexad_loop_times window; /* The last complete second. */
    struct hexad_loop_times total; /* Since start. */
    struct hexad_worst_cycle worst[8]; /* Since start, the worst first. */
};
static_assert(sizeof(struct hexad_statistics) == 992, "size");
static_assert(alignof(struct hexad_statistics) == 8, "alignment");
static_assert(offsetof(struct hexad_statistics, header) == 0, "header");
static_assert(offsetof(struct hexad_statistics, window) == 32, "window");
static_assert(offsetof(struct hexad_statistics, total) == 320, "total");
static_assert(offsetof(struct hexad_statistics, worst) == 608, "worst");

#endif
