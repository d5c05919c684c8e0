"""A machine that `hexad export` wrote, in MuJoCo: what every client of such a model needs.

Names, frames and signs are those that the exported file explains at its top.
"""

import csv
import xml.etree.ElementTree as xml

import mujoco
import numpy as np

LEGS = range(1, 7)
# Time in which a brake brings a leg to rest [s].
BRAKE_S = 0.02
COORDINATES = ["alpha", "beta", "gamma", "x", "y", "z"]


def load(path):
    """The model of an exported file. The loops of a URDF are closed here, as URDF cannot express it."""
    spec = mujoco.MjSpec.from_file(path)
    root = xml.parse(path).getroot()
    if root.tag == "robot":
        for i in LEGS:
            at = root.find(f"./joint[@name='ball_platform_{i}_fixed']/origin").get("xyz")
            spec.body("platform").add_site(name=f"ball_platform_{i}", pos=[float(x) for x in at.split()])
            spec.body(f"rod_{i}").add_site(name=f"ball_rod_{i}")
            spec.add_equality(
                name=f"ball_{i}",
                type=mujoco.mjtEq.mjEQ_CONNECT,
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                name1=f"ball_platform_{i}",
                name2=f"ball_rod_{i}",
            )
    for i in LEGS:
        spec.add_equality(
            name=f"brake_{i}",
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=f"prismatic_{i}",
            active=False,
            solref=[BRAKE_S, 1.0],
        )
    return spec.compile()


class Machine:
    """Model, data, and where the coordinates of legs and platform are."""

    def __init__(self, path):
        self.model = load(path)
        self.data = mujoco.MjData(self.model)
        joint = self.model.joint
        legs = [[f"universal_first_{i}", f"universal_second_{i}", f"prismatic_{i}"] for i in LEGS]
        self.leg_qpos = np.array([[joint(name).qposadr[0] for name in leg] for leg in legs])
        self.leg_dof = np.array([[joint(name).dofadr[0] for name in leg] for leg in legs])
        # Angles as at home, legs in the middle of their stroke.
        self.middle = np.array([[0.0, 0.0, joint(leg[2]).range.mean()] for leg in legs])
        free = joint("platform_free")
        self.free_qpos = free.qposadr[0] + np.arange(7)
        self.free_dof = free.dofadr[0] + np.arange(6)
        self.balls = [[self.model.site(f"ball_{end}_{i}").id for end in ("rod", "platform")] for i in LEGS]
        self.laws = []
        for link in ("cylinder", "rod"):
            law = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_NUMERIC, f"{link}_transverse_inertia")
            if law >= 0:
                start = self.model.numeric_adr[law]
                bodies = [self.model.body(f"{link}_{i}").id for i in LEGS]
                self.laws.append((bodies, self.model.numeric_data[start : start + 3]))

        self.brakes = np.array([self.model.equality(f"brake_{i}").id for i in LEGS])

    @property
    def lengths(self):
        """L [m]"""
        return self.data.qpos[self.leg_qpos[:, 2]]

    @property
    def rates(self):
        """L' [m/s]"""
        return self.data.qvel[self.leg_dof[:, 2]]

    @property
    def prismatic_dof(self):
        return self.leg_dof[:, 2]

    def follow_lengths(self):
        """Gives links whose inertia varies with the length of the leg the one of now."""
        for bodies, (constant, quadratic, reference) in self.laws:
            # MuJoCo keeps principal moments; those of a link in the model are transverse, transverse, axial.
            transverse = constant + quadratic * (self.lengths - reference) ** 2
            self.model.body_inertia[bodies, 0] = transverse
            self.model.body_inertia[bodies, 1] = transverse

    def place(self, x):
        """Stands the machine at X = alpha, beta, gamma [rad], x, y, z [m]: the legs follow the platform."""
        self.data.qpos[self.free_qpos[:3]] = x[3:]
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, rotation(x[:3])[0].flatten())
        self.data.qpos[self.free_qpos[3:]] = quaternion
        self.data.qvel[:] = 0.0
        self.data.qpos[self.leg_qpos] = self.middle
        # Newton's method, leg by leg; six steps or so to the last digit.
        for _ in range(50):
            mujoco.mj_fwdPosition(self.model, self.data)
            gaps = self.gaps()
            if np.abs(gaps).max() < 4e-16 * (1.0 + np.abs(self.data.site_xpos).max()):
                break
            jacobian = self.gap_jacobian()
            for leg, gap in enumerate(gaps):
                rows = jacobian[3 * leg : 3 * leg + 3, self.leg_dof[leg]]
                self.data.qpos[self.leg_qpos[leg]] -= np.linalg.solve(rows, gap)
        if np.abs(gaps).max() > 1e-12:
            raise RuntimeError(f"no legs found for the pose {x}: gaps of {gaps} m")
        self.follow_lengths()

    def push(self, force):
        """Actuator forces [N] until the next call; None brakes."""
        data, brakes = self.data, self.brakes
        if force is None and not data.eq_active[brakes].any():
            # The joints' positions count from those at home.
            home = self.model.qpos0[self.leg_qpos[:, 2]]
            self.model.eq_data[brakes, 0] = self.lengths - home
        data.eq_active[brakes] = force is None
        data.ctrl[:] = 0.0 if force is None else force

    def advance(self, steps):
        """Lets so many time steps of the model pass."""
        self.follow_lengths()
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def velocities(self):
        """Of all joints at the instant of their positions: MuJoCo's are those of half a step before."""
        return self.data.qvel + 0.5 * self.model.opt.timestep * self.data.qacc

    def twist(self, velocities):
        """omega [rad/s], then v [m/s] of the platform in the base."""
        r = np.zeros(9)
        mujoco.mju_quat2Mat(r, self.data.qpos[self.free_qpos[3:]])
        v, w = np.split(velocities[self.free_dof], 2)
        return np.array([*(r.reshape(3, 3) @ w), *v])

    def gaps(self):
        """What is left open of the six loops [m], 6 x 3."""
        at = self.data.site_xpos
        return np.array([at[rod] - at[platform] for rod, platform in self.balls])

    def gap_jacobian(self):
        """How the gaps change with qvel, 18 x nv."""
        jacobian = np.zeros((18, self.model.nv))
        one = np.zeros((3, self.model.nv))
        for leg, ends in enumerate(self.balls):
            for site, sign in zip(ends, (1.0, -1.0)):
                mujoco.mj_jacSite(self.model, self.data, one, None, site)
                jacobian[3 * leg : 3 * leg + 3] += sign * one
        return jacobian

    def gap_bias(self):
        """What the gaps accelerate by at qacc = 0, 18."""
        bias = np.zeros(18)
        one = np.zeros((3, self.model.nv))
        for leg, ends in enumerate(self.balls):
            for site, sign in zip(ends, (1.0, -1.0)):
                body = self.model.site_bodyid[site]
                mujoco.mj_jacDot(self.model, self.data, one, None, self.data.site_xpos[site], body)
                bias[3 * leg : 3 * leg + 3] += sign * one @ self.data.qvel
        return bias

    def coordinates(self):
        """X of the platform, beta in [-90, 90] degrees."""
        r = np.zeros(9)
        mujoco.mju_quat2Mat(r, self.data.qpos[self.free_qpos[3:]])
        r = r.reshape(3, 3)
        alpha, gamma = np.arctan2(-r[1, 2], r[2, 2]), np.arctan2(-r[0, 1], r[0, 0])
        beta = np.arctan2(r[0, 2], np.hypot(r[0, 0], r[0, 1]))
        return np.array([alpha, beta, gamma, *self.data.qpos[self.free_qpos[:3]]])


def rotation(angles):
    """R = Rx(alpha) Ry(beta) Rz(gamma), and its three axes in the base."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(angles), np.cos(angles)
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])
    return rx @ ry @ rz, (np.array([1.0, 0, 0]), rx[:, 1], (rx @ ry)[:, 2])


def rows_of(path, columns):
    """The named columns of a CSV file, wherever they are."""
    with open(path, newline="") as file:
        return [[float(row[name]) for name in columns] for row in csv.DictReader(file)]


def write_rows(path, columns, rows):
    """Shortest digits that read back the same."""
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows([repr(float(x)) for x in row] for row in rows)
