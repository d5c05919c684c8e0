"""Drivers, setpoint sources and panels of hexad.

    class MyDriver(hexad.Driver):
        def measure(self, tick_ns): return hexad.Measured(length_m=read_lengths())
        def apply(self, force_n): push(force_n)
        def brake(self): close_brakes()

    MyDriver("fried2008").run()        # `name` of the machine file

A program that only publishes or receives uses `Client`; an operator's panel uses `request`.
"""

from .client import Client, HexadError, Result, Role, judge, monotonic_ns, request, view
from .driver import Driver, sleep_until
from .messages import Command, Force, Measured, Setpoint, Statistics, Status

__all__ = [
    "Client",
    "Command",
    "Driver",
    "Force",
    "HexadError",
    "Measured",
    "Result",
    "Role",
    "Setpoint",
    "Statistics",
    "Status",
    "judge",
    "monotonic_ns",
    "request",
    "sleep_until",
    "view",
]
