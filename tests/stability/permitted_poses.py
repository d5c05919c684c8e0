"""All poses with given leg lengths that numpy finds from random starts, within a rotation of home and on its side of singular poses.

    python permitted_poses.py CASES.json      # prints a list of [case, row, quaternion w x y z, position x y z]

It shares no equation with hexad: the unknowns are a quaternion and the position, the equations `|p + R(q) b - a|^2 = L^2` and `|q|^2 = 1`.
Levenberg's method takes all starts of a machine at once.
"""

import json
import sys

import numpy as np

STARTS_PER_ROW, STEPS = 300, 60
# Largest residual of a solution; distance below which two are one; margin of rotation and condition within which all must agree.
CONVERGED, SAME, EDGE_RAD, MAX_CONDITION = 1e-11, 1e-5, 1e-6, 1e4


def turned(q, b):
    """R(q) b, for quaternions of any norm, and its derivatives by q."""
    w, v = q[:, None, :1], q[:, None, 1:]
    dot, cross = np.sum(v * b, axis=2, keepdims=True), np.cross(v, b)
    value = (w**2 - np.sum(v**2, axis=2, keepdims=True)) * b + 2 * v * dot + 2 * w * cross
    units = np.cross(np.eye(3)[None, None], b[None, :, None, :])
    by_v = -2 * b[..., None] * v[:, :, None, :] + 2 * dot[..., None] * np.eye(3) + 2 * v[..., None] * b[:, None, :]
    by_v = by_v + 2 * w[..., None] * units.transpose(0, 1, 3, 2)
    return value, np.concatenate([2 * (w * b + cross)[..., None], by_v], axis=3)


def equations(x, lengths, a, b):
    arm, by_q = turned(x[:, :4], b)
    leg = x[:, None, 4:] + arm - a
    residual = np.hstack([np.sum(leg**2, axis=2) - lengths**2, np.sum(x[:, :4] ** 2, axis=1, keepdims=True) - 1])
    by_x = np.zeros((len(x), 7, 7))
    by_x[:, :6, :4] = 2 * np.einsum("nij,nijk->nik", leg, by_q)
    by_x[:, :6, 4:], by_x[:, 6, :4] = 2 * leg, 2 * x[:, :4]
    return residual, by_x


def solved(x, lengths, a, b):
    """Where Levenberg's method ends, with the norm of the residual."""
    damping = np.full(len(x), 1e-2)
    residual, by_x = equations(x, lengths, a, b)
    norm = np.linalg.norm(residual, axis=1)
    for _ in range(STEPS):
        k = np.flatnonzero(norm > 1e-14)
        normal = by_x[k].transpose(0, 2, 1) @ by_x[k] + damping[k, None, None] * np.eye(7)
        step = np.linalg.solve(normal, by_x[k].transpose(0, 2, 1) @ residual[k, :, None])[:, :, 0]
        there = x[k] - step
        new_residual, new_by_x = equations(there, lengths[k], a, b)
        new_norm = np.linalg.norm(new_residual, axis=1)
        better = new_norm < norm[k]
        damping[k] *= np.where(better, 0.2, 5.0)
        k = k[better]
        x[k], residual[k], by_x[k], norm[k] = there[better], new_residual[better], new_by_x[better], new_norm[better]
    return x, norm


def product(p, q):
    w = p[:, :1] * q[:, :1] - np.sum(p[:, 1:] * q[:, 1:], axis=1, keepdims=True)
    return np.hstack([w, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])])


def wrenches(x, a, b):
    arm, _ = turned(x[:, :4], b)
    leg = x[:, None, 4:] + arm - a
    n = leg / np.linalg.norm(leg, axis=2, keepdims=True)
    return np.concatenate([n, np.cross(arm - arm.mean(axis=1, keepdims=True), n)], axis=2)


def permitted(case, random):
    a, b, home, lengths = (np.array(case[key]) for key in ("base", "platform", "home", "lengths"))
    # Lengths of about 1.
    unit = np.linalg.norm(b - b.mean(axis=0), axis=1).mean()
    a, b, lengths = a / unit, b / unit, lengths / unit
    home = np.concatenate([home[:4], home[4:] / unit])[None]
    row = np.repeat(np.arange(len(lengths)), STARTS_PER_ROW)
    axis = random.normal(size=(2, len(row), 3))
    axis /= np.linalg.norm(axis, axis=2, keepdims=True)
    half = 0.5 * case["max_rotation"] * np.cbrt(random.uniform(size=(len(row), 1)))
    q = product(np.hstack([np.cos(half), np.sin(half) * axis[0]]), home[:, :4])
    # Anywhere on the sphere on which the squares of the lengths have their mean.
    seen = a - turned(q, b)[0]
    middle = seen.mean(axis=1)
    square = np.mean(lengths[row] ** 2, axis=1) - np.mean(np.sum((seen - middle[:, None]) ** 2, axis=2), axis=1)
    x, norm = solved(np.hstack([q, middle + axis[1] * np.sqrt(np.maximum(square, 0))[:, None]]), lengths[row], a, b)
    turn = 2 * np.arccos(np.minimum(np.abs(x[:, :4] @ home[0, :4]), 1))
    matrix = wrenches(x, a, b)
    side = np.linalg.det(matrix) * np.linalg.det(wrenches(home, a, b)) > 0
    is_good = (norm < CONVERGED) & side & (turn < case["max_rotation"] - EDGE_RAD) & (np.linalg.cond(matrix) < MAX_CONDITION)
    found = []
    for k in np.flatnonzero(is_good):
        pose = x[k] * np.where(np.arange(7) < 4, np.sign(x[k, :4] @ home[0, :4]), 1)
        if not any(other == row[k] and np.abs(pose - there).max() < SAME for other, there in found[-40:]):
            found.append((row[k], pose))
    return [[int(row), *pose[:4], *(unit * pose[4:])] for row, pose in found]


with open(sys.argv[1]) as file:
    cases = json.load(file)
random = np.random.default_rng(1)
print(json.dumps([[index, *pose] for index, case in enumerate(cases) for pose in permitted(case, random)]))
