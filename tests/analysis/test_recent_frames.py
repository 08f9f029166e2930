"""Frames of a ring are shown as ``nvscope packets`` shows them, whatever was let go and however it was looked at."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.packets import packets
from nvscope.analysis.recent_frames import FoundFrames, RecentFrames, Wanted
from nvscope.analysis.recent_rows import RecentRows
from nvscope.analysis.watching import Scene, Watching, scene_at
from nvscope.capture.open import open_source
from nvscope.capture.packed import packed
from nvscope.engine.ring import FrameRing
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells
from nvscope.view.rows.frames import FrameRows, PacketRows
from tests.laws import examples
from tests.packets import Batches
from tests.records import replace

ROOT = Path(__file__).parents[2]
PLANT = str(ROOT / "captures" / "plant.pcapng.gz")
PRESS = str(ROOT / "captures" / "can" / "press.log")
TELEGRAMS = str(ROOT / "captures" / "telegrams.pcap")
INTERFACES = str(ROOT / "captures" / "interfaces.pcapng")
CAPTURES = (PLANT, PRESS, TELEGRAMS, INTERFACES)
EXPRESSIONS = (
    "nv.index == 7", "nv.index == 7 && nv.counter > 100", "frame.time_delta > 0.05", "frame.time_relative > 20",
    "frame.number > 600", "arp", "can.id == 0x110", "can.len == 8", 'list.key == "udp/1202/9"',
    "udp.payload contains 30:31",
)  # fmt: skip


@cache
def frames_of(path: str) -> tuple[PacketBatch, tuple[str, ...]]:
    """Return all frames of a capture, and what its channels are called."""
    source = open_source([path])
    return packed(list(source)), tuple(source.channels)


@cache
def shown_of(path: str, expression: str | None) -> tuple[int, ...]:
    """Return the numbers of the frames that ``nvscope packets`` shows."""
    inquiry = Inquiry([path])
    chosen = None if expression is None else inquiry.filter(expression, all_frames=True)
    all_frames = chosen is not None and bool(chosen.of_others)
    read = packets(inquiry.open(), inquiry.reading(chosen, all_frames=all_frames), PacketRows())
    return tuple(number for rows in read for number in rows.frame_number.tolist())


def all_rows(inquiry: Inquiry) -> FrameRows:
    (rows,) = packets(inquiry.open(), inquiry.reading(all_frames=True), PacketRows())
    return rows


@cache
def whole_scene(path: str) -> Scene:
    scene = scene_at(Inquiry([path]), None)
    assert scene is not None
    return scene


def looked_at(scene: Scene, wanted: Wanted) -> FoundFrames:
    frames = RecentFrames.of(scene, wanted)
    while frames.step(scene):
        pass
    return frames.found()


@given(st.data())
@examples(60)
def test_whatever_the_ring_lets_go_and_however_it_is_looked_at(data: st.DataObject) -> None:
    path = data.draw(st.sampled_from(CAPTURES))
    expression = data.draw(st.sampled_from((None, *EXPRESSIONS)))
    whole, channels = frames_of(path)
    cuts = sorted({0, len(whole), *data.draw(st.lists(st.integers(0, len(whole)), max_size=12))})
    batches = [whole[begin:stop] for begin, stop in pairwise(cuts)]
    inquiry, ring = Inquiry([path]), FrameRing(data.draw(st.integers(1, 200_000)))
    frames: RecentFrames | None = None
    # Nothing but the ring and the names of channels counts for who looks at frames.
    scene = replace(whole_scene(path), recent=ring.recent())
    for _ in inquiry.run(Batches(batches, channels), [ring]):
        if data.draw(st.booleans()):
            scene = replace(scene, recent=ring.recent())
            if frames is None or not frames.fits(scene.recent):
                frames = RecentFrames.of(scene, Wanted(expression))
            frames.step(scene, data.draw(st.integers(1, 500)))
    scene = replace(scene, recent=ring.recent())
    if frames is None or not frames.fits(scene.recent):
        frames = RecentFrames.of(scene, Wanted(expression))
    while frames.step(scene, 200):
        pass
    found, recent = frames.found(), scene.recent
    assert found.is_whole
    assert not found.behind(recent)

    def kept(numbers: Sequence[int]) -> list[int]:
        return [number for number in numbers if recent.first_frame <= number < recent.stop_frame]

    assert found.matches.tolist() == kept(shown_of(path, expression))
    if expression != "arp":
        assert found.frames.tolist() == kept(shown_of(path, None))


@pytest.mark.parametrize("expression", [one for one in EXPRESSIONS if one != "arp"])
def test_the_lists_of_chosen_frames_are_those_of_a_report(expression: str) -> None:
    inquiry = Inquiry([PLANT])
    found = looked_at(whole_scene(PLANT), Wanted(expression))
    report = inquiry.report(inquiry.analyze(expression))
    assert sorted(found.lists) == sorted(row["key"] for row in report["lists"])


def test_a_filter_goes_by_what_was_found() -> None:
    expression = 'cause.kind == "second-sender"'
    found = looked_at(whole_scene(PLANT), Wanted(expression))
    assert tuple(found.matches.tolist()) == shown_of(PLANT, expression)
    assert set(found.lists) == {"udp/1202/7"}


def test_the_frames_of_one_list_alone() -> None:
    scene = whole_scene(PLANT)
    found = looked_at(scene, Wanted("nv.counter == 5", "udp/1202/9"))
    assert tuple(found.frames.tolist()) == shown_of(PLANT, 'list.key == "udp/1202/9"')
    assert tuple(found.matches.tolist()) == shown_of(PLANT, 'list.key == "udp/1202/9" && nv.counter == 5')
    assert "udp/1202/7" in found.lists
    assert not len(looked_at(scene, Wanted(None, "udp/1202/77")).frames)


@pytest.mark.parametrize("path", CAPTURES)
def test_frames_by_their_numbers_are_those_of_the_capture(path: str) -> None:
    scene, every = whole_scene(path), all_rows(Inquiry([path]))
    rows = RecentRows(scene)
    chance = np.random.default_rng(1)
    for count in (1, 7, len(every) // 2):
        numbers = np.sort(chance.choice(every.frame_number, count, replace=False))
        found, expected = rows.rows(scene, numbers), every.part(numbers - 1)
        for name, field in FIELDS.items():
            if name != "frame.time_delta_displayed":
                assert cells.texts(field, found) == cells.texts(field, expected), name


def test_frames_that_are_no_more_are_left_out() -> None:
    scene = scene_at(Inquiry([PLANT]), None, Watching(60_000))
    assert scene is not None
    first, stop = scene.recent.first_frame, scene.recent.stop_frame
    assert first > 1
    found = RecentRows(scene).rows(scene, np.array([1, first - 1, first, stop - 1, stop, stop + 7]))
    assert found.frame_number.tolist() == [first, stop - 1]


@pytest.mark.parametrize(
    ("path", "names"),
    [
        (PLANT, ("ip.src", "udp.dstport", "nv.id", "nv.index", "nv.subindex")),
        (PRESS, ("can.channel", "can.id", "can.flags.xtd", "can.flags.rtr", "can.flags.err")),
    ],
)
def test_the_frame_before_in_a_stream(path: str, names: Sequence[str]) -> None:
    scene = whole_scene(path)
    numbers = list(shown_of(path, None))
    all_of = RecentRows(scene).rows(scene, np.array(numbers))
    streams = list(zip(*(cells.texts(FIELDS[name], all_of) for name in names), strict=True))
    rows = RecentRows(scene)
    for at in range(0, len(numbers), 37):
        expected = next((numbers[one] for one in reversed(range(at)) if streams[one] == streams[at]), None)
        found = rows.before_in_stream(scene, numbers[at])
        assert (None if found is None else found.frame_number.tolist()[0]) == expected


def test_frames_of_no_stream_have_none_before() -> None:
    scene = whole_scene(PLANT)
    number = shown_of(PLANT, "arp")[-1]
    assert RecentRows(scene).before_in_stream(scene, number) is None
