"""What must hold for any file: it is refused in words, or read, tracked, judged and shown, every frame in its place.

``examine`` raises AssertionError where something does not hold; any other exception is a bug as well.
"""

from __future__ import annotations

import json
import random
import signal
import threading
import types
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from dissectors.batch import PAD_BYTES, LinkType, PacketBatch
from dissectors.headers import VLAN_TYPES
from dissectors.link import MAX_VLAN_TAGS
from dissectors.netvar import PortRules
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from nvscope.capture.source import SourceInfo
from nvscope.engine.reading import Reading
from nvscope.errors import UnreadableInput
from nvscope.findings.judge import judge
from nvscope.report import json as json_face
from nvscope.report import markdown, text
from nvscope.report.packets.records import Csv, JsonArray, JsonLines
from nvscope.report.packets.text import Text
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from nvscope.view.escape import visible
from nvscope.view.fields.frame import DEFAULT_FIELDS
from nvscope.view.lines.netvar_line import Moment
from tests.capture.reference import Content, read_pcap, read_pcapng
from tests.fuzz.anatomy import PCAP_ORDERS, SECTION_MAGIC
from tests.fuzz.mutations import COMPRESSIONS
from tests.oracle.compare import differences
from tests.oracle.frame import Frame
from tests.oracle.reference import reference_report
from tests.packets import Shown, document_of, tracked

NAME = "a\x1b[31m\u202e<b>|`capture"
"""A file name that a terminal, a browser and a Markdown reader would all obey."""

SHORTEST_RECORD_BYTES = 16
ORACLE_FRAMES = 400
GUARD_SECONDS = 60
"""Far above what anything here takes, on any machine."""

_MOMENTS: tuple[Moment, ...] = ("a", "ad", "d", "e", "r", "u", "ud")
_COMPRESSED = (b"\x1f\x8b", b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18")


class EndlessError(AssertionError):
    """Something takes many times longer than anything of its size should."""


@contextmanager
def ends() -> Iterator[None]:
    """Raise EndlessError where the block does not end; only in the main thread, and where there are alarms."""
    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(_number: int, _frame: types.FrameType | None) -> None:
        raise EndlessError(f"not finished after {GUARD_SECONDS} s")

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.alarm(GUARD_SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@dataclass
class Examined:
    """How far a file came: what a fuzzer must reach often to be worth its time."""

    readable: bool = False
    frames: int = 0
    telegrams: int = 0
    lists: int = 0
    findings: int = 0
    cut: bool = False


def examine(raw: bytes, folder: Path, rng: random.Random) -> Examined:
    """Put a file through everything; ``rng`` draws in which sizes it is read, and in which forms it is shown."""
    with ends():
        path = folder / NAME
        path.write_bytes(raw)
        compressed = raw.startswith(_COMPRESSED) or raw[1:4] == b"\x2a\x4d\x18"
        expected = None if compressed else content_of(raw)
        refusal: UnreadableInput | None = None
        try:
            source = CaptureFile(str(path))
            batches = list(_bounded(source, None if compressed else len(raw)))
        except UnreadableInput as error:
            refusal = error
        if refusal is not None:
            assert expected is None or not expected.readable, f"refused, though readable: {refusal}"
            assert refusal.what
            assert refusal.where
            return Examined()
        if expected is not None:
            _check_content(source.info, batches, expected)
        check_other_sizes(path, rng, source.info, batches)
        if expected is not None and rng.random() < 0.2:
            compression = rng.choice(list(COMPRESSIONS.values()))
            path.write_bytes(compression(raw))
            again = CaptureFile(str(path))
            found = list(_bounded(again, len(raw)))
            _check_content(again.info, found, expected)
            path.write_bytes(raw)
        return check_report(path, rng, batches)


def content_of(raw: bytes) -> Content:
    """Return what a plain reader finds in a file that is not compressed."""
    if raw[:4] in PCAP_ORDERS:
        return read_pcap(raw)
    if raw[:4] == SECTION_MAGIC:
        return read_pcapng(raw)
    return Content(readable=False)


def _bounded(source: CaptureFile, file_bytes: int | None) -> Iterator[PacketBatch]:
    """Pass on batches, each of which must bring frames, and no more of them than the bytes of the file can hold."""
    frames = 0
    for batch in source:
        assert len(batch), "an empty batch"
        assert int(batch.captured.min()) >= 0
        assert int(batch.offset.min()) >= 0
        # Rows near the end of a mapped file are not padded by the file itself, but never leave the buffer.
        assert int(batch.offset.max()) + PAD_BYTES <= len(batch.data)
        assert int((batch.offset + batch.captured).max()) <= len(batch.data)
        frames += len(batch)
        assert file_bytes is None or frames * SHORTEST_RECORD_BYTES <= file_bytes, "more frames than fit in the file"
        yield batch
    assert source.info.frames == frames


def _check_content(info: SourceInfo, batches: Sequence[PacketBatch], expected: Content) -> None:
    """Compare packets, drops, comments and the place of damage with what the plain reader finds."""
    assert expected.readable, "read, though it should be refused"
    assert [tuple(row) for row in _rows(batches)] == [
        (packet.ts_ns, packet.original, packet.link, packet.data) for packet in expected.packets
    ]
    assert (info.truncation.offset if info.truncation else None) == expected.cut
    assert bool(info.truncation and info.truncation.message.startswith("damaged")) == expected.damaged
    assert info.drops == expected.drops
    assert list(info.comments) == expected.comments


def _rows(batches: Sequence[PacketBatch]) -> Iterator[tuple[int, int, int, bytes]]:
    for batch in batches:
        columns = zip(batch.ts_ns.tolist(), batch.original.tolist(), batch.link.tolist(), strict=True)
        for row, (ts_ns, original, link) in enumerate(columns):
            yield ts_ns, original, link, batch.packet(row)


def check_other_sizes(path: Path, rng: random.Random, info: SourceInfo, batches: Sequence[PacketBatch]) -> None:
    """Read the file in another cut of the work: the same packets, the same to tell about it."""
    source = CaptureFile(
        str(path),
        sizes=ReadingSizes(
            rng.choice((1, 3, 50, 32_768)), rng.choice((17, 300, 5000, 1 << 20)), rng.choice((0, 1, 3, 40))
        ),
        small_file_bytes=rng.choice((0, 8 << 20)),
        chunk_bytes=rng.choice((16, 4096, 1 << 20)),
    )
    assert list(_rows(list(_bounded(source, None)))) == list(_rows(batches))
    assert _told(source.info) == _told(info)


def _told(info: SourceInfo) -> tuple[object, ...]:
    """What is told about a file, apart from the words about its damage: what is found first has a say in them."""
    offset = info.truncation.offset if info.truncation else None
    return info.format, info.bytes, info.frames, info.drops, info.comments, offset


def check_report(path: Path, rng: random.Random, batches: Sequence[PacketBatch]) -> Examined:
    source = CaptureFile(str(path))
    state = tracked(source)
    summary = summarize(state)
    document = report_document(summary, judge(state, source.infos, summary=summary), source.infos)
    capture = document["capture"]
    frames = sum(len(batch) for batch in batches)
    assert capture["telegrams"] + capture["other_frames"] == capture["frames"] == frames
    assert capture["sources"][0]["frames"] == frames
    _check_faces(document, rng)
    _check_packets(path, rng, capture["telegrams"] + capture.get("can_frames", 0))

    _check_ports(path, rng, frames)

    whole = document_of(tracked(batches))
    assert document_of(tracked(_cut(batches, rng))) == whole, "another cut into batches, another report"
    # The plain rules know no CAN.
    if frames <= ORACLE_FRAMES and "can_frames" not in capture:
        expected = [
            Frame(int(batch.ts_ns[row]), int(batch.link[row]), batch.packet(row), int(batch.original[row]))
            for batch in batches
            for row in range(len(batch))
        ]
        if not any(_beyond_limits(frame) for frame in expected):
            found = differences(reference_report(expected), whole)
            assert not found, "not as the rules say:\n" + "\n".join(found[:20])
    return Examined(
        True, frames, capture["telegrams"], len(document["lists"]), len(document["findings"]),
        source.info.truncation is not None,
    )  # fmt: skip


def _check_ports(path: Path, rng: random.Random, frames: int) -> None:
    """Read ports as telegrams, or not, by order: then payloads of any content and length are telegrams."""
    ports = PortRules(tuple(range(65_536)) if rng.random() < 0.5 else (53, 1300), rng.choice(((), (1202,))))
    capture = document_of(tracked(CaptureFile(str(path)), Reading(ports)))["capture"]
    assert capture["telegrams"] + capture["other_frames"] == capture["frames"] == frames
    shown = Shown(CaptureFile(str(path)), Reading(ports))
    lines = "".join(part for rows in shown for part in Text().render(rows))
    assert_printable(lines)
    assert lines.count("\n") == shown.counts[1] == capture["telegrams"] + capture.get("can_frames", 0)
    trees = Shown(CaptureFile(str(path)), Reading(ports), limit=5)
    assert_printable("".join(part for rows in trees for part in Text(trees=True, dumps=True).render(rows)))


# Where the protocol stands in the link layers that have VLAN tags, and where what follows it begins.
_TAGGED = {LinkType.ETHERNET: (12, 14), LinkType.LINUX_SLL: (14, 16), LinkType.LINUX_SLL2: (0, 20)}


def _beyond_limits(frame: Frame) -> bool:
    """Tell whether a frame has more VLAN tags than are looked at; the plain rules know no such limit."""
    if frame.link not in _TAGGED:
        return False
    protocol_at, at = _TAGGED[LinkType(frame.link)]
    tags = 0
    while int.from_bytes(frame.data[protocol_at : protocol_at + 2], "big") in VLAN_TYPES and tags <= MAX_VLAN_TAGS:
        protocol_at, at, tags = at + 2, at + 4, tags + 1
    return tags > MAX_VLAN_TAGS


def _cut(batches: Sequence[PacketBatch], rng: random.Random) -> Iterator[PacketBatch]:
    for batch in batches:
        count = min(rng.choice((1, 2, 7, 20)), len(batch))
        places = sorted(rng.sample(range(len(batch) + 1), count))
        for begin, end in zip([0, *places], [*places, len(batch)], strict=True):
            yield batch[begin:end]


def _check_faces(document: dict[str, object], rng: random.Random) -> None:
    for details in (False, True):
        width = rng.choice((1, 40, 80, 100, 300))
        plain = text.render(document, width=width, utc=rng.random() < 0.5, details=details)
        assert_printable(plain)
    assert_printable(markdown.render(document, utc=rng.random() < 0.5))
    shown = json_face.render(document)
    assert_printable(shown)
    assert json.loads(shown) == json.loads(json.dumps(document))


def _check_packets(path: Path, rng: random.Random, telegrams: int) -> None:
    """Show the telegrams in all forms, the long ones of the first only."""
    moment = rng.choice(_MOMENTS)
    lines = _shown(path, Text(moment=moment, width=rng.choice((None, 40, 90))))
    assert lines.count("\n") == telegrams
    _shown(path, Text(trees=True, dumps=rng.random() < 0.5, width=rng.choice((None, 40, 90))), 20)
    _shown(path, Text(dumps=True, moment=moment), 20)
    rows = [json.loads(line) for line in _shown(path, JsonLines(DEFAULT_FIELDS)).splitlines()]
    assert len(rows) == telegrams
    assert json.loads(_shown(path, JsonArray(DEFAULT_FIELDS), 20) or "[]") == rows[:20]
    _shown(path, Csv(DEFAULT_FIELDS), 20)


def _shown(path: Path, face: Text | JsonLines | JsonArray | Csv, limit: int | None = None) -> str:
    parts = [face.begin()]
    for rows in Shown(CaptureFile(str(path)), limit=limit):
        parts += face.render(rows)
    parts.append(face.end())
    shown = "".join(parts)
    assert_printable(shown)
    return shown


def assert_printable(shown: str) -> None:
    """Assert that a text has printable characters and line feeds only: nothing in it steers a terminal."""
    for line in shown.split("\n"):
        assert line.isprintable(), f"unprintable: {visible(line)[:300]}"
