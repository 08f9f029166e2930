"""TCP connections put in order, against the rules written byte by byte."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nvscope.tracker.streams
from dissectors import address
from dissectors.batch import PacketBatch
from dissectors.claims import Claims
from dissectors.link import peel
from nvscope.tracker.pieces import BROKEN_OFF, BY_CLIENT, ORDER_BITS, REPLACED, PieceKind
from nvscope.tracker.streams import ENOUGH, Streams
from tests.laws import crossed, examples, some
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.capture_faults import Faults, captured
from tests.oracle.frame import Frame
from tests.oracle.rules.streams import Delivery, Others
from tests.oracle.rules.streams import Streams as Rules
from tests.oracle.tcp import ACK, FIN, RST, SYN, peel_tcp
from tests.oracle.tcp_line import Line, tcp_frame
from tests.oracle.visu_traffic import initial, visu_traffic
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
            if isinstance(event, Others):
                continue
            (client, port), (server, server_port) = event.connection.client, event.connection.server
            where = str(client), port, str(server), server_port, event.from_client
            if not isinstance(event, Delivery):
                how = event.reset * BROKEN_OFF | event.by_client * BY_CLIENT | event.replaced * REPLACED
                found[where].append(("E", how, number))
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


@examples(60)
@given(seed=st.integers(0, 20_000), packets=st.sampled_from([60, 250, 1000]), limit=st.sampled_from([0, 1 << 26]))
def test_long_connections_are_put_in_order_at_once_as_they_are_in_turn(seed: int, packets: int, limit: int) -> None:
    batches = cut(batch_of(long_talks(seed)), packets)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(nvscope.tracker.streams, "_FEW", 1 << 40)
        in_turn = delivered(batches)
        patched.setattr(nvscope.tracker.streams, "_FEW", 16)
        # Below that, it does not matter in which order the segments of several connections are taken.
        patched.setattr(nvscope.tracker.streams, "MOST_KEPT_IN_ALL_BYTES", limit)
        assert delivered(batches) == in_turn


def long_talks(seed: int) -> list[Frame]:
    """Return the frames of some connections over which much is said, a part of which is missing, twice, late or cut."""
    rng = random.Random(seed)
    frames: list[Frame] = []
    for number in range(rng.randint(1, 4)):
        # The second one is between the same ends as the first.
        line = Line(
            ("10.0.0.1", 50_000 + number // 2), isn=(initial(rng), initial(rng)), now=number * rng.randrange(SECOND)
        )
        faults = Faults.drawn(rng)
        if rng.random() < 0.7:
            line.open()
        for _ in range(rng.choice((1, 40, 200))):
            for from_client, most in ((True, 3), (False, rng.choice((1, 3)))):
                for _ in range(rng.randint(0, most)):
                    data = rng.randbytes(rng.choice((1, 40, 1400)))
                    if rng.random() < faults.stray:
                        line.segment(
                            from_client, data, seq=line.sent[from_client] + rng.choice((-900, 900, 2**30 + 1, 2**31))
                        )
                    line.say(from_client, data)
            line.wait(rng.choice((0, MILLISECOND, SECOND if rng.random() < 0.05 else 0)))
        for from_client in rng.choice(((), (True,), (True, False), (False, True))):
            line.close(from_client)
        if rng.random() < 0.2:
            line.wait(rng.choice((1, 300)) * SECOND).segment(rng.random() < 0.5, b"late", seq=line.sent[True] - 5)
        if rng.random() < 0.2:
            line.reset(rng.random() < 0.5)
        frames += captured(rng, faults, line)
    return sorted(frames, key=lambda frame: frame.ts_ns)


ENDS = {"open": Line.segment, "closed": Line.close, "reset": Line.reset}


@pytest.mark.parametrize(
    ("end", "apart", "packets"),
    crossed(list(ENDS), [(2**31, 2**31), (-(2**29), 2**29), (2**29, -(2**21)), (2**30 + 900, 0)], [1, 3, 1000]),
)
def test_where_both_ends_speak_of_another_connection_it_has_begun(
    end: str, apart: tuple[int, int], packets: int
) -> None:
    line = Line().open().ask(b"ask").answer(b"answer")
    ENDS[end](line, True)
    ENDS[end](line, False)
    garbage = line.segment(False, b"x", seq=line.sent[False] + 2**31).segment(True, b"y", seq=line.sent[True] + 2**31)
    isn = [(one + by) % 2**32 for one, by in zip((1000, 5000), apart, strict=True)]
    other = Line(isn=(isn[0], isn[1]), now=garbage.now).ask(b"one").ask(b"two").segment(False).answer(b"reply")
    more = other.ask(b"three").answer(b"reply too")
    frames = [*(frame for port in range(50_001, 50_060) for frame in opened_and_closed(port)), *line.frames]
    frames += more.frames
    found = delivered(cut(batch_of(frames), packets))
    assert found == by_the_rules(frames)
    asked = b"".join(one[1] for one in found["10.0.0.1", 50_000, "10.0.0.5", 80, True] if isinstance(one[1], bytes))
    assert asked == b"askonetwothree"


@pytest.mark.parametrize(("data", "flags"), [(b"x", ACK), (b"", FIN | ACK)])
@pytest.mark.parametrize("count", [256, 257])
def test_no_more_than_some_segments_are_kept_aside_however_short(data: bytes, flags: int, count: int) -> None:
    line = Line().open().ask(b"ask").answer(b"answer")
    far, told = line.sent[True] + 2**31, line.sent[False] + 2**31
    for number in range(count):
        line.segment(True, data, flags, seq=far + number * len(data), ack=told)
    line.segment(False, b"answer", seq=told, ack=far + len(data) * count + (not data))
    frames = [*(frame for port in range(50_001, 50_060) for frame in opened_and_closed(port)), *line.frames]
    found = delivered(cut(batch_of(frames), 100))
    assert found == by_the_rules(frames)
    said = b"".join(one[1] for one in found["10.0.0.1", 50_000, "10.0.0.5", 80, True] if isinstance(one[1], bytes))
    assert said == b"ask" + data * (count if count == 256 else 1)


@pytest.mark.parametrize("packets", [1, 3, 1000])
def test_a_connection_that_goes_on_is_no_other_one_whatever_strays(packets: int) -> None:
    line = Line().open().ask(b"ask").answer(b"answer")
    far, told = line.sent[True] + 2**31, line.sent[False] + 2**31
    line.segment(True, b"stray", seq=far).segment(True, b"stray", seq=far + 5, ack=told)
    line.segment(False, b"stray too", seq=told + 1, ack=far + 10)  # not where the other one acknowledges
    line.segment(True, b"stray", seq=far, ack=told).ask(b"more")
    line.segment(False, b"late", seq=told, ack=far + 5).answer(b"answer")
    frames = [*(frame for port in range(50_001, 50_060) for frame in opened_and_closed(port)), *line.frames]
    found = delivered(cut(batch_of(frames), packets))
    assert found == by_the_rules(frames)
    assert [[one[1] for one in found["10.0.0.1", 50_000, "10.0.0.5", 80, by]] for by in (True, False)] == [
        [b"ask", b"more"], [b"answer", b"answer"],
    ]  # fmt: skip


@pytest.mark.parametrize("packets", [1, 2, 1000])
def test_what_comes_long_after_the_end_begins_anew(packets: int) -> None:
    line = Line().open().ask(b"ask").answer(b"answer").close(True).close(False)
    line.wait(300 * SECOND).segment(False, b"answer", seq=line.sent[False] - 7)
    frames = [*(frame for port in range(50_001, 50_060) for frame in opened_and_closed(port)), *line.frames]
    found = delivered(cut(batch_of(frames), packets))
    assert found == by_the_rules(frames)
    assert [one for one in found["10.0.0.1", 50_000, "10.0.0.5", 80, False] if one[0] == "D"] == [
        ("D", b"answer", len(frames) - 3), ("D", b"answer", len(frames)),
    ]  # fmt: skip


def opened_and_closed(port: int) -> list[Frame]:
    """Return the frames of a connection over which nothing is said."""
    return Line(("10.0.0.1", port)).open().close(True).close(False).frames


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
