"""What a capture has twice of the Parameter Manager: it was asked, written and answered once."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from tests.laws import crossed, every_other
from tests.oracle.builders import MILLISECOND, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.rules.parameter import READ, READ_REPLY, WRITE, WRITE_REPLY
from tests.packets import batch_of, cut, tracked
from tests.tracker.test_parameter import ASKED, ASKING, check, told, written

SECOND = 1000 * MILLISECOND


def said(
    service: int, at_ns: int, counter: int, data: bytes = b"", *, identification: int = 0, v6: bool = False
) -> Frame:  # fmt: skip
    """Return a request, or the reply to one."""
    ends = ("fd00::1", "fd00::2") if v6 else (ASKING, ASKED)
    source, destination = ends if service in (READ, WRITE) else ends[::-1]
    payload = telegram(service, 0x2000, 1, counter=counter, data=data)
    return data_frame(at_ns, source, destination, payload, identification=identification)


def written_each_second(*, identified: bool = True, v6: bool = False) -> list[Frame]:
    """Return ten writes, one a second, with their replies 5 ms later, and something behind them."""
    frames = []
    for number in range(10):
        own = {"identification": 100 + 2 * number if identified else 0, "v6": v6}
        frames += [
            said(WRITE, number * SECOND, number, bytes([number]), **own),
            said(WRITE_REPLY, number * SECOND + 5 * MILLISECOND, number, **own),
        ]
    return [*frames, data_frame(20 * SECOND, "10.0.0.9", "10.0.0.8", b"the end")]


def twice(frames: list[Frame], after_ns: int, which: slice) -> list[Frame]:
    """Return frames of which some come once more."""
    again = [one._replace(ts_ns=one.ts_ns + after_ns) for one in frames[:-1][which]]
    return sorted([*frames, *again], key=lambda one: one.ts_ns)


def outcome(frames: list[Frame]) -> tuple[dict[str, Any], list[tuple[Any, ...]], list[dict[str, Any]]]:
    """Return the row of the report, the findings, and the writes without their frames; as the rules say, in any cut."""
    state = tracked([batch_of(frames)])
    check(frames, state)
    for packets in every_other(1, 2, 3, 7):
        in_parts = tracked(cut(batch_of(frames), packets))
        assert (told(in_parts), written(in_parts)) == (told(state), written(state))
    (row,), findings = told(state)
    bare = [{key: value for key, value in one.items() if "frame" not in key} for one in written(state)]
    return row, findings, bare


@cache
def outcome_of_once(
    *, identified: bool = True, v6: bool = False
) -> tuple[dict[str, Any], list[tuple[Any, ...]], list[dict[str, Any]]]:
    return outcome(written_each_second(identified=identified, v6=v6))


ALL, REQUESTS, REPLIES = slice(None), slice(0, None, 2), slice(1, None, 2)


@pytest.mark.parametrize(
    ("which", "after_ns"), crossed([ALL, REQUESTS, REPLIES], [0, 20_000, 30 * MILLISECOND, 100 * MILLISECOND])
)
def test_what_a_mirror_port_shows_twice_is_counted_once(which: slice, after_ns: int) -> None:
    frames = written_each_second()
    row, findings, writes = outcome(twice(frames, after_ns, which))
    once, nothing, alike = outcome_of_once()
    assert (row | {"copies": 0}, findings, writes) == (once, nothing, alike)
    assert row["copies"] == len(frames[:-1][which])
    assert not findings
    assert [one["outcome"] for one in writes] == ["confirmed"] * 10


@pytest.mark.parametrize("v6", [False, True])
@pytest.mark.parametrize("which", [ALL, REQUESTS, REPLIES])
def test_so_it_is_where_packets_are_not_identified_if_it_comes_at_once(which: slice, v6: bool) -> None:
    frames = written_each_second(identified=False, v6=v6)
    row, findings, writes = outcome(twice(frames, 500_000, which))
    assert (row | {"copies": 0}, findings, writes) == outcome_of_once(identified=False, v6=v6)
    assert outcome(twice(frames, 500_001, which))[0]["copies"] == 0


def test_who_asks_again_sends_another_packet() -> None:
    frames = [
        said(READ, 0, 1, identification=7), said(READ, 50 * MILLISECOND, 1, identification=8),
        said(READ_REPLY, 60 * MILLISECOND, 1, b"\1\0", identification=3),
    ]  # fmt: skip
    row, _, _ = outcome(frames)
    assert (row["requests"], row["retransmissions"], row["copies"]) == (1, 1, 0)


def test_an_identification_that_stays_hides_nothing_that_differs() -> None:
    """Some small stacks number no packets, and some programs no requests."""
    frames = []
    for number in range(20):
        at_ns = number * 40 * MILLISECOND
        frames.append(said(WRITE, at_ns, 1, bytes([number]), identification=9))
        frames.append(said(WRITE_REPLY, at_ns + MILLISECOND, 1, identification=0))
    row, findings, writes = outcome(frames)
    assert (row["requests"], row["replies"], row["copies"]) == (20, 20, 0)
    assert [one["new"]["data"] for one in writes] == [bytes([number]) for number in range(20)]
    assert not findings
