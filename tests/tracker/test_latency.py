"""How long acknowledgements took: against a reference that follows each wait by itself, whatever the cut."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.tracker.figures import LATENCIES, Of
from nvscope.tracker.subjects import subjects
from nvscope.tracker.summary import Summary, summarize
from tests.laws import examples
from tests.oracle.builders import ACKNOWLEDGEMENT, MILLISECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.reference import reference_report
from tests.oracle.traffic import generate
from tests.packets import batch_of, cut, tracked

PRESS, HMI, PANEL, ALL = "10.0.0.1", "10.0.0.2", "10.0.0.3", "255.255.255.255"
WANTS = 1
ROOM = 0.01


def told(batches: Sequence[PacketBatch], of: Of) -> dict[tuple[Any, ...], list[Any]]:
    """Return count, p50, p99 and most of all that have some, by list, node and SubIndex."""
    return told_in(summarize(tracked(batches)), of)


def told_in(summary: Summary, of: Of) -> dict[tuple[Any, ...], list[Any]]:
    """Return the same of what is summed up already."""
    keys = {entry.number: str(entry.key) for entry in summary.lists}
    found = {}
    for one in subjects(summary):
        if one.of is of and one.measured.latency is not None and one.measured.latency.count:
            assert one.list is not None
            node = None if one.node is None else summary.addresses[one.node]
            found[keys[one.list], node, one.subindex] = [figure.read(one.measured) for figure in LATENCIES]
    return found


def expected(took_ns: list[int]) -> list[Any]:
    ordered = sorted(took_ns)
    percentiles = [ordered[-(-percent * len(ordered) // 100) - 1] for percent in (50, 99)]
    return [len(ordered), *(pytest.approx(one, rel=ROOM, abs=1) for one in percentiles), ordered[-1]]


@given(st.integers(0, 10_000), st.sampled_from([1, 13, 1000]))
@examples(15)
def test_what_acknowledgements_took_is_what_each_wait_took(seed: int, packets: int) -> None:
    frames = generate(seed, frames=random.Random(seed).choice([60, 400]), link=None)
    streams: dict[tuple[Any, ...], list[int]] = {}
    for entry in reference_report(frames)["lists"]:
        for stream in entry["streams"]:
            if stream["_latencies_ns"]:
                streams[entry["key"], stream["node"], stream["subindex"]] = stream["_latencies_ns"]
    summary = summarize(tracked(cut(batch_of(frames), packets)))
    for of, parts in ((Of.STREAM, (0, 1, 2)), (Of.NODE, (0, 1)), (Of.LIST, (0,))):
        together: dict[tuple[Any, ...], list[int]] = {}
        for key, took_ns in streams.items():
            named = tuple(part if place in parts else None for place, part in enumerate(key))
            together.setdefault(named, []).extend(took_ns)
        assert told_in(summary, of) == {key: expected(took_ns) for key, took_ns in together.items()}


def test_the_traffic_above_has_many_of_them() -> None:
    counts = [row[0] for seed in range(20) for row in told([batch_of(generate(seed, link=None))], Of.LIST).values()]
    assert sum(counts) > 100
    assert max(counts) > 10


def data(ms: int, counter: int, source: str = PRESS) -> Frame:
    return data_frame(START + ms * MILLISECOND, source, ALL, telegram(list_id=7, counter=counter, flags=WANTS))


def acknowledged(ms: int, counter: int, to: str = PRESS, by: str = HMI) -> Frame:
    return data_frame(START + ms * MILLISECOND, by, to, telegram(ACKNOWLEDGEMENT, list_id=7, counter=counter, data=b""))


@pytest.mark.parametrize("packets", [1, 2, 1000])
def test_only_the_answer_that_closes_a_wait_in_time_counts(packets: int) -> None:
    frames = [
        data(0, 0), acknowledged(5, 0), acknowledged(6, 0, by=PANEL),  # 5 ms; the second one closes nothing
        data(2_000, 1), data(2_100, 2), acknowledged(2_120, 2),  # given up; 20 ms
        data(4_000, 3), acknowledged(5_001, 3),  # too late
        data(6_000, 4), acknowledged(7_000, 4),  # just in time: 1 s
        data(8_000, 5),  # open at the end
    ]  # fmt: skip
    took = told(cut(batch_of(frames), packets), Of.LIST)
    ms = MILLISECOND
    assert took == {("udp/1202/7", None, None): expected([5 * ms, 20 * ms, 1_000 * ms])}
