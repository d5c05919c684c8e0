"""An exported machine in MuJoCo that plays the hardware: measures legs, takes forces, brakes without them.

    hexad export --config F --format mjcf --output machine.xml
    python mujoco_plant.py NAME machine.xml [--rate-hz R] [--lockstep] [--record RUN.csv] [--friction LEGS.csv]

NAME is that of the configuration. With --lockstep it is the clock of a daemon with release = "lockstep". Ends with
SIGTERM or SIGINT; --record writes what was measured, and the forces that followed, in each period. LEGS.csv has a row
per leg with dry friction that no model file holds: load_friction, stribeck_n, stribeck_speed_m_s.
"""

import argparse

import hexad
import numpy as np
from mujoco_machine import COORDINATES, LEGS, Machine, rows_of, write_rows

# A force older than this is not applied [s].
FORCE_TIMEOUT_S = 0.05

# Before all that is not real-time.
PRIORITY = 1


class DryFriction:
    """Dry friction of the drives: coulomb + stribeck exp(-(L' / speed)^2) + load |G|, G the drive's own force.

    MuJoCo bounds the friction of a joint by a number of the model. It is set in each period, by the rate at its beginning.
    """

    def __init__(self, machine, path):
        rows = rows_of(path, ["load_friction", "stribeck_n", "stribeck_speed_m_s"])
        self.load, self.stribeck_n, self.speed_m_s = np.array(rows).T
        self.coulomb_n = machine.model.dof_frictionloss[machine.prismatic_dof].copy()
        self.scale = machine.model.actuator_gear[:, 0].copy()

    def set(self, machine, force_n):
        stribeck = self.stribeck_n * np.exp(-((machine.rates / self.speed_m_s) ** 2))
        load = self.load * np.abs(self.scale * (0.0 if force_n is None else np.array(force_n)))
        machine.model.dof_frictionloss[machine.prismatic_dof] = self.coulomb_n + stribeck + load


class Plant(hexad.Driver):
    """The platform moves between the ticks, under the forces of the last one."""

    def __init__(self, given):
        period_s = 1.0 / given.rate_hz
        super().__init__(
            given.name,
            period_s=period_s,
            longest_age_s=FORCE_TIMEOUT_S,
            priority=PRIORITY,
            simulated=given.lockstep,
        )
        self.machine_in_mujoco, self.rows = Machine(given.model), []
        self.machine_in_mujoco.place(self.machine_in_mujoco.coordinates())
        self.friction = DryFriction(self.machine_in_mujoco, given.friction) if given.friction else None
        self.steps = round(period_s / self.machine_in_mujoco.model.opt.timestep)
        self.last_tick_ns, self.measured = None, None

    def measure(self, tick_ns):
        machine = self.machine_in_mujoco
        if self.last_tick_ns is not None:
            machine.advance((tick_ns - self.last_tick_ns) // self.period_ns * self.steps)
        self.last_tick_ns = tick_ns
        velocities = machine.velocities()
        self.measured = hexad.Measured(
            length_m=tuple(machine.lengths),
            length_rate_m_s=tuple(velocities[machine.prismatic_dof]),
            rates_valid=1,
            pose_valid=1,
            x=tuple(machine.coordinates()),
            twist=tuple(machine.twist(velocities)),
        )
        # It moves by the grid of the ticks, so its measurements are those of the tick.
        self.measured.header.time_ns = tick_ns
        return self.measured

    def apply(self, force_n):
        self.push(force_n, force_n)

    def brake(self):
        self.push(None, [float("nan")] * len(LEGS))

    def push(self, force_n, recorded):
        """Forces, or brakes, until the next tick."""
        self.rows.append([self.last_tick_ns, *self.measured.x, *self.measured.twist, *recorded])
        self.machine_in_mujoco.push(force_n)
        if self.friction:
            self.friction.set(self.machine_in_mujoco, force_n)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("name")
    arguments.add_argument("model")
    arguments.add_argument("--rate-hz", type=float, default=1000.0)
    arguments.add_argument("--lockstep", action="store_true")
    arguments.add_argument("--record")
    arguments.add_argument("--friction")
    given = arguments.parse_args()
    plant = Plant(given)
    plant.run()
    if given.record:
        twist = ["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"]
        columns = ["time_ns", *COORDINATES, *twist, *(f"force_{i}" for i in LEGS)]
        write_rows(given.record, columns, plant.rows)


if __name__ == "__main__":
    main()
