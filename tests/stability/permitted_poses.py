#     python permitted_poses.py CASE.json      # prints a list of [row, quaternion w x y z, position x y z]
#
# Poses with given leg lengths that numpy finds from random starts, turned from home by no more than is permitted, and anywhere. Arms
# are in base axes at home, so the quaternion q is the rotation from home. It shares no equation with hexad: the unknowns are q and the
# position p, the equations `|p + q b q* - a|^2 = L^2` and `|q|^2 = 1`. Levenberg's method takes all starts at once.
import json
import sys

import numpy as np

STARTS_PER_ROW, STEPS, CONVERGED = 300, 60, 1e-11


def times(p, q):
    real = p[..., :1] * q[..., :1] - np.sum(p[..., 1:] * q[..., 1:], axis=-1, keepdims=True)
    imaginary = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate([real, imaginary], axis=-1)


def equations(x, lengths):
    q, by_q = x[:, :4], np.einsum("nj,jkir->nirk", x[:, :4], turned)
    leg = x[:, None, 4:] + np.einsum("nirk,nk->nir", by_q, q) - base
    residual = np.hstack([np.sum(leg**2, axis=2) - lengths**2, np.sum(q**2, axis=1, keepdims=True) - 1])
    by_x = np.zeros((len(x), 7, 7))
    by_x[:, :6, :4] = 4 * np.einsum("nir,nirk->nik", leg, by_q)
    by_x[:, :6, 4:], by_x[:, 6, :4] = 2 * leg, 2 * q
    return residual, by_x, np.linalg.norm(residual, axis=1)


base, arms, position, max_rotation, lengths = map(np.array, json.load(open(sys.argv[1])))
# q b q* for each pair of units, symmetric.
turned = times(times(np.eye(4)[:, None, None], np.pad(arms, ((0, 0), (1, 0)))), np.diag([1.0, -1, -1, -1])[:, None])[..., 1:]
turned = (turned + turned.swapaxes(0, 1)) / 2
random, row = np.random.default_rng(1), np.repeat(np.arange(len(lengths)), STARTS_PER_ROW)
lengths, axis = lengths[row], random.normal(size=(len(row), 3))
half = max_rotation / 2 * np.cbrt(random.uniform(size=(len(row), 1)))
q = np.hstack([np.cos(half), np.sin(half) * axis / np.linalg.norm(axis, axis=1, keepdims=True)])
x = np.hstack([q, position + lengths.max() * random.uniform(-1, 1, size=(len(row), 3))])
damping, (residual, by_x, norm) = np.full(len(x), 1e-2), equations(x, lengths)
for _ in range(STEPS):
    k = np.flatnonzero(norm > 1e-14)
    transposed = by_x[k].transpose(0, 2, 1)
    normal = transposed @ by_x[k] + damping[k, None, None] * np.eye(7)
    there = x[k] - np.linalg.solve(normal, transposed @ residual[k, :, None])[:, :, 0]
    new = equations(there, lengths[k])
    better = new[2] < norm[k]
    damping[k] *= np.where(better, 0.2, 5.0)
    k = k[better]
    x[k], residual[k], by_x[k], norm[k] = (part[better] for part in (there, *new))
print(json.dumps([[int(row[k]), *x[k]] for k in np.flatnonzero(norm < CONVERGED)]))
