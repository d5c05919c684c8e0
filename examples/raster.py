#!/usr/bin/env python3
"""Table of a raster of N x N points, for hexad move --trajectory.

    raster.py N STEP_M SECONDS

The points are STEP_M apart in x and y. The platform moves for SECONDS between two points and stands for as long at each.
"""

import sys

n, step, seconds = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
names = ["alpha", "beta", "gamma", "x", "y", "z"]
print(",".join(["t", *names, *(f"{name}_rate" for name in names), *(f"{name}_accel" for name in names)]))
t = 0.0
for row in range(n):
    for column in range(n) if row % 2 == 0 else reversed(range(n)):
        for _ in range(2):  # arrival and departure
            pose = [0.0, 0.0, 0.0, column * step, row * step, 0.0]
            print(",".join(str(value) for value in [round(t, 6), *pose, *[0.0] * 12]))
            t += seconds
