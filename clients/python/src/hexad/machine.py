"""Inverse dynamics of many motions, as numpy arrays."""

from __future__ import annotations

import os
import weakref
from typing import TYPE_CHECKING

from .client import _LIBRARY, HexadError, Result, _checked

if TYPE_CHECKING:
    import numpy


class Machine:
    """The model of a machine file, without a daemon: `Machine("fried2008.toml").inverse_dynamics(x, x_rate, x_accel)`.

    HexadError with a line for each error of the file. Any number of threads may use it at once.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._handle = _LIBRARY.hexad_open_machine(os.fsencode(path))
        if not self._handle:
            raise HexadError(Result.INVALID)
        weakref.finalize(self, _LIBRARY.hexad_close_machine, self._handle)

    def inverse_dynamics(
        self,
        x: numpy.ndarray,
        x_rate: numpy.ndarray,
        x_accel: numpy.ndarray,
        fidelity: str = "exact",
        threads: int = 1,
        out: numpy.ndarray | None = None,
    ) -> numpy.ndarray:
        """Forces of the actuators [N] of each motion: X, X', X'' (alpha, beta, gamma, x, y, z and derivatives) in rows.

        All are arrays of float64 of the shape (N, 6), one row after the other. Nothing is copied: the forces are written to `out`, or to a
        new array. NaN in all six where the pose is singular or a number is not finite. `threads=0`: one per processor.
        """
        import numpy

        shape = (len(x), 6)
        if out is None:
            out = numpy.empty(shape)
        arrays = {"x": x, "x_rate": x_rate, "x_accel": x_accel, "out": out}
        pointers = [_pointer(array, name, shape) for name, array in arrays.items()]
        if not out.flags.writeable:
            raise ValueError("out is read-only; pass an array of your own")
        if not 0 <= threads < 2**32:
            raise ValueError(f"threads = {threads} must be 0 (one per processor) or positive")
        _checked(
            _LIBRARY.hexad_inverse_dynamics_batch(self._handle, fidelity.encode(), len(x), *pointers, threads)
        )
        return out


def _pointer(array: numpy.ndarray, name: str, shape: tuple[int, int]) -> int:
    """Address of an array that the library can use as it is."""
    import numpy

    if not isinstance(array, numpy.ndarray) or array.dtype != numpy.float64:
        kind = getattr(array, "dtype", type(array).__name__)
        raise TypeError(f"{name} is {kind}, and must be an array of float64: numpy.asarray({name}, dtype=float)")
    if array.shape != shape:
        raise ValueError(f"{name} has the shape {array.shape}, and must have {shape}, as many rows as x")
    if not array.flags.c_contiguous:
        raise ValueError(f"{name} is a view with gaps or columns first: numpy.ascontiguousarray({name})")
    return array.ctypes.data
