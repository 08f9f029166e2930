"""Generate a capture of a plant whose lists have 2 to 64 variables each, with their definition files, from a seed.

The plant is that of ``plant.py`` (nodes, intervals, losses, malformed telegrams); only what the telegrams hold is
another thing: values as controllers send them. Measurements are noisy (no two alike), counters and times rise, states
and texts change now and then.

    python tests/benchmarks/values.py --telegrams 1000000 --seed 1 --dir DIR

prints the path of the capture; beside it lie the folder of its .gvl files and a JSON file with what it holds.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from frame_writer import FrameWriter
from generate import HERE, SOURCES
from plant import (
    DATA,
    INTERVALS_US,
    LISTS,
    LISTS_PER_NODE,
    OTHER_TRAFFIC,
    START_US,
    Events,
    Streams,
    other_traffic,
    telegrams,
)

from dissectors.batch import I64, U8, U64
from dissectors.netvar import HEADER, PORT
from nvscope.definition.load import load_definitions
from nvscope.definition.packing import TelegramLayout, pack

VARIABLES = (2, 4, 6, 8, 12, 16, 24, 32, 48, 64)
TYPES = ("REAL", "BOOL", "INT", "DINT", "REAL", "BOOL", "WORD", "TIME", "LREAL", "UINT")
TEXT_LISTS = (12, 24)  # lists with so many variables end with a text
TEXT = "STRING(20)"

_GVL = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL
{variables}
END_VAR]]></Declarations>
  <NetvarSettings Protocol="UDP">
    <ListIdentifier>{index}</ListIdentifier>
    <Pack>True</Pack>
    <ProtocolSettings>
      <ProtocolSetting Name="Port" Value="{port}" />
    </ProtocolSettings>
  </NetvarSettings>
</GVL>
"""


def write_definitions(folder: Path) -> list[Path]:
    """Write a .gvl file for each list of the plant, and return them by list."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number in range(LISTS):
        count = VARIABLES[number % len(VARIABLES)]
        types = [TYPES[place % len(TYPES)] for place in range(count)]
        if count in TEXT_LISTS:
            types[-1] = TEXT
        variables = "\n".join(f"\tv{place}_{kind[:4].lower()} : {kind};" for place, kind in enumerate(types))
        files.append(folder / f"list{number + 1:02}.gvl")
        files[-1].write_text(_GVL.format(variables=variables, index=number + 1, port=PORT))
    return files


class ValueWriter(FrameWriter):
    """Writes telegrams that hold values of variables."""

    def __init__(self, streams: Streams, layouts: list[TelegramLayout], rng: np.random.Generator) -> None:
        super().__init__(streams, rng)
        self.layouts = layouts
        self.items = np.array([layout.items for layout in layouts])

    def data(self, events: Events, size: int) -> U8:
        """Return values as the telegrams' layouts have them, of shape (n, size)."""
        found = np.empty((len(events), size), np.uint8)
        for stream in np.unique(events.stream).tolist():
            own = np.flatnonzero(events.stream == stream)
            layout = self.layouts[stream]
            rows = np.zeros(len(own), layout.layout.dtype)
            for place, element in enumerate(layout.elements):
                rows[str(place)] = values(element.type.name, events.time_us[own], 1000 * stream + place)
            found[own] = rows.view(np.uint8).reshape(len(own), size)
        return found

    def heads(self, events: Events, data_bytes: I64, numbers: I64) -> npt.NDArray[np.void]:
        """Return the headers with the number of variables that each list has."""
        head = super().heads(events, data_bytes, numbers)
        items = head["netvar"]["items"]
        head["netvar"]["items"] = np.where(items != 0, self.items[events.stream], 0)
        return head


def values(kind: str, time_us: I64, seed: int) -> Any:
    """Return values of a type at some times."""
    noise = _noise(time_us, seed)
    share = (noise >> np.uint64(40)).astype(np.float64) / (1 << 24)
    seconds = (time_us - START_US) / 1e6
    if kind in ("REAL", "LREAL"):
        return 50 + seed % 40 * np.sin(seconds / (5 + seed % 50)) + share
    if kind == "INT":
        return (1000 * np.sin(seconds / (3 + seed % 7)) + 20 * share).astype(np.int64)
    if kind == "DINT":
        return (seconds * 1000).astype(np.int64) + seed
    if kind == "BOOL":
        return (time_us // (200_000 + 1_000 * (seed % 900))) & 1
    if kind == "WORD":
        return 1 << (time_us // 3_000_000 + seed) % 16
    if kind == "TIME":
        return time_us // 1000 % 60_000
    if kind == "UINT":
        return time_us // 10_000 & 0xFFFF
    order = time_us // 500_000 % 100_000
    texts = {number: f"order {number}".encode().ljust(21, b"\0") for number in np.unique(order).tolist()}
    return np.array([texts[number] for number in order.tolist()], "V21")


def _noise(time_us: I64, seed: int) -> U64:
    mixed = (time_us + (seed << 20)).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= mixed >> np.uint64(29)
    return mixed * np.uint64(0xBF58476D1CE4E5B9)


def write_capture(path: Path, definitions: list[Path], count: int, seed: int) -> dict[str, Any]:
    """Write a capture with ``count`` telegrams of the lists of some definitions, and return what it holds."""
    rng = np.random.default_rng(seed)
    layouts = [
        layout for entry in load_definitions([str(file) for file in definitions]).lists for layout in pack(entry)
    ]
    sizes = np.array([layout.layout.size_bytes for layout in layouts])
    index = np.array([layout.list.list_id for layout in layouts])
    streams = Streams(
        index.astype(np.uint16),
        np.array([layout.subindex for layout in layouts], np.uint16),
        sizes,
        (index - 1) // LISTS_PER_NODE,
        np.zeros(len(layouts), np.uint8),
        np.zeros(len(layouts), np.uint8),
        np.array([INTERVALS_US[(number - 1) % len(INTERVALS_US)] for number in index.tolist()]),
        rng.integers(0, 65536, len(layouts)),
    )
    sent = telegrams(streams, count, rng)
    first_us, last_us = int(sent.time_us[0]), int(sent.time_us[-1])
    others = other_traffic(round(count * OTHER_TRAFFIC), first_us, last_us, rng)
    events = Events.joined([sent, others])
    events = events[np.argsort(events.time_us, kind="stable")]
    writer = ValueWriter(streams, layouts, rng)
    writer.write_capture(path, events)
    whole = events.kind == DATA
    items = np.array([layout.items for layout in layouts])
    return {
        "bytes": path.stat().st_size,
        "frames": len(events),
        "telegrams": len(sent),
        "well_formed": int(whole.sum()),
        "values": int(items[events.stream[whole]].sum()),
        "lists": len(definitions),
        "data_bytes_mean": round(float(sizes[events.stream[whole]].mean()), 1),
        "header_bytes": HEADER.size_bytes,
    }


def ensure_capture(folder: Path, count: int, seed: int) -> Path:
    """Return the capture with these parameters, writing it and its definitions where they do not exist yet."""
    generators = (Path(__file__), *(HERE / name for name in SOURCES))
    parameters = {
        "telegrams": count,
        "seed": seed,
        "generator": hashlib.sha256(b"".join(file.read_bytes() for file in generators)).hexdigest(),
    }
    path = folder / f"values-{count}-{seed}.pcap"
    about = path.with_suffix(".json")
    if path.exists() and about.exists() and json.loads(about.read_text())["parameters"] == parameters:
        return path
    folder.mkdir(parents=True, exist_ok=True)
    definitions = write_definitions(folder / "values-gvl")
    unfinished = path.with_suffix(".unfinished")
    contents = write_capture(unfinished, definitions, count, seed)
    about.unlink(missing_ok=True)
    os.replace(unfinished, path)
    contents["definitions"] = [str(file) for file in definitions]
    about.write_text(json.dumps({"parameters": parameters, **contents}, indent=2) + "\n")
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description="Generate a capture of lists with 2 to 64 variables.")
    parser.add_argument("--telegrams", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    arguments = parser.parse_args()
    sys.stdout.write(f"{ensure_capture(arguments.dir, arguments.telegrams, arguments.seed)}\n")


if __name__ == "__main__":
    main()
