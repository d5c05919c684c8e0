"""Compares types of a file with the types of ROS 2: hashes by its own generator, in its own files, and as rclpy states them."""

import glob
import json
import os
import sys

import rclpy
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
from rosidl_generator_type_description import calculate_type_hash, extract_full_type_description
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory


def field(name, number, kind):
    kind = {"type_id": number, "capacity": 0, "string_capacity": 0, "nested_type_name": kind}
    return {"name": name, "type": kind, "default_value": ""}


fields = json.load(open(sys.argv[1]))
types = {name: {"type_name": name, "fields": [field(*row) for row in fields[name]]} for name in fields}
installed = {}
for path in glob.glob(os.path.join(sys.prefix, "share", "*", "*", "*.json")):
    for row in json.load(open(path)).get("type_hashes", []):
        installed[row["type_name"]] = row["hash_string"]
hashes = {name: calculate_type_hash(extract_full_type_description(name, types)) for name in types}
for name, found in hashes.items():
    print(name, found, "equal" if installed.get(name) == found else "is not %s" % installed.get(name))

rclpy.init()
node = rclpy.create_node("hashes")
stated = 0
for kind in (JointState, PoseStamped, TwistStamped, AccelStamped, MultiDOFJointTrajectory):
    node.create_publisher(kind, "/" + kind.__name__, 1)
    info = node.get_publishers_info_by_topic("/" + kind.__name__)[0]
    stated += str(info.topic_type_hash) == hashes[info.topic_type]
print("rclpy states", stated, "of them")
