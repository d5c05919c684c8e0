"""Structs of motions and frames, `struct hexad_motion` and `struct hexad_frames`."""

import ctypes
from ctypes import c_double


class Motion(ctypes.Structure):
    """Motion at one instant, of the platform in the base frame or of a tool in a work frame, in the axes of that frame.

    `x`: alpha, beta, gamma, then the origin; `twist`: omega, then the velocity of the origin; `acceleration`: the derivative of the
    twist. `view` shows each as numpy array.
    """

    _fields_ = [("x", c_double * 6), ("twist", c_double * 6), ("acceleration", c_double * 6)]


class FrameStruct(ctypes.Structure):
    """X of a tool frame in the platform frame, and of a work frame in the base frame."""

    _fields_ = [("tool", c_double * 6), ("work", c_double * 6)]
