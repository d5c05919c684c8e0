#!/usr/bin/env python3
"""Repeatability of a positioner, from the output of hexad goto --table over a table that has each target several times.

    repeatability.py O.csv

For each coordinate in um or urad, the largest of all targets: standard deviation of the reached values, and distance of their mean
from the target. The visits of a target count as one series: let the table approach it from the same side, or from both.
"""

import csv
import statistics
import sys
from collections import defaultdict

AXES = ["alpha", "beta", "gamma", "x", "y", "z"]
visits = defaultdict(list)
with open(sys.argv[1], newline="") as file:
    for row in csv.DictReader(file):
        target, reached = ([1e6 * float(row[f"{of}_{axis}"]) for axis in AXES] for of in ("target", "reached"))
        visits[tuple(target)].append(reached)
series = {target: list(zip(*reached)) for target, reached in visits.items() if len(reached) > 1}
print(f"{len(series)} targets, {sum(map(len, visits.values()))} visits")
for k, axis in enumerate(AXES):
    deviation = max(statistics.stdev(values[k]) for values in series.values())
    distance = max(abs(statistics.mean(values[k]) - target[k]) for target, values in series.items())
    print(f"{axis:5} {'urad' if k < 3 else 'um  '}  standard deviation {deviation:.3f}, mean from the target {distance:.3f}")
