"""Captures and definitions of list 7, made for a test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from nvscope.capture.pcap import PcapSink
from tests.definition.lists import telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of

_GVL = Path(__file__).parents[2] / "captures" / "peers" / "counters.gvl"


def written(path: Path, frames: Sequence[Frame], name: str = "in.pcap") -> str:
    """Write frames to a capture file, and return its name."""
    with PcapSink(str(path / name)) as sink:
        sink.write(batch_of(frames))
    return name


def defined(path: Path, name: str, declarations: str) -> list[str]:
    """Write a file that defines list 7, and return the option that names it."""
    gvl = _GVL.read_text().replace("<ListIdentifier>3<", "<ListIdentifier>7<")
    start, end = gvl.index("\ta : BOOL"), gvl.index("END_VAR")
    (path / f"{name}.gvl").write_text(f"{gvl[:start]}\t{declarations}\n{gvl[end:]}")
    return ["--gvl", f"{name}.gvl"]


def numbered(data: Sequence[bytes], items: int, subindex: int = 0) -> list[Frame]:
    """Return a telegram of one SubIndex for each data, a second apart."""
    return [telegram(one, items, subindex=subindex, counter=at, ts_ns=at * 10**9) for at, one in enumerate(data)]
