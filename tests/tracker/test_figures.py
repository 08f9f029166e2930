"""The table of figures: what a report says stands in it, and what it says is true."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.list_key import ListKey
from nvscope.tracker.figures import (
    BY_NAME,
    BY_SCOPE,
    FIGURES,
    LIST_COUNTERS,
    Of,
    Value,
    figures_of,
)
from nvscope.tracker.subjects import Subject, subjects
from nvscope.tracker.summary import Summary, summarize
from nvscope.tracker.timing import LEARNED_INTERVALS
from tests.oracle.builders import START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, cut, tracked
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]
SCENARIOS = sorted((ROOT / "tests" / "scenarios").glob("*.toml"))
CAPTURES = [
    ROOT / "captures" / name for name in ("plant.pcapng.gz", "peers/peers.pcap", "can/press.log", "interfaces.pcapng")
]
MS, S = 1_000_000, 1_000_000_000
PRESS, HMI, PANEL, ALL = "10.0.0.1", "10.0.0.2", "10.0.0.3", "255.255.255.255"
NEAR = 0.008
"""Percentiles are those of buckets that are so wide."""


def inquiry_of(path: Path, directory: Path) -> Inquiry:
    return simulated(path).inquiry(directory) if path.suffix == ".toml" else Inquiry([str(path)])


@cache
def answered(path: Path) -> tuple[Summary, dict[str, Any]]:
    """Return what follows from a capture or scenario, and the report on it."""
    from tempfile import TemporaryDirectory  # noqa: PLC0415

    with TemporaryDirectory() as directory:
        inquiry = inquiry_of(path, Path(directory))
        found = inquiry.analyze(causes=True)
        return found.summary, inquiry.report(found)


def rows_of(report: dict[str, Any]) -> Iterator[tuple[Of, dict[str, Any]]]:
    """Yield the parts of a report that figures are told of, in the order of ``subjects``."""
    for entry in report["lists"]:
        yield Of.LIST, entry
        for node in entry["nodes"]:
            yield Of.NODE, node
        for stream in entry["streams"]:
            yield Of.STREAM, stream
    for bus in report.get("buses", ()):
        yield Of.BUS, bus


def told(row: dict[str, Any], path: str) -> Any:
    """Return what a part of a report has at a path; None where it has nothing."""
    value: Any = row
    for key in path.split("."):
        if value is None or (key == "remote" and key not in value):  # frames that ask for others are only on CAN
            return None
        value = value[key]
    return value


def test_names_are_given_once_and_say_of_what() -> None:
    assert len(BY_NAME) == len(FIGURES)
    for figure in FIGURES:
        assert figure.of
        assert set(figure.keys) <= set(figure.of)
        assert figure.help == figure.help.strip()
        assert not figure.help.endswith(".")
    assert {figure.name for figure in LIST_COUNTERS} >= set(BY_SCOPE)


@pytest.mark.parametrize("path", [*CAPTURES, *SCENARIOS], ids=lambda path: path.stem)
def test_reports_have_the_figures_where_the_table_says(path: Path) -> None:
    summary, report = answered(path)
    pairs = list(zip(subjects(summary), rows_of(report), strict=True))
    for subject, (of, row) in pairs:
        assert subject.of is of
        for figure in figures_of(of):
            if of not in figure.keys:
                continue
            value, expected = figure.read(subject.measured), told(row, figure.keys[of])
            if figure.unit == "time" and value is not None:
                value = str(value)
            if isinstance(value, float):
                value = round(value, 3)
            if figure.keys[of].startswith("errors.") and row["errors"] is None:
                expected = 0 if value is not None else None  # what a bus without error frames says of them
            assert value == expected, (figure.name, of)
    assert pairs or path.stem.startswith(("foreign", "page-encodings"))  # in which nobody sends lists


NO_FIGURES = {"port", "id", "subindex", "cob_id", "items", "length", "checksum"}
"""Numbers that say which one it is, or of which shape it was last."""


def numbers_in(row: dict[str, Any], within: str = "") -> Iterator[str]:
    """Yield the paths of the numbers in a part of a report, but of those that are in lists."""
    for key, value in row.items():
        if isinstance(value, dict):
            yield from numbers_in(value, f"{within}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{within}{key}"


@pytest.mark.parametrize("path", [*CAPTURES, *SCENARIOS], ids=lambda path: path.stem)
def test_reports_count_nothing_that_is_not_in_the_table(path: Path) -> None:
    for of, row in rows_of(answered(path)[1]):
        named = {key: value for key, value in row.items() if key != "variables"}
        assert set(numbers_in(named)) <= NO_FIGURES | {one.keys[of] for one in figures_of(of) if of in one.keys}


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_pace_stands_behind_all_that_is_counted(path: Path) -> None:
    """Whoever looks for what a report had before finds it where it was."""
    for of, row in rows_of(answered(path)[1]):
        added = ["rate"] if of is Of.BUS else ["rate", "jitter", "latency_ns"]
        assert list(row)[-len(added) :] == added


@pytest.mark.parametrize("of", list(Of))
def test_every_figure_occurs_in_a_capture(of: Of) -> None:
    """What is nothing everywhere is shown to be right by no test above."""
    missing = {figure.name for figure in figures_of(of)}
    for path in [*SCENARIOS, *CAPTURES]:
        if not missing:
            break
        for subject in subjects(answered(path)[0]):
            if subject.of is of:
                missing -= {
                    name for name in missing if BY_NAME[name].read(subject.measured) not in (None, 0, "NOERROR")
                }
    # CAN FD, controllers that tell their counters, and frames that show a return come in tests of their own.
    assert missing <= {"fast_bits", "data_bit_rate", "tx_errors", "rx_errors", "bus_off_returned"}


# --- worked out by hand


def at(ms: float, subindex: int, counter: int, source: str = PRESS, list_id: int = 7) -> Frame:
    return data_frame(
        START + int(ms * MS), source, ALL, telegram(list_id=list_id, subindex=subindex, counter=counter)
    )  # fmt: skip


def measured(frames: Sequence[Frame], intervals_ms: int | None = None, packets: int = 1000) -> list[Subject]:
    state = tracked(cut(batch_of(sorted(frames, key=lambda frame: frame.ts_ns)), packets))
    intervals_ns = {} if intervals_ms is None else {ListKey.udp(1202, 7): intervals_ms * MS}
    return list(subjects(summarize(state, intervals_ns=intervals_ns)))


def figure(subjects: Sequence[Subject], name: str, of: Of, **which: int) -> Value:
    (one,) = (
        subject
        for subject in subjects
        if subject.of is of and all(getattr(subject, key) == value for key, value in which.items())
    )
    return BY_NAME[name].read(one.measured)


def irregular(subindex: int, late_ms: int, late: Sequence[int] = (40, 80)) -> list[Frame]:
    """Return 101 telegrams, 100 ms apart but for some intervals that are longer: these are the last percents."""
    frames, time_ms = [], 0.0
    for counter in range(101):
        time_ms += 100 + late_ms if counter in late else 100 if counter else 0
        frames.append(at(time_ms, subindex, counter))
    return frames


@pytest.mark.parametrize("packets", [1, 7, 1000])
@pytest.mark.parametrize(("nominal_ms", "expected"), [(None, 30), (100, 30), (200, 15), (50, 60)])
def test_jitter_is_how_far_p99_lies_from_p50_in_percent_of_the_nominal_interval(
    packets: int, nominal_ms: int | None, expected: float
) -> None:
    """Of 100 intervals, 98 are 100 ms and two 130 ms: the 99th is one of these."""
    found = measured(irregular(0, 30), nominal_ms, packets)
    for of in (Of.STREAM, Of.LIST, Of.NODE):
        assert figure(found, "jitter", of) == pytest.approx(expected, abs=2 * 100 * NEAR)
        assert figure(found, "interval_p50", of) == pytest.approx(100 * MS, rel=NEAR)
        assert figure(found, "interval_p99", of) == pytest.approx(130 * MS, rel=NEAR)
        assert figure(found, "interval_count", of) == 100
        assert figure(found, "interval_max", of) == 130 * MS
        assert figure(found, "interval_min", of) == 100 * MS
        assert figure(found, "interval_mean", of) == 100_600_000
    assert figure(measured(irregular(0, 30, [40])), "jitter", Of.LIST) == pytest.approx(0, abs=100 * NEAR)


def test_the_jitter_of_a_list_is_that_of_its_worst_stream_and_its_intervals_are_those_of_all() -> None:
    found = measured([*irregular(0, 30), *irregular(1, 50), *irregular(2, 0)])
    assert [figure(found, "jitter", Of.STREAM, subindex=part) for part in range(3)] == [
        pytest.approx(expected, abs=2 * 100 * NEAR) for expected in (30, 50, 0)
    ]
    for of in (Of.LIST, Of.NODE):
        assert figure(found, "jitter", of) == figure(found, "jitter", Of.STREAM, subindex=1)
        assert figure(found, "interval_count", of) == 300
        # 3 · 10 s, and twice 30 and 50 ms.
        assert figure(found, "interval_mean", of) == round(30_160 * MS / 300)
        assert figure(found, "interval_max", of) == 150 * MS
        # The 297th of 300 is the first of the four long ones.
        assert figure(found, "interval_p99", of) == pytest.approx(130 * MS, rel=NEAR)


def test_few_intervals_are_told_as_they_are() -> None:
    """Before the usual interval is known, each interval is an event of its own."""
    frames = [at(ms, 0, counter) for counter, ms in enumerate([0, 10, 30])]
    assert len(frames) < LEARNED_INTERVALS
    found = measured(frames)
    assert figure(found, "interval_count", Of.LIST) == 2
    assert figure(found, "interval_mean", Of.LIST) == 15 * MS
    assert figure(found, "jitter", Of.LIST) is None
    alone = measured(frames[:1])
    assert figure(alone, "interval_count", Of.LIST) == 0
    assert figure(alone, "interval_p50", Of.LIST) is None


def test_the_rate_is_telegrams_in_the_time_that_was_watched() -> None:
    """21 telegrams of one stream and 11 of another, in a capture of 20 s that a foreign list begins."""
    frames = [at(0, 0, 1, PANEL, 9)]
    frames += [at(10_000 + 500 * number, 0, number) for number in range(21)]
    frames += [at(1_000 * number, 1, number, HMI) for number in range(10, 21)]
    found = measured(frames)
    (key,) = {one.list for one in found if one.measured.telegrams == 32}
    told = [(one.of, BY_NAME["rate"].read(one.measured)) for one in found if one.list == key]
    expected = [(Of.LIST, 1.6), (Of.NODE, 1.05), (Of.NODE, 0.55), (Of.STREAM, 1.05), (Of.STREAM, 0.55)]
    assert told == expected


def test_there_is_no_rate_where_no_time_has_passed() -> None:
    found = measured([at(0, 0, 0)])
    assert figure(found, "telegrams", Of.LIST) == 1
    assert figure(found, "rate", Of.LIST) is None


def test_a_node_has_the_figures_of_its_streams_on_the_list() -> None:
    """The press loses three telegrams of SubIndex 0 and one of 1, the panel two; another list is no matter."""
    frames = [at(100 * place, 0, counter) for place, counter in enumerate([0, 1, 5, 6])]
    frames += [at(100 * place + 1, 1, counter) for place, counter in enumerate([0, 1, 3, 4])]
    frames += [at(100 * place + 2, 0, counter, PANEL) for place, counter in enumerate([7, 8, 11])]
    frames += [at(100 * place + 3, 0, counter, PRESS, 9) for place, counter in enumerate([0, 9])]
    found = measured(frames)
    (key,) = {one.list for one in found if one.of is Of.LIST and one.measured.telegrams == 11}
    told = [
        [BY_NAME[name].read(one.measured) for name in ("telegrams", "lost", "gaps", "longest_gap")]
        for one in found
        if one.list == key and one.of is not Of.STREAM
    ]
    assert told == [[11, 6, 3, 3], [8, 4, 2, 3], [3, 2, 1, 2]]
