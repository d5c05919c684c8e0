#!/usr/bin/env python3
"""Emergency stop by a USB button, beside the emergency-stop circuit.

    estop_button.py /dev/input/by-id/NAME-event-kbd [--config FILE]

Any key stops all machines of this host, or the one of the file. So does a button that is unplugged.
"""

import struct
import subprocess
import sys

EVENT = struct.Struct("llHHi")  # struct input_event of Linux: time, type, code, value
KEY_PRESSED = (1, 1)

if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
    sys.exit(__doc__)
button = open(sys.argv[1], "rb", buffering=0)
try:
    with button:
        while event := button.read(EVENT.size):
            _, _, kind, _, value = EVENT.unpack(event)
            if (kind, value) == KEY_PRESSED:
                subprocess.run(["hexad", "estop", *sys.argv[2:]], check=False)
finally:
    subprocess.run(["hexad", "estop", *sys.argv[2:]], check=False)
