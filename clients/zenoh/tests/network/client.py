"""client.py FUNCTION MACHINE ENDPOINT NAME [FILE]: a client of another author. Each function is a part of a test; see main.rs."""

import json
import math
import os
import struct
import subprocess
import sys
import time
import traceback

import zenoh

function, machine, endpoint, name = sys.argv[1:5]
# The certificate may be another one than that of the name.
file = sys.argv[5] if len(sys.argv) > 5 else name
HOME_Z = 1.25
AMPLITUDE = 0.05
OMEGA = 2.0 * math.pi * 0.5


zenoh.init_log_from_env_or("warn")


def connect(authority="ca", certificate=True, settle=0.5):
    tls = {"root_ca_certificate": authority + ".pem"}
    if certificate:
        tls.update(enable_mtls=True, connect_certificate=file + ".pem", connect_private_key=file + ".key")
    session = zenoh.open(zenoh.Config.from_json5(json.dumps({
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 4000, "exit_on_failure": True},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"link": {"tx": {"lease": 2000}, "tls": tls}},
    })))
    # What the bridge has declared arrives after the connection.
    time.sleep(settle)
    return session


def send(session, request, timeout=40.0, **fields):
    """Sends a request; returns its replies. A request to move names its session."""
    if request in ("goto", "hold", "jog"):
        fields["session"] = str(session.info.zid())
    payload = json.dumps(fields) if fields else None
    return session.get("hexad/%s/request/%s/%s" % (machine, name, request), payload=payload, timeout=timeout)


def ask(session, request, timeout=40.0, **fields):
    """Outcome of a request; None without an answer."""
    began = time.monotonic()
    for reply in send(session, request, timeout, **fields):
        answer = json.loads(reply.ok.payload.to_string())
        print(request, answer["result"], answer["text"], "%.1f ms" % (1e3 * (time.monotonic() - began)), flush=True)
        return answer
    print(request, "without an answer", flush=True)
    return None


def alive():
    """A session, and the liveliness token with which its motions end."""
    session = connect()
    token = session.liveliness().declare_token("hexad/%s/client/%s/%s" % (machine, name, session.info.zid()))
    time.sleep(0.5)
    return session, token


class Newest:
    """The newest message of each topic."""

    def __init__(self, session):
        self.messages, self.ages, self.count = {}, [], {}
        self.subscriber = session.declare_subscriber("hexad/%s/*" % machine, self.take)

    def take(self, sample):
        topic = str(sample.key_expr).rsplit("/", 1)[1]
        content = sample.payload.to_bytes()
        assert content[:4] == b"\0\1\0\0", content[:4]
        self.messages[topic] = content[4:]
        self.count[topic] = self.count.get(topic, 0) + 1
        if topic == "status":
            self.ages.append(time.monotonic_ns() - struct.unpack_from("<Q", content, 4 + 24)[0])

    def height(self):
        """Height above home: frame "base" after the time, then x, y, z."""
        return struct.unpack_from("<3d", self.messages["pose"], 24)[2] - HOME_Z


class Source:
    """A source of poses with a clock of its own: seconds ahead, and parts in a million fast."""

    def __init__(self, session, key=None, ahead=100.0, ppm=50.0):
        self.epoch, self.sequence = time.time_ns(), 0
        self.ahead, self.ppm = ahead, ppm
        self.began = math.inf
        self.publisher = session.declare_publisher(
            key or "hexad/%s/setpoint/%s" % (machine, name),
            reliability=zenoh.Reliability.BEST_EFFORT, congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME, express=True)

    def pose(self, now_ns, z=None, epoch=None, kind=1):
        """A pose on the motion, which begins `began` and is a sine after a second. The angle gamma shows the time to the test."""
        t = max(now_ns * 1e-9 - self.began, 0.0)
        s = min(t, 1.0)
        gain = s**3 * (10 - 15 * s + 6 * s * s)
        z = HOME_Z + gain * AMPLITUDE * math.sin(OMEGA * t) if z is None else z
        stamp = int(now_ns * (1 + self.ppm * 1e-6) + self.ahead * 1e9)
        self.sequence += 1
        header = struct.pack("<IIQQQ", 7, 0, epoch or self.epoch, self.sequence, stamp)
        return b"\0\1\0\0" + header + struct.pack("<Q19d", kind, 0, 0, t * 1e-9, 0, 0, z, *[0.0] * 13)

    def run(self, seconds, rate=100, also=lambda: None):
        due, end = time.monotonic_ns(), time.monotonic_ns() + int(seconds * 1e9)
        while due < end and time.monotonic_ns() < end:
            time.sleep(max(due - time.monotonic_ns(), 0) * 1e-9)
            self.publisher.put(self.pose(time.monotonic_ns()))
            also()
            due += 10**9 // rate

    def begin(self):
        self.began = time.monotonic()
        print("began", time.monotonic_ns(), flush=True)


def engaged(session):
    source = Source(session)
    source.run(1.5)
    answers = []
    key = "hexad/%s/request/%s/engage" % (machine, name)
    # A Zenoh reply may be lost though the request was carried out: then it is sent again, as docs/network.md says.
    for _ in range(3):
        session.get(key, lambda reply: answers.append(json.loads(reply.ok.payload.to_string())), timeout=8.0)
        end = time.monotonic() + 8.0
        while not answers and time.monotonic() < end:
            source.run(0.1)
        if answers:
            break
        print("engage without an answer", flush=True)
    assert answers[0]["state"] == "active", answers
    print("engaged", flush=True)
    return source


def moves():
    began = time.monotonic()
    session = connect()
    print("connected after %.1f ms" % (1e3 * (time.monotonic() - began)), flush=True)
    tokens = lambda: [str(it.ok.key_expr) for it in session.liveliness().get("hexad/*", timeout=2.0)]
    while not (found := tokens()):
        assert time.monotonic() - began < 20.0, "no liveliness token"
    assert found == ["hexad/" + machine], found
    newest = Newest(session)
    answer = ask(session, "engage")
    assert answer["result"] == "refused" and "setpoint" in answer["text"], answer
    assert ask(session, "status")["status"]["machine"] == machine
    source = engaged(session)
    heights = []
    source.begin()
    source.run(6.0, also=lambda: heights.append(newest.height()))
    print("heights", min(heights), max(heights), flush=True)
    assert 0.8 * AMPLITUDE < max(heights) < 1.1 * AMPLITUDE, max(heights)
    assert -1.1 * AMPLITUDE < min(heights) < -0.8 * AMPLITUDE, min(heights)
    answer = ask(session, "stop") or ask(session, "stop")
    assert answer["state"] == "standby", answer
    assert ask(session, "park", timeout=2.0) is None, "not among the requests of the file"
    ages = sorted(newest.ages)
    print("age of a status: p50 %.2f, p99 %.2f ms of %d" % (*[ages[len(ages) * p // 100] * 1e-6 for p in (50, 99)], len(ages)))
    print("messages", newest.count, flush=True)
    assert set(newest.count) == {"status", "pose", "statistics"}, newest.count


def hurried():
    """Subscribes, and asks at once: the request must not overtake the declaration of its key."""
    unanswered = 0
    for _ in range(200):
        session = connect(settle=0.0)
        subscriber = session.declare_subscriber("hexad/%s/*" % machine, lambda sample: None)
        unanswered += not list(session.get("hexad/%s/request/%s/status" % (machine, name), timeout=20.0))
        session.close()
    assert unanswered == 0, "%d of 200 requests" % unanswered


def motions():
    target = {"target": {"z_m": HOME_Z + 0.02}, "engage": True}
    answer = ask(connect(), "goto", **target)
    assert "/client/studio/SESSION" in answer["text"] and '"session"' in answer["text"], answer
    session, token = alive()
    newest = Newest(session)
    answer = ask(session, "goto", **target)
    assert answer["result"] == "done", answer
    assert abs(newest.height() - 0.02) < 1e-3, newest.height()
    assert ask(session, "goto", target={"z_m": 9.0})["result"] == "invalid"
    for _ in range(40):
        send(session, "jog", rate={"z_m_s": -0.02})
        time.sleep(0.05)
    assert newest.height() < 0.018, newest.height()
    # The token ends, and with it a motion on its way.
    send(session, "goto", target={"z_m": HOME_Z + 0.06}, speed=0.05)
    time.sleep(1.0)
    token.undeclare()
    time.sleep(1.0)
    before = newest.height()
    time.sleep(1.0)
    print("rests at", before, newest.height(), flush=True)
    assert abs(newest.height() - before) < 1e-4 and before < 0.05, (before, newest.height())
    assert ask(session, "stop")["state"] == "standby"


def killed():
    """Moves until it is killed."""
    session, token = alive()
    answer = ask(session, "goto", target={"z_m": HOME_Z}, engage=True, id=1)
    assert answer["result"] == "done" and answer["id"] == 1, answer
    ask(session, "goto", target={"z_m": HOME_Z + 0.06}, speed=0.02)


def sessions():
    """Sessions of one certificate: one moves and is killed; one moves later, beyond the end of another one."""
    (session, token), (other, other_token) = alive(), alive()
    newest = Newest(session)
    process = subprocess.Popen([sys.executable, sys.argv[0], "killed", *sys.argv[2:]])
    while "pose" not in newest.messages or newest.height() < 1e-3:
        time.sleep(0.01)
    for it, id in [(session, 2), (other, 3)]:
        answer = ask(it, "goto", target={"z_m": HOME_Z}, id=id)
        assert answer["result"] == "refused" and answer["id"] == id, answer
    before = newest.height()
    time.sleep(1.0)
    assert newest.height() > before + 1e-3, "another session has ended the motion"
    process.kill()
    while newest.height() > before + 1e-5:
        before = newest.height()
        assert before < 0.05, "the motion has not ended with its session"
        time.sleep(0.5)
    replies = send(session, "goto", target={"z_m": HOME_Z}, speed=0.02, id=4)
    time.sleep(0.5)
    other.close()
    answer = json.loads(replies.recv().ok.payload.to_string())
    assert answer["result"] == "done" and answer["id"] == 4 and abs(newest.height()) < 1e-3, answer


def follows(seconds=60.0):
    """Moves until it is ended."""
    # A session ends with its object.
    session = connect()
    source = engaged(session)
    source.begin()
    source.run(seconds)


def steps():
    """A clock that is set forwards, then back."""
    session = connect()
    source = engaged(session)
    source.begin()
    source.run(2.0)
    source.ahead += 1000.0
    source.run(2.0)
    print("set forwards", flush=True)
    source.ahead -= 2000.0
    source.run(2.0)
    print("set back", flush=True)
    source.epoch = time.time_ns()
    source.run(2.0)
    print("another life", flush=True)
    source.run(20.0)


def bad_setpoints():
    """An admitted source that sends what is no setpoint, beside its motion."""
    session = connect()
    source = engaged(session)
    source.begin()
    source.run(1.0)
    capture = [source.pose(time.monotonic_ns() - 10**9) for _ in range(100)]
    for bad, put in [
        ("nan", lambda: source.publisher.put(source.pose(time.monotonic_ns(), z=math.nan))),
        ("oversized", lambda: source.publisher.put(bytes(30_000))),
        ("kind", lambda: source.publisher.put(source.pose(time.monotonic_ns(), kind=2))),
        ("replayed", lambda: source.publisher.put(capture[source.sequence % 100])),
        ("past epoch", lambda: source.publisher.put(source.pose(time.monotonic_ns(), epoch=1))),
        ("flood", lambda: [source.publisher.put(source.pose(time.monotonic_ns())) for _ in range(1000)]),
    ]:
        first, began = source.sequence, time.monotonic()
        source.run(2.5, also=put)
        print("sent", bad, "%.0f a second" % ((source.sequence - first) / (time.monotonic() - began)), flush=True)
    source.run(2.0)
    print("end of disturbances", flush=True)
    source.run(20.0)


def denied():
    """An admitted certificate that may read and stop, on the key of another one."""
    session = connect()
    other = Source(session, "hexad/%s/setpoint/studio" % machine)
    other.run(2.5)
    # Each reason is logged once a second.
    time.sleep(1.5)
    answer = ask(session, "engage", timeout=3.0)
    assert answer is None, answer
    key = "hexad/%s/request/studio/engage" % machine
    assert list(session.get(key, timeout=3.0)) == [], "with the name of another one"


def refused():
    """Certificates that are not admitted."""
    for authority, certificate in [("ca", True), ("ca", False)]:
        for _ in range(3):
            try:
                session = connect(authority, certificate)
                answers = list(session.get("hexad/%s/request/%s/estop" % (machine, name), timeout=1.0))
                assert answers == [], answers
                print("has no rights", flush=True)
                session.close()
            except zenoh.ZError as error:
                print("refused", str(error)[:100], flush=True)


try:
    globals()[function]()
    print("end of", function, flush=True)
    code = 0
except BaseException:
    traceback.print_exc()
    code = 1
sys.stdout.flush()
sys.stderr.flush()
# Callbacks of a session may keep the interpreter.
os._exit(code)
