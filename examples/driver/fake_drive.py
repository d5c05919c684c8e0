"""Six drives that are not there, for examples that run without hardware.

They carry the platform of config/fried2008.toml, linearized at its home pose: the forces there hold it, any others
accelerate the legs by the matrix in mobility.inc. That is right to a hundredth within some millimetres of home and for
slow motions; the legs have no ends, no friction, no noise. `hexad plant` simulates the whole machine.
"""

import pathlib

# Length of a leg and its force at home, by `hexad check`.
HOME_LENGTH_M = 1.2033148663839878
HOLDING_FORCE_N = 15.987146479544544

# From the command to an open brake [s]. A brake closes at once.
BRAKE_OPENING_S = 0.05

# The bits of all six legs.
ALL_LEGS = 0x3F


def mobility():
    """Accelerations of the legs by forces beyond those at home [m/(s^2 N)], by `hexad inverse-dynamics`."""
    lines = pathlib.Path(__file__).with_name("mobility.inc").read_text().splitlines()
    return [[float(number) for number in line.split(",") if number.strip()] for line in lines]


class FakeDrive:
    """Drives, brakes and what they move."""

    def __init__(self):
        self.mobility = mobility()
        self.length_m, self.rate_m_s, self.force_n = [HOME_LENGTH_M] * 6, [0.0] * 6, [0.0] * 6
        self.is_enabled, self.enabled_for_s = False, 0.0

    def apply(self, force_n):
        """Enables the drives and opens the brakes, if they are not, and applies the forces."""
        self.is_enabled, self.force_n = True, force_n

    def brake(self):
        """Closes the brakes and disables the drives."""
        self.is_enabled, self.enabled_for_s = False, 0.0
        self.rate_m_s, self.force_n = [0.0] * 6, [0.0] * 6

    def brake_is_open(self):
        return self.enabled_for_s >= BRAKE_OPENING_S

    def advance(self, duration_s):
        """Lets time pass."""
        if not self.is_enabled:
            return
        self.enabled_for_s += duration_s
        if not self.brake_is_open():
            return
        beyond = [force - HOLDING_FORCE_N for force in self.force_n]
        for leg, row in enumerate(self.mobility):
            self.rate_m_s[leg] += sum(share * force for share, force in zip(row, beyond)) * duration_s
            self.length_m[leg] += self.rate_m_s[leg] * duration_s
