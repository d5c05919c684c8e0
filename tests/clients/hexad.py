"""hexad's topics in Python: how to join them, publish and subscribe.

    pip install iceoryx2==0.9.3        # the version that the daemon uses
    hexad messages --language python > hexad_messages.py

    bus = Bus("fried2008")             # `name` of the configuration
    forces, measured = bus.subscriber(Force), bus.publisher(Measured)
    measured.publish(monotonic_ns(), Measured(length_m=lengths))
    force = forces.receive_latest()    # None if nothing arrived
    if force is not None and force.may_be_applied(monotonic_ns()): ...
"""

import contextlib
import fcntl
import math
import os
import secrets
import stat
import time

import iceoryx2 as iox2

import hexad_messages
from hexad_messages import Command, Header, Measured, Setpoint, Status

# A force older than this is not applied [ns].
FORCE_TIMEOUT_NS = 50_000_000


class Force(hexad_messages.Force):
    def may_be_applied(self, now_ns, timeout_ns=FORCE_TIMEOUT_NS):
        """Whether the actuators may apply the forces. If not, and when no message arrives for too long: brake."""
        is_recent = 0 <= now_ns - self.header.time_ns <= timeout_ns
        is_intact = self.header.schema == self.schema and self.is_intact()
        return is_recent and is_intact and self.valid == 1 and all(map(math.isfinite, self.force_n))


def monotonic_ns():
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def sleep_until(instant_ns):
    time.sleep(max(0.0, (instant_ns - monotonic_ns()) * 1e-9))


def use_fifo_priority():
    """Runs this process before all that is not real-time, if the system permits it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pass


class Bus:
    """Participation in the topics of one machine; `simulated` for a daemon with release = "lockstep"."""

    def __init__(self, machine, simulated=False):
        iox2.set_log_level(iox2.LogLevel.Error)
        self.prefix = f"{'hexad-simulated' if simulated else 'hexad'}/{machine}/"
        self.simulated = simulated
        # Signals belong to this program, not to the library.
        mode = iox2.SignalHandlingMode.Disabled
        with location() as config:
            builder = iox2.NodeBuilder.new().signal_handling_mode(mode).config(config)
            self.node = builder.create(iox2.ServiceType.Ipc)

    def _service(self, message):
        """The first participant creates the topic, so all use these numbers."""
        builder = self.node.service_builder(iox2.ServiceName.new(self.prefix + message.topic))
        builder = builder.publish_subscribe(message).max_publishers(16 if message.topic == "command" else 4)
        builder = builder.max_subscribers(16).max_nodes(32)
        builder = builder.subscriber_max_buffer_size(256).enable_safe_overflow(True).history_size(0)
        return builder.open_or_create()

    def publisher(self, message):
        return Publisher(self._service(message).publisher_builder().create())

    def subscriber(self, message, depth=8):
        port = self._service(message).subscriber_builder().buffer_size(depth).create()
        return Subscriber(port, message, self.simulated)


def user_folder():
    """Folder of this user's shared memory, as in the daemon: the service's own, the user's runtime folder, or /tmp."""
    user = os.geteuid()
    own = lambda path: os.path.isdir(path) and os.stat(path).st_uid == user
    if own("/run/hexad"):
        return "/run/hexad"
    for runtime in os.environ.get("XDG_RUNTIME_DIR", ""), f"/run/user/{user}":
        if os.path.isabs(runtime) and own(runtime):
            return f"{runtime}/hexad"
    return f"/tmp/hexad-{user}" if user else "/run/hexad-root"


def make_own(folder, mode):
    """Makes a folder in which only this user may write, and refuses one that another could have made."""
    if not os.path.isdir(folder):
        os.mkdir(folder)
        os.chmod(folder, mode)
    found = os.lstat(folder)
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o022:
        raise PermissionError(f"{folder} must be a folder of this user in which nobody else may write")


@contextlib.contextmanager
def location():
    """Where this user's shared memory is; while a node is created there, no daemon chooses another prefix."""
    folder = user_folder()
    make_own(folder, 0o711)
    make_own(f"{folder}/iceoryx2", 0o700)
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    with open(os.open(f"{folder}/prefix", flags, 0o600), "r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        prefix = file.read()
        if not prefix:
            prefix = f"hexad_{secrets.token_hex(8)}_"
            file.write(prefix)
            file.flush()
        config = iox2.config.default()
        config.global_cfg.root_path = iox2.Path.new(f"{folder}/iceoryx2")
        config.global_cfg.prefix = iox2.FileName.new(prefix)
        yield config


class Publisher:
    """Publisher of one topic, which numbers its messages."""

    def __init__(self, port):
        self.port, self.epoch, self.sequence = port, monotonic_ns(), 0

    def publish(self, time_ns, message):
        """`time_ns` is the instant at which the content holds."""
        self.sequence += 1
        message.header = Header(message.schema, 0, self.epoch, self.sequence, time_ns)
        self.port.send_copy(message)


class Subscriber:
    """Subscriber of one topic. Rejects other schemas, wrong checksums, older lives of the publisher and repetitions."""

    def __init__(self, port, message, simulated):
        self.port, self.message, self.simulated, self.last = port, message, simulated, (0, 0)

    def receive(self):
        """The next message; None if there is none."""
        while (sample := self.port.receive()) is not None:
            message = self.message.from_buffer_copy(sample.payload().contents)
            header = message.header
            order = (header.epoch, header.sequence)
            has_begun = self.simulated or header.epoch <= monotonic_ns()
            if header.schema == message.schema and has_begun and order > self.last and message.is_intact():
                self.last = order
                return message
        return None

    def receive_latest(self):
        """The newest message since the last call; None if none arrived."""
        latest = None
        while (message := self.receive()) is not None:
            latest = message
        return latest
