"""Lines of trees know their bytes: those that they tell, at the places that they tell."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.packets import packets
from nvscope.cli.definitions import project_of
from nvscope.protocols.table import PROTOCOLS
from nvscope.view.lines.shown import Wording
from nvscope.view.lines.tree import PlacedLine, Trees
from nvscope.view.lines.tree_lines import BYTES_AT, SHOWN_BYTES
from nvscope.view.rows.frames import PacketRows

CAPTURES = Path(__file__).parents[3] / "captures"
PEERS = (CAPTURES / "peers" / "peers.pcap", (CAPTURES / "peers",))
PRESS = (CAPTURES / "can" / "press.log", (CAPTURES / "can" / "press.gvl", CAPTURES / "can" / "level.gvl"))
OTHERS = [
    (CAPTURES / name, ()) for name in ("telegrams.pcap", "truncated.pcap", "interfaces.pcapng", "plant.pcapng.gz")
]


def trees_of(path: Path, definitions: tuple[Path, ...]) -> Iterator[tuple[Trees, int, bytes]]:
    inquiry = Inquiry([str(path)], project_of(None, list(map(str, definitions)) or None))
    wording = Wording({}, inquiry.layouts, inquiry.pdos)
    make = {one.name: one.tree() for one in PROTOCOLS}
    for rows in packets(inquiry.open(), inquiry.reading(all_frames=True), PacketRows(limit=400)):
        trees = Trees(rows, make, wording, dumps=False)
        for row in range(len(rows)):
            yield trees, row, rows.packets.packet(int(rows.row[row]))


def text_of(line: PlacedLine) -> str:
    return "".join(cell.text for cell in line.line)


@pytest.mark.parametrize(("path", "definitions"), [PEERS, PRESS, *OTHERS])
def test_a_line_is_about_the_bytes_that_it_tells(path: Path, definitions: tuple[Path, ...]) -> None:
    for trees, row, packet in trees_of(path, definitions):
        covered = set[int]()
        for line in trees.placed_lines(row):
            if line.place is None:
                continue
            start, stop = line.place
            assert 0 <= start < stop <= len(packet) or (start == stop and line.title), text_of(line)
            if line.tells_place:
                digits = packet[start:stop].hex(" ")
                shown = digits if stop - start <= SHOWN_BYTES else f"{digits[: 3 * SHOWN_BYTES - 4]} …"
                assert text_of(line)[: BYTES_AT + len(shown)] == f"  {start:04x}  {shown}"
                covered |= set(range(start, stop))
            elif line.title == "Data":
                covered |= set(range(start, stop))
        spans = trees.spans(row)
        # No byte of a message is without a line.
        assert covered >= set(range(spans.start, min(spans.stop, len(packet))))


@pytest.mark.parametrize(("path", "definitions"), [PEERS, PRESS])
def test_beside_its_bytes_a_tree_says_the_same_without_them(path: Path, definitions: tuple[Path, ...]) -> None:
    for trees, row, _ in trees_of(path, definitions):
        whole, beside = trees.placed_lines(row), trees.placed_lines(row, beside_bytes=True)
        for one, other in zip(whole, beside, strict=True):
            said = text_of(one)[BYTES_AT + 3 * SHOWN_BYTES - 1 :] if one.tells_place else text_of(one)
            assert said.split() == text_of(other).split()
            assert (one.place, one.title) == (other.place, other.title)
