"""Generate a capture of a busy plant, of any size, from a seed.

Ten nodes send fifty lists by broadcast, every 10 ms to 1 s; a few lists want acknowledgements or carry checksums;
some telegrams are lost, repeated, overtaken or malformed, and one frame in a hundred is other traffic. Written with
numpy in blocks, so that ten million telegrams take seconds. UDP checksums are absent (zero), which IPv4 allows.

    python tests/benchmarks/generate.py --telegrams 1000000 --seed 1 --dir DIR

With ``--kind events`` the same lists are sent at random intervals, 10 000 telegrams a second, as where values are sent
on change: no two intervals are alike. ``many`` has 5 000 lists in place of fifty, ``large`` telegrams of 1 400 bytes,
``steady`` is cyclic without faults.

prints the path of the capture; beside it lies a JSON file with the parameters and what the capture holds. A capture
that exists with the same parameters, made by the same version of these files, is not written again.
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
from frame_writer import FrameWriter
from plant import CYCLIC, KIND_NAMES, KINDS, NODES, OTHER_TRAFFIC, Events, other_traffic, plant, telegrams

HERE = Path(__file__).parent
SOURCES = ("plant.py", "frame_writer.py", "generate.py")
"""What a capture hangs on, beside its parameters."""


def write_capture(path: Path, count: int, seed: int, kind: str = CYCLIC) -> dict[str, Any]:
    """Write a capture with ``count`` telegrams and return what it holds."""
    rng = np.random.default_rng(seed)
    streams = plant(rng, kind)
    sent = telegrams(streams, count, rng, kind)
    others = other_traffic(round(count * OTHER_TRAFFIC), int(sent.time_us[0]), int(sent.time_us[-1]), rng)
    events = Events.joined([sent, others])
    events = events[np.argsort(events.time_us, kind="stable")]
    writer = FrameWriter(streams, rng)
    writer.write_capture(path, events)
    kinds = np.bincount(events.kind, minlength=len(KIND_NAMES))
    return {
        "bytes": path.stat().st_size,
        "frames": len(events),
        "telegrams": len(sent),
        "other_frames": len(others),
        "nodes": NODES,
        "lists": len(np.unique(streams.list_index)),
        "streams": len(streams.node),
        "duration_s": round(float(events.time_us[-1] - events.time_us[0]) / 1e6, 3),
        "kinds": dict(zip(KIND_NAMES, kinds.tolist(), strict=True)),
    }


def ensure_capture(folder: Path, count: int, seed: int, kind: str = CYCLIC) -> Path:
    """Return the capture with these parameters, writing it where it does not exist yet."""
    parameters = {
        "telegrams": count,
        "seed": seed,
        "kind": kind,
        "generator": hashlib.sha256(b"".join((HERE / name).read_bytes() for name in SOURCES)).hexdigest(),
    }
    path = folder / f"{'plant' if kind == CYCLIC else kind}-{count}-{seed}.pcap"
    about = path.with_suffix(".json")
    if path.exists() and about.exists() and json.loads(about.read_text())["parameters"] == parameters:
        return path
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    contents = write_capture(unfinished, count, seed, kind)
    about.unlink(missing_ok=True)
    os.replace(unfinished, path)
    about.write_text(json.dumps({"parameters": parameters, **contents}, indent=2) + "\n")
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description="Generate a capture of a busy plant.")
    parser.add_argument("--telegrams", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, default=CYCLIC)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    arguments = parser.parse_args()
    path = ensure_capture(arguments.dir, arguments.telegrams, arguments.seed, arguments.kind)
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
