"""Laws that hold for any traffic on CAN: however batches are cut, and whatever a filter chooses."""

from __future__ import annotations

import json
import random
import tempfile
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from dissectors.can.frame import dissect_can
from dissectors.can.pdo import PdoRules
from dissectors.carried import Carried
from dissectors.sorter import Sorter
from dissectors.varieties import NO_TELEGRAM
from nvscope.capture.open import open_source
from nvscope.capture.pcap import PcapSink
from nvscope.definition.load import load_definitions
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.report.packets.records import JsonLines
from nvscope.report.packets.text import Text
from nvscope.view.fields.frame import DEFAULT_CAN_FIELDS
from tests.can_plant import CanPlant, drawn_plant
from tests.capture import build
from tests.capture.reference import Packet
from tests.fuzz.program import run
from tests.laws import examples
from tests.packets import Batches, Shown
from tests.records import replace

SEEDS = st.integers(0, 100_000)
FILTERS = (
    "can", "!can", "can.len == 8", "can.data[0] > 7f", 'can.channel == "can1"', "can.flags.rtr", "list.id > 0x140",
    "canopen.node == 5", 'finding.code == "NV603"', "frame.number < 20", "list.nSendCount > 5",
)  # fmt: skip


def read(plant: CanPlant) -> tuple[PacketBatch, Sequence[str], Pdos]:
    with tempfile.TemporaryDirectory() as folder:
        log, options = plant.write(Path(folder))
        source = open_source([log])
        (batch,) = source
        return batch, list(source.channels), Pdos(load_definitions([name for name in options if name != "--gvl"]))


def cut(batch: PacketBatch, chance: random.Random) -> list[PacketBatch]:
    cuts = sorted(chance.sample(range(len(batch) + 1), chance.randint(0, min(20, len(batch)))))
    return [batch[start:stop] for start, stop in zip([0, *cuts], [*cuts, len(batch)], strict=True)]


@examples(30)
@given(seed=SEEDS, tree=st.booleans())
def test_any_cut_gives_the_same_lines_trees_and_records(seed: int, tree: bool) -> None:
    plant = drawn_plant(seed)
    whole, channels, pdos = read(plant)
    reading = Reading(pdos=pdos.rules())
    shown = []
    for batches in ([whole], cut(whole, random.Random(seed)), [whole[row : row + 1] for row in range(len(whole))]):
        faces = Text(trees=tree, pdos=pdos, width=None), JsonLines(DEFAULT_CAN_FIELDS)
        text, records = (
            "".join(part for rows in Shown(Batches(batches, channels), reading) for part in face.render(rows))
            for face in faces
        )
        # Columns of lines get wider as they need it.
        shown.append([[line.split() for line in text.splitlines()], records.splitlines()])
    assert shown[0] == shown[1] == shown[2]
    assert len(shown[0][1]) == len(plant.lines)


@examples(30)
@given(seed=SEEDS)
def test_varieties_are_what_each_frame_is_by_itself(seed: int) -> None:
    """Every frame is a row; list, part and data are those of the frame dissected alone by a sorter of its own."""
    whole, channels, pdos = read(drawn_plant(seed))
    rules = replace(pdos.rules(), names=lambda: channels)
    told = Sorter(pdos=rules).sort(whole)
    assert (told.variety != NO_TELEGRAM).all()
    for row in range(len(whole)):
        one = whole[row : row + 1]
        alone, own = Sorter(pdos=rules).sort(one), dissect_can(one)
        numbers = told.variety[row], alone.variety[0]
        for column in fields(Carried):
            left, right = (getattr(one.varieties.carried, column.name) for one in (told, alone))
            assert left[numbers[0]] == right[numbers[1]], column.name
        at = told.packets.offset[row] + told.varieties.carried.at[numbers[0]]
        size = int(told.varieties.carried.captured_bytes[numbers[0]])
        assert told.packets.data[at : at + size].tobytes() == own.payload(0)


@examples(12)
@given(seed=SEEDS, expression=st.sampled_from(FILTERS))
def test_a_filter_in_a_report_changes_no_figure(seed: int, expression: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        log, options = drawn_plant(seed).write(Path(folder))
        whole = run("report", log, *options, "--json").document()
        ran = run("report", log, *options, "--json", "-Y", expression)
        shown = run("packets", log, *options, "-Y", expression, "-e", "list.key").out.split()
    part = ran.document()
    assert part["capture"] == whole["capture"]
    lists = {entry["key"]: entry for entry in whole["lists"]}
    for entry in part["lists"]:
        streams = lists[entry["key"]]["streams"]
        for name in entry.keys() - {"streams", "values"}:  # which are those of what was chosen
            assert entry[name] == lists[entry["key"]][name], name
        assert all(stream in streams for stream in entry["streams"])
    assert all(finding in whole["findings"] for finding in part["findings"])
    assert {entry["key"] for entry in part["lists"]} == set(shown)
    assert part["filter"]["expression"] == expression


@pytest.mark.parametrize("link", [LinkType.CAN_SOCKETCAN, LinkType.LINUX_SLL, LinkType.LINUX_SLL2])
def test_cooked_frames_say_what_plain_ones_say(tmp_path: Path, link: int) -> None:
    """The same frames in link type 227, SLL and SLL2: the same fields, but for the lengths of the packets."""
    batch, channels, _ = read(drawn_plant(5))
    frames = dissect_can(batch)
    # Which bus it is a log says alone, and which way a frame went a cooked header alone.
    names = [field.name for field in DEFAULT_CAN_FIELDS if field.name not in ("can.channel", "can.direction")]
    with PcapSink(str(tmp_path / "a.pcap")) as sink:
        sink.write(batch)
    expected = records(tmp_path / "a.pcap", names)
    assert len(expected) == len(frames)
    (tmp_path / "b.pcap").write_bytes(cooked(batch, link))
    assert records(tmp_path / "b.pcap", names) == expected
    assert PdoRules(names=lambda: channels).channel(0) == "can0"


def records(path: Path, names: Sequence[str]) -> list[dict[str, Any]]:
    options = [word for name in names for word in ("-e", name)]
    ran = run("packets", str(path), "-T", "ndjson", *options)
    assert ran.code == 0
    return [json.loads(line) for line in ran.out.splitlines()]


def cooked(batch: PacketBatch, link: int) -> bytes:
    """Return the packets of a batch as a capture of another link type, the identifier in the host's byte order."""
    packets = []
    for row in range(len(batch)):
        raw = batch.packet(row)
        if link != LinkType.CAN_SOCKETCAN:
            protocol = (0x000D if raw[5] & 4 else 0x000C).to_bytes(2, "big")
            head = {
                LinkType.LINUX_SLL: bytes([0, 1, 1, 0x18]) + bytes(10) + protocol,
                LinkType.LINUX_SLL2: protocol + bytes([0, 0, 0, 0, 0, 3, 1, 0x18]) + bytes(10),
            }[LinkType(link)]
            raw = head + raw[3::-1] + raw[4:]
        packets.append(Packet(int(batch.ts_ns[row]), len(raw), link, raw))
    return build.pcap(packets, link=link)
