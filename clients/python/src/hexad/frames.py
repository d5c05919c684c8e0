"""Change of coordinates between the platform in the base frame and a tool in a work frame."""

from __future__ import annotations

from .client import _LIBRARY, _checked
from .messages import Setpoint
from .motion import FrameStruct, Motion


class Frames(FrameStruct):
    """A tool frame and a work frame, as `[[frame]]` of the machine file: `Frames(tool=(0, 0, 0, 0, 0, 0.35))`.

    Rotations of the tool are about its origin. Angles of a result are those nearest to zero.
    """

    def tool_motion(self, platform: Motion) -> Motion:
        """Motion of the tool in the work frame while the platform moves so in the base frame."""
        tool = Motion()
        _checked(_LIBRARY.hexad_tool_motion(self, platform, tool))
        return tool

    def platform_motion(self, tool: Motion) -> Motion:
        """Motion of the platform in the base frame with which the tool moves so: the inverse of `tool_motion`."""
        platform = Motion()
        _checked(_LIBRARY.hexad_platform_motion(self, tool, platform))
        return platform


def motion_of(setpoint: Setpoint) -> Motion:
    """The motion that a setpoint describes."""
    motion = Motion()
    _checked(_LIBRARY.hexad_motion_of_setpoint(setpoint, motion))
    return motion


def setpoint_of(motion: Motion) -> Setpoint:
    """The setpoint of a motion. HexadError at beta = 90 deg, where angles have no rates."""
    setpoint = Setpoint()
    _checked(_LIBRARY.hexad_setpoint_of_motion(motion, setpoint))
    return setpoint
