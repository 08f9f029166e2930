"""A protocol over TCP: its messages are shown as those over UDP are, each in the segment that it came in."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.packets import packets
from nvscope.engine.run import run
from nvscope.protocols.table import PROTOCOLS
from nvscope.report.packets.text import Text
from nvscope.view.lines.shown import NO_WORDING
from nvscope.view.rows.frames import PacketRows
from tests.laws import examples
from tests.oracle.builders import MILLISECOND
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.pcap import write_pcap
from tests.packets import Batches
from tests.protocols.probe import PROBE, probe

START_NS = 1_700_000_000_000_000_000


def shown(frames: list[bytes], folder: Path, *, trees: bool = False) -> list[str]:
    write_pcap(
        [Frame(START_NS + place * MILLISECOND, ETHERNET, data, len(data)) for place, data in enumerate(frames)],
        folder / "probes.pcap",
    )
    inquiry = Inquiry([str(folder / "probes.pcap")], protocols=(*PROTOCOLS, PROBE))
    face = Text(trees=trees, protocols=inquiry.protocols)
    rows = packets(inquiry.open(), inquiry.reading(), PacketRows())
    return (face.begin() + "".join(text for part in rows for text in face.render(part)) + face.end()).splitlines()


def test_lines(tmp_path: Path) -> None:
    assert shown([probe(1), probe(2, v6=True), probe(3)[:50]], tmp_path) == [
        "1  0.000000  10.0.0.1 → 10.0.0.2  probe  #1",
        "2  0.001000  fe80::1  → fe80::2   probe  #2",
    ]


def test_a_tree(tmp_path: Path) -> None:
    tree = shown([probe(260, options=3, tagged=True, more=b"!")], tmp_path, trees=True)
    titles = [line.split("  ")[0] for line in tree if line and not line.startswith(" ")]
    assert titles == ["Frame 1", "Ethernet", "VLAN tag", "IPv4", "TCP", "Options", "Probe", "Data"]
    told = {" ".join(line.split()) for line in tree}
    assert "0028 12 69 Destination port 4713 port of the receiver" in told
    assert "0032 80 Data offset 0x80 32 bytes" in told
    assert "0033 18 Flags 0x18 psh, ack" in told
    assert "0048 01 04 Number 260 counts up" in told


@given(st.integers(0, 10_000))
@examples(30)
def test_layers_lie_one_behind_the_other_up_to_the_message(seed: int) -> None:
    chance = random.Random(seed)
    data = probe(1, options=chance.randrange(11), v6=chance.random() < 0.5, tagged=chance.random() < 0.5)
    reading = Inquiry([], protocols=(PROBE,)).reading()
    observer = PacketRows()
    for _ in run(Batches([PacketBatch.of([data], ETHERNET)]), reading, [observer]):
        (rows,) = observer.pieces()
    tree = PROBE.tree()(rows, NO_WORDING, dumps=True)
    found, span = tree.layers(0, data, ETHERNET), tree.spans(0)
    assert found[0].start == 0
    assert data[span.start :].startswith(b"PB")
    assert span.start == found[-1].stop
    assert all(before.stop == after.start for before, after in pairwise(found))
