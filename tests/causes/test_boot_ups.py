"""Nodes that start anew and ask for lists: what they asked for decides where half of their streams begin anew."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.causes.plants import causes_in
from tests.oracle.builders import BOOT_UP_REQUEST, data_frame, telegram
from tests.oracle.frame import Frame

MS, SECOND = 1_000_000, 1_000_000_000
PRESS, SAW, ALL = "10.0.0.1", "10.0.0.2", "255.255.255.255"


def sent(source: str, number: int, counters: list[int], phase_ms: int) -> list[Frame]:
    return [
        data_frame(
            (at * 100 + phase_ms) * MS, source, ALL,
            telegram(list_id=number, counter=counter, data=bytes([at % 256, at // 256])),
        )
        for at, counter in enumerate(counters)
    ]  # fmt: skip


def plant(anew: list[int], others: list[int]) -> list[Frame]:
    """Return a press with two lists and a saw with one, which go on for 40 s."""
    return [*sent(PRESS, 1, anew, 0), *sent(PRESS, 2, others, 20), *sent(SAW, 7, list(range(500, 900)), 50)]


GOES_ON, ANEW = list(range(100, 500)), [*range(100, 300), *range(1, 201)]
ASKS = data_frame(20 * SECOND + 46 * MS, PRESS, ALL, telegram(BOOT_UP_REQUEST, list_id=7, counter=0, data=b""))


def told(frames: list[Frame], directory: Path) -> list[tuple[str, ...]]:
    return [(cause.kind.name, cause.title, *cause.checked) for cause in causes_in(frames, directory)]


def test_who_asks_for_lists_starts_anew_with_half_of_its_streams(tmp_path: Path) -> None:
    assert told([*plant(ANEW, GOES_ON), ASKS], tmp_path) == [
        ("node-restart", "Node 10.0.0.1 started anew at 20.0 s",
         "the counter of list 1 began anew: 1 of its 2 streams that go on",
         "it asked for list 7 at 20.0 s, answered in 4.0 ms", "without a pause"),
    ]  # fmt: skip


def test_without_a_request_it_is_the_list(tmp_path: Path) -> None:
    ((kind, *_),) = told(plant(ANEW, GOES_ON), tmp_path)
    assert kind == "list-restarted"


@pytest.mark.parametrize("list_id", [7, 9])
def test_of_a_node_that_starts_anew_it_is_said_what_it_asked_for(list_id: int, tmp_path: Path) -> None:
    asks = data_frame(20 * SECOND + 46 * MS, PRESS, ALL, telegram(BOOT_UP_REQUEST, list_id=list_id, data=b""))
    (cause, *_) = (one for one in told([*plant(ANEW, ANEW), asks], tmp_path) if one[0] == "node-restart")
    expected = "answered in 4.0 ms" if list_id == 7 else "and nobody answered"
    assert f"it asked for list {list_id} at 20.0 s, {expected}" in cause


def test_a_request_at_another_time_shows_nothing(tmp_path: Path) -> None:
    earlier = ASKS._replace(ts_ns=5 * SECOND)
    ((kind, *_),) = told([*plant(ANEW, GOES_ON), earlier], tmp_path)
    assert kind == "list-restarted"
