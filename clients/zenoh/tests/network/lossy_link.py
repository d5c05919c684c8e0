"""lossy_link.py NAMESPACE ADDRESS NAMESPACE ADDRESS DELAY_MS JITTER_MS LOSS: a link between two network namespaces.

Packets are delayed, overtake each other, and are lost at random. SIGUSR1 cuts the link, SIGUSR2 mends it. The kernel need not
have netem.
"""

import ctypes
import fcntl
import heapq
import os
import random
import select
import signal
import struct
import subprocess
import sys
import time

TUNSETIFF, IFF_TUN, IFF_NO_PI, CLONE_NEWNET = 0x400454CA, 0x0001, 0x1000, 0x40000000


def open_end(namespace, address):
    with open("/var/run/netns/" + namespace) as file:
        assert ctypes.CDLL(None, use_errno=True).setns(file.fileno(), CLONE_NEWNET) == 0, ctypes.get_errno()
    end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(end, TUNSETIFF, struct.pack("16sH22x", b"lossy0", IFF_TUN | IFF_NO_PI))
    for arguments in ["addr add %s/24 dev lossy0" % address, "link set lossy0 mtu 1500 up"]:
        subprocess.run(["ip", *arguments.split()], check=True)
    return end


namespaces, addresses = sys.argv[1:4:2], sys.argv[2:5:2]
delay, jitter, loss = float(sys.argv[5]) * 1e-3, float(sys.argv[6]) * 1e-3, float(sys.argv[7])
ends = [open_end(*it) for it in zip(namespaces, addresses)]
is_cut = False


def cut(number, _):
    global is_cut
    is_cut = number == signal.SIGUSR1
    print("cut" if is_cut else "mended", flush=True)


signal.signal(signal.SIGUSR1, cut)
signal.signal(signal.SIGUSR2, cut)
chance = random.Random(1)
waiting, number = [], 0
print("ready", flush=True)
while True:
    left = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else 1.0
    readable, _, _ = select.select(ends, [], [], left)
    now = time.monotonic()
    for end in readable:
        try:
            packet = os.read(end, 65536)
        except BlockingIOError:
            continue
        if not is_cut and chance.random() >= loss:
            number += 1
            due = now + delay + jitter * (2.0 * chance.random() - 1.0)
            heapq.heappush(waiting, (due, number, ends[1 - ends.index(end)], packet))
    while waiting and waiting[0][0] <= now:
        _, _, end, packet = heapq.heappop(waiting)
        if not is_cut:
            os.write(end, packet)
