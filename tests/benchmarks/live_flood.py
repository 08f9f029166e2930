"""Telegrams of 100 000 senders that do not exist, each of three lists: more streams than are told apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from frame_writer import FRAME, PCAP_HEADER, RECORD_BYTES

from dissectors.netvar import HEADER, PORT

SENDERS, LISTS, DATA_BYTES = 100_000, 3, 8
FIRST_ADDRESS = 0x0A000001  # 10.0.0.1


def flood(folder: Path, count: int) -> tuple[Path, dict[str, Any]]:
    """Write so many telegrams, the senders in turn; return the file with what it holds."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"flood-{count}.pcap"
    records = np.zeros(count, np.dtype([("head", FRAME), ("data", "u1", DATA_BYTES)]))
    number, head = np.arange(count), records["head"]
    head["captured"] = head["original"] = records.dtype.itemsize - RECORD_BYTES
    head["mac_destination"], head["mac_source"] = 0xFF, (2, 0, 0, 0, 0, 1)
    head["ethertype"], head["version"], head["ttl"], head["protocol"] = 0x0800, 0x45, 64, 17
    head["ip_length"] = 20 + 8 + HEADER.size_bytes + DATA_BYTES
    head["source"], head["destination"] = FIRST_ADDRESS + number % SENDERS, 0xFFFFFFFF
    head["source_port"] = head["destination_port"] = PORT
    head["udp_length"] = 8 + HEADER.size_bytes + DATA_BYTES
    netvar = head["netvar"]
    netvar["identity"] = HEADER["identity"].default
    netvar["index"] = 1 + number // SENDERS % LISTS
    netvar["items"], netvar["length"] = 2, HEADER.size_bytes + DATA_BYTES
    netvar["counter"] = 1 + number // (SENDERS * LISTS)
    with path.open("wb") as file:
        file.write(PCAP_HEADER)
        records.tofile(file)
    return path, {"frames": count, "telegrams": count}
