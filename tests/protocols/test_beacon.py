"""An invented protocol, from the file to finding, filter, line, tree and record, without touching the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dissectors.batch import PacketBatch
from dissectors.claims import Claims
from dissectors.dissector import Dissector
from dissectors.layout import Field, Layout
from dissectors.transport import DatagramBatch, SegmentBatch
from nvscope.analysis.default_fields import default_fields
from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.packets import packets
from nvscope.analysis.reading import reading_of
from nvscope.cli.packets import packets as verb
from nvscope.engine.dealing import SplitBy, deal
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Recogniser
from nvscope.engine.run import run
from nvscope.protocols.table import PROTOCOLS, accumulators_of, dissectors_of
from nvscope.report.packets.records import JsonLines
from nvscope.report.packets.text import Text
from nvscope.tracker.evidence.event_columns import EventTable
from nvscope.tracker.evidence.evidence import OTHERS, Evidence
from nvscope.tracker.state import TrackerState
from nvscope.view.rows.frames import PacketRows
from tests.oracle.builders import MILLISECOND, data_frame, telegram
from tests.oracle.pcap import write_pcap
from tests.packets import Batches, batch_of
from tests.protocols import beacon
from tests.protocols.beacon import BEACON
from tests.records import replace

READING = Reading(dissectors=dissectors_of([BEACON]))
START_NS = 1_700_000_000_000_000_000


@pytest.fixture
def inquiry(tmp_path: Path) -> Inquiry:
    """Four beacons of which one is missing and one has a tail, telegrams around them, and a stranger on the port."""
    sent = [
        ("10.0.0.1", 1202, telegram(list_id=7, counter=1)),
        ("10.0.0.2", beacon.PORT, beacon.payload(1)),
        ("10.0.0.2", beacon.PORT, b"no beacon"),
        ("10.0.0.2", beacon.PORT, beacon.payload(2, kind=2, speed=0, more=b"\x01\x02")),
        ("10.0.0.1", 1202, telegram(list_id=7, counter=2)),
        ("10.0.0.2", beacon.PORT, beacon.payload(4, kind=7)),
        ("10.0.0.2", 4712, beacon.payload(5)),
    ]
    frames = [
        data_frame(START_NS + place * MILLISECOND, sender, "10.0.0.255", content, port=port)
        for place, (sender, port, content) in enumerate(sent)
    ]
    write_pcap(frames, tmp_path / "a.pcap")
    return Inquiry([str(tmp_path / "a.pcap")], protocols=(*PROTOCOLS, BEACON))


def test_events(inquiry: Inquiry) -> None:
    """What it tells of its own is heard beside what the state tells, under its own name."""
    evidence = Evidence()
    state = TrackerState(others=accumulators_of([BEACON]), listeners=[evidence])
    for _ in run(inquiry.open(), READING, [state]):
        pass
    columns = evidence.columns[OTHERS]
    (event,) = zip(*(column.tolist() for column in columns.table()), strict=True)
    told = EventTable(*event)
    assert columns.kinds[told.kind] is beacon.BeaconEvent.LOST
    assert (told.frame, told.amount) == (6, 1)
    assert (told.since_ns - START_NS, told.time_ns - START_NS) == (3 * MILLISECOND, 5 * MILLISECOND)
    assert not evidence.columns["steps"].count


def written(inquiry: Inquiry, face: Text | JsonLines, expression: str | None = None) -> str:
    chosen = inquiry.filter(expression) if expression else None
    rows = packets(inquiry.open(), inquiry.reading(chosen), PacketRows())
    return face.begin() + "".join(text for part in rows for text in face.render(part)) + face.end()


def test_lines(inquiry: Inquiry) -> None:
    assert written(inquiry, Text(protocols=inquiry.protocols)).splitlines() == [
        "1  0.000000  10.0.0.1 → 10.0.0.255:1202  list 7 sub 0  data  1 item   22 B  #1",
        "2  0.001000  10.0.0.2 → 10.0.0.255       beacon  alive #1, 1500 rpm",
        "4  0.003000  10.0.0.2 → 10.0.0.255       beacon  leaving #2, 0 rpm",
        "5  0.004000  10.0.0.1 → 10.0.0.255:1202  list 7 sub 0  data  1 item   22 B  #2",
        "6  0.005000  10.0.0.2 → 10.0.0.255       beacon  kind 7 #4, 1500 rpm",
    ]


def test_a_tree_and_its_dump(inquiry: Inquiry) -> None:
    tree = written(inquiry, Text(trees=True, dumps=True, protocols=inquiry.protocols), "frame.number == 4").splitlines()
    at = tree.index("Beacon")
    assert [line.split("  ")[0] for line in tree[:at] if not line.startswith(" ")] == [
        "Frame 4", "Ethernet", "IPv4", "UDP",
    ]  # fmt: skip
    assert [line.split() for line in tree[at + 1 : at + 6]] == [
        ["002a", "42", "43", "Magic", "0x4342", "BC"],
        ["002c", "02", "Kind", "2", "leaving"],
        ["002d", "02", "Number", "2", "counts", "up"],
        ["002e", "00", "00", "Speed", "0", "in", "rounds", "a", "minute"],
        ["Data", "2", "bytes"],
    ]
    assert "0020  00 ff 04 b2 12 67 00 10 00 00 42 43 02 02 00 00" in "\n".join(tree)


@pytest.mark.parametrize(
    ("expression", "frames"),
    [
        ("beacon", [2, 4, 6]),
        ("!beacon", [1, 5]),
        ("beacon.speed > 1000", [2, 6]),
        ('beacon.kind == "leaving"', [4]),
        ("beacon.kind", [2, 4]),
        ("udp", [1, 2, 4, 5, 6]),
        ("udp.dstport == 4711 && ip.src == 10.0.0.2", [2, 4, 6]),
        ("nv", [1, 5]),
        ("nv.counter == 1 || beacon.number == 4", [1, 6]),
        ("udp.payload[0:2] == 42:43", [2, 4, 6]),
        ("list.id == 7", [1, 5]),
        ("!list.id", [2, 4, 6]),
        ('finding.code == "NV991"', []),
    ],
)
def test_filters(inquiry: Inquiry, expression: str, frames: list[int]) -> None:
    shown = written(inquiry, JsonLines([inquiry.fields["frame.number"]]), expression)
    assert [int(line.split(":")[1].rstrip("}")) for line in shown.splitlines() if line] == frames


def test_records(inquiry: Inquiry) -> None:
    fields = [inquiry.fields[name] for name in ("frame.number", "beacon.number", "beacon.kind", "nv.index", "ip.src")]
    assert written(inquiry, JsonLines(fields)).splitlines()[2:4] == [
        '{"frame.number":4,"beacon.number":2,"beacon.kind":"leaving","nv.index":null,"ip.src":"10.0.0.2"}',
        '{"frame.number":5,"beacon.number":null,"beacon.kind":null,"nv.index":7,"ip.src":"10.0.0.1"}',
    ]


def test_default_columns_are_those_of_what_the_capture_begins_with(inquiry: Inquiry) -> None:
    names = [field.name for field in default_fields(inquiry, inquiry.open())]
    assert names[-3:] == ["beacon.number", "beacon.kind", "beacon.speed"]
    assert names[:-3] == [field.name for field in default_fields(Inquiry(inquiry.paths), inquiry.open())]


@pytest.mark.parametrize(
    ("expression", "shown"),
    [("beacon", True), ("beacon.number == 2", True), ("beacon.number == 77", False), ("nv", False), ("udp", True)],
)
def test_a_filter_leaves_its_finding_where_it_chooses_a_frame(
    inquiry: Inquiry, expression: str, shown: bool
) -> None:  # fmt: skip
    document = inquiry.report(inquiry.analyze(expression, causes=True))
    assert ("NV991" in {one["code"] for one in document["findings"]}) == shown
    assert document["filter"]["telegrams"] == (2 if expression in ("nv", "udp") else 0)


def test_plain_lines_of_the_program_show_it(
    inquiry: Inquiry, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    """The verb reads without an inquiry where nothing but lines is asked for."""
    for default in (Text.__init__, reading_of):
        known = default.__kwdefaults__ | {"protocols": inquiry.protocols}
        monkeypatch.setattr(default, "__kwdefaults__", known)
    verb(sources=[*inquiry.paths], quiet=True)
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["1", "2", "4", "5", "6"]


@pytest.mark.parametrize("rows", [[1, 1], [2, 1], [4], [99], [-1]])
def test_a_dissector_that_breaks_its_promise_is_told(inquiry: Inquiry, rows: list[int]) -> None:
    """Frames twice, backwards, of others, or of no batch would make wrong figures."""

    class Broken(beacon.BeaconBatch):
        row = np.array(rows)

    def dissect(packets: PacketBatch, datagrams: DatagramBatch, segments: SegmentBatch) -> Broken:
        found = beacon.dissect(packets, datagrams, segments)
        return Broken(found.datagram, found.header)

    broken = Dissector(beacon.NAME, Claims(udp=(beacon.PORT,)), dissect)
    (told,) = run(inquiry.open(), Reading(dissectors=(broken,)), ())
    with pytest.raises(ValueError, match="dissector beacon"):
        _ = told.parts


def test_a_frame_that_two_could_read_is_the_first_ones(inquiry: Inquiry) -> None:
    (dissector,) = READING.dissectors
    other = replace(dissector, name="other")
    (told,) = run(inquiry.open(), Reading(dissectors=(dissector, other)), ())
    assert {name: part.row.tolist() for name, part in told.parts.items()} == {"beacon": [1, 3, 5]}
    (told,) = run(inquiry.open(), Reading(dissectors=(other, dissector)), ())
    assert list(told.parts) == ["other"]


@pytest.mark.parametrize("by", [SplitBy.LIST, SplitBy.SENDER, SplitBy.BUS])
def test_messages_go_to_one_part(inquiry: Inquiry, by: SplitBy) -> None:
    (told,) = Recogniser(READING).tell(next(iter(inquiry.open())))
    assert [len(own.parts.get(beacon.NAME, ())) for _, own in deal(told, by, 3)] == [3, 0, 0]


@pytest.mark.parametrize("size_bytes", [66, 130, 5000])
def test_what_was_not_captured_is_not_gathered(size_bytes: int) -> None:
    """Behind the last packet of a buffer lie few bytes that can be read."""
    (told,) = run(Batches([batch_of([data_frame(0, "10.0.0.1", "10.0.0.2", b"", port=beacon.PORT)])]), READING, ())
    datagrams = told.batch.datagrams
    assert len(datagrams) == 1
    layout = Layout("large", (Field("all", f"V{size_bytes}", "All", "of it"),))
    assert len(layout.gather(told.packets.data, datagrams.holding(size_bytes).payload)) == 0
    assert len(datagrams.holding(0)) == 1


def test_the_report_has_its_finding_and_is_otherwise_the_same(inquiry: Inquiry) -> None:
    document = inquiry.report(inquiry.analyze(causes=True))
    alone = Inquiry(inquiry.paths)
    plain = alone.report(alone.analyze(causes=True))
    (gap,) = (one for one in document["findings"] if one["code"] == "NV991")
    assert gap["message"] == "1 of 4 beacons of 10.0.0.2 never came."
    document["findings"].remove(gap)
    (cause,) = document["causes"]
    assert [one["code"] for one in cause["findings"]] == ["NV991"]
    document["causes"].remove(cause)
    for counted in ("findings", "findings_beside_lists"):
        document["totals"][counted][gap["severity"]] -= 1
    assert document == plain


def test_a_session_looks_at_it_too(inquiry: Inquiry) -> None:
    session = inquiry.session()
    session.start()
    assert session.wait(60)
    assert "NV991" in {finding.code for finding in session.stop().findings}
