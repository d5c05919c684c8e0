/* Drivers, setpoint sources and panels of hexad. Made by cbindgen from clients/c/src.
 *
 * Structs and numbers are in hexad_messages.h. Link with `pkg-config --cflags --libs hexad`.
 *
 * Threads: every function may be called in any thread. Two calls with one client at the same time do not wait for
 * each other: the second returns HEXAD_BUSY. A client may be used in one thread and later in another.
 * hexad_last_error is that of the calling thread. A machine may be used in any number of threads at once.
 *
 * Real time: hexad_open allocates and may take milliseconds. Publishing and hexad_latest_* neither allocate nor wait,
 * except while a participant connects or leaves (up to 0.1 ms). hexad_request and hexad_request_in_cycle wait: call
 * hexad_request in another thread.
 */

#ifndef HEXAD_H
#define HEXAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "hexad_messages.h"

// Version of this ABI, which is also the number of libhexad.so.0.
#define HEXAD_ABI 0

// Role of a client: publishes measurements and receives forces.
#define HEXAD_DRIVER 1

// Role of a client: publishes setpoints; receives status, statistics and measurements.
#define HEXAD_SOURCE 2

// Role of a client: receives status, statistics and measurements.
#define HEXAD_MONITOR 4

// Added to a role for a daemon with `release = "lockstep"`: all times are those of the measured messages.
#define HEXAD_SIMULATED 8

// Outcome of a function. hexad_last_error has the text of all from HEXAD_INVALID on.
enum hexad_result {
  // Done. Of hexad_latest_force: the forces may be applied.
  HEXAD_OK = 0,
  // No force may be applied: close the brakes.
  HEXAD_BRAKE = 1,
  // No message has arrived yet.
  HEXAD_NOTHING = 2,
  // An argument is wrong, or the client was not opened in the role of the function.
  HEXAD_INVALID = 3,
  // Another thread uses the client.
  HEXAD_BUSY = 4,
  // The shared memory could not be used.
  HEXAD_SHARED_MEMORY = 5,
  // No daemon of the machine was found.
  HEXAD_NO_DAEMON = 6,
  // This user may not send requests.
  HEXAD_FORBIDDEN = 7,
  // The daemon has refused the request.
  HEXAD_REFUSED = 8,
  // The request was accepted and did not reach its state.
  HEXAD_NOT_COMPLETED = 9,
  // Neither its state nor an answer came in time: it is not known whether the request was carried out.
  HEXAD_TIMED_OUT = 10,
  // An error in this library: report it.
  HEXAD_INTERNAL = 11,
};

// A program that has joined the topics of a machine.
struct hexad_client;

// The model of a machine. Any number of threads may use it at once.
struct hexad_machine;

// A tool frame and a work frame, as [[frame]] of the machine file: X of their axes and origins. Zeros: the platform, the base.
struct hexad_frames {
  // The tool frame in the platform frame. [rad, m]
  double tool[6];
  // The work frame in the base frame. [rad, m]
  double work[6];
};

// Motion at one instant, of the platform in the base frame or of a tool in a work frame, in the axes of that frame.
struct hexad_motion {
  // X: alpha, beta, gamma, then the origin. [rad, m]
  double x[6];
  // omega, then the velocity of the origin. [rad/s, m/s]
  double twist[6];
  // omega', then the acceleration of the origin. [rad/s^2, m/s^2]
  double acceleration[6];
};

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the ABI of the library that is loaded: HEXAD_ABI of its header.
uint32_t hexad_abi(void);

// CLOCK_MONOTONIC [ns], the clock of all stamps.
uint64_t hexad_monotonic_ns(void);

// Text of the last failure in this thread; empty before the first. It is valid until the next failure in this thread.
const char *hexad_last_error(void);

// Joins the topics of a machine (`name` of its file) in one or several roles (their sum), as the user of the daemon.
// Returns NULL on failure. The client belongs to the caller until hexad_close, and to this process: a child of fork opens its own.
//
// # Safety
//
// `machine` is NULL or a string.
struct hexad_client *hexad_open(const char *machine,
                                uint32_t roles);

// Leaves the topics and frees the client; NULL is allowed. Returns HEXAD_BUSY, and frees nothing, while another thread uses
// it. In a child of fork it does nothing: the client is that of the parent.
//
// # Safety
//
// `client` is NULL or from hexad_open, and is not used afterwards.
enum hexad_result hexad_close(struct hexad_client *client);

// Publishes a measurement for the instant at which the sensors were sampled [ns]. The library fills in the header of the
// message that it sends.
//
// # Safety
//
// `client` is NULL or from hexad_open; `measured` is NULL or a message.
enum hexad_result hexad_publish_measured(struct hexad_client *client,
                                         uint64_t time_ns,
                                         const struct hexad_measured *measured);

// Judges the newest force message with a longest age [ns]: HEXAD_OK if its forces may be applied now, else HEXAD_BRAKE.
// Called in every period it is the driver's watchdog: without new messages the last one becomes too old. `force` receives
// the message in either case; zeros before the first. Damaged, repeated and older messages never get here. In simulated time
// now is the time of the last measurement that this client has published.
//
// # Safety
//
// `client` is NULL or from hexad_open; `force` is NULL or room for a message.
enum hexad_result hexad_latest_force(struct hexad_client *client,
                                     uint64_t longest_age_ns,
                                     struct hexad_force *force);

// The same judgement of a message from anywhere at any instant [ns], but for its order: age, schema, checksum, valid, finite forces.
//
// # Safety
//
// `force` is NULL or a message.
enum hexad_result hexad_judge_force(const struct hexad_force *force,
                                    uint64_t now_ns,
                                    uint64_t longest_age_ns);

// Publishes a setpoint for an instant [ns]. The library fills in the header of the message that it sends.
//
// # Safety
//
// `client` is NULL or from hexad_open; `setpoint` is NULL or a message.
enum hexad_result hexad_publish_setpoint(struct hexad_client *client,
                                         uint64_t time_ns,
                                         const struct hexad_setpoint *setpoint);

// Sends a request (HEXAD_REQUEST_...) for a cycle in simulated time, and returns when the daemon has posted it: call it before
// hexad_publish_setpoint with the same time. The cycle at `cycle_ns` obeys it, none before, but a stop, off or estop does not wait. The
// status of that cycle shows whether it was refused. It waits for the daemon, up to 3 s; in real time use hexad_request.
//
// # Safety
//
// `client` is NULL or from hexad_open.
enum hexad_result hexad_request_in_cycle(struct hexad_client *client,
                                         uint64_t cycle_ns,
                                         uint32_t request);

// The newest status: HEXAD_OK if one has arrived since the client was opened, else HEXAD_NOTHING. The same message is
// returned again until another arrives; its header has the time.
//
// # Safety
//
// `client` is NULL or from hexad_open; `status` is NULL or room for a message.
enum hexad_result hexad_latest_status(struct hexad_client *client,
                                      struct hexad_status *status);

// The newest statistics of the loop, in the same way. The daemon sends them every second.
//
// # Safety
//
// `client` is NULL or from hexad_open; `statistics` is NULL or room for a message.
enum hexad_result hexad_latest_statistics(struct hexad_client *client,
                                          struct hexad_statistics *statistics);

// The newest measurement of the driver, in the same way.
//
// # Safety
//
// `client` is NULL or from hexad_open; `measured` is NULL or room for a message.
enum hexad_result hexad_latest_measured(struct hexad_client *client,
                                        struct hexad_measured *measured);

// Sends a request (HEXAD_REQUEST_...) over the control socket and waits until its state is reached, at most `within_s`
// seconds and two more. `until_ready` also waits for measurement and setpoint where they are missing. It needs no client,
// and any user whom the machine file admits may call it. hexad_last_error has the daemon's reason. It does what the command of the
// same name does: a stop, off or estop goes to every daemon of the machine at once, and counts if that of the service, else of this
// user or of root has confirmed it. Where the socket does not answer within half a second, an emergency stop and off go by SIGUSR1,
// and then last until a clear; a stop goes by SIGUSR2. HEXAD_TIMED_OUT means that it is not known whether the platform is stopped.
//
// # Safety
//
// `machine` is NULL or a string.
enum hexad_result hexad_request(const char *machine,
                                uint32_t request,
                                bool until_ready,
                                double within_s);

// Reads a machine file. Returns NULL on failure; hexad_last_error has a line for each error of the file, with its place and
// bound. The machine belongs to the caller until hexad_close_machine. No daemon is needed.
//
// # Safety
//
// `path` is NULL or a string.
struct hexad_machine *hexad_open_machine(const char *path);

// Frees the machine; NULL is allowed.
//
// # Safety
//
// `machine` is NULL or from hexad_open_machine, and is not used afterwards.
enum hexad_result hexad_close_machine(struct hexad_machine *machine);

// Forces of the actuators [N] at `count` motions: arrays of `count` rows of six numbers, one row after the other. X is alpha, beta,
// gamma, x, y, z [rad, m]; X' and X'' are its derivatives. A row of `forces` is NaN in all six where the pose is singular or a number
// of the motion is not finite, and the result is still HEXAD_OK. `fidelity` is "exact" or another value of `fidelity` in machine
// files, but "auto". The work is done in `threads` threads, 0 for one per processor; the forces do not depend on their number.
//
// # Safety
//
// `machine` is NULL or from hexad_open_machine; `fidelity` is NULL or a string; `x`, `x_rate` and `x_accel` are NULL or `count` rows
// that nobody changes, `forces` is NULL or room for as many.
enum hexad_result hexad_inverse_dynamics_batch(const struct hexad_machine *machine,
                                               const char *fidelity,
                                               size_t count,
                                               const double *x,
                                               const double *x_rate,
                                               const double *x_accel,
                                               double *forces,
                                               uint32_t threads);

// Motion of the tool in the work frame while the platform moves so in the base frame. The angles are those nearest to zero.
//
// # Safety
//
// `frames` is NULL or frames, `platform` is NULL or a motion, `tool` is NULL or room for one; both may be the same.
enum hexad_result hexad_tool_motion(const struct hexad_frames *frames,
                                    const struct hexad_motion *platform,
                                    struct hexad_motion *tool);

// Motion of the platform in the base frame with which the tool moves so in the work frame: the inverse of hexad_tool_motion.
//
// # Safety
//
// `frames` is NULL or frames, `tool` is NULL or a motion, `platform` is NULL or room for one; both may be the same.
enum hexad_result hexad_platform_motion(const struct hexad_frames *frames,
                                        const struct hexad_motion *tool,
                                        struct hexad_motion *platform);

// Fills in x, x_rate and x_accel of a setpoint, and leaves the rest. HEXAD_INVALID at beta = 90 deg, where angles have no rates.
//
// # Safety
//
// `motion` is NULL or a motion; `setpoint` is NULL or a message.
enum hexad_result hexad_setpoint_of_motion(const struct hexad_motion *motion,
                                           struct hexad_setpoint *setpoint);

// Motion of a setpoint: the inverse of hexad_setpoint_of_motion.
//
// # Safety
//
// `setpoint` is NULL or a message; `motion` is NULL or room for a motion.
enum hexad_result hexad_motion_of_setpoint(const struct hexad_setpoint *setpoint,
                                           struct hexad_motion *motion);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HEXAD_H */
