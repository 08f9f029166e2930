"""WebVisu in broken frames: nothing raises, and everything is told in characters that can be printed."""

from __future__ import annotations

import json
import random
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_source
from nvscope.errors import UnreadableInput
from nvscope.report.packets.text import Text
from nvscope.report.text import render
from nvscope.view.rows.frames import PacketRows
from tests.fuzz.examination import assert_printable
from tests.fuzz.mutations import mutated, shortened
from tests.laws import some
from tests.oracle.pcap import write_pcap
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import Batches

PANEL = (Path(__file__).parents[2] / "captures" / "visu" / "panel.pcap").read_bytes()


def shown(raw: bytes, path: Path) -> dict[str, object]:
    """Return the report on a file, of which lines, trees and report were printed."""
    path.write_bytes(raw)
    inquiry = Inquiry(Batches(list(open_source([str(path)]))))
    rows = PacketRows()
    text, trees = Text(), Text(trees=True)
    for _ in inquiry.run(inquiry.open(), [rows]):
        for piece in rows.pieces():
            for part in (*text.render(piece), *trees.render(piece)):
                assert_printable(part)
    report = inquiry.report(inquiry.analyze())
    assert_printable(render(report, everything=True))
    json.dumps(report)
    return report


def test_broken_captures(tmp_path: Path) -> None:
    with_pages = 0
    for number in some(range(150)):
        rng = random.Random(number)
        raw = mutated(rng, shortened(rng, PANEL, 165), [PANEL])
        try:
            with_pages += "visu" in shown(raw, tmp_path / "a.pcap")
        except UnreadableInput:
            continue
    assert with_pages


def test_wild_traffic(tmp_path: Path) -> None:
    for number in some(range(60)):
        frames = [frame for frame in visu_traffic(5 * number + 1) if frame.link == 1]
        write_pcap(frames, tmp_path / "frames.pcap")
        shown((tmp_path / "frames.pcap").read_bytes(), tmp_path / "a.pcap")
