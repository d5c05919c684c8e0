"""Plays a trajectory as a setpoint source.

    python trajectory.py NAME TRAJECTORY.csv [--rate-hz R] [--engage] [--lockstep] [--record PLAYED.csv]

NAME is that of the configuration. The file has t [s] and X, X', X'' in rows `t, alpha..z, alpha_rate.., alpha_accel..`,
at rest at both ends, its first pose where the platform stands. That pose is offered until the daemon follows it; then
the trajectory is played once. --engage requests control, as `hexad engage` does. With --lockstep it responds to the
measurements of a plant in simulated time.
"""

import argparse
import os
import threading

import numpy as np

from hexad import Client, Role, Setpoint, monotonic_ns, request, sleep_until
from hexad.messages import DIAGNOSTIC_READY_TO_ENGAGE, REQUEST_ENGAGE, SETPOINT_KIND_MOTION, STATE_ACTIVE
from mujoco_machine import COORDINATES, rows_of, write_rows

# How long to stand at the end [s]: the platform is a little behind.
SETTLE_S = 0.5


class Trajectory:
    """X, X', X'' between rows by the polynomials of fifth order that meet them."""

    def __init__(self, path):
        columns = [name + suffix for suffix in ("", "_rate", "_accel") for name in COORDINATES]
        table = np.array(rows_of(path, ["t", *columns]))
        self.times, self.knots = table[:, 0] - table[0, 0], table[:, 1:].reshape(-1, 3, 6)
        self.duration = self.times[-1]

    def at(self, t):
        if t >= self.duration:
            return self.knots[-1]
        k = np.searchsorted(self.times, t, side="right") - 1
        h = self.times[k + 1] - self.times[k]
        (x0, v0, a0), (x1, v1, a1) = self.knots[k], self.knots[k + 1]
        # In s = (t - t0) / h; what is left of x1, v1, a1 after x0 + v0 t + a0 t^2 / 2.
        x, v, a = x1 - x0 - h * v0 - 0.5 * h**2 * a0, h * (v1 - v0 - h * a0), h**2 * (a1 - a0)
        c = (10 * x - 4 * v + 0.5 * a, -15 * x + 7 * v - a, 6 * x - 3 * v + 0.5 * a)
        s = (t - self.times[k]) / h
        return (
            x0 + h * s * v0 + 0.5 * (h * s) ** 2 * a0 + s**3 * (c[0] + s * (c[1] + s * c[2])),
            v0 + h * s * a0 + s**2 * (3 * c[0] + s * (4 * c[1] + s * 5 * c[2])) / h,
            a0 + s * (6 * c[0] + s * (12 * c[1] + s * 20 * c[2])) / h**2,
        )


class Player:
    """The setpoint of each instant."""

    def __init__(self, client, trajectory, engage):
        self.client = client
        self.trajectory, self.engage, self.began_ns = trajectory, engage, None

    def setpoint(self, now_ns):
        """The setpoint of this instant; None at the end."""
        status = self.client.latest_status()
        if status is not None and self.began_ns is None:
            if status.state == STATE_ACTIVE:
                self.began_ns = now_ns
            elif self.engage and status.diagnostic.code == DIAGNOSTIC_READY_TO_ENGAGE:
                self.client.request_in_cycle(now_ns, REQUEST_ENGAGE)
        t = 0.0 if self.began_ns is None else (now_ns - self.began_ns) * 1e-9
        if t > self.trajectory.duration + SETTLE_S:
            return None
        x, xd, xdd = self.trajectory.at(t)
        return Setpoint(kind=SETPOINT_KIND_MOTION, x=tuple(x), x_rate=tuple(xd), x_accel=tuple(xdd))


def use_fifo_priority():
    """Runs this process before all that is not real-time, if the system permits it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pass


def run_in_real_time(client, player, period_ns, rows):
    use_fifo_priority()
    tick_ns = (monotonic_ns() // period_ns + 1) * period_ns
    while (setpoint := player.setpoint(tick_ns)) is not None:
        client.publish_setpoint(tick_ns, setpoint)
        rows.append([tick_ns, *setpoint.x])
        tick_ns = (max(tick_ns, monotonic_ns()) // period_ns + 1) * period_ns
        sleep_until(tick_ns)


def run_in_lockstep(client, player, _period_ns, rows):
    setpoint, answered, setpoint_ns = None, 0, None
    while True:
        measured = client.latest_measured()
        if measured is None or measured.header.sequence == answered:
            os.sched_yield()
            continue
        answered, time_ns = measured.header.sequence, measured.header.time_ns
        # A measurement that is repeated has the same response.
        if time_ns != setpoint_ns:
            setpoint, setpoint_ns = player.setpoint(time_ns), time_ns
            if setpoint is None:
                return
            rows.append([time_ns, *setpoint.x])
        client.publish_setpoint(time_ns, setpoint)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("name")
    arguments.add_argument("trajectory")
    arguments.add_argument("--rate-hz", type=float, default=1000.0)
    arguments.add_argument("--engage", action="store_true")
    arguments.add_argument("--lockstep", action="store_true")
    arguments.add_argument("--record")
    given = arguments.parse_args()
    role, rows = Role.SOURCE | Role.SIMULATED if given.lockstep else Role.SOURCE, []
    with Client(given.name, role) as client:
        player = Player(client, Trajectory(given.trajectory), given.engage and given.lockstep)
        if given.engage and not given.lockstep:
            threading.Thread(target=request, args=(given.name, "engage", True), daemon=True).start()
        run = run_in_lockstep if given.lockstep else run_in_real_time
        run(client, player, round(1e9 / given.rate_hz), rows)
    if given.record:
        write_rows(given.record, ["time_ns", *COORDINATES], rows)


if __name__ == "__main__":
    main()
