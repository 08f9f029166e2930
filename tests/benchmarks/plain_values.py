"""Decode values one telegram at a time: the record walk, ``struct.unpack``, and a CSV line, as scripts do it.

    python tests/benchmarks/plain_values.py CAPTURE DIRECTORY GVL...      a CSV file a list
    python tests/benchmarks/plain_values.py CAPTURE - GVL...              values only, nothing is written

Prints how many telegrams it decoded.
"""

from __future__ import annotations

import csv
import struct
import sys
from pathlib import Path
from typing import Any

from nvscope.definition.load import load_definitions
from nvscope.definition.packing import dtype_of, pack

_FORMATS = {"u1": "B", "i1": "b", "<u2": "H", "<i2": "h", "<u4": "I", "<i4": "i", "<u8": "Q", "<i8": "q"}
_FORMATS |= {"<f4": "f", "<f8": "d"}
_HEADER_AT = 42  # Ethernet, IPv4 without options, UDP
_HEADER_BYTES = 20


def main() -> None:
    capture, target, *definitions = sys.argv[1:]
    known: dict[tuple[int, int], tuple[int, int, struct.Struct]] = {}
    rows: dict[int, Any] = {}
    for entry in load_definitions(definitions).lists:
        if target != "-":
            rows[entry.list_id or 0] = csv.writer((Path(target) / f"{entry.name}.csv").open("w", newline=""))
        for layout in pack(entry):
            kinds = [dtype_of(element.type) for element in layout.elements]
            told = "".join(_FORMATS.get(kind, kind.replace("V", "") + "s") for kind in kinds)
            known[entry.list_id or 0, layout.subindex] = layout.items, layout.length, struct.Struct(f"<{told}")
    header = struct.Struct("<IIHHHHHBB").unpack_from
    record = struct.Struct("<IIII").unpack_from
    telegrams = 0
    data = Path(capture).read_bytes()
    at = 24
    while at < len(data):
        seconds, microseconds, captured, _ = record(data, at)
        at += 16
        start = at + _HEADER_AT
        at += captured
        if captured < _HEADER_AT + _HEADER_BYTES:
            continue
        identity, service, index, subindex, items, length, *_ = header(data, start)
        if identity != 0x33532D00 or service or (layout := known.get((index, subindex))) is None:
            continue
        if (items, length) != layout[:2] or captured != _HEADER_AT + length:
            continue
        values = layout[2].unpack_from(data, start + _HEADER_BYTES)
        telegrams += 1
        if rows:
            rows[index].writerow((seconds, microseconds, *values))
    print(telegrams)


if __name__ == "__main__":
    main()
