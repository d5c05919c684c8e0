"""Least cost of a calibration, by scipy's least squares with equations of its own and derivatives by differences.

    python bundle_adjustment.py CASE.json       prints the cost
"""

import json
import sys

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

HUBER_QUANTILE = 3.09
STEP = 1e-6
# Of weights and least squares in turn.
ROUNDS = 15


def pose(rows):
    # Columns were written as rows of the transposed matrix, column by column.
    return Rotation.from_matrix(np.array(rows[0]).reshape(3, 3)), np.array(rows[1]).ravel()


case = json.load(open(sys.argv[1]))
nominal = np.array(case["nominal"]).ravel()
lengths = np.array(case["lengths"]).reshape(-1, 6)
length_noise, position_noise, angle_noise = case["noise"]
count = len(lengths)
has_reflectors = case["reflectors"] is not None
poses = [pose(it) for it in case["poses"]]
start_rotations = Rotation.from_quat([it[0].as_quat() for it in poses])
start_positions = np.array([it[1] for it in poses])
tracker_rotation, tracker_position = pose(case["tracker"])
if has_reflectors:
    places = np.array(case["reflectors"]).reshape(-1, 3)
    seen = np.array(case["seen"], dtype=float).reshape(count, -1, 3)
else:
    probe_rotation, probe_position = pose(case["probe"])
    seen = [pose(it) for it in case["seen"]]
    seen_rotations = Rotation.from_quat([it[0].as_quat() for it in seen])
    seen_positions = np.array([it[1] for it in seen])
shared = 48 + (places.size if has_reflectors else 6)


def rows(u):
    base = nominal[:18].reshape(6, 3) + u[:18].reshape(6, 3)
    platform = nominal[18:36].reshape(6, 3) + u[18:36].reshape(6, 3)
    offsets = nominal[36:42] + u[36:42]
    steps = u[shared:].reshape(count, 6)
    rotations = Rotation.from_rotvec(steps[:, :3]) * start_rotations
    positions = start_positions + steps[:, 3:]
    matrices = rotations.as_matrix()
    joints = np.einsum("nij,lj->nli", matrices, platform) + positions[:, None]
    parts = [(np.linalg.norm(joints - base, axis=2) - offsets - lengths) / length_noise]
    to_tracker = Rotation.from_rotvec(u[42:45]) * tracker_rotation
    origin = tracker_position + u[45:48]
    if has_reflectors:
        at = np.einsum("nij,kj->nki", matrices, places + u[48:shared].reshape(-1, 3)) + positions[:, None]
        found = np.einsum("ij,nkj->nki", to_tracker.as_matrix(), at) + origin
        parts.append(((found - seen) / position_noise).reshape(count, -1))
    else:
        turned = Rotation.from_rotvec(u[48:51]) * probe_rotation
        at = np.einsum("nij,j->ni", matrices, probe_position + u[51:54]) + positions
        parts.append((to_tracker.apply(at) + origin - seen_positions) / position_noise)
        parts.append((to_tracker * rotations * turned * seen_rotations.inv()).as_rotvec() / angle_noise)
    return np.hstack(parts)


def losses(u):
    """Huber's loss of each row, and its derivative by the squared residual."""
    each = rows(u)
    n = each.shape[1] - 6
    bound = n * (1 - 2 / (9 * n) + HUBER_QUANTILE * np.sqrt(2 / (9 * n))) ** 3
    square = np.maximum(np.sum(each**2, axis=1), 1e-300)
    is_within = square <= bound
    return np.where(is_within, square, 2 * np.sqrt(bound * square) - bound), np.where(is_within, 1, np.sqrt(bound / square))


def residuals(u):
    return np.concatenate([(rows(u) * np.sqrt(weights)[:, None]).ravel(), u[:42] / case["tolerance"]])


def jacobian(u):
    """Central differences; the poses of all rows move at once, as each row depends on its own."""
    width = rows(u).shape[1]

    def difference(step):
        return (residuals(u + step) - residuals(u - step)) / (2 * STEP)

    found = np.zeros((count * width + 42, len(u)))
    for k in range(shared):
        found[:, k] = difference(STEP * np.eye(1, len(u), k)[0])
    for k in range(6):
        step = np.zeros(len(u))
        step[shared + k :: 6] = STEP
        by_pose = difference(step)[: count * width].reshape(count, width)
        for row in range(count):
            found[row * width : (row + 1) * width, shared + 6 * row + k] = by_pose[row]
    return found


u = np.zeros(shared + 6 * count)
for _ in range(ROUNDS):
    weights = losses(u)[1]
    u = least_squares(residuals, u, jac=jacobian, method="lm", x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15).x
print(repr(float(np.sum(losses(u)[0]) + np.sum((u[:42] / case["tolerance"]) ** 2))))
