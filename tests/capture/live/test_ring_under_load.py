"""The kernel's ring while more comes than is read: nothing torn, nothing twice, nothing lost without being counted.

Frames are numbered, and their number says what is in them and how long they are: tiny ones, jumbo frames, VLAN tags.
"""

from __future__ import annotations

import json

import pytest

from tests.capture.live.network import cable, needs_namespaces
from tests.capture.live.test_ring import wait_for_ring

pytestmark = needs_namespaces

_FRAME = """
import struct
def frame(number):
    size = 8900 if number % 50 == 7 else number * 7919 % 1400
    tag = struct.pack(">HH", 0x88A8 if number % 2 else 0x8100, number & 0xFFF) if number % 3 == 0 else b""
    body = bytes((number + place) & 0xFF for place in range(64)) * (size // 64 + 1)
    return b"\\xff" * 6 + b"\\x02\\0\\0\\0\\0\\1" + tag + struct.pack(">HI", 0x88B5, number) + body[: size + 42]
"""

_SEND = """
import socket, sys
out = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
out.bind((sys.argv[1], 0))
for number in range(int(sys.argv[2])):
    out.send(frame(number))
"""

_READ = """
import json, signal, sys, time
from nvscope.capture.live.open import LiveSettings, open_live
settings = LiveSettings(bpf="", buffer_bytes=int(sys.argv[2]))
source, pause_s = open_live([sys.argv[1]], settings), float(sys.argv[3])
signal.signal(signal.SIGTERM, lambda *_: source.stop())
numbers, times, torn = [], [], 0
for batch in source:
    if not numbers:
        time.sleep(pause_s)  # who reads too slowly
    for row in range(len(batch)):
        packet = batch.packet(row)
        at = 18 if packet[12:14] in (b"\\x81\\0", b"\\x88\\xa8") else 14
        numbers.append(int.from_bytes(packet[at : at + 4], "big"))
        times.append(int(batch.ts_ns[row]))
        torn += int(packet != frame(numbers[-1]) or int(batch.original[row]) != len(packet))
doubled = sum(after <= before for before, after in zip(numbers, numbers[1:]))
info, between = source.infos[0], list(zip(numbers, numbers[1:], times, times[1:]))
holes = [(since, until) for before, after, since, until in between if after > before + 1]
print(json.dumps({
    "frames": len(numbers), "torn": torn, "doubled": doubled, "drops": info.drops,
    "lost": sum(one.packets for one in info.lost),
    "untold": sum(not any(one.touches(*hole) for one in info.lost) for hole in holes),
    "spans": [(one.since_ns, one.until_ns) for one in info.lost],
}))
"""


@pytest.mark.parametrize(("buffer_bytes", "pause_s", "loses"), [(64 << 20, 0.0, False), (4 << 20, 1.0, True)])
def test_each_frame_comes_whole_and_once_or_is_counted_as_dropped(
    buffer_bytes: int, pause_s: float, loses: bool
) -> None:
    sent = 20_000
    with cable() as (press, engineer):
        for host in (press, engineer):
            host.ip("link", "set", host.device, "mtu", "9000")
        reading = engineer.python_program(_FRAME + _READ, engineer.device, str(buffer_bytes), str(pause_s))
        wait_for_ring(engineer)
        press.python(_FRAME + _SEND, press.device, str(sent))
        reading.terminate()
        out, said = reading.communicate(timeout=30)
    assert reading.returncode == 0, said
    told = json.loads(out)
    assert (told["torn"], told["doubled"]) == (0, 0)
    assert told["frames"] + told["drops"] == sent
    assert (told["drops"] > 0) == loses
    assert (told["lost"], told["untold"]) == (told["drops"], 0)


_WAIT = """
import subprocess, sys
from nvscope.capture.live.device import device_of
from nvscope.capture.live.ring import BLOCK_BYTES, KernelRing
send = ["ip", "netns", "exec", sys.argv[2], sys.executable, "-c", sys.argv[3], sys.argv[4]]
ring = KernelRing(device_of(sys.argv[1]), buffer_bytes=32 * BLOCK_BYTES)
taken = 0
for frames in (7_500, 8_500):
    subprocess.run([*send, str(frames)], check=True)
    taken += len(ring.take())
    ring.is_filling()
print(taken + sum(map(len, ring.drain())), ring.drops()["kernel"])
"""


def test_what_was_read_is_the_kernels_again_as_soon_as_more_is_waited_for() -> None:
    """Half of the buffer, and then more than the other half: both fit, but not beside each other.

    Where the sender is slow, blocks are closed before they are full: there is room for six of them.
    """
    with cable() as (press, engineer):
        sender = "def frame(number): return b'\\xff' * 12 + b'\\x88\\xb5' + bytes(1000)\n" + _SEND
        reading = engineer.python_program(_WAIT, engineer.device, press.namespace, sender, press.device)
        out, said = reading.communicate(timeout=30)
    assert (reading.returncode, out) == (0, "16000 0\n"), said


_BUFFER = """
import sys
from nvscope.capture.live.ring import usual_buffer_bytes
print(*(usual_buffer_bytes(name) >> 20 for name in sys.argv[1:]))
"""


def test_a_fast_interface_has_a_larger_buffer() -> None:
    """A cable between namespaces tells 10 Gbit/s, a loopback and what is not there tell nothing."""
    with cable() as (_, engineer):
        asked = engineer.python_program(_BUFFER, engineer.device, "lo", "..")
        out, said = asked.communicate(timeout=30)
    assert out == "128 64 64\n", said
