from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dissectors import address
from dissectors.batch import PacketBatch
from dissectors.netvar import HEADER, PortRules
from nvscope.engine.reading import Reading
from nvscope.errors import UsageError
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, FieldType, TextColumn
from nvscope.view.fields.frame import DEFAULT_FIELDS, FIELDS, output_field
from nvscope.view.rows.frames import FrameRows
from tests.laws import examples
from tests.oracle.builders import LINKS
from tests.oracle.frame import Datagram, Frame, peel
from tests.oracle.traffic import generate, mutate
from tests.packets import Batches, Shown, batch_of

IDENTITIES = (b"\x00-S3", b"0-S3")


def rows_of(frames: list[Frame]) -> list[FrameRows]:
    return list(Shown(Batches([batch_of(frames)])))


def is_can(frame: Frame) -> bool:
    """Return whether a cooked header (SLL, SLL2) says that a frame of CAN, CAN FD or CAN XL follows."""
    at = {113: 14, 276: 0}.get(frame.link)
    return at is not None and frame.data[at : at + 2] in (b"\0\x0c", b"\0\x0d", b"\0\x0e")


def values(name: str, rows: FrameRows) -> list[object]:
    """The values of a field as Python objects, None where it does not exist."""
    entry = FIELDS[name]
    column, known = entry.column(rows), entry.exists(rows)
    found: list[object]
    if isinstance(column, AddressColumn):
        found = [address.text(*pair) for pair in zip(column.high.tolist(), column.low.tolist(), strict=True)]
    elif isinstance(column, BytesColumn):
        found = [column.data[start:stop].tobytes() for start, stop in zip(column.start, column.stop, strict=True)]
    elif isinstance(column, TextColumn):
        found = [column.texts[code] for code in column.code]
    else:
        found = column.tolist()
    return found if known is None else [value if there else None for value, there in zip(found, known, strict=True)]


def test_every_field_and_bit_of_the_header_is_a_field_with_the_words_of_the_table() -> None:
    for entry in HEADER:
        assert (FIELDS[f"nv.{entry.name}"].label, FIELDS[f"nv.{entry.name}"].help) == (entry.label, entry.help)
        for bit in entry.bits:
            assert FIELDS[f"nv.{entry.name}.{bit.name}"].label == bit.label
            assert FIELDS[f"nv.{entry.name}.{bit.name}"].type is FieldType.BOOL
    assert {entry.name for entry in DEFAULT_FIELDS} >= {name for name in FIELDS if name.startswith("nv.")}


@pytest.mark.parametrize("link", LINKS)
def test_columns_have_the_shape_of_their_type(link: int) -> None:
    (rows,) = rows_of(generate(5, frames=300, link=link))
    count = len(rows)
    assert count
    for entry in FIELDS.values():
        column, known = entry.column(rows), entry.exists(rows)
        assert known is None or (known.shape == (count,) and known.dtype == np.bool_)
        if entry.type is FieldType.ADDRESS:
            assert isinstance(column, AddressColumn)
            assert column.high.shape == column.low.shape == (count,)
            assert column.high.dtype == column.low.dtype == np.uint64
        elif entry.type is FieldType.BYTES:
            assert isinstance(column, BytesColumn)
            assert (column.start <= column.stop).all()
            assert column.start.shape == (count,)
        elif entry.type is FieldType.TEXT:
            assert isinstance(column, TextColumn)
            assert column.code.shape == (count,)
            assert len(column.texts) > int(column.code.max())
        else:
            assert isinstance(column, np.ndarray)
            assert column.shape == (count,)
            assert column.dtype.kind in {FieldType.BOOL: "b", FieldType.UNSIGNED: "ui"}.get(entry.type, "i")
            assert entry.type is not FieldType.UNSIGNED or int(column.min()) >= 0


@given(st.integers(0, 10_000), st.sampled_from([*LINKS, None]), st.booleans())
@example(49, 113, True)
@examples(30)
def test_values_are_what_the_bytes_say(seed: int, link: int | None, broken: bool) -> None:
    frames = generate(seed, frames=120, link=link)
    # a flipped bit can make a frame of CAN of one that a cooked capture calls IP: no matter of the UDP oracle
    frames = [frame for frame in (mutate(seed, frames) if broken else frames) if not is_can(frame)]
    expected = []
    for number, frame in enumerate(frames, 1):
        datagram = peel(frame)
        if isinstance(datagram, Datagram) and len(datagram.payload) >= 12 and datagram.payload[:4] in IDENTITIES:
            expected.append((number, frame, datagram))
    found: dict[str, list[object]] = {name: [] for name in FIELDS}
    for rows in rows_of(frames):
        for name in FIELDS:
            found[name] += values(name, rows)
    assert found["frame.number"] == [number for number, _, _ in expected]
    assert found["frame.time"] == found["frame.time_epoch"] == [frame.ts_ns for _, frame, _ in expected]
    assert found["frame.time_relative"] == [frame.ts_ns - frames[0].ts_ns for _, frame, _ in expected]
    assert found["frame.time_delta"] == [
        frame.ts_ns - frames[max(number - 2, 0)].ts_ns for number, frame, _ in expected
    ]
    times = [frame.ts_ns for _, frame, _ in expected]
    assert found["frame.time_delta_displayed"] == [time - times[max(at - 1, 0)] for at, time in enumerate(times)]
    assert found["frame.len"] == [frame.original for _, frame, _ in expected]
    assert found["frame.cap_len"] == [len(frame.data) for _, frame, _ in expected]
    assert found["ip.src"] == [str(datagram.source) for _, _, datagram in expected]
    assert found["ip.dst"] == [str(datagram.destination) for _, _, datagram in expected]
    assert found["ip.version"] == [datagram.source.version for _, _, datagram in expected]
    assert found["udp.dstport"] == [datagram.port for _, _, datagram in expected]
    assert found["udp.length"] == [datagram.length + 8 for _, _, datagram in expected]
    assert found["udp.payload"] == [datagram.payload for _, _, datagram in expected]
    assert found["nv.broadcast"] == [datagram.broadcast for _, _, datagram in expected]
    assert found["nv.truncated"] == [len(datagram.payload) < datagram.length for _, _, datagram in expected]
    assert found["nv.data"] == [
        datagram.payload[20:] if len(datagram.payload) >= 20 else None for _, _, datagram in expected
    ]
    for name, begin, end in (
        ("identity", 0, 4), ("id", 4, 8), ("index", 8, 10), ("subindex", 10, 12), ("items", 12, 14),
        ("length", 14, 16), ("counter", 16, 18), ("flags", 18, 19), ("checksum", 19, 20),
    ):  # fmt: skip
        assert found[f"nv.{name}"] == [
            int.from_bytes(datagram.payload[begin:end], "little") if len(datagram.payload) >= end else None
            for _, _, datagram in expected
        ]
    for name, mask in (("ack", 1), ("checksum", 2), ("invalid", 4)):
        assert found[f"nv.flags.{name}"] == [
            bool(datagram.payload[18] & mask) if len(datagram.payload) >= 19 else None for _, _, datagram in expected
        ]


def test_services_and_faults_have_names() -> None:
    named: set[tuple[object, object]] = set()
    faults: set[object] = set()
    for seed in range(12):
        for rows in rows_of(mutate(seed, generate(seed, frames=300))):
            named |= set(zip(values("nv.id", rows), values("nv.service", rows), strict=True))
            faults |= set(values("nv.fault", rows))
    assert (0, "ODStateFree") in named
    assert (5, "ODAcknowledgement") in named
    assert all((name is None) == (number not in HEADER["id"].values) for number, name in named)
    assert faults == {None, "header-cut", "short", "length", "byte-swapped", "service"}


def test_ports_decided_by_hand() -> None:
    frames = generate(1, frames=100)
    without = Shown(Batches([batch_of(frames)]), Reading(PortRules(others=tuple(range(65536)))))
    assert list(without) == []
    assert without.counts == (100, 0, 0)


@given(st.integers(1, 90), st.lists(st.integers(0, 100), max_size=5))
@examples(30)
def test_a_limit_stops_reading(limit: int, cuts: list[int]) -> None:
    whole = batch_of(generate(3, frames=100))
    edges = [0, *sorted(cuts), 100]
    read: list[int] = []

    def batches() -> Iterator[PacketBatch]:
        for start, stop in pairwise(edges):
            read.append(stop)
            yield whole[start:stop]

    # An iterator, to see how far it is read.
    numbers = [number for rows in Shown(Batches(batches()), limit=limit) for number in values("frame.number", rows)]
    everything = [number for rows in Shown(Batches([whole])) for number in values("frame.number", rows)]
    assert numbers == everything[:limit]
    if len(everything) >= limit:
        assert read[-1] == next(stop for stop in edges[1:] if stop >= everything[limit - 1])  # type: ignore[operator]


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("nv.countr", "nv.counter"),
        ("index", "nv.index"),
        ("NV.INDX", "nv.index"),
        ("ip.source", "ip.src"),
        ("zz", "`nvscope keys --fields` lists them"),
    ],
)
def test_an_unknown_field_names_the_nearest(name: str, near: str) -> None:
    with pytest.raises(UsageError) as caught:
        output_field(name)
    assert near in caught.value.next_step


def test_a_field_is_found_in_any_case() -> None:
    assert output_field(" NV.Counter ") is FIELDS["nv.counter"]
