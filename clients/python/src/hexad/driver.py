"""Base class of drivers: the loop, its watchdog, its priority, its end."""

from __future__ import annotations

import abc
import ctypes
import gc
import os
import signal
import threading
import time
import warnings
from collections.abc import Sequence
from typing import Any

from .client import Client, Role, monotonic_ns
from .messages import Force, Measured

# In simulated time a measurement without response is repeated: a participant may not be connected yet [ns].
REPEAT_NS = 100_000_000

# Memory that is there now. Not MCL_FUTURE: beyond the limit of a user every later allocation would fail.
_MCL_CURRENT = 1


def sleep_until(instant_ns: int) -> None:
    """Sleeps until an instant of CLOCK_MONOTONIC [ns]."""
    time.sleep(max(0.0, (instant_ns - monotonic_ns()) * 1e-9))


class Driver(abc.ABC):
    """Connects the drives of one machine.

    In each period `run` calls `measure`, publishes, and calls `apply` with the newest forces if they may be applied, else
    `brake`. Forces older than `longest_age_s` may not. It ends in order with SIGINT, SIGTERM or `stop`, and with `brake` at
    every end, also that of an exception.

    `simulated` is for a daemon with `release = "lockstep"`: the driver is then the clock, and each period waits for the
    forces of its measurement.
    """

    def __init__(
        self,
        machine: str,
        *,
        period_s: float = 0.001,
        longest_age_s: float = 0.02,
        priority: int = 70,
        simulated: bool = False,
    ) -> None:
        self.machine = machine
        self.period_ns = round(period_s * 1e9)
        self.longest_age_ns = round(longest_age_s * 1e9)
        # Below the daemon's threads, 80 and 79; 0 for an ordinary process.
        self.priority = priority
        self.simulated = simulated
        self._is_ending = False

    @abc.abstractmethod
    def measure(self, tick_ns: int) -> Measured:
        """The measurement of this period, which begins at `tick_ns`.

        Its stamp is the instant of this call, or `header.time_ns` if that is not zero: the instant of sampling.
        """

    @abc.abstractmethod
    def apply(self, force_n: Sequence[float]) -> None:
        """Enables the drives, opens the brakes, applies the forces [N]; positive pushes the platform away from the base."""

    @abc.abstractmethod
    def brake(self) -> None:
        """Closes the brakes and disables the drives. Called in every period without forces."""

    def stop(self) -> None:
        """Ends `run` after the present period; any thread may call it."""
        self._is_ending = True

    def run(self) -> None:
        """Drives until a signal or `stop`."""
        role = Role.DRIVER | Role.SIMULATED if self.simulated else Role.DRIVER
        handlers = self._handle_signals()
        try:
            with Client(self.machine, role) as client:
                self._run_in_lockstep(client) if self.simulated else self._run_in_real_time(client)
        finally:
            self.brake()
            gc.enable()
            gc.unfreeze()
            for number, handler in handlers.items():
                signal.signal(number, handler)

    def _handle_signals(self) -> dict[int, Any]:
        # Python handles signals in its main thread alone.
        if threading.current_thread() is not threading.main_thread():
            return {}
        return {number: signal.signal(number, lambda *_: self.stop()) for number in (signal.SIGINT, signal.SIGTERM)}

    def _prepare(self) -> None:
        """Priority, memory, and no pause of the garbage collector."""
        gc.collect()
        gc.freeze()
        gc.disable()
        if self.priority == 0:
            return
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self.priority))
        except PermissionError:
            warnings.warn(f"no FIFO priority {self.priority}: it takes CAP_SYS_NICE or LimitRTPRIO", stacklevel=3)
        if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT) != 0:
            warnings.warn(f"memory is not locked: {os.strerror(ctypes.get_errno())}", stacklevel=3)

    def _act(self, may_be_applied: bool, force: Force) -> None:
        if may_be_applied:
            self.apply(list(force.force_n))
        else:
            self.brake()

    def _run_in_real_time(self, client: Client) -> None:
        self._prepare()
        tick_ns = (monotonic_ns() // self.period_ns + 1) * self.period_ns
        while not self._is_ending:
            sleep_until(tick_ns)
            now_ns = monotonic_ns()
            measured = self.measure(tick_ns)
            client.publish_measured(measured.header.time_ns or now_ns, measured)
            self._act(*client.latest_force(self.longest_age_ns))
            # After a pause of the host: no burst of periods that are past.
            tick_ns = max(tick_ns, monotonic_ns()) // self.period_ns * self.period_ns + self.period_ns

    def _run_in_lockstep(self, client: Client) -> None:
        tick_ns = 0
        while not self._is_ending:
            measured = self.measure(tick_ns)
            client.publish_measured(tick_ns, measured)
            published_ns = monotonic_ns()
            while True:
                may_be_applied, force = client.latest_force(0)
                # Before the first message the release is 0 as well.
                if force.release_ns == tick_ns and force.header.sequence > 0:
                    break
                if self._is_ending:
                    return
                if monotonic_ns() - published_ns > REPEAT_NS:
                    client.publish_measured(tick_ns, measured)
                    published_ns = monotonic_ns()
                os.sched_yield()
            self._act(may_be_applied, force)
            tick_ns += self.period_ns
