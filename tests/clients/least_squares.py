"""Base parameters of a machine from recordings, by least squares in numpy. It shares no code with `hexad identify`.

    hexad convert EMPTY.mcap --csv EMPTY.csv
    hexad convert LOADED.mcap --csv LOADED.csv
    python least_squares.py machine.toml EMPTY.csv LOADED.csv KG X,Y,Z DELAY_S

LOADED.csv has the weight of KG at X, Y, Z on the platform. Prints JSON: number of equations, rank, condition, and the base
parameters by their names in `hexad identify --json`. The force scales of the machine file are 1.
"""

import csv
import json
import sys
import tomllib

import numpy as np
from mujoco_machine import rotation

# Width of the local polynomials, their samples, samples of an equation, rate below which a leg nearly stands.
HALF_WIDTH_S, SAMPLES_PER_HALF_WIDTH = 0.02, 4
GROUP = 16
STANDING_M_S, STANDING_RATIO = 0.03, 0.2
POSE = [f"estimated_{name}" for name in ("alpha", "beta", "gamma", "x", "y", "z")]
FORCES = [f"drive_command_{i}" for i in range(1, 7)]
COLUMNS = ["cycle", "missed_measurements", "t", "estimated_t", *POSE, *FORCES]


class Machine:
    """Geometry and gravity of a machine file."""

    def __init__(self, path):
        with open(path, "rb") as file:
            text = tomllib.load(file)
        self.gravity = np.array(text["gravity_m_s2"])
        self.base, self.platform = (np.array([leg[key] for leg in text["leg"]]) for key in ("base_m", "platform_m"))
        axes = np.array([leg.get("universal_axis", [0.0, 1.0, 0.0]) for leg in text["leg"]])
        self.universal_axis = axes / np.linalg.norm(axes, axis=1, keepdims=True)


def smoothed(times, values, center, half):
    """Value, first and second derivative at an instant of the polynomial of fourth degree through the values near it."""
    x = (times - center) / half
    weight = np.where(np.abs(x) < 1.0, 1.0 - x * x, 0.0)
    powers = x[:, None] ** np.arange(5)
    found = np.linalg.lstsq(powers * weight[:, None], values * weight[:, None], rcond=None)[0]
    return found[0], found[1] / half, 2.0 * found[2] / half**2


def rotation_vectors(r):
    """Of small rotations."""
    axis = 0.5 * np.array([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]]).T
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    return axis * np.where(sine > 0.0, np.arcsin(sine) / np.maximum(sine, np.finfo(float).tiny), 1.0)


def rotation_of(vector):
    """By Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


class Samples:
    """Motion and commands of a recording at the same instants."""

    def __init__(self, path, delay_s):
        with open(path) as file:
            lines = list(csv.DictReader(file))
        under_control = [line for line in lines if line["state"] in ("engaging", "active", "stopping", "parking")]
        table = {name: np.array([float(line[name]) for line in under_control]) for name in COLUMNS}
        if (np.diff(table["cycle"]) != 1).any() or np.diff(table["missed_measurements"]).any():
            raise ValueError(f"{path}: cycles or measurements are missing")
        released, measured = (table[name] - table["t"][0] for name in ("t", "estimated_t"))
        x, forces = (np.array([table[name] for name in names]).T for names in (POSE, FORCES))
        rotations = np.array([rotation(angles)[0] for angles in x[:, :3]])
        middles = 0.5 * ((released[:-1] + delay_s) + (released[1:] + delay_s))
        half = HALF_WIDTH_S
        step, duration = half / SAMPLES_PER_HALF_WIDTH, measured[-1]
        found = []
        for index in range(int((duration - 2.0 * half) / step) + 1):
            time = half + step * index
            near = np.flatnonzero((measured > time - half) & (measured < time + half))
            middle = near[len(near) // 2]
            moved = np.hstack([rotation_vectors(rotations[near] @ rotations[middle].T), x[near, 3:] - x[middle, 3:]])
            shift, rate, accel = smoothed(measured[near], moved, time, half)
            held = np.flatnonzero((middles > time - half) & (middles < time + half))
            force = smoothed(middles[held], forces[:-1][held], time, half)[0]
            r = rotation_of(shift[:3]) @ rotations[middle]
            found.append((r, x[middle, 3:] + shift[3:], rate[:3], rate[3:], accel[:3], accel[3:], force))
        self.rotation, self.position, self.omega, self.v, self.omega_rate, self.a, self.command = map(np.array, zip(*found))


def turning(inertia_times, omega, omega_rate):
    """Torque I omega' + omega x I omega."""
    return inertia_times(omega_rate) + np.cross(omega, inertia_times(omega))


def platform_wrenches(samples, gravity):
    """Torque about C and force of a unit of each parameter of the platform, by Newton and Euler."""
    r, w, wd, a = samples.rotation, samples.omega, samples.omega_rate, samples.a - gravity
    zero = np.zeros_like(a)
    yield "mass", zero, a
    for k, axis in enumerate("xyz"):
        h = r[:, :, k]
        yield f"moment_{axis}", np.cross(h, a), np.cross(wd, h) + np.cross(w, np.cross(w, h))
    for element in ("xx", "yy", "zz", "xy", "xz", "yz"):
        unit = np.zeros((3, 3))
        i, j = ("xyz".index(axis) for axis in element)
        unit[i, j] = unit[j, i] = 1.0
        inertia = r @ unit @ r.transpose(0, 2, 1)
        yield f"inertia_{element}", turning(lambda z: np.einsum("sij,sj->si", inertia, z), w, wd), zero


class Leg:
    """Motion of the two links of a leg, and how they move with the twist of the platform."""

    def __init__(self, samples, base, platform, u):
        w, wd = samples.omega, samples.omega_rate
        self.arm = b = samples.rotation @ platform
        velocity = samples.v + np.cross(w, b)
        self.joint_acceleration = samples.a + np.cross(wd, b) + np.cross(w, np.cross(w, b))
        leg = samples.position + b - base
        dot = lambda p, q: np.sum(p * q, axis=-1, keepdims=True)
        length = np.linalg.norm(leg, axis=1, keepdims=True)
        self.n = n = leg / length
        rate = dot(n, velocity)
        n1 = (velocity - n * rate) / length
        accel = dot(n, self.joint_acceleration) + length * dot(n1, n1)
        n2 = (self.joint_acceleration - n * accel - 2.0 * n1 * rate) / length
        self.rate, self.accel = rate[:, 0], accel[:, 0]
        # The second axis of the universal joint is normal to the first one, u, and to the leg.
        k, k1, k2 = np.cross(u, n), np.cross(u, n1), np.cross(u, n2)
        size = np.linalg.norm(k, axis=1, keepdims=True)
        x = k / size
        size1 = dot(x, k1)
        x1 = (k1 - x * size1) / size
        size2 = dot(x1, k1) + dot(x, k2)
        x2 = (k2 - 2.0 * x1 * size1 - x * size2) / size
        y, y1 = np.cross(n, x), np.cross(n1, x) + np.cross(n, x1)
        spin, spin1 = dot(x1, y), dot(x2, y) + dot(x1, y1)
        self.omega = np.cross(n, n1) + n * spin
        self.omega_rate = np.cross(n, n2) + n1 * spin + n * spin1
        # Velocity of the joint, and angular velocity of the links, for a unit of each component of the twist.
        unit = np.eye(3)
        self.joint_by_twist = [np.cross(axis, b) for axis in unit] + [np.tile(axis, (len(b), 1)) for axis in unit]
        self.turn_by_twist = []
        for joint in self.joint_by_twist:
            turned = (joint - n * dot(n, joint)) / length
            second = np.cross(u, turned)
            self.turn_by_twist.append(np.cross(n, turned) + n * dot((second - x * dot(x, second)) / size, y))

    def wrenches(self, gravity):
        """Force at the joint on the platform and torque on the links of a unit of each parameter, as power of the twist."""
        n, w, wd = self.n, self.omega, self.omega_rate
        along = lambda z: n * np.sum(n * z, axis=1, keepdims=True)
        still = np.zeros_like(n)
        terms = {
            "cylinder_moment": (still, -np.cross(n, gravity)),
            "transverse_inertia": (still, turning(lambda z: z - along(z), w, wd)),
            "axial_inertia": (still, turning(along, w, wd)),
            "rod_moment": (
                -np.cross(wd, n) - np.cross(w, np.cross(w, n)),
                -np.cross(n, self.joint_acceleration - gravity),
            ),
        }
        for name, (force, torque) in terms.items():
            pairs = zip(self.joint_by_twist, self.turn_by_twist)
            yield name, np.array([np.sum(force * joint + torque * turn, axis=1) for joint, turn in pairs]).T


def columns(machine, samples):
    """Force of all legs for a unit of each base parameter: samples x legs. And the rates of the legs."""
    joints = zip(machine.base, machine.platform, machine.universal_axis)
    legs = [Leg(samples, *joint) for joint in joints]
    wrenches = {name: np.hstack(parts) for name, *parts in platform_wrenches(samples, machine.gravity)}
    for leg in legs:
        for name, wrench in leg.wrenches(machine.gravity):
            wrenches[name] = wrenches.get(name, 0.0) + wrench
    by_leg = np.array([np.hstack([np.cross(leg.arm, leg.n), leg.n]) for leg in legs]).transpose(1, 2, 0)
    found = {name: np.linalg.solve(by_leg, wrench[:, :, None])[:, :, 0] for name, wrench in wrenches.items()}
    found["reflected_mass"] = np.array([leg.accel for leg in legs]).T
    return found, np.array([leg.rate for leg in legs]).T


def equations(machine, samples, weight, at):
    """Rows of the unknowns, by name, and the known side: means of successive samples while a leg moves."""
    forces, rates = columns(machine, samples)
    x, y, z = at
    point = {"mass": 1.0, "moment_x": x, "moment_y": y, "moment_z": z}
    point |= {"inertia_xx": y * y + z * z, "inertia_yy": x * x + z * z, "inertia_zz": x * x + y * y}
    point |= {"inertia_xy": -x * y, "inertia_xz": -x * z, "inertia_yz": -y * z}
    known = weight * sum(value * forces[name] for name, value in point.items())
    standing = np.minimum(STANDING_M_S, STANDING_RATIO * np.sqrt(np.mean(rates**2, axis=0)))
    rows, right = [], []
    for first in range(0, len(rates) - GROUP + 1, GROUP):
        group = slice(first, first + GROUP)
        for leg in range(6):
            rate, command = rates[group, leg], samples.command[group, leg]
            sign = np.sign(rate[0])
            if not (rate * sign > standing[leg]).all():
                continue
            row = {name: -np.mean(force[group, leg]) for name, force in forces.items()}
            row |= {f"viscous_friction_{leg + 1}": -np.mean(rate), f"coulomb_friction_{leg + 1}": -sign}
            row |= {f"force_scale_{leg + 1}": np.mean(command)}
            row |= {f"scaled_load_friction_{leg + 1}": -sign * np.mean(np.abs(command))}
            rows.append(row)
            right.append(np.mean(known[group, leg]))
    return rows, right


def main():
    path, empty, loaded, weight, at, delay_s = sys.argv[1:]
    machine, at = Machine(path), [float(x) for x in at.split(",")]
    rows, right = equations(machine, Samples(empty, float(delay_s)), 0.0, at)
    for side, more in zip((rows, right), equations(machine, Samples(loaded, float(delay_s)), float(weight), at)):
        side.extend(more)
    names = sorted({name for row in rows for name in row})
    matrix = np.array([[row.get(name, 0.0) for name in names] for row in rows])
    norms = np.linalg.norm(matrix, axis=0)
    found, _, rank, singular = np.linalg.lstsq(matrix / norms, np.array(right), rcond=None)
    result = {"equations": len(rows), "rank": int(rank), "condition": singular[0] / singular[-1]}
    result["base_parameters"] = dict(zip(names, found / norms))
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main()
