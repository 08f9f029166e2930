"""What is watched equals what a report says: at the end, at any second, and however often somebody looks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, Watched, Watching, scene_at, scenes_by_second, watching
from nvscope.capture.by_second import BySecond
from nvscope.causes.mark import Mark
from nvscope.definition.project_file import read_project
from nvscope.view.asked_time import parse_range
from nvscope.view.documents.drawn import plain
from nvscope.view.documents.variables import streams_of
from tests.oracle.builders import data_frame, telegram
from tests.oracle.pcap import write_pcap

ROOT = Path(__file__).parents[2]
PLANT = str(ROOT / "captures" / "plant.pcapng.gz")
PEERS = str(ROOT / "captures" / "peers" / "peers.pcap")
PRESS = str(ROOT / "captures" / "can" / "press.log")
START_NS = 1_704_067_200_000_000_000


def report_of(inquiry: Inquiry) -> Any:
    return plain(inquiry.report(inquiry.analyze()))


def document_of(scene: Scene) -> Any:
    return plain(scene.document)


def without_until(document: Any) -> Any:
    document["capture"]["until_ns"] = None
    return document


@pytest.mark.parametrize("path", [PLANT, PEERS, PRESS])
def test_the_last_scene_is_the_report(path: str) -> None:
    session = watching(Inquiry([path]))
    session.start()
    while not session.ended:
        session.snapshot()
    assert document_of(session.stop()) == report_of(Inquiry([path]))


def test_the_scene_of_a_moment_is_the_report_up_to_it() -> None:
    inquiry = Inquiry([PLANT])
    for second in (7, 12, 24, 26):
        scene = scene_at(inquiry, START_NS + second * 1_000_000_000)
        assert scene is not None
        until = Inquiry([PLANT], asked=parse_range(None, f"{second}s", utc=True))
        expected = report_of(until)
        found = document_of(scene)
        # Which part of the file was read is another matter.
        found["capture"]["sources"] = expected["capture"]["sources"] = None
        assert found["lists"] == expected["lists"]
        assert found["causes"] == expected["causes"]


def test_a_second_after_the_other_is_the_same_as_all_at_once() -> None:
    seen = list(scenes_by_second(Inquiry([PLANT])))
    assert len(seen) == 30
    frames = [scene.snapshot.summary.capture.frames for scene in seen]
    assert frames == sorted(frames)
    assert without_until(document_of(seen[-1])) == without_until(report_of(Inquiry([PLANT])))


def test_what_was_asked_to_end_has_no_scene() -> None:
    assert scene_at(Inquiry([PLANT]), None, progress=lambda: False) is None


def test_values_are_those_of_the_moment_and_stay_as_they_are() -> None:
    project = read_project(None, [str(Path(PEERS).parent)])
    inquiry = Inquiry([PEERS], project)
    scenes = list(scenes_by_second(inquiry))
    first, last = scenes[1], scenes[-1]
    kept = [[one.data.tobytes() for one in stream.sequence] for stream in first.variables]
    found = inquiry.analyze(values=True)
    assert found.values is not None
    wanted = streams_of(found.state, found.values)
    assert [stream.list for stream in last.variables] == [stream.list for stream in wanted]
    for own, other in zip(last.variables, wanted, strict=True):
        assert [one.data.tobytes() for one in own.sequence] == [one.data.tobytes() for one in other.sequence]
        assert [one.changes.tolist() for one in own.sequence] == [one.changes.tolist() for one in other.sequence]
    assert kept == [[one.data.tobytes() for one in stream.sequence] for stream in first.variables]
    assert kept != [[one.data.tobytes() for one in stream.sequence] for stream in last.variables][: len(kept)]


def test_the_ring_holds_what_it_was_given_room_for() -> None:
    scene = scene_at(Inquiry([PLANT]), None, Watching(ring_bytes=20_000))
    assert scene is not None
    assert scene.recent.stop_frame == 1213
    assert scene.recent.first_frame > 1
    assert scene.recent.bytes <= 20_000
    assert sum(map(len, scene.frames())) == len(scene.recent)


def test_a_clock_tells_the_moments_of_causes() -> None:
    scene = scene_at(Inquiry([PLANT]), None, Watching(clock=lambda time_ns: f"<{(time_ns - START_NS) // 10**9}>"))
    assert scene is not None
    titles = [row["title"] for row in scene.document["causes"]]
    assert "Node 192.168.1.12 is silent since <23> (list 12)" in titles


def test_after_a_reset_only_what_came_since_is_counted() -> None:
    inquiry = Inquiry([PLANT])
    watched = Watched(inquiry, BySecond(inquiry.open()))
    looks = []
    for told in inquiry.run(watched.source, watched.observers):
        if not len(told) and told.until_ns is not None:
            if len(looks) == 15:
                watched.reset()
            looks.append(watched.look())
    before, begun, last = looks[14], looks[15], watched.look()
    assert {row["diag"]["nSendCount"] for row in begun.document["lists"]} == {0}
    whole = {row["key"]: row["diag"]["nSendCount"] for row in document_of(last)["lists"]}
    assert whole["udp/1202/7"] == 382  # of 700, as the frames of the capture tell
    assert sum(whole.values()) < sum(row["diag"]["nSendCount"] for row in report_of(Inquiry([PLANT]))["lists"])
    assert "loss-of-list" in {row["kind"] for row in before.document["causes"]}
    kinds = [row["kind"] for row in last.document["causes"]]
    assert sorted(kinds) == ["node-restart", "node-silent", "second-sender"]


def test_behind_a_clock_that_was_set_back_time_goes_on(tmp_path: Path) -> None:
    """What the clock shows is now: nothing is an hour old, and strips of the last seconds are not empty."""
    hour_ns, every_ns = 3_600_000_000_000, 50_000_000
    frames = [
        data_frame(
            START_NS + at * every_ns - (hour_ns if at >= 80 else 0),
            "10.0.0.1",
            "255.255.255.255",
            telegram(counter=at),
        )
        for at in range(160)
    ]
    write_pcap(frames, tmp_path / "set.pcap")
    scenes = list(scenes_by_second(Inquiry([str(tmp_path / "set.pcap")])))
    last = scenes[-1]
    assert last.at_ns == frames[-1].ts_ns
    assert (scenes[2].at_ns or 0) > frames[0].ts_ns > last.at_ns
    assert [row["kind"] for row in last.document["causes"]] == ["clock"]
    chronicle = last.chronicle
    assert chronicle is not None
    assert (chronicle.end_ns, chronicle.start_ns < chronicle.end_ns) == (last.at_ns, True)
    (key,) = chronicle.numbers
    assert Mark.SILENT not in chronicle.last(3_000_000_000).strips([key], 30)[0]
    assert last.pace.per_second(0, 2) == 20.0
