"""Actuator forces of motions by MuJoCo, for comparison with `hexad inverse-dynamics`: the same columns in, and out
`t, force_1..6`.

    python mujoco_inverse_dynamics.py MODEL INPUT.csv OUTPUT.csv

mj_inverse gives the generalized forces of the tree of bodies. Forces that hold the loops together act along the
rows of the constraint Jacobian: `qfrc = S^T Gamma + J^T lambda` is solved for both. Coulomb friction and end stops are left out: MuJoCo has
them as constraints that act where Gamma does.
"""

import sys

import mujoco
import numpy as np

from mujoco_machine import COORDINATES, LEGS, Machine, rotation, rows_of, write_rows


def move(machine, x, xd, xdd):
    """Pose, velocities and accelerations of all joints for X, X', X'' of the platform."""
    machine.place(x)
    r, (e1, e2, e3) = rotation(x[:3])
    w1 = e1 * xd[0]
    w2 = w1 + e2 * xd[1]
    omega = w2 + e3 * xd[2]
    omega_rate = e1 * xdd[0] + e2 * xdd[1] + e3 * xdd[2] + np.cross(w1, e2) * xd[1] + np.cross(w2, e3) * xd[2]

    data, free, legs = machine.data, machine.free_dof, machine.leg_dof.flatten()
    jacobian = machine.gap_jacobian()
    data.qvel[free] = [*xd[3:], *(r.T @ omega)]
    data.qvel[legs] = np.linalg.solve(jacobian[:, legs], -jacobian[:, free] @ data.qvel[free])
    mujoco.mj_fwdVelocity(machine.model, data)
    data.qacc[free] = [*xdd[3:], *(r.T @ omega_rate)]
    rest = jacobian[:, free] @ data.qacc[free] + machine.gap_bias()
    data.qacc[legs] = np.linalg.solve(jacobian[:, legs], -rest)


def forces(machine):
    """Gamma of the state and the accelerations that are set [N]."""
    mujoco.mj_inverse(machine.model, machine.data)
    pushes = np.eye(machine.model.nv)[:, machine.prismatic_dof]
    unknowns = np.hstack([pushes, machine.gap_jacobian().T])
    return np.linalg.solve(unknowns, machine.data.qfrc_inverse)[: len(LEGS)]


def main(model, source, target):
    machine = Machine(model)
    left_out = mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS | mujoco.mjtDisableBit.mjDSBL_LIMIT
    machine.model.opt.disableflags |= left_out
    columns = [name + suffix for suffix in ("", "_rate", "_accel") for name in COORDINATES]
    out = []
    for t, *numbers in rows_of(source, ["t", *columns]):
        x, xd, xdd = np.reshape(numbers, (3, 6))
        move(machine, x, xd, xdd)
        out.append([t, *forces(machine)])
    write_rows(target, ["t", *(f"force_{i}" for i in LEGS)], out)


if __name__ == "__main__":
    main(*sys.argv[1:])
