"""Several captures in one report that do not cover the same time: what nobody listened to is unknown, not wrong."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink, open_source
from nvscope.capture.recordings import APART_NS, recordings
from nvscope.capture.source import SourceInfo
from nvscope.definition.buses import Buses, BusSettings
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from tests.definition.lists import telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, document_of, tracked
from tests.program_here import run_text

MS, SECOND, DAY = 1_000_000, 1_000_000_000, 86_400 * 1_000_000_000
START = 1_700_000_000 * SECOND
FLAGS_AT = 14 + 20 + 8 + 18
WANTS = b"\1"


def cyclic(
    begin_s: float, end_s: float, *, list_id: int = 7, subindex: int = 0, counter: int = 1, wants: bool = False
) -> list[Frame]:
    """Return a stream sent each 100 ms from a second on, up to another, that may ask for acknowledgements."""
    frames = []
    for number in range(round((end_s - begin_s) * 10)):
        ts_ns = START + round(begin_s * SECOND) + number * 100 * MS
        frame = telegram(b"\0", 1, subindex=subindex, counter=counter + number, ts_ns=ts_ns, list_id=list_id)
        flags = WANTS if wants else b"\0"
        frames.append(frame._replace(data=frame.data[:FLAGS_AT] + flags + frame.data[FLAGS_AT + 1 :]))
    return frames


def state_of(folder: Path, captures: Sequence[list[Frame]], named: Sequence[str] = "abcde") -> TrackerState:
    """Return what is known from captures, written to files and read as one timeline."""
    names = []
    for number, frames in enumerate(captures):
        names.append(str(folder / f"{named[number]}.pcap"))
        with open_sink(names[-1]) as sink:
            sink.write(batch_of(sorted(frames, key=lambda frame: frame.ts_ns)))
    states = [tracked(open_source(order)) for order in list(permutations(names))[:6]]
    assert len({tuple(map(told, judge(state))) for state in states}) == 1  # in whichever order they are given
    return states[0]


def told(finding: Finding) -> tuple[str, int, str]:
    return finding.kind.code, finding.count, finding.message


def codes(state: TrackerState) -> list[tuple[str, int]]:
    """Return the codes of findings on lists, with their counts."""
    return sorted((one.kind.code, one.count) for one in judge(state) if one.list_number is not None)


def later(frames: list[Frame], by_ns: int) -> list[Frame]:
    return [frame._replace(ts_ns=frame.ts_ns + by_ns) for frame in frames]


def test_what_is_told_a_second_is_told_of_the_time_in_which_somebody_listened(tmp_path: Path) -> None:
    first = cyclic(0, 10)
    states = [state_of(tmp_path, [first]), state_of(tmp_path, [first, later(first, 3 * DAY), later(first, 5 * DAY)])]
    assert [document_of(state)["lists"][0]["rate"] for state in states] == [pytest.approx(10, rel=0.02)] * 2


def test_so_is_the_load_of_a_bus(tmp_path: Path) -> None:
    loads = []
    for days in ([0], [0, 3, 5]):
        names = []
        for day in days:
            names.append(tmp_path / f"{day}.log")
            times = (1_700_000_000 + 86_400 * day + number / 10 for number in range(101))
            names[-1].write_text("".join(f"({time:.6f}) can0 181#0102030405060708\n" for time in times))
        buses = Buses((("can0", BusSettings(125_000)),))
        (bus,) = summarize(tracked(open_source(list(map(str, names)))), buses=buses).can.buses
        assert bus.load is not None
        loads.append(bus.load.mean)
    assert loads[1] == pytest.approx(loads[0], rel=0.02)


@pytest.mark.parametrize("by_ns", [2 * APART_NS, DAY // 24, 3 * DAY])
def test_captures_apart_are_judged_as_if_each_were_alone(by_ns: int, tmp_path: Path) -> None:
    """Waits, steps, intervals and cycles end with the one and begin with the other."""
    first = [
        *cyclic(0, 10, wants=True), *cyclic(0, 10.05, list_id=8), *cyclic(0.01, 9.9, list_id=8, subindex=1),
        *cyclic(0, 5, list_id=9),
    ]  # fmt: skip
    # It begins inside of a cycle; the Counter of list 8 is far from what it was.
    second = later([*first[1:100], *cyclic(0, 10, list_id=8, counter=400), *cyclic(0, 5, list_id=9)], by_ns)
    apart = [codes(state_of(tmp_path, [frames])) for frames in (first, second)]
    counts: dict[str, int] = {}
    for code, count in apart[0] + apart[1]:
        counts[code] = counts.get(code, 0) + count
    together = state_of(tmp_path, [first, second])
    assert dict(codes(together)) == counts
    assert int(together.senders.timing.columns.column("most_ns").max()) == 100 * MS


def test_what_begins_again_behind_a_hole_is_no_restart_and_a_stop_before_it_is_told(tmp_path: Path) -> None:
    first, second = [*cyclic(0, 5), *cyclic(0, 10, list_id=8)], later(cyclic(0, 10), DAY)
    (finding,) = (one for one in judge(state_of(tmp_path, [first, second])) if one.list_number is not None)
    assert told(finding)[:2] == ("NV504", 1)
    assert finding.message.startswith("Silent for the last 5.0 s of a capture; ")


def test_files_that_follow_each_other_are_one_capture(tmp_path: Path) -> None:
    """A telegram that is lost between two of them is lost, and who stops in the last one has stopped."""
    first, second = [*cyclic(0, 10), *cyclic(0, 9, list_id=8)], cyclic(10.1, 20, counter=102)
    assert codes(state_of(tmp_path, [first, second])) == [("NV201", 1), ("NV504", 1)]


def test_a_sender_that_stopped_is_told_though_the_next_file_has_none_at_all(tmp_path: Path) -> None:
    stranger = Frame(START + 40 * SECOND, 1, bytes(60), 60)
    assert codes(state_of(tmp_path, [cyclic(0, 10), [stranger]])) == [("NV504", 1)]


def test_a_capture_that_ends_earlier_leaves_what_it_alone_saw_open(tmp_path: Path) -> None:
    """Its streams are not silent from there on, and nobody saw whether the last telegram was acknowledged."""
    short, long = cyclic(0, 10), cyclic(5, 30, list_id=8)
    assert codes(state_of(tmp_path, [short, long])) == []
    waiting = state_of(tmp_path, [cyclic(0, 10, wants=True), long])
    assert codes(waiting) == [("NV301", 99)]


def test_what_another_capture_sees_too_is_silent_where_it_is(tmp_path: Path) -> None:
    short, long = cyclic(0, 10), [*cyclic(5, 30, list_id=8), *cyclic(5, 10)]
    assert ("NV504", 1) in codes(state_of(tmp_path, [short, long]))


def test_captures_of_different_places_one_after_the_other_are_not_one(tmp_path: Path) -> None:
    assert codes(state_of(tmp_path, [cyclic(0, 10), cyclic(15, 30, list_id=8)])) == []


def test_who_sends_a_list_later_is_no_second_sender_where_nobody_listened_to_it_meanwhile(tmp_path: Path) -> None:
    """Another capture went on, of other lists; where it hears this one too, there are two senders."""
    first, others = cyclic(0, 10), cyclic(5, 130, list_id=8)
    source_at = 14 + 15
    readdressed = [
        frame._replace(data=frame.data[:source_at] + b"\2" + frame.data[source_at + 1 :]) for frame in cyclic(100, 110)
    ]
    assert codes(state_of(tmp_path, [first, others, readdressed])) == []
    assert ("NV401", 1) in codes(state_of(tmp_path, [first, [*others, *cyclic(5, 10)], readdressed]))


def test_they_are_where_one_begins_at_once_or_its_name_goes_on(tmp_path: Path) -> None:
    """Each has one sender alone, which no other has; who is lost or stops between them is told."""
    parts = [cyclic(0, 10), cyclic(10.5, 15, list_id=8), cyclic(15.5, 25, counter=104)]
    expected = [("NV201", 1), ("NV504", 1)]
    assert codes(state_of(tmp_path, parts)) == expected
    slow = [cyclic(0, 10), cyclic(20, 25, list_id=8), cyclic(35, 45, counter=104)]
    assert ("NV201", 1) not in codes(state_of(tmp_path, slow))
    series = "plant_00001_20261123", "plant_00002_20261124", "plant_00003_20261125"
    assert codes(state_of(tmp_path, slow, series)) == expected


def test_nothing_ends_behind_the_time_that_is_asked_for(tmp_path: Path) -> None:
    names = []
    for name, frames in (("a", cyclic(0, 30)), ("b", cyclic(0, 60, list_id=8))):
        names.append(str(tmp_path / f"{name}.pcap"))
        with open_sink(names[-1]) as sink:
            sink.write(batch_of(frames))
    for begin, end in (("0s", "20s"), ("5s", "50s"), ("40s", "50s")):
        done = run_text("report", *names, "--from-time", begin, "--to-time", end, "--json")
        assert json.loads(done.stdout)["findings"] == []


def test_a_bus_is_silent_only_as_long_as_it_was_captured(tmp_path: Path) -> None:
    def log(channel: str, begin_s: int, end_s: int, *identifiers: int) -> list[str]:
        return [
            f"({1_700_000_000 + second / 10:.6f}) {channel} {identifier:03X}#0102\n"
            for second in range(10 * begin_s, 10 * end_s) for identifier in identifiers
        ]  # fmt: skip

    (tmp_path / "a.log").write_text("".join(log("can0", 0, 100, 0x181)))
    (tmp_path / "b.log").write_text("".join(log("can1", 50, 200, 0x182)))
    assert codes(tracked(open_source([str(tmp_path / "a.log"), str(tmp_path / "b.log")]))) == []
    (tmp_path / "b.log").write_text("".join(log("can0", 50, 200, 0x182)))
    assert codes(tracked(open_source([str(tmp_path / "a.log"), str(tmp_path / "b.log")]))) == [("NV504", 1)]


def test_a_recording_may_begin_in_1970() -> None:
    infos = [SourceInfo("a", "pcap", start_ns=0, end_ns=0), SourceInfo("b", "pcap", start_ns=APART_NS, end_ns=DAY)]
    assert [(one.first, one.start_ns) for one in recordings(infos)] == [("a", 0), ("b", APART_NS)]
    assert recordings([SourceInfo("empty", "pcap")]) == []
