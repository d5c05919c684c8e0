"""hexad's topics in Python: the structs that src/messages/structs.rs documents, and how to join.

    pip install iceoryx2==0.9.3        # the version that the daemon uses

    bus = Bus("fried2008")             # `name` of the configuration
    forces, measured = bus.subscriber(Force), bus.publisher(Measured)
    measured.publish(monotonic_ns(), Measured(length_m=lengths, length_rate_m_s=rates))
    force = forces.newest()            # None if nothing came
    if force is not None and force.may_be_applied(monotonic_ns()): ...
"""

import ctypes
import math
import os
import time
import zlib
from ctypes import c_double, c_uint32, c_uint64

import iceoryx2 as iox2

SCHEMA = 4
SIX = c_double * 6
THREE = c_double * 3

# A force older than this is not applied [ns].
FORCE_TIMEOUT_NS = 50_000_000

# A request; a state and a cause, of those that `hexad faults` prints.
ENGAGE = 1
ACTIVE = 3
READY_TO_ENGAGE = 7


class Header(ctypes.Structure):
    _fields_ = [
        ("schema", c_uint32),
        ("reserved", c_uint32),
        ("epoch", c_uint64),
        ("sequence", c_uint64),
        ("time_ns", c_uint64),
    ]

    @staticmethod
    def type_name():
        return "hexad_header"


class Message(ctypes.Structure):
    """What all messages have in common; `topic` is the last part of the topic's name."""

    topic = ""

    @classmethod
    def type_name(cls):
        return "hexad_" + cls.topic

    def is_whole(self):
        return True


class Setpoint(Message):
    topic = "setpoint"
    _fields_ = [("header", Header), ("x", SIX), ("x_rate", SIX), ("x_accel", SIX)]


class Measured(Message):
    topic = "measured"
    _fields_ = [
        ("header", Header),
        ("length_m", SIX),
        ("length_rate_m_s", SIX),
        ("pose_valid", c_uint32),
        ("reserved", c_uint32),
        ("x", SIX),
        ("twist", SIX),
    ]


class Force(Message):
    topic = "force"
    _fields_ = [
        ("header", Header),
        ("force_n", SIX),
        ("valid", c_uint32),
        ("state", c_uint32),
        ("fault", c_uint32),
        ("limiting", c_uint32),
        ("release_ns", c_uint64),
        ("checksum", c_uint32),
        ("reserved", c_uint32),
    ]

    def is_whole(self):
        """CRC-32 of the bytes before the checksum."""
        return self.checksum == zlib.crc32(bytes(self)[: Force.checksum.offset])

    def may_be_applied(self, now_ns, timeout_ns=FORCE_TIMEOUT_NS):
        """Whether the drives may push with it. If not, and when nothing comes for too long: brake."""
        is_young = self.header.time_ns <= now_ns <= self.header.time_ns + timeout_ns
        return is_young and self.is_whole() and self.valid == 1 and all(map(math.isfinite, self.force_n))


class Command(Message):
    topic = "command"
    _fields_ = [("header", Header), ("request", c_uint32), ("reserved", c_uint32)]


class Times(ctypes.Structure):
    _fields_ = [(name, c_uint64) for name in "count min mean p50 p90 p99 p999 p9999 max".split()]


class LoopTimes(ctypes.Structure):
    _fields_ = [(name, Times) for name in "wakeup_ns compute_ns measured_age_ns end_to_end_ns".split()]


class WorstCycle(ctypes.Structure):
    _fields_ = [(name, c_uint64) for name in "cycle due_ns wakeup_ns compute_ns".split()]
    _fields_ += [(name, c_uint32) for name in "io_late involuntary_switches page_faults steal_ms".split()]


class Statistics(ctypes.Structure):
    _fields_ = [("window", LoopTimes), ("total", LoopTimes), ("worst", WorstCycle * 8)]


class Status(Message):
    topic = "status"
    _fields_ = [
        ("header", Header),
        *((name, c_uint32) for name in "state fault refused limiting".split()),
        *((name, c_double) for name in "fault_value fault_bound".split()),
        *((name, c_uint32) for name in "fault_index reserved".split()),
        *((name, c_uint64) for name in "answered_epoch answered_sequence".split()),
        *((name, c_uint32) for name in "pose_valid error_valid".split()),
        *((name, SIX) for name in "x twist".split()),
        *((name, c_double) for name in "condition singular_in_s".split()),
        *((name, THREE) for name in "position_error_m orientation_error_rad".split()),
        ("wrench_error", SIX),
        *((name, c_uint64) for name in "cycles late_wakeups overruns skipped caught_up".split()),
        *((name, c_uint64) for name in "allocations io_allocations".split()),
        *((name, c_uint64) for name in "without_measurement without_setpoint".split()),
        *((name, c_uint64) for name in "rejected_schema rejected_older_source rejected_repeated".split()),
        ("statistics", Statistics),
    ]


def monotonic_ns():
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def sleep_until(instant_ns):
    time.sleep(max(0.0, (instant_ns - monotonic_ns()) * 1e-9))


def be_punctual():
    """Before everything that is not real-time, where this is allowed, so that a busy machine does not make us late."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pass


class Bus:
    """Participation in the topics of one machine; `simulated` as of a daemon with release = "lockstep"."""

    def __init__(self, machine, simulated=False):
        iox2.set_log_level(iox2.LogLevel.Error)
        self.prefix = f"{'hexad-simulated' if simulated else 'hexad'}/{machine}/"
        self.simulated = simulated
        # Signals are ours, not the library's.
        mode = iox2.SignalHandlingMode.Disabled
        builder = iox2.NodeBuilder.new().signal_handling_mode(mode).config(places())
        self.node = builder.create(iox2.ServiceType.Ipc)

    def _service(self, message):
        """Who comes first creates the topic, so these numbers are everybody's."""
        builder = self.node.service_builder(iox2.ServiceName.new(self.prefix + message.topic))
        builder = builder.publish_subscribe(message).max_publishers(4).max_subscribers(16).max_nodes(32)
        builder = builder.subscriber_max_buffer_size(256).enable_safe_overflow(True).history_size(0)
        return builder.open_or_create()

    def publisher(self, message):
        return Publisher(self._service(message).publisher_builder().create())

    def subscriber(self, message, depth=8):
        port = self._service(message).subscriber_builder().buffer_size(depth).create()
        return Subscriber(port, message, self.simulated)


def places():
    """iceoryx2's usual places, or where these are another user's, places of our own, as the daemon does."""
    config = iox2.config.default()
    usual, user = config.global_cfg.root_path.to_string().rstrip("/"), os.geteuid()
    if os.path.exists(usual) and os.stat(usual).st_uid != user:
        config.global_cfg.root_path = iox2.Path.new(f"{usual}-{user}")
        config.global_cfg.prefix = iox2.FileName.new(f"iox2_{user}_")
    return config


class Publisher:
    """Numbers what it publishes."""

    def __init__(self, port):
        self.port, self.epoch, self.sequence = port, monotonic_ns(), 0

    def publish(self, time_ns, message):
        """`time_ns` is the instant at which the content holds."""
        self.sequence += 1
        message.header = Header(SCHEMA, 0, self.epoch, self.sequence, time_ns)
        self.port.send_copy(message)


class Subscriber:
    """Passes over other schemas, wrong checksums, older lives of the source, and what was seen already."""

    def __init__(self, port, message, simulated):
        self.port, self.message, self.simulated, self.last = port, message, simulated, (0, 0)

    def receive(self):
        """The next message; None if there is none."""
        while (sample := self.port.receive()) is not None:
            message = self.message.from_buffer_copy(sample.payload().contents)
            header = message.header
            order = (header.epoch, header.sequence)
            has_begun = self.simulated or header.epoch <= monotonic_ns()
            if header.schema == SCHEMA and has_begun and order > self.last and message.is_whole():
                self.last = order
                return message
        return None

    def newest(self):
        """The newest message since the last call; None if none came."""
        newest = None
        while (message := self.receive()) is not None:
            newest = message
        return newest
