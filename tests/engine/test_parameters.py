"""Telegrams of the Parameter Manager reach observers with both nodes, and belong to no list."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dissectors import address
from nvscope.engine.dealing import SplitBy, deal
from nvscope.engine.keys import NOBODY
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Recogniser
from nvscope.engine.told import Told
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame, peel
from tests.oracle.rules.telegram import PARAMETER_SERVICES
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of, cut

Row = tuple[int, int, int, int, int, str, str]


def told_of(told: Told) -> list[Row]:
    """Return frame, service, Index, SubIndex, Counter, sender and receiver ("" for everybody) of each."""
    rows, varieties, nodes = told.laid.parameters, told.varieties, told.keys.nodes

    def name(node: int) -> str:
        return "" if node == NOBODY else address.text(int(nodes.high[node]), int(nodes.low[node]))

    return [
        (
            packet + told.first_frame, int(varieties.telegrams.header["id"][varieties.part[variety]]),
            int(varieties.carried.identifier[variety]), int(varieties.carried.subindex[variety]), counter,
            name(sender), name(receiver),
        )
        for packet, variety, counter, sender, receiver in zip(
            *(column.tolist() for column in (rows.packet, rows.variety, rows.counter, rows.sender, rows.receiver)),
            strict=True,
        )
    ]  # fmt: skip


def expected(frames: list[Frame]) -> list[Row]:
    """Return the same, read from the frames one by one."""
    found = []
    for number, frame in enumerate(frames, 1):
        content = peel(frame)
        data = getattr(content, "payload", b"")
        if len(data) < 12 or data[:4] not in (b"\x00-S3", b"0-S3"):
            continue
        service, index, subindex = (int.from_bytes(data[at:to], "little") for at, to in ((4, 8), (8, 10), (10, 12)))
        if service in PARAMETER_SERVICES:
            counter = int.from_bytes(data[16:18], "little") if len(data) >= 20 else None
            receiver = "" if content.broadcast else str(content.destination)
            found.append((number, service, index, subindex, counter, str(content.source), receiver))
    return found


@examples(40)
@given(seed=st.integers(0, 10_000), packets=st.integers(1, 200))
def test_they_are_those_that_the_bytes_say(seed: int, packets: int) -> None:
    frames = generate(seed, frames=200)
    if seed % 2:
        frames = mutate(seed, frames)
    recogniser = Recogniser(Reading())
    found = [
        row for batch in cut(batch_of(frames), packets) for told in recogniser.tell(batch) for row in told_of(told)
    ]
    wanted = expected(frames)
    assert [row[:4] + row[5:] for row in found] == [row[:4] + row[5:] for row in wanted]
    assert all(row[4] == want[4] for row, want in zip(found, wanted, strict=True) if want[4] is not None)


def test_request_and_reply() -> None:
    asking, asked = "10.0.0.1", "10.0.0.2"
    frames = [
        data_frame(0, asking, asked, telegram(1, 0x2000, 5, counter=9, items=1, data=b"")),
        data_frame(1, asked, asking, telegram(2, 0x2000, 5, counter=9, data=b"\x2a\x00")),
        data_frame(2, asking, "10.0.0.255", telegram(3, 0x2001, 0, counter=10)),
        data_frame(3, asked, asking, telegram(23, 0x2001, 0, counter=10, data=b"")),
        data_frame(4, asked, asking, telegram(100, 0x2001, 0, counter=10, data=b"")),
        data_frame(5, asked, asking, telegram(0, 7)),
    ]
    (told,) = Recogniser(Reading()).tell(batch_of(frames))
    assert told_of(told) == [
        (1, 1, 0x2000, 5, 9, asking, asked),
        (2, 2, 0x2000, 5, 9, asked, asking),
        (3, 3, 0x2001, 0, 10, asking, ""),
        (4, 23, 0x2001, 0, 10, asked, asking),
        (5, 100, 0x2001, 0, 10, asked, asking),
    ]
    assert len(told.keys.lists) == 1
    data = told.varieties.carried.take(told.laid.parameters.variety)
    at = told.packets.offset[1] + data.at[1]
    assert told.packets.data[at : at + data.size_bytes[1]].tobytes() == b"\x2a\x00"


@examples(20)
@given(seed=st.integers(0, 10_000), parts=st.integers(1, 4))
def test_each_is_dealt_to_one_part(seed: int, parts: int) -> None:
    frames = generate(seed, frames=200)
    for told in Recogniser(Reading()).tell(batch_of(frames)):
        for by in (SplitBy.SENDER, SplitBy.LIST):
            dealt = [row for _, own in deal(told, by, parts) for row in told_of(own)]
            assert sorted(dealt) == told_of(told)


def test_of_further_pairs_requests_and_replies_are_left_out_together() -> None:
    """One without the other would look as if nobody had answered, or asked."""
    frames = [
        data_frame(number, source, destination, telegram(service, counter=number))
        for number, (source, destination, service) in enumerate([
            ("10.0.0.1", "10.0.0.9", 1), ("10.0.0.2", "10.0.0.9", 1), ("10.0.0.3", "10.0.0.9", 1),
            ("10.0.0.9", "10.0.0.3", 2), ("10.0.0.9", "10.0.0.2", 2), ("10.0.0.9", "10.0.0.1", 2),
        ])
    ]  # fmt: skip
    for size in (1, 6):
        recogniser = Recogniser(Reading(max_streams=2))
        batches = cut(batch_of(frames), size)
        told = [row[0] for batch in batches for told in recogniser.tell(batch) for row in told_of(told)]
        assert told == [1, 2, 5, 6]
