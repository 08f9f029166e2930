"""TCP connections put in order, against the rules written byte by byte."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors import address
from dissectors.batch import PacketBatch
from dissectors.claims import Claims
from dissectors.link import peel
from nvscope.tracker.pieces import ORDER_BITS, PieceKind
from nvscope.tracker.streams import ENOUGH, Streams
from tests.laws import examples, some
from tests.oracle.frame import Frame
from tests.oracle.rules.streams import Delivery
from tests.oracle.rules.streams import Streams as Rules
from tests.oracle.tcp import ACK, RST, SYN, peel_tcp
from tests.oracle.tcp_line import Line, tcp_frame
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut

PORTS = (80, 8080)
Where = tuple[str, int, str, int, bool]
"""Client and its port, server and its port, and whether the client speaks."""

What = tuple[str, bytes | int, int]
"""D and bytes, H and how many are missing, E and whether it was broken off; and the frame."""


def delivered(batches: Iterable[PacketBatch], enough: int = ENOUGH) -> dict[Where, list[What]]:
    """Return what the product brings of each direction; it may forget what has ended of more than ``enough``."""
    streams, first_frame = Streams(PORTS, enough), 1
    found: dict[Where, list[What]] = defaultdict(list)
    for packets in batches:
        batch = packets.with_margin()
        brought = streams.observe(batch, peel(batch, claims=Claims(tcp=PORTS)).tcp, first_frame)
        pieces = brought.pieces
        ends = streams.connections.ends_of(pieces.stream >> 1)
        for row, (stream, kind, start, size, order) in enumerate(
            zip(*(getattr(pieces, name).tolist() for name in ("stream", "kind", "start", "size", "order")), strict=True)
        ):
            client, server = (address.text(int(high[row]), int(low[row])) for high, low in (ends.client, ends.server))
            where = client, int(ends.client_port[row]), server, int(ends.server_port[row]), not stream & 1
            frame = order >> ORDER_BITS
            if kind == PieceKind.DATA:
                data = batch.data[start : start + size].tobytes() if start >= 0 else brought.kept[~start]
                found[where].append(("D", data, frame))
            elif kind == PieceKind.HOLE:
                found[where].append(("H", size, frame))
            elif kind == PieceKind.END:
                found[where].append(("E", size, frame))
        first_frame += len(packets)
        streams.outlived()
    return joined(found)


def by_the_rules(frames: Sequence[Frame]) -> dict[Where, list[What]]:
    """Return the same by the rules."""
    rules = Rules(PORTS)
    found: dict[Where, list[What]] = defaultdict(list)
    for number, frame in enumerate(frames, 1):
        for event in rules.observe(number, frame):
            (client, port), (server, server_port) = event.connection.client, event.connection.server
            where = str(client), port, str(server), server_port, event.from_client
            if not isinstance(event, Delivery):
                found[where].append(("E", int(event.reset), number))
            elif event.missing:
                found[where].append(("H", event.missing, number))
            else:
                found[where].append(("D", event.data, number))
    return joined(found)


def joined(found: dict[Where, list[What]]) -> dict[Where, list[What]]:
    """Return the same, with what a frame brings of one kind in one piece."""
    return {where: list(_joined(pieces)) for where, pieces in found.items()}


def _joined(pieces: list[What]) -> Iterator[What]:
    for (kind, frame), group in groupby(pieces, key=lambda one: (one[0], one[2])):
        contents = [content for _, content, _ in group]
        if kind == "E":
            yield from (("E", content, frame) for content in contents)
            continue
        whole = contents[0]
        for content in contents[1:]:
            whole += content  # type: ignore[operator]
        yield kind, whole, frame


@pytest.mark.parametrize("seed", some(range(120)))
def test_each_byte_is_in_its_place(seed: int) -> None:
    frames = visu_traffic(seed)
    assert delivered([batch_of(frames)]) == by_the_rules(frames)


@examples(60)
@given(seed=st.integers(0, 20_000), packets=st.integers(1, 200))
def test_so_it_is_however_a_capture_is_cut(seed: int, packets: int) -> None:
    frames = visu_traffic(seed)
    assert delivered(cut(batch_of(frames), packets)) == by_the_rules(frames)


@examples(60)
@given(seed=st.integers(0, 20_000), packets=st.integers(1, 200), pause_s=st.sampled_from([1, 100, 300]))
def test_what_is_forgotten_would_not_have_been_asked_for(seed: int, packets: int, pause_s: int) -> None:
    # Whose ports are both claimed may be the server, or not, once it is forgotten who was.
    once = [frame for frame in visu_traffic(seed) if not _may_both_serve(frame)]
    later = pause_s * 10**9 + max(frame.ts_ns for frame in once) - min(frame.ts_ns for frame in once)
    twice = [*once, *(frame._replace(ts_ns=frame.ts_ns + later) for frame in once)]
    assert delivered(cut(batch_of(twice), packets), enough=0) == by_the_rules(twice)


@pytest.mark.parametrize("packets", [1, 2, 1000])
def test_what_was_reset_before_anything_came_is_asked_for_again(packets: int) -> None:
    refused, stale = (
        Line(("10.0.0.1", port)).segment(True, flags=SYN, seq=1000, ack=0) for port in (50_000, 50_001)
    )  # fmt: skip
    refused.segment(False, flags=RST | ACK, seq=0, ack=1001)
    # The server remembers an older connection between the same ends, and the client takes that away.
    stale.segment(False, seq=77, ack=2**31).segment(True, flags=RST, seq=2**31, ack=0)
    frames = [frame for line in (refused, stale) for frame in line.open().ask(b"ask").answer(b"answer").frames]
    found = delivered(cut(batch_of(frames), packets))
    assert found == by_the_rules(frames)
    assert [pieces[-1][1] for pieces in found.values()] == [b"ask", b"answer"] * 2


def _may_both_serve(frame: Frame) -> bool:
    segment = peel_tcp(frame)
    return segment is not None and {segment.source_port, segment.destination_port} <= set(PORTS)


def opened(port: int, second: int) -> Frame:
    """Return the first data of a connection that a client opens from a port."""
    return tcp_frame(second * 10**9, ("10.0.0.1", port), ("10.0.0.5", 80), seq=second // 3, data=b"x")


def test_of_too_many_connections_those_that_are_silent_for_longest_are_forgotten() -> None:
    frames = [opened(port, second) for second, port in enumerate([50000, 50001, 50002, 50000, 50003])]
    streams = Streams(PORTS, enough=0, most=2)
    batch = batch_of(frames).with_margin()
    streams.observe(batch, peel(batch, claims=Claims(tcp=PORTS)).tcp, 1)
    outlived = streams.outlived()
    assert outlived is not None
    assert (outlived.kept.tolist(), outlived.only_ended) == ([0, 3], False)
    assert streams.connections.ends_of(np.arange(2)).client_port.tolist() == [50000, 50003]
