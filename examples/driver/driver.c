/* A driver to copy, in C11 and C++: measures, publishes, applies forces, brakes when none may be applied.
 *
 *     make && ./driver fried2008        # needs libhexad: README.md of this folder
 *
 * Replace fake_drive.h by your drives. The rest is what every driver has to do: an absolute timer, the stamp of the
 * instant of sampling, a watchdog, drives that report that they are ready, brakes closed at every end.
 */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <hexad.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "fake_drive.h"

#define PERIOD_NS UINT64_C(1000000)

/* Brakes close when the newest force is older than this [ns]. */
#define WATCHDOG_NS UINT64_C(20000000)

/* Below the daemon's threads, 80 and 79. */
#define PRIORITY 70

/* Bits of drive_valid: all four fields are filled in. */
#define ALL_FIELDS 0xfu

static volatile sig_atomic_t is_ending;

static void end(int signal_number)
{
    (void)signal_number;
    is_ending = 1;
}

static void use_real_time(void)
{
    struct sched_param parameters;
    memset(&parameters, 0, sizeof parameters);
    parameters.sched_priority = PRIORITY;
    if (sched_setscheduler(0, SCHED_FIFO, &parameters) != 0)
        fprintf(stderr, "driver: no FIFO priority: %s\n", strerror(errno));
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
        fprintf(stderr, "driver: memory is not locked: %s\n", strerror(errno));
}

static void sleep_until(uint64_t instant_ns)
{
    struct timespec instant;
    instant.tv_sec = (time_t)(instant_ns / 1000000000u);
    instant.tv_nsec = (long)(instant_ns % 1000000000u);
    /* Ends early at a signal: the loop then looks at is_ending. */
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &instant, NULL);
}

/* What the drives measure and report. */
static struct hexad_measured measurement(const struct fake_drive *drive)
{
    struct hexad_measured measured;
    memset(&measured, 0, sizeof measured);
    memcpy(measured.length_m, drive->length_m, sizeof measured.length_m);
    memcpy(measured.force_n, drive->force_n, sizeof measured.force_n);
    measured.drive_valid = ALL_FIELDS;
    measured.drive_enabled = drive->is_enabled ? ALL_LEGS : 0;
    measured.brake_open = drive_brake_is_open(drive) ? ALL_LEGS : 0;
    return measured;
}

static void run(struct hexad_client *client)
{
    struct fake_drive drive;
    struct hexad_measured measured;
    struct hexad_force force;
    enum hexad_result verdict = HEXAD_BRAKE, before;
    uint64_t tick_ns = hexad_monotonic_ns(), now_ns, sampled_ns = tick_ns;

    drive_start(&drive);
    while (!is_ending) {
        tick_ns += PERIOD_NS;
        sleep_until(tick_ns);
        now_ns = hexad_monotonic_ns();
        drive_advance(&drive, (double)(now_ns - sampled_ns) * 1e-9);
        sampled_ns = now_ns;
        measured = measurement(&drive);
        if (hexad_publish_measured(client, sampled_ns, &measured) != HEXAD_OK) {
            fprintf(stderr, "driver: %s\n", hexad_last_error());
            break;
        }
        before = verdict;
        verdict = hexad_latest_force(client, WATCHDOG_NS, &force);
        if (verdict == HEXAD_OK)
            drive_apply(&drive, force.force_n);
        else
            drive_brake(&drive);
        if (verdict != before)
            printf("%s\n", verdict == HEXAD_OK ? "brakes open" : "brakes closed");
        /* After a pause of the host: no burst of periods that are past. */
        if (now_ns > tick_ns + PERIOD_NS)
            tick_ns = now_ns;
    }
    drive_brake(&drive);
    printf("brakes closed, the driver ends\n");
}

int main(int count, char **arguments)
{
    struct sigaction action;
    struct hexad_client *client = hexad_open(count > 1 ? arguments[1] : "fried2008", HEXAD_DRIVER);
    if (client == NULL) {
        fprintf(stderr, "driver: %s\n", hexad_last_error());
        return 1;
    }
    memset(&action, 0, sizeof action);
    action.sa_handler = end;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
    use_real_time();
    run(client);
    return hexad_close(client) == HEXAD_OK ? 0 : 1;
}
