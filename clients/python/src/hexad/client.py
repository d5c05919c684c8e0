"""Participation in the topics of a machine, and requests of operators."""

from __future__ import annotations

import ctypes
import enum
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import library, messages
from .messages import Force, Measured, Setpoint, Statistics, Status

if TYPE_CHECKING:
    import numpy

_LIBRARY = library.load()


class Role(enum.IntFlag):
    """Roles of a client; their sum opens it in several."""

    DRIVER = 1
    SOURCE = 2
    MONITOR = 4
    SIMULATED = 8


class Result(enum.IntEnum):
    """Outcomes of the library, `enum hexad_result`."""

    OK = 0
    BRAKE = 1
    NOTHING = 2
    INVALID = 3
    BUSY = 4
    SHARED_MEMORY = 5
    NO_DAEMON = 6
    FORBIDDEN = 7
    REFUSED = 8
    NOT_COMPLETED = 9
    TIMED_OUT = 10
    INTERNAL = 11


class HexadError(RuntimeError):
    """A call has failed; `result` says how, the text why."""

    def __init__(self, result: Result) -> None:
        super().__init__(_LIBRARY.hexad_last_error().decode(errors="replace"))
        self.result = result


def _checked(number: int) -> Result:
    result = Result(number)
    if result >= Result.INVALID:
        raise HexadError(result)
    return result


def monotonic_ns() -> int:
    """CLOCK_MONOTONIC [ns], the clock of all stamps."""
    return _LIBRARY.hexad_monotonic_ns()


def judge(force: Force, now_ns: int, longest_age_ns: int) -> bool:
    """Whether a force message may be applied: age, schema, checksum, valid, finite forces."""
    return _checked(_LIBRARY.hexad_judge_force(force, now_ns, longest_age_ns)) == Result.OK


def request(machine: str, name: str, until_ready: bool = False, within_s: float = 30.0) -> None:
    """Sends an operator's request (`engage`, `stop`, `park`, `clear`, `off`, `estop`) and waits until its state is reached."""
    number = getattr(messages, f"REQUEST_{name.upper()}")
    _checked(_LIBRARY.hexad_request(machine.encode(), number, until_ready, within_s))


def view(field: Any) -> numpy.ndarray:
    """Array field of a message as numpy array of the same memory: `view(status.x)[3] = ...`."""
    import numpy

    return numpy.ctypeslib.as_array(field)


class Client:
    """A program that has joined the topics of a machine, as the user of the daemon.

    Two threads may not use it at the same time, and a child of `os.fork` opens its own. Use it in a `with` statement, or call `close`.
    """

    def __init__(self, machine: str, roles: Role) -> None:
        self._handle = _LIBRARY.hexad_open(machine.encode(), int(roles))
        if not self._handle:
            raise HexadError(Result.SHARED_MEMORY)
        # Room for what is received, so that a period allocates little.
        self._force, self._measured = Force(), Measured()
        self._status, self._statistics = Status(), Statistics()

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leaves the topics. Further calls raise HexadError."""
        handle, self._handle = self._handle, None
        _checked(_LIBRARY.hexad_close(handle))

    def publish_measured(self, time_ns: int, measured: Measured) -> None:
        """Publishes a measurement for the instant at which the sensors were sampled [ns]."""
        _checked(_LIBRARY.hexad_publish_measured(self._handle, time_ns, measured))

    def latest_force(self, longest_age_ns: int) -> tuple[bool, Force]:
        """Whether the forces of the newest message may be applied now, and the message.

        Called in every period it is the driver's watchdog: without new messages the last one becomes too old. In simulated time
        now is the time of the last measurement that was published. The next call overwrites the message.
        """
        number = _LIBRARY.hexad_latest_force(self._handle, longest_age_ns, self._force)
        return _checked(number) == Result.OK, self._force

    def publish_setpoint(self, time_ns: int, setpoint: Setpoint) -> None:
        """Publishes a setpoint for an instant [ns]."""
        _checked(_LIBRARY.hexad_publish_setpoint(self._handle, time_ns, setpoint))

    def request_in_cycle(self, cycle_ns: int, number: int) -> None:
        """Sends a request (`messages.REQUEST_...`) for a cycle in simulated time: call it before `publish_setpoint` with the same time.

        The status of that cycle shows whether the request was refused. In real time use `request`.
        """
        _checked(_LIBRARY.hexad_request_in_cycle(self._handle, cycle_ns, number))

    def latest_status(self) -> Status | None:
        """The newest status; None before the first. The next call overwrites it."""
        return self._newest(_LIBRARY.hexad_latest_status, self._status)

    def latest_statistics(self) -> Statistics | None:
        """The newest statistics, sent every second; None before the first. The next call overwrites them."""
        return self._newest(_LIBRARY.hexad_latest_statistics, self._statistics)

    def latest_measured(self) -> Measured | None:
        """The newest measurement of the driver; None before the first. The next call overwrites it."""
        return self._newest(_LIBRARY.hexad_latest_measured, self._measured)

    def _newest(self, function: Any, message: ctypes.Structure) -> Any:
        return message if _checked(function(self._handle, message)) == Result.OK else None
