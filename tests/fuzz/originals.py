"""The files that are mutated: the sample captures, random traffic, and scenarios."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path

from nvscope.capture.compressed import Decompressed, compression_of
from tests.capture import build
from tests.capture.reference import Packet
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate
from tests.simulate.simulation import simulated

_ROOT = Path(__file__).parents[2]
CAPTURES = _ROOT / "captures"
SCENARIOS = sorted((_ROOT / "tests" / "scenarios").glob("*.toml"))


def sample_captures() -> dict[str, bytes]:
    """Return every capture of ``captures/index.toml`` by its name, without compression; CAN logs are fuzzed apart."""
    index = tomllib.loads((CAPTURES / "index.toml").read_text())
    names = [entry["file"] for entry in index["capture"] if not entry["file"].endswith(".log")]
    return {name: _plain((CAPTURES / name).read_bytes()) for name in names}


def _plain(raw: bytes) -> bytes:
    compression = compression_of(raw[:4])
    return b"".join(Decompressed(iter([raw]), compression)) if compression else raw


def random_traffic(seed: int, frames: int = 200) -> bytes:
    """Return random traffic, of one link type as pcap or of all as pcapng."""
    if seed % 2:
        return pcap_of(generate(seed, frames), order="<>"[seed // 2 % 2], nanoseconds=seed % 3 > 0)
    return pcapng_of(generate(seed, frames, None), order="<>"[seed // 2 % 2])


def scenario_traffic(path: Path) -> bytes:
    """Return the traffic of a scenario as pcapng."""
    return pcapng_of(simulated(path).frames())


def pcap_of(frames: Iterable[Frame], *, order: str = "<", nanoseconds: bool = True) -> bytes:
    frames = list(frames)
    packets = [Packet(frame.ts_ns, frame.original, frame.link, frame.data) for frame in frames]
    return build.pcap(packets, order=order, nanoseconds=nanoseconds, link=frames[0].link if frames else 1)


def pcapng_of(frames: Iterable[Frame], *, order: str = "<") -> bytes:
    """Return frames as one section with an interface for each link type, times in ns."""
    numbers: dict[int, int] = {}
    blocks = [build.section(order)]
    for frame in frames:
        if frame.link not in numbers:
            numbers[frame.link] = len(numbers)
            blocks.append(build.interface(order, frame.link, options=build.option(order, 9, b"\x09")))
        blocks.append(
            build.enhanced(order, frame.ts_ns, frame.data, original=frame.original, number=numbers[frame.link])
        )
    return b"".join(blocks)
