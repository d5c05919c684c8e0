#!/usr/bin/env python3
"""Panel on a terminal. Its user must be in the group that may send requests.

    panel.py /run/hexad/NAME.sock

    goto x_m=0.02 gamma_rad=0.05      to these coordinates, the others stay
    step z_m=0.001                    the same, added to the target
    jog z_m_s=0.01                    until the next line, for example an empty one
    engage | hold | stop | park | clear | off | estop
"""

import json
import select
import socket
import sys

link = socket.socket(socket.AF_UNIX)
link.connect(sys.argv[1])
answers = link.makefile("r")
lines = open(0, "rb", buffering=0)  # without a buffer, select sees every line


def ask(request, **more):
    link.sendall(json.dumps({"version": 1, "request": request, **more}).encode() + b"\n")
    return json.loads(answers.readline())


for line in lines:
    name, *words = line.decode().split() or ["status"]
    try:
        numbers = {key: float(value) for key, value in (word.split("=") for word in words)}
    except ValueError:
        print("not understood; example: goto x_m=0.02", flush=True)
        continue
    if name == "jog":
        while (answer := ask("jog", rate=numbers))["result"] == "accepted" and not select.select([lines], [], [], 0.05)[0]:
            pass
    elif name in ("goto", "step"):
        answer = ask("goto", target=numbers, relative=name == "step")
    else:
        answer = ask(name, wait=name != "status")
    print(answer["result"], answer["state"], answer["text"], flush=True)
