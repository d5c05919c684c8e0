"""libhexad: that of the wheel, else that of the system."""

import ctypes
import pathlib
from ctypes import POINTER, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_uint64, c_void_p

from .messages import Force, Measured, Setpoint, Statistics, Status
from .motion import FrameStruct, Motion

# Version of the ABI that this package was written for: libhexad.so.0.
ABI = 0
NAME = f"libhexad.so.{ABI}"

# Arguments of the functions that return a result; clients/c/include/hexad.h explains them.
_FUNCTIONS = {
    "hexad_close": [c_void_p],
    "hexad_publish_measured": [c_void_p, c_uint64, POINTER(Measured)],
    "hexad_latest_force": [c_void_p, c_uint64, POINTER(Force)],
    "hexad_judge_force": [POINTER(Force), c_uint64, c_uint64],
    "hexad_publish_setpoint": [c_void_p, c_uint64, POINTER(Setpoint)],
    "hexad_request_in_cycle": [c_void_p, c_uint64, c_uint32],
    "hexad_latest_status": [c_void_p, POINTER(Status)],
    "hexad_latest_statistics": [c_void_p, POINTER(Statistics)],
    "hexad_latest_measured": [c_void_p, POINTER(Measured)],
    "hexad_tool_motion": [POINTER(FrameStruct), POINTER(Motion), POINTER(Motion)],
    "hexad_platform_motion": [POINTER(FrameStruct), POINTER(Motion), POINTER(Motion)],
    "hexad_setpoint_of_motion": [POINTER(Motion), POINTER(Setpoint)],
    "hexad_motion_of_setpoint": [POINTER(Setpoint), POINTER(Motion)],
    "hexad_close_machine": [c_void_p],
    "hexad_inverse_dynamics_batch": [c_void_p, c_char_p, c_size_t, *[c_void_p] * 4, c_uint32],
    "hexad_request": [c_char_p, c_uint32, c_bool, c_double],
}


def load() -> ctypes.CDLL:
    """The library with the types of its functions."""
    own = pathlib.Path(__file__).with_name(NAME)
    library = ctypes.CDLL(str(own) if own.exists() else NAME)
    for name, arguments in _FUNCTIONS.items():
        function = getattr(library, name)
        function.argtypes, function.restype = arguments, c_int
    library.hexad_abi.argtypes, library.hexad_abi.restype = [], c_uint32
    library.hexad_monotonic_ns.argtypes, library.hexad_monotonic_ns.restype = [], c_uint64
    library.hexad_last_error.argtypes, library.hexad_last_error.restype = [], c_char_p
    library.hexad_open.argtypes, library.hexad_open.restype = [c_char_p, c_uint32], c_void_p
    library.hexad_open_machine.argtypes, library.hexad_open_machine.restype = [c_char_p], c_void_p
    if library.hexad_abi() != ABI:
        raise ImportError(f"{NAME} has ABI {library.hexad_abi()}, and this package needs {ABI}")
    return library
