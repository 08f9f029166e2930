"""Send the frames of a capture as fast as the kernel takes them, or at a rate: ``sendmmsg`` over the mapped file.

    python tests/benchmarks/live_sender.py DEVICE FILE --rate 50000 --batch 128

No frame is copied or looked at by Python: the kernel is told where each lies, some at a time. Prints a line of JSON:
how many were sent, in how many seconds. Needs Linux and the right to open a packet socket.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import mmap
import os
import socket
import sys
import time

import numpy as np

from nvscope.capture.open import open_source

_SOL_PACKET, _QDISC_BYPASS = 263, 20
_IOVEC = np.dtype([("base", "u8"), ("length", "u8")])
_MESSAGE = np.dtype({
    "names": ["name", "name_length", "iovec", "iovecs", "control", "control_length", "flags", "sent"],
    "formats": ["u8", "u4", "u8", "u8", "u8", "u8", "i4", "u4"],
    "offsets": [0, 8, 16, 24, 32, 40, 48, 56],
    "itemsize": 64,
})  # fmt: skip


def frames_of(path: str, limit: int | None) -> tuple[mmap.mmap, np.ndarray, np.ndarray]:
    """Return a mapped capture, and where in it frames begin and how long they are."""
    with open(path, "rb") as file:
        # Private and writable: what only reads cannot be asked for its address.
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
    starts, lengths, begin = [], [], 0
    for batch in open_source([path]):
        size = np.asarray(batch.captured, np.int64)
        # A record of pcap: a head of 16 bytes, and the frame.
        starts.append(begin + np.cumsum(size + 16) - size + 24 * (not begin))
        lengths.append(size)
        begin = int(starts[-1][-1] + size[-1])
    return mapped, np.concatenate(starts)[:limit], np.concatenate(lengths)[:limit]


def send(device: str, path: str, rate: int, batch: int, limit: int | None) -> dict[str, float]:
    mapped, starts, lengths = frames_of(path, limit)
    # All pages are there before the first frame is sent.
    sum(mapped[:: mmap.PAGESIZE])
    address = ctypes.addressof(ctypes.c_char.from_buffer(mapped))
    iovecs = np.zeros(len(starts), _IOVEC)
    iovecs["base"], iovecs["length"] = address + starts, lengths
    messages = np.zeros(len(starts), _MESSAGE)
    messages["iovec"] = iovecs.ctypes.data + np.arange(len(starts)) * _IOVEC.itemsize
    messages["iovecs"] = 1
    out = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    out.bind((device, 0))
    out.setsockopt(_SOL_PACKET, _QDISC_BYPASS, 1)
    sendmmsg = ctypes.CDLL(None, use_errno=True).sendmmsg
    sendmmsg.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int]
    descriptor, place, count = out.fileno(), messages.ctypes.data, len(starts)
    if rate:
        # Bursts of half a millisecond: what comes evenly is not to look uneven.
        batch = max(min(batch, rate // 2000), 1)
    sent, failures = 0, 0
    begin = time.monotonic()
    while sent < count:
        if rate:
            early = begin + sent / rate - time.monotonic()
            if early > 0:
                time.sleep(early)
        done = sendmmsg(descriptor, place + sent * _MESSAGE.itemsize, min(batch, count - sent), 0)
        if done < 0:
            failures += 1
            if failures > 1000:
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
            continue
        sent += done
    return {"sent": sent, "seconds": time.monotonic() - begin, "failures": failures}


def main() -> None:
    parser = argparse.ArgumentParser(description="Send the frames of a pcap file.")
    parser.add_argument("device")
    parser.add_argument("file")
    parser.add_argument("--rate", type=int, default=0, help="frames a second; 0: as fast as possible")
    parser.add_argument("--batch", type=int, default=128, help="frames in one call of sendmmsg, at most")
    parser.add_argument("--limit", type=int, help="only the first frames of the file")
    arguments = parser.parse_args()
    told = send(arguments.device, arguments.file, arguments.rate, arguments.batch, arguments.limit)
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main()
