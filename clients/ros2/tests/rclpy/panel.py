"""A node of ROS 2: drives the machine over the bridge, and reads its state. Each function is one test; see main.rs."""

import math
import os
import signal
import sys
import time

import rclpy
from geometry_msgs.msg import AccelStamped, PoseStamped, Transform, Twist, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

HOME_Z = 1.25
AMPLITUDE = 0.02
OMEGA = 2.0 * math.pi * 0.5

rclpy.init()
node = rclpy.create_node("panel")
newest = {}


def listen(topic, kind):
    node.create_subscription(kind, topic, lambda message: newest.update({topic: message}), qos_profile_sensor_data)


def spin(seconds):
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        rclpy.spin_once(node, timeout_sec=left)


def wait(what, condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        rclpy.spin_once(node, timeout_sec=0.02)


def ask(request, meanwhile=lambda: None):
    """Outcome of a request, with `meanwhile` called in each millisecond until then."""
    client = node.create_client(Trigger, "/" + request)
    wait("service " + request, client.service_is_ready)
    future = client.call_async(Trigger.Request())
    end = time.monotonic() + 30.0
    while not future.done():
        assert time.monotonic() < end, request
        meanwhile()
        rclpy.spin_once(node, timeout_sec=0.001)
    print(request, future.result().success, future.result().message, flush=True)
    return future.result()


def stamped(message, age=0.0):
    ns = time.time_ns() - int(age * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(ns, 10**9)
    message.header.frame_id = "base"
    return message


def lift(t):
    """Height above home, velocity and acceleration: a sine that begins at rest."""
    if t <= 0.0:
        return 0.0, 0.0, 0.0
    # From rest to the sine within a second, twice differentiable.
    s = min(t, 1.0)
    gain, rate, accel = s**3 * (10 - 15 * s + 6 * s * s), 30 * s * s * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)
    sine, cosine = AMPLITUDE * math.sin(OMEGA * t), AMPLITUDE * math.cos(OMEGA * t) * OMEGA
    return gain * sine, rate * sine + gain * cosine, accel * sine + 2 * rate * cosine - gain * sine * OMEGA**2


def pose(t, age=0.0):
    message = stamped(PoseStamped(), age)
    message.pose.position.z = HOME_Z + lift(t)[0]
    message.pose.orientation.w = 1.0
    return message


def setpoint(t):
    message = stamped(MultiDOFJointTrajectory())
    z, velocity, accel = lift(t)
    point = MultiDOFJointTrajectoryPoint(transforms=[Transform()], velocities=[Twist()], accelerations=[Twist()])
    point.transforms[0].translation.z = HOME_Z + z
    point.transforms[0].rotation.w = 1.0
    point.velocities[0].linear.z = velocity
    point.accelerations[0].linear.z = accel
    message.points = [point]
    return message


class Source:
    """Publishes a message of each period. The motion begins with `begin`."""

    def __init__(self, kind, topic, rate, message):
        self.publisher = node.create_publisher(kind, topic, qos_profile_sensor_data)
        self.period, self.message = 1.0 / rate, message
        self.due = time.monotonic()
        self.began = math.inf
        wait("subscriber of " + topic, lambda: self.publisher.get_subscription_count() > 0)

    def begin(self):
        self.began = time.monotonic()

    def __call__(self):
        if (now := time.monotonic()) >= self.due:
            self.due = max(self.due + self.period, now)
            self.publisher.publish(self.message(now - self.began))

    def run(self, seconds, also=lambda: None):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self()
            also()
            rclpy.spin_once(node, timeout_sec=0.001)


def follows(source, seconds=6.0):
    """Plays the motion; returns the highest and the lowest height above home that /pose has shown."""
    heights = []
    source.begin()
    source.run(seconds, lambda: heights.append(newest["/pose"].pose.position.z - HOME_Z))
    print("heights", min(heights), max(heights), flush=True)
    assert min(heights) < -0.8 * AMPLITUDE and max(heights) > 0.8 * AMPLITUDE, (min(heights), max(heights))
    assert max(heights) < 1.2 * AMPLITUDE and min(heights) > -1.2 * AMPLITUDE, (min(heights), max(heights))


STATE = {"/joint_states": JointState, "/pose": PoseStamped, "/twist": TwistStamped, "/acceleration": AccelStamped}
LEGS = range(1, 7)
JOINTS = ["prismatic_%d" % leg for leg in LEGS] + ["universal_%s_%d" % (axis, leg) for leg in LEGS for axis in ("first", "second")]


def state():
    for topic, kind in STATE.items():
        listen(topic, kind)
    wait("state", lambda: len(newest) == len(STATE) and newest["/joint_states"].name == JOINTS)


def check_state():
    joints = newest["/joint_states"]
    assert max(map(abs, joints.position[6:])) < 0.01, "at home they are 0"
    assert all(1.1 < length < 2.3 for length in joints.position[:6]), joints
    assert len(joints.velocity) == 18 and len(joints.effort) in (0, 18), joints
    assert newest["/pose"].header.frame_id == "base" and abs(newest["/pose"].pose.position.z - HOME_Z) < 1e-3
    age = time.time() - joints.header.stamp.sec - joints.header.stamp.nanosec * 1e-9
    assert 0.0 < age < 5.0, age
    # Nodes and topics become known one by one.
    wait("the topic /tf", lambda: ("/tf", ["tf2_msgs/msg/TFMessage"]) in node.get_topic_names_and_types())
    wait("the name of the node", lambda: "hexad_ros2" in node.get_node_names())
    # Of ROS itself, and of the bridge: none besides.
    topics = {"/parameter_events", "/rosout", "/tf", "/setpoint_pose", "/setpoint_trajectory", *STATE}
    assert {name for name, _ in node.get_topic_names_and_types()} == topics, node.get_topic_names_and_types()


def poses():
    state()
    check_state()
    answer = ask("engage")
    assert not answer.success and "setpoint" in answer.message, answer
    source = Source(PoseStamped, "/setpoint_pose", 100, pose)
    source.run(1.0)
    assert ask("engage", source).message == "active"
    follows(source)
    rising = []
    source.run(2.0, lambda: rising.append(newest["/acceleration"].accel.linear.z))
    # The amplitude of the acceleration is 0.2 m/s^2.
    assert 0.1 < max(rising) and min(rising) < -0.1, (min(rising), max(rising))
    answer = ask("stop", source)
    assert answer.success and answer.message == "standby", answer
    parks = node.create_client(Trigger, "/park")
    assert not parks.wait_for_service(timeout_sec=1.0), "not among the requests of the file"


def readers():
    """Readers of each kind take every message, by the numbers that the publisher gave them, and each sample of the joints is whole."""
    state()
    for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT):
        for depth in (1, 10):
            for subscription in list(node.subscriptions):
                node.destroy_subscription(subscription)
            numbers, joints = {topic: [] for topic in STATE}, set()

            def take(topic, message, info):
                numbers[topic].append(info["publication_sequence_number"])
                if topic == "/joint_states":
                    joints.add(tuple(message.name))

            quality = QoSProfile(depth=depth, reliability=reliability)
            callbacks = {topic: lambda message, info, topic=topic: take(topic, message, info) for topic in STATE}
            for topic, kind in STATE.items():
                node.create_subscription(kind, topic, callbacks[topic], quality)
            wait("messages", lambda: all(numbers.values()))
            spin(3.0)
            sent = {topic: taken[-1] - taken[0] + 1 for topic, taken in numbers.items()}
            assert 75 < max(sent.values()) < min(sent.values()) + 15, ("one message per sample, 3 s at 50 Hz", sent)
            for topic, taken in numbers.items():
                print(reliability.name, "depth", depth, topic, "sent", sent[topic], "taken", len(taken), flush=True)
                # On a busy host, pauses of a process leave more messages than a queue keeps.
                assert sent[topic] - len(taken) <= sent[topic] // 5, (topic, sent, len(taken))
            assert joints == {tuple(JOINTS)}, joints


def stops_itself():
    node.create_subscription(JointState, "/joint_states", lambda message: newest.update(joints=message), 10)
    wait("joints", lambda: newest)
    print("reads", flush=True)
    os.kill(os.getpid(), signal.SIGSTOP)


def others_read():
    poses = []
    node.create_subscription(PoseStamped, "/pose", poses.append, qos_profile_sensor_data)
    # At 1 kHz. The bridge would wait 100 ms for the stopped reader from its 8192nd message on.
    spin(13.0)
    poses.clear()
    spin(2.0)
    print("poses in 2 s", len(poses), flush=True)
    assert len(poses) > 200, len(poses)


def new_clients():
    for _ in range(4):
        client = node.create_client(Trigger, "/stop")
        wait("service stop", client.service_is_ready)
        sent = time.monotonic()
        future = client.call_async(Trigger.Request())
        wait("an answer", future.done)
        print("answered after", time.monotonic() - sent, flush=True)
        assert time.monotonic() - sent < 1.0, "Fast DDS repeats its heartbeat after 3 s"
        node.destroy_client(client)


def trajectory():
    state()
    source = Source(MultiDOFJointTrajectory, "/setpoint_trajectory", 200, setpoint)
    source.run(1.0)
    assert ask("engage", source).message == "active"
    follows(source)
    print("moving", flush=True)
    source.run(20.0)


def disturbances():
    state()
    source = Source(PoseStamped, "/setpoint_pose", 100, pose)
    source.run(1.0)
    assert ask("engage", source).message == "active"
    source.begin()
    source.run(1.0)
    for name, message in [
        ("nan", lambda t: PoseStamped(header=pose(t).header)),
        ("old", lambda t: pose(t, age=1.0)),
    ]:
        def also():
            bad = message(time.monotonic() - source.began)
            if name == "nan":
                bad.pose.position.x = math.nan
                bad.pose.orientation.w = 1.0
            source.publisher.publish(bad)
        source.run(2.5, also)
        print("sent", name, flush=True)
    other = Source(PoseStamped, "/setpoint_pose", 1, pose)
    source.run(2.5, lambda: other.publisher.publish(pose(0.0)))
    print("sent other", flush=True)

    def flood():
        for _ in range(8):
            source.publisher.publish(pose(time.monotonic() - source.began))
    source.run(3.0, flood)
    print("sent flood", flush=True)
    source.run(1.5)
    follows(source, 4.0)
    print("moving", flush=True)
    source.run(20.0)


def stranger():
    spin(5.0)
    assert node.get_topic_names_and_types() != [], "its own"
    assert "hexad_ros2" not in node.get_node_names(), node.get_node_names()


globals()[sys.argv[1]]()
print("end of", sys.argv[1], flush=True)
