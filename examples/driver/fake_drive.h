/* Six drives that are not there, for examples that run without hardware.
 *
 * They carry the platform of config/fried2008.toml, linearized at its home pose: the forces there hold it, any others
 * accelerate the legs by the matrix in mobility.inc. That is right to a hundredth within some millimetres of home and for
 * slow motions; the legs have no ends, no friction, no noise. `hexad plant` simulates the whole machine.
 */
#ifndef FAKE_DRIVE_H
#define FAKE_DRIVE_H

#include <stdbool.h>

/* Length of a leg and its force at home, by `hexad check`. */
#define HOME_LENGTH_M 1.2033148663839878
#define HOLDING_FORCE_N 15.987146479544544

/* Accelerations of the legs by forces beyond those [m/(s^2 N)], by `hexad inverse-dynamics`. */
static const double mobility[36] = {
#include "mobility.inc"
};

/* From the command to an open brake [s]. A brake closes at once. */
#define BRAKE_OPENING_S 0.05

/* The bits of all six legs. */
#define ALL_LEGS 0x3fu

struct fake_drive {
    double length_m[6];
    double rate_m_s[6];
    double force_n[6];
    bool is_enabled;
    double enabled_for_s;
};

static inline void drive_start(struct fake_drive *drive)
{
    int leg;
    for (leg = 0; leg < 6; leg++) {
        drive->length_m[leg] = HOME_LENGTH_M;
        drive->rate_m_s[leg] = drive->force_n[leg] = 0.0;
    }
    drive->is_enabled = false;
    drive->enabled_for_s = 0.0;
}

/* Enables the drives and opens the brakes, if they are not, and applies the forces. */
static inline void drive_apply(struct fake_drive *drive, const double force_n[6])
{
    int leg;
    drive->is_enabled = true;
    for (leg = 0; leg < 6; leg++)
        drive->force_n[leg] = force_n[leg];
}

/* Closes the brakes and disables the drives. */
static inline void drive_brake(struct fake_drive *drive)
{
    int leg;
    drive->is_enabled = false;
    drive->enabled_for_s = 0.0;
    for (leg = 0; leg < 6; leg++)
        drive->rate_m_s[leg] = drive->force_n[leg] = 0.0;
}

static inline bool drive_brake_is_open(const struct fake_drive *drive)
{
    return drive->enabled_for_s >= BRAKE_OPENING_S;
}

/* Lets time pass. */
static inline void drive_advance(struct fake_drive *drive, double duration_s)
{
    double acceleration[6];
    int leg, other;
    if (!drive->is_enabled)
        return;
    drive->enabled_for_s += duration_s;
    if (!drive_brake_is_open(drive))
        return;
    for (leg = 0; leg < 6; leg++) {
        acceleration[leg] = 0.0;
        for (other = 0; other < 6; other++)
            acceleration[leg] += mobility[6 * leg + other] * (drive->force_n[other] - HOLDING_FORCE_N);
    }
    for (leg = 0; leg < 6; leg++) {
        drive->rate_m_s[leg] += acceleration[leg] * duration_s;
        drive->length_m[leg] += drive->rate_m_s[leg] * duration_s;
    }
}

#endif
