"""Forces that hold the machine in MuJoCo's simulation, settled on springs.

    python mujoco_statics.py MODEL POSES.csv OUTPUT.csv

In: alpha..z. At each pose the legs are put on damped springs, nothing else holds the platform, and the machine swings
until it stands: a little lower, where springs and weight are in balance. Out: alpha..z of where it stands,
force_1..6 of the springs, and `gap`, the largest opening of a loop [m].
"""

import sys

import mujoco
import numpy as np

from mujoco_machine import COORDINATES, LEGS, Machine, rows_of, write_rows

# Natural frequency of the machine on its springs [rad/s]: it sinks by 2.5 mm of g / w^2, and is at rest to 1e-12 of that
# within a second.
W = 62.8
# Longest it may take [s].
PATIENCE = 5.0
# At rest: what the forces still change by in ten milliseconds, as a share of the largest.
AT_REST = 1e-9


def settle(machine, x):
    """Forces at rest near X [N]."""
    model, data = machine.model, machine.data
    machine.place(x)
    targets = machine.lengths.copy()
    mass = model.body_mass.sum() / len(LEGS) + model.dof_armature[machine.prismatic_dof]
    before = np.full(len(LEGS), np.inf)
    hold = round(0.01 / model.opt.timestep)
    for _ in range(round(PATIENCE / 0.01)):
        for _ in range(hold):
            force = mass * W * (W * (targets - machine.lengths) - 2.0 * machine.rates)
            data.ctrl[:] = force
            mujoco.mj_step(model, data)
        if np.abs(force - before).max() < AT_REST * np.abs(force).max():
            return force
        before = force
    raise RuntimeError(f"not at rest after {PATIENCE} s near {x}: {force - before} N in the last 10 ms")


def main(model, source, target):
    machine = Machine(model)
    out = []
    for x in rows_of(source, COORDINATES):
        force = settle(machine, x)
        mujoco.mj_fwdPosition(machine.model, machine.data)
        out.append([*machine.coordinates(), *force, np.abs(machine.gaps()).max()])
    write_rows(target, [*COORDINATES, *(f"force_{i}" for i in LEGS), "gap"], out)


if __name__ == "__main__":
    main(*sys.argv[1:])
