"""An exported machine in MuJoCo that plays the hardware: measures legs, takes forces, brakes without them.

    hexad export --config F --format mjcf --output machine.xml
    python mujoco_plant.py NAME machine.xml [--rate-hz R] [--lockstep] [--record RUN.csv]

NAME is that of the configuration. With --lockstep it is the clock of a daemon with release = "lockstep". Ends with
SIGTERM or SIGINT; --record writes what was measured, and the forces that followed, in each period.
"""

import argparse
import os
import signal
import sys

from hexad import Bus, Force, Measured, use_fifo_priority, monotonic_ns, sleep_until
from mujoco_machine import COORDINATES, LEGS, Machine, write_rows

# Without a response a measurement is repeated: a participant may not be connected yet [ns].
REPEAT_NS = 100_000_000


def measurement(machine):
    velocities = machine.velocities()
    return Measured(
        length_m=tuple(machine.lengths),
        length_rate_m_s=tuple(velocities[machine.prismatic_dof]),
        rates_valid=1,
        pose_valid=1,
        x=tuple(machine.coordinates()),
        twist=tuple(machine.twist(velocities)),
    )


def drive(machine, measured, force, steps, rows):
    """One period under a force, or braked."""
    push = list(force.force_n) if force is not None else None
    pushes = [float("nan")] * 6 if push is None else push
    rows.append([measured.header.time_ns, *measured.x, *measured.twist, *pushes])
    machine.push(push)
    machine.advance(steps)


def run_in_real_time(machine, bus, period_ns, rows):
    forces, source = bus.subscriber(Force), bus.publisher(Measured)
    steps = round(period_ns * 1e-9 / machine.model.opt.timestep)
    use_fifo_priority()
    tick_ns = (monotonic_ns() // period_ns + 1) * period_ns
    force = None
    while True:
        sleep_until(tick_ns)
        measured = measurement(machine)
        source.publish(tick_ns, measured)
        force = forces.receive_latest() or force
        now_ns = monotonic_ns()
        drive(machine, measured, force if force and force.may_be_applied(now_ns) else None, steps, rows)
        tick_ns += period_ns


def run_in_lockstep(machine, bus, period_ns, rows):
    forces, source = bus.subscriber(Force), bus.publisher(Measured)
    steps = round(period_ns * 1e-9 / machine.model.opt.timestep)
    time_ns = 0
    while True:
        measured = measurement(machine)
        source.publish(time_ns, measured)
        said_ns = monotonic_ns()
        while (force := forces.receive_latest()) is None or force.release_ns != time_ns:
            if monotonic_ns() - said_ns > REPEAT_NS:
                source.publish(time_ns, measured)
                said_ns = monotonic_ns()
            os.sched_yield()
        drive(machine, measured, force if force.may_be_applied(time_ns) else None, steps, rows)
        time_ns += period_ns


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("name")
    arguments.add_argument("model")
    arguments.add_argument("--rate-hz", type=float, default=1000.0)
    arguments.add_argument("--lockstep", action="store_true")
    arguments.add_argument("--record")
    given = arguments.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    machine, rows = Machine(given.model), []
    machine.place(machine.coordinates())
    run = run_in_lockstep if given.lockstep else run_in_real_time
    try:
        run(machine, Bus(given.name, given.lockstep), round(1e9 / given.rate_hz), rows)
    except KeyboardInterrupt:
        pass
    finally:
        if given.record:
            twist = ["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"]
            write_rows(given.record, ["time_ns", *COORDINATES, *twist, *(f"force_{i}" for i in LEGS)], rows)


if __name__ == "__main__":
    main()
