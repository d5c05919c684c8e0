"""Frames of libhexad against scipy and numpy: poses as 4x4 matrices, and their derivatives by the product rule."""

import numpy as np
from scipy.spatial.transform import Rotation

import hexad

CASES = 3000


def cross(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def axial(m):
    return np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2


def matrix(x):
    # Capital letters: each rotation is about an axis that the earlier ones have turned.
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = Rotation.from_euler("XYZ", x[:3]).as_matrix(), x[3:]
    return m


def matrices(motion):
    """The pose as a matrix, and its first and second derivative."""
    x, twist, acceleration = (np.array(field) for field in (motion.x, motion.twist, motion.acceleration))
    pose, first, second = matrix(x), np.zeros((4, 4)), np.zeros((4, 4))
    w = cross(twist[:3])
    first[:3, :3], first[:3, 3] = w @ pose[:3, :3], twist[3:]
    second[:3, :3], second[:3, 3] = (cross(acceleration[:3]) + w @ w) @ pose[:3, :3], acceleration[3:]
    return pose, first, second


def numbers(pose, first, second):
    """Rotation matrix, place, twist and acceleration of the three matrices."""
    r = pose[:3, :3]
    w = axial(first[:3, :3] @ r.T)
    accel = axial(second[:3, :3] @ r.T)
    return np.concatenate([r.ravel(), pose[:3, 3], w, first[:3, 3], accel, second[:3, 3]])


random = np.random.default_rng(42)
worst = np.zeros(3)
for _ in range(CASES):
    frames = hexad.Frames(tool=tuple(random.uniform(-1, 1, 6)), work=tuple(random.uniform(-3, 3, 6)))
    platform = hexad.Motion(*(tuple(random.uniform(-3, 3, 6)) for _ in range(3)))
    work, tool = np.linalg.inv(matrix(np.array(frames.work))), matrix(np.array(frames.tool))
    there = frames.tool_motion(platform)
    wanted = numbers(*(work @ m @ tool for m in matrices(platform)))
    worst[0] = max(worst[0], np.abs(numbers(*matrices(there)) - wanted).max())
    back = frames.platform_motion(there)
    worst[1] = max(worst[1], np.abs(numbers(*matrices(back)) - numbers(*matrices(platform))).max())
    if abs(np.cos(platform.x[1])) > 0.1:
        again = hexad.motion_of(hexad.setpoint_of(platform))
        worst[2] = max(worst[2], np.abs(numbers(*matrices(again)) - numbers(*matrices(platform))).max())
print(worst)
assert 0 < worst.max() and (worst < [1e-13, 1e-13, 1e-12]).all(), worst

# At beta = 90 deg a motion has no rates of angles.
try:
    hexad.setpoint_of(hexad.Motion(x=(0, np.pi / 2, 0, 0, 0, 0)))
except hexad.HexadError as error:
    assert error.result == hexad.Result.INVALID and "beta = 1.57" in str(error), error
else:
    raise AssertionError("no error")
