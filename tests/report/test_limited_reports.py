"""Reports with a limit of streams: what they leave out, they do not make up."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.buses import Buses, BusSettings
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_project
from nvscope.engine.reading import Reading
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests import program
from tests.engine.traffic import CHANNELS, reading_of, traffic
from tests.laws import examples, some
from tests.oracle.builders import ACKNOWLEDGEMENT, BOOT_UP_REQUEST, MILLISECOND, START, data_frame, telegram
from tests.packets import batch_of, observed
from tests.records import replace
from tests.report.limited import invented
from tests.simulate.simulation import project_of, simulated
from tests.tracker.can.test_state import batch

ROOT = Path(__file__).parents[2]
SCENARIOS = sorted((ROOT / "tests" / "scenarios").glob("*.toml"))
CAPTURES = ROOT / "captures"
KEPT = {
    "plant": ([CAPTURES / "plant.pcapng.gz"], []),
    "peers": ([CAPTURES / "peers" / "peers.pcap"], [CAPTURES / "peers"]),
    "press": ([CAPTURES / "can" / "press.log"], [CAPTURES / "can"]),
}
UNLIMITED = 1 << 20


def reports(captures: Sequence[Path], project: Project) -> Iterator[dict[str, Any]]:
    """Yield the report without a limit, then those with ever more streams until nothing is left out."""
    for most in (UNLIMITED, *range(1, UNLIMITED)):
        limited = replace(project, limits=replace(project.limits, max_streams=most))
        inquiry = Inquiry([str(path) for path in captures], limited)
        report = inquiry.report(inquiry.analyze(causes=True))
        yield report
        if most != UNLIMITED and not any(finding["code"] == "NV906" for finding in report["findings"]):
            return


@pytest.mark.parametrize("path", some(SCENARIOS), ids=lambda path: path.stem)
def test_no_limit_makes_a_report_on_a_scenario_say_more(path: Path, tmp_path: Path) -> None:
    scenario = simulated(path)
    captures = [scenario.write(tmp_path / "simulated.pcapng")]
    whole, *limited = reports(captures, project_of(scenario.scenario, tmp_path))
    assert [invented(report, whole) for report in limited] == [[]] * len(limited)
    assert limited[-1] == whole


@pytest.mark.parametrize("name", KEPT)
def test_no_limit_makes_a_report_on_a_capture_say_more(name: str) -> None:
    captures, definitions = KEPT[name]
    whole, *limited = reports(captures, read_project(None, definitions=[str(path) for path in definitions]))
    assert [invented(report, whole) for report in limited] == [[]] * len(limited)
    assert limited[-1] == whole
    assert len(limited) > 1


def report_on(batches: Sequence[PacketBatch], most: int) -> dict[str, Any]:
    state = observed(TrackerState(), batches, replace(reading_of(None), max_streams=most), CHANNELS)
    summary = summarize(state)
    return report_document(summary, judge(state, summary=summary), [])


@given(st.integers(0, 10_000), st.sampled_from([1, 2, 3, 5, 9, 17, 40]))
@examples(200)
def test_no_limit_makes_a_report_on_any_traffic_say_more(seed: int, most: int) -> None:
    batches = traffic(seed)
    assert invented(report_on(batches, most), report_on(batches, UNLIMITED)) == []


NODES = [f"10.0.0.{number}" for number in range(1, 10)]
EVERYBODY = "255.255.255.255"


def sent(frames: Sequence[tuple[int, int, str, bytes]], most: int) -> dict[str, Any]:
    """Return the report on frames: when in ms, from which node, to whom, and what."""
    told = [
        data_frame(START + time_ms * MILLISECOND, NODES[source], destination, content)
        for time_ms, source, destination, content in sorted(frames, key=lambda frame: frame[0])
    ]
    return report_on([batch_of(told)], most)


def codes(report: dict[str, Any]) -> list[str]:
    return [finding["code"] for finding in report["findings"]]


@pytest.mark.parametrize("others", [NODES[5:7], [EVERYBODY, NODES[5]], ["224.0.0.9", EVERYBODY]])
def test_a_stream_to_several_receivers_has_no_gaps(others: list[str]) -> None:
    frames = [(100 * number, 0, others[number % 2], telegram(counter=number)) for number in range(20)]
    every, limited = (sent(frames, most) for most in (UNLIMITED, 1))
    assert codes(every) == []
    assert limited == every


def test_a_sender_of_which_streams_are_left_out_has_unknown_counters() -> None:
    """One Counter for all telegrams: what the other list has counted looks like a loss."""
    frames = [(50 * number, 0, EVERYBODY, telegram(list_id=1 + number % 2, counter=number)) for number in range(300)]
    assert codes(sent(frames, UNLIMITED)) == ["NV206"]
    limited = sent(frames, 1)
    assert codes(limited) == ["NV906"]
    (entry,) = limited["lists"]
    (stream,) = entry["streams"]
    assert (stream["telegrams"], stream["interval_ns"]["nominal"]) == (150, 100_000_000)
    for name in ("counter_scope", "lost", "lost_claimed", "duplicates", "overtaken", "restarts"):
        assert stream[name] is None
    for name in ("lost", "lost_claimed", "gaps", "longest_gap", "duplicates", "overtaken", "restarts"):
        assert entry["counters"][name] is None
    assert entry["diag"]["nErrorCount"] == 0  # all of the list is there


def test_a_sender_that_is_all_there_is_counted_whatever_is_left_out_of_others() -> None:
    frames = [(100 * number, 0, EVERYBODY, telegram(counter=number)) for number in range(400) if number != 20]
    frames += [(100 * number + 50, 1 + number % 4, EVERYBODY, telegram(list_id=2)) for number in range(400)]
    limited = sent(frames, 1)
    assert codes(limited) == ["NV201", "NV906"]
    assert limited["lists"][0] == sent(frames, UNLIMITED)["lists"][0]


def test_acknowledgements_that_are_left_out_are_not_called_missing() -> None:
    frames = []
    for number in range(20):
        frames.append((100 * number, 0, EVERYBODY, telegram(counter=number, flags=1)))
        frames.append((100 * number + 5, 1 + number % 2, NODES[0], telegram(ACKNOWLEDGEMENT, counter=number, data=b"")))
    (entry,) = sent(frames, UNLIMITED)["lists"]
    assert (entry["counters"]["missing_acknowledgements"], entry["latency_ns"]["count"]) == (0, 20)
    limited = sent(frames, 1)
    assert codes(limited) == ["NV906"]
    (entry,) = limited["lists"]
    assert entry["counters"]["missing_acknowledgements"] is None
    assert [entry["diag"][name] for name in ("nErrorCount", "sLastError", "tLastError")] == [None] * 3
    assert entry["streams"][0]["latency_ns"] == {"count": None, "p50": None, "p99": None, "max": None}
    assert entry["streams"][0]["lost"] == 0  # its sender is all there


def test_nobody_is_blamed_for_what_a_reader_says_of_a_sender_that_may_be_left_out() -> None:
    frames = [(100 * number, 0, EVERYBODY, telegram(counter=number)) for number in range(5)]
    frames += [(100 * number + 10, 1, EVERYBODY, telegram(counter=number)) for number in range(5)]
    frames += [
        (100 * number + 20, 2, EVERYBODY, telegram(ACKNOWLEDGEMENT, counter=number, data=b"", flags=4))
        for number in range(5)
    ]
    for most, node in ((UNLIMITED, "10.0.0.2"), (1, None)):
        (finding,) = (one for one in sent(frames, most)["findings"] if one["code"] == "NV302")
        assert (finding["node"], finding["count"], len(finding["frames"])) == (node, 5, 5)


def test_boot_up_requests_may_be_answered_by_what_is_left_out() -> None:
    frames = [(0, 5, EVERYBODY, telegram(list_id=9)), (1000, 2, EVERYBODY, telegram(BOOT_UP_REQUEST, data=b""))]
    frames += [(1001, 0, EVERYBODY, telegram()), (5000, 5, EVERYBODY, telegram(list_id=9, counter=2))]
    every, limited = (sent(frames, most) for most in (UNLIMITED, 1))
    assert codes(every) == []
    assert codes(limited) == ["NV906"]
    assert [entry["counters"]["bootup_unanswered"] for entry in limited["lists"]] == [None, 0]


def test_a_list_of_which_a_subindex_is_left_out_has_no_torn_cycles() -> None:
    """The third SubIndex is sent on change, so that nobody knows what belongs to one cycle."""
    frames = []
    for number in range(400):
        parts = [0] if number in (20, 40) else [0, 1]
        frames += [
            (100 * number + part, 0, EVERYBODY, telegram(subindex=part, counter=number, items=2)) for part in parts
        ]
    for number, place in enumerate([5, 6, 10, 19, 20, 29, 30, 39, 43, 44, 53]):
        frames.append((100 * place + 3, 0, EVERYBODY, telegram(subindex=2, counter=number, items=2)))
    assert codes(sent(frames, UNLIMITED)) == ["NV201"]
    assert codes(sent(frames, 2)) == ["NV906"]


@pytest.mark.parametrize(("lists", "told"), [(2, True), (6, False)])
def test_only_what_would_be_mirrored_with_all_telegrams_is_called_so(lists: int, told: bool) -> None:
    frames = []
    for number in range(100):
        for place in range(lists):
            again = 2 if not place or (lists == 2 and number % 20) else 1
            frames += [(100 * number + place, place, EVERYBODY, telegram(list_id=place + 1, counter=number))] * again
    every, limited = (sent(frames, most) for most in (UNLIMITED, 1))
    assert ("NV905" in codes(every)) is told
    assert "NV905" not in codes(limited)
    frames = [frame for frame in frames if frame[1] == 0] + [(50, 1, EVERYBODY, telegram(list_id=2))]
    assert "NV905" in codes(sent(frames, 1))


def test_of_several_senders_it_is_said_that_there_may_be_more() -> None:
    frames = [
        (100 * number + node, node, EVERYBODY, telegram(counter=number)) for number in range(9) for node in range(4)
    ]
    for most, message in ((UNLIMITED, "4 nodes send this list"), (3, "At least 3 nodes send this list")):
        (finding,) = (one for one in sent(frames, most)["findings"] if one["code"] == "NV401")
        assert finding["message"].startswith(message)


def test_what_is_unknown_is_a_question_mark_in_tables(tmp_path: Path) -> None:
    two_readers = simulated(ROOT / "tests" / "scenarios" / "acknowledgement-two-readers.toml").write(
        tmp_path / "a.pcap"
    )
    one_counter = simulated(ROOT / "tests" / "scenarios" / "counter-node-telegram.toml").write(tmp_path / "b.pcap")

    def row(capture: Path, *columns: str) -> list[str]:
        shown = program.run("report", capture, "--max-streams", "1", "-v", "--wide").stdout.decode()
        head, cells = (line for line in shown.splitlines() if re.match(r"status +list|\S \w+ +udp/1202/7 ", line))
        return [cells[: head.index(name) + len(name)].split()[-1] for name in columns]

    assert row(two_readers, "lost", "no ack", "nErrorCount") == ["0", "?", "?"]
    assert row(one_counter, "lost", "no ack", "nErrorCount") == ["?", "0", "?"]


def test_the_load_of_a_bus_is_that_of_all_frames() -> None:
    frames = [(second * 1_000_000_000, 0, word, b"\1\2") for second, word in enumerate([1, 1, 2, 2, 2, 3])]
    loads = []
    for most in (UNLIMITED, 2, 1):
        state = observed(TrackerState(), [batch(frames)], Reading(max_streams=most))
        (bus,) = summarize(state, buses=Buses((("*", BusSettings(125_000, None)),))).can.buses
        assert bus.load is not None
        loads.append(bus.load.mean)
    assert loads[0] > 0
    assert loads == [loads[0]] * 3
