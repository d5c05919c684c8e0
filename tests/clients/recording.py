"""What a recording holds, as JSON: read with the packages mcap and mcap-ros2-support."""

import json
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def rotated(q, v):
    """v turned by the quaternion q."""
    u = (q.x, q.y, q.z)

    def cross(a, b):
        return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])

    t = tuple(2 * c for c in cross(u, v))
    s = cross(u, t)
    return tuple(v[k] + q.w * t[k] + s[k] for k in range(3))


def gap(frames):
    """Largest distance between the end of a leg and its joint on the platform."""
    def point(v):
        return (v.x, v.y, v.z)

    platform, largest = frames["platform"], 0.0
    for leg in range(1, 7):
        base, rod, joint = (frames[f"{name}_{leg}"] for name in ("leg", "rod", "platform_joint"))
        end = [a + b for a, b in zip(point(base.translation), rotated(base.rotation, point(rod.translation)))]
        at = rotated(platform.rotation, point(joint.translation))
        at = [a + b for a, b in zip(point(platform.translation), at)]
        largest = max(largest, max(abs(a - b) for a, b in zip(end, at)))
    return largest


def main(path):
    found = {"cycles": 0, "scenes": 0, "largest_gap_m": 0.0}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for metadata in reader.iter_metadata():
            if metadata.name == "hexad":
                found["name"] = metadata.metadata["name"]
        for _, channel, _, message in reader.iter_decoded_messages():
            if channel.topic == "/hexad/cycle":
                found["cycles"] += 1
                lengths = list(message.measured_length_m)
                found["last"] = {"cycle": message.cycle, "length": lengths, "code": message.diagnostic.code}
            elif channel.topic == "/joint_states":
                found["joints"] = list(message.name)
            elif channel.topic == "/tf":
                found["scenes"] += 1
                frames = {it.child_frame_id: it.transform for it in message.transforms}
                found["frames"] = len(frames)
                found["largest_gap_m"] = max(found["largest_gap_m"], gap(frames))
    print(json.dumps(found))


main(sys.argv[1])
