/* A setpoint source to copy, in C11 and C++: engages, raises the platform by 5 mm within 2 s, lowers it again, ends.
 *
 *     make && ./setpoint_source fried2008
 *
 * Until the daemon is in control it offers the pose in which the platform stands. Each setpoint is X, X' and X'' of one
 * smooth motion; x, the fourth coordinate, points up in config/fried2008.toml.
 */
#define _POSIX_C_SOURCE 200809L

#include <hexad.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define PERIOD_NS UINT64_C(1000000)

/* Duration of the way up, and of the way down [s], and its height [m]. */
#define RISE_S 2.0
#define HEIGHT_M 0.005

/* Stands at the end: the platform is a little behind [s]. */
#define SETTLE_S 0.5

#define UP 3

/* Longest wait for control [s]. */
#define PATIENCE_S 15.0

/* Minimum-jerk motion from 0 to 1 and its derivatives [1/s, 1/s^2]. */
static void minimum_jerk(double t, double duration, double out[3])
{
    double u = t <= 0.0 ? 0.0 : t >= duration ? 1.0 : t / duration;
    out[0] = u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
    out[1] = 30.0 * u * u * (1.0 - u) * (1.0 - u) / duration;
    out[2] = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (duration * duration);
}

static struct hexad_setpoint setpoint_at(const double start[6], double t)
{
    struct hexad_setpoint setpoint;
    double up[3], down[3];
    memset(&setpoint, 0, sizeof setpoint);
    minimum_jerk(t, RISE_S, up);
    minimum_jerk(t - RISE_S, RISE_S, down);
    memcpy(setpoint.x, start, sizeof setpoint.x);
    setpoint.kind = HEXAD_SETPOINT_KIND_MOTION;
    setpoint.x[UP] += HEIGHT_M * (up[0] - down[0]);
    setpoint.x_rate[UP] = HEIGHT_M * (up[1] - down[1]);
    setpoint.x_accel[UP] = HEIGHT_M * (up[2] - down[2]);
    return setpoint;
}

/* Takes control as soon as the setpoints hold the pose of the platform. It waits, so it has a thread of its own. */
static void *engage(void *machine)
{
    if (hexad_request((const char *)machine, HEXAD_REQUEST_ENGAGE, true, PATIENCE_S) != HEXAD_OK)
        fprintf(stderr, "setpoint_source: %s\n", hexad_last_error());
    return NULL;
}

/* Returns the exit code. */
static int play(struct hexad_client *client)
{
    struct timespec pause = {0, (long)PERIOD_NS};
    struct hexad_status status;
    struct hexad_setpoint setpoint;
    double start[6], t = 0.0;
    bool has_start = false, has_control = false;
    uint64_t opened_ns = hexad_monotonic_ns(), began_ns = 0, now_ns;

    while (t < 2.0 * RISE_S + SETTLE_S) {
        nanosleep(&pause, NULL);
        now_ns = hexad_monotonic_ns();
        if (!has_control && now_ns - opened_ns > (uint64_t)(PATIENCE_S * 1e9)) {
            fprintf(stderr, "setpoint_source: no control: see hexad status\n");
            return 1;
        }
        if (hexad_latest_status(client, &status) != HEXAD_OK)
            continue;
        if (!has_control && status.state == HEXAD_STATE_ACTIVE) {
            has_control = true;
            began_ns = now_ns;
        } else if (has_control && status.state != HEXAD_STATE_ACTIVE) {
            fprintf(stderr, "setpoint_source: control ended, diagnostic %u\n", (unsigned)status.diagnostic.code);
            return 1;
        }
        if (!has_start && status.pose_valid == 1) {
            has_start = true;
            memcpy(start, status.x, sizeof start);
        }
        if (!has_start)
            continue;
        t = has_control ? (double)(now_ns - began_ns) * 1e-9 : 0.0;
        setpoint = setpoint_at(start, t);
        if (hexad_publish_setpoint(client, now_ns, &setpoint) != HEXAD_OK) {
            fprintf(stderr, "setpoint_source: %s\n", hexad_last_error());
            return 1;
        }
    }
    printf("done\n");
    return 0;
}

int main(int count, char **arguments)
{
    int code;
    char standard[] = "fried2008", *machine = count > 1 ? arguments[1] : standard;
    pthread_t thread;
    struct hexad_client *client = hexad_open(machine, HEXAD_SOURCE);
    if (client == NULL) {
        fprintf(stderr, "setpoint_source: %s\n", hexad_last_error());
        return 1;
    }
    if (pthread_create(&thread, NULL, engage, machine) != 0) {
        fprintf(stderr, "setpoint_source: no thread\n");
        return 1;
    }
    pthread_detach(thread);
    code = play(client);
    hexad_close(client);
    return code;
}
