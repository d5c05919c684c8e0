"""A driver to copy: measures, publishes, applies forces, brakes when none may be applied.

    python driver.py fried2008 [--simulated]       # as the user of the daemon

With --simulated it is the clock of a daemon with release = "lockstep": the same driver without real time.

Replace fake_drive.py by your drives. The base class does the rest: absolute timer, stamps, watchdog, priority, garbage
collection, brakes at every end. Python is late by milliseconds now and then: for more than some 100 Hz choose C or Rust.
"""

import sys

import hexad
from fake_drive import ALL_LEGS, FakeDrive

# Of the drives [Hz]; in simulated time that of the daemon.
RATE_HZ = 500.0
SIMULATED_RATE_HZ = 1000.0

# Bits of drive_valid: all four fields are filled in.
ALL_FIELDS = 0xF


class ExampleDriver(hexad.Driver):
    def __init__(self, machine, simulated):
        rate_hz = SIMULATED_RATE_HZ if simulated else RATE_HZ
        super().__init__(machine, period_s=1.0 / rate_hz, simulated=simulated)
        self.drive, self.was_enabled, self.sampled_ns = FakeDrive(), False, None

    def measure(self, tick_ns):
        now_ns = tick_ns if self.simulated else hexad.monotonic_ns()
        if self.sampled_ns is not None:
            self.drive.advance((now_ns - self.sampled_ns) * 1e-9)
        self.sampled_ns = now_ns
        measured = hexad.Measured(
            length_m=tuple(self.drive.length_m),
            force_n=tuple(self.drive.force_n),
            drive_valid=ALL_FIELDS,
            drive_enabled=ALL_LEGS if self.drive.is_enabled else 0,
            brake_open=ALL_LEGS if self.drive.brake_is_open() else 0,
        )
        measured.header.time_ns = now_ns
        return measured

    def apply(self, force_n):
        self.drive.apply(force_n)
        self.report()

    def brake(self):
        self.drive.brake()
        self.report()

    def report(self):
        if self.drive.is_enabled != self.was_enabled:
            print("brakes", "open" if self.drive.is_enabled else "closed", flush=True)
        self.was_enabled = self.drive.is_enabled


if __name__ == "__main__":
    names = [argument for argument in sys.argv[1:] if argument != "--simulated"]
    ExampleDriver((names or ["fried2008"])[0], "--simulated" in sys.argv).run()
    print("brakes closed, the driver ends")
