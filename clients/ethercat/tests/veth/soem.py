"""Brings the simulated segment to OP and enables its drives with SOEM, a main device that nobody here wrote."""

import struct
import sys
import time

import pysoem

main = pysoem.Master()
main.open(sys.argv[1])
assert main.config_init() == 6, "devices"
for drive in main.slaves:
    name = drive.sdo_read(0x1008, 0)
    assert name == b"hexad simulated servo drive", name
    drive.sdo_write(0x6060, 0, bytes([10]))
    assert drive.sdo_read(0x6076, 0) == struct.pack("<I", 24000)
try:
    main.slaves[0].sdo_read(0x2FFF, 0)
    sys.exit("an object that is missing was read")
except pysoem.SdoError as error:
    assert error.abort_code == 0x06020000, error
main.config_map()
assert main.config_dc()
assert main.state_check(pysoem.SAFEOP_STATE, 50000) == pysoem.SAFEOP_STATE
main.state = pysoem.OP_STATE
main.write_state()


def exchange(word):
    for drive in main.slaves:
        drive.output = struct.pack("<HhB", word, 0, 10)
    main.send_processdata()
    counter = main.receive_processdata(20000)
    time.sleep(0.001)
    return counter


for _ in range(1000):
    exchange(0)
    if main.state_check(pysoem.OP_STATE, 2000) == pysoem.OP_STATE:
        break
for word in (6, 7, 15):
    for _ in range(50):
        counter = exchange(word)
words = [struct.unpack_from("<H", drive.input)[0] & 0x6F for drive in main.slaves]
print("working counter", counter, "of", main.expected_wkc, "enabled", words.count(0x27))
main.close()
