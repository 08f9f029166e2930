"""The same job with other libraries, each as a whole process: read a capture, read the header of every telegram.

    python tests/benchmarks/readers.py dpkt FILE
    python tests/benchmarks/readers.py scapy FILE --limit 20000

prints the number of telegrams with a whole header.
"""

from __future__ import annotations

import argparse
import struct
import sys
from importlib import import_module
from itertools import islice
from typing import Any

from dissectors.netvar import HEADER, IDENTITY


def read_with_dpkt(path: str, limit: int | None) -> int:
    # Imported here: a process that measures one library must not pay for the others.
    dpkt: Any = import_module("dpkt")
    header = struct.Struct("<" + "".join({1: "B", 2: "H", 4: "I"}[field.size_bytes] for field in HEADER))
    identity = IDENTITY.to_bytes(4, "little")
    telegrams = 0
    with open(path, "rb") as file:
        for _, frame in islice(dpkt.pcap.Reader(file), limit):
            network = dpkt.ethernet.Ethernet(frame).data
            if not isinstance(network, dpkt.ip.IP) or not isinstance(network.data, dpkt.udp.UDP):
                continue
            payload = network.data.data
            if len(payload) >= header.size and payload.startswith(identity):
                header.unpack_from(payload)
                telegrams += 1
    return telegrams


def read_with_scapy(path: str, limit: int | None) -> int:
    from scapy.layers import l2  # noqa: F401, PLC0415  # registers Ethernet as a link type
    from scapy.utils import PcapReader  # noqa: PLC0415

    from dissectors.scapy_layers import NetVar  # noqa: PLC0415

    names = [field.name for field in HEADER]
    telegrams = 0
    with PcapReader(path) as packets:
        for packet in islice(packets, limit):
            telegram = packet.getlayer(NetVar)
            if telegram is not None:
                for name in names:
                    telegram.getfieldval(name)
                telegrams += 1
    return telegrams


READERS = {"dpkt": read_with_dpkt, "scapy": read_with_scapy}


def main() -> None:
    parser = argparse.ArgumentParser(description="Count the telegrams of a capture with another library.")
    parser.add_argument("library", choices=READERS)
    parser.add_argument("file")
    parser.add_argument("--limit", type=int, help="stop after so many frames")
    arguments = parser.parse_args()
    sys.stdout.write(f"{READERS[arguments.library](arguments.file, arguments.limit)}\n")


if __name__ == "__main__":
    main()
