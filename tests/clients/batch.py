"""Forces of many motions in Python against those of 80 digits in tests/data: `batch.py FOLDER`."""

import csv
import pathlib
import sys

import numpy as np

import hexad

folder = pathlib.Path(sys.argv[1])
worst = 0.0
for name in ("motion_base", "scattered", "telescope"):
    machine = hexad.Machine(folder / f"{name}.toml")
    with open(folder / f"{name}.csv", newline="") as file:
        table = {title: np.array(column, dtype=float) for title, *column in zip(*csv.reader(file))}

    def rows(end):
        return np.column_stack([table[name + end] for name in ("alpha", "beta", "gamma", "x", "y", "z")])

    motions = [np.ascontiguousarray(rows(end)) for end in ("", "_rate", "_accel")]
    wanted = np.column_stack([table[f"force_{leg}"] for leg in range(1, 7)])
    found = machine.inverse_dynamics(*motions)
    worst = max(worst, (np.abs(found - wanted).max(axis=1) / np.abs(wanted).max(axis=1)).max())
print(worst)
assert 0 < worst < 1e-14, worst

# Into an array of the caller, in any number of threads, of arrays that cannot be written to.
many = [np.tile(rows, (40, 1)) for rows in motions]
for array in many:
    array.flags.writeable = False
out = np.zeros_like(many[0])
for threads in (0, 1, 5):
    out[:] = 0
    assert machine.inverse_dynamics(*many, threads=threads, out=out) is out
    assert (out == np.tile(found, (40, 1))).all(), threads
gravity = machine.inverse_dynamics(*motions, fidelity="gravity")
assert (gravity != found).any()
assert machine.inverse_dynamics(*(rows[:0] for rows in motions)).shape == (0, 6)
x, x_rate, x_accel = (rows.copy() for rows in motions)
x_rate[3, 2] = np.inf
assert (np.isnan(machine.inverse_dynamics(x, x_rate, x_accel)).all(axis=1) == (np.arange(len(x)) == 3)).all()

# What the library could only use as a copy is refused.
wide = np.zeros((len(x), 12))
read_only = np.zeros_like(x)
read_only.flags.writeable = False
WRONG = [
    ({"x": x.astype(np.float32)}, TypeError, "x is float32, and must be an array of float64"),
    ({"x_rate": x.astype(">f8")}, TypeError, "x_rate is >f8"),
    ({"x_accel": x.tolist()}, TypeError, "x_accel is list"),
    ({"x_rate": x[:-1]}, ValueError, f"x_rate has the shape ({len(x) - 1}, 6), and must have ({len(x)}, 6)"),
    ({"x": x.ravel()}, ValueError, "x has the shape"),
    ({"x": np.asfortranarray(x)}, ValueError, "numpy.ascontiguousarray(x)"),
    ({"x_accel": wide[:, :6]}, ValueError, "x_accel is a view with gaps"),
    ({"out": wide[:, :6]}, ValueError, "out is a view with gaps"),
    ({"out": read_only}, ValueError, "out is read-only"),
    ({"out": x}, hexad.HexadError, "forces must be another array than x: they overlap"),
    ({"fidelity": "best"}, hexad.HexadError, 'fidelity = "best" must be one of gravity, '),
    ({"threads": -1}, ValueError, "threads = -1 must be 0"),
]
right = {"x": x, "x_rate": x_rate, "x_accel": x_accel}
for wrong, kind, text in WRONG:
    try:
        machine.inverse_dynamics(**{**right, **wrong})
    except kind as error:
        assert text in str(error), error
    else:
        raise AssertionError(text)
try:
    hexad.Machine("nowhere.toml")
except hexad.HexadError as error:
    assert error.result == hexad.Result.INVALID and str(error).startswith("nowhere.toml: could not be read"), error
else:
    raise AssertionError("no error")
