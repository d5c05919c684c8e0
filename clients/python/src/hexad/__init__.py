"""Drivers, setpoint sources and panels of hexad.

    class MyDriver(hexad.Driver):
        def measure(self, tick_ns): return hexad.Measured(length_m=read_lengths())
        def apply(self, force_n): push(force_n)
        def brake(self): close_brakes()

    MyDriver("fried2008").run()        # `name` of the machine file

A program that only publishes or receives uses `Client`; an operator's panel uses `request`. `Frames` turns poses of a tool into poses of the
platform. `Machine` computes the forces of many motions.
"""

from .client import Client, HexadError, Result, Role, judge, monotonic_ns, request, view
from .driver import Driver, sleep_until
from .frames import Frames, motion_of, setpoint_of
from .machine import Machine
from .messages import Force, Measured, Setpoint, Statistics, Status
from .motion import Motion

__all__ = [
    "Client",
    "Driver",
    "Force",
    "Frames",
    "HexadError",
    "Machine",
    "Measured",
    "Motion",
    "Result",
    "Role",
    "Setpoint",
    "Statistics",
    "Status",
    "judge",
    "monotonic_ns",
    "motion_of",
    "request",
    "setpoint_of",
    "sleep_until",
    "view",
]
