"""What a screen tells of sources, of what is kept, and of the program itself."""

from __future__ import annotations

from types import MappingProxyType

from nvscope import units
from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Watching, scene_at
from nvscope.capture.source import SourceInfo, Truncation
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.plant.source_blocks import (
    Block,
    OwnLoad,
    limits_block,
    lines_of,
    own_block,
    recording_block,
    ring_block,
    source_block,
)
from tests.view.lines.plant.test_bus_load import CAN, S_NS

CLOCK = Clock(0, True)


def told(block: Block, width: int = 200) -> str:
    return "\n".join("".join(cell.text for cell in line) for line in lines_of([block], width))


def test_a_file() -> None:
    info = SourceInfo(
        "a\x1b.pcapng", "pcapng", 2_000_000, 100, 25, MappingProxyType({"kernel": 5, "interface": 20}),
        truncation=Truncation(1234, "cut short"), comments=((None, "first"),), start_ns=0, end_ns=99 * S_NS,
    )  # fmt: skip
    assert told(source_block(info, CLOCK, 99 * S_NS)).splitlines() == [
        "a\\x1b.pcapng   pcapng, file",
        "  packets   00:00:00.000 to 00:01:39.000, 1 min 39 s",
        "  frames    100 frames, 2.0 MB, 1.0/s in the mean",
        "  dropped   ✗ 25, 20 % of all; 20 in the interface, before the operating system had them (isb_ifdrop); "
        "5 in the operating system (isb_osdrop, the queue of a socket)",
        "  cut off   ! cut short, at byte 1 234",
        "  comment   first",
    ]


def test_a_live_source_in_trouble() -> None:
    info = SourceInfo(
        "eth0", "ethernet", drops=None, is_live=True, hears_answers=False, clock_steps=2,
        without_carrier=((S_NS, 2 * S_NS), (5 * S_NS, None)),
    )  # fmt: skip
    text = told(source_block(info, CLOCK, 9 * S_NS))
    assert text.startswith("eth0   ethernet, live\n  packets   none yet\n  frames    0 frames, 0 B\n")
    assert "  dropped   unknown: the system tells" in text
    assert "  no cable  ✗ 00:00:01.000 to 00:00:02.000, since 00:00:05.000 (NV907)" in text
    assert "  clock     ! its clock was set 2 times while it was watched (NV902)" in text
    assert "  hears not what others answer to each other" in text
    ended = SourceInfo("eth0", "ethernet", is_live=True, failure="it was deleted")
    assert told(source_block(ended, CLOCK, None)).splitlines()[:2] == [
        "eth0   ethernet, ended", "  ended     ✗ it was deleted",
    ]  # fmt: skip


def test_what_is_kept_and_what_was_let_go() -> None:
    inquiry = Inquiry([str(CAN / "press.log")])
    scene = scene_at(inquiry, None)
    assert scene is not None
    text = told(ring_block(scene.recent, Clock.of(scene.document, utc=True), scene.at_ns))
    assert "  frames    1 219 frames in " in text
    assert " of 268.4 MB (<0.1 %)" in text
    assert "  oldest    00:00:00.000, 10.0 s ago" in text
    assert "  rate      122/s, frames of all sources over the last 5.0 s" in text
    assert "  let go    none" in text
    small = scene_at(inquiry, None, Watching(ring_bytes=1))
    assert small is not None
    assert len(small.recent) + small.recent.passed == 1219
    text = told(ring_block(small.recent, CLOCK, small.at_ns))
    assert (f"  let go    {units.count(small.recent.passed)} frame" in text) is bool(small.recent.passed)


def test_limits() -> None:
    scene = scene_at(Inquiry([str(CAN / "press.log")]), None)
    assert scene is not None
    text = told(limits_block(scene.snapshot.summary, 50_000, 0))
    assert "  streams   6 of 50 000 at most (limits.max_streams), in 6 lists" in text
    assert "  left out  ! 7 frames of further streams" in told(limits_block(scene.snapshot.summary, 6, 7))


def test_the_program_itself() -> None:
    text = told(own_block(OwnLoad(5.0, 12.34, 70_000_000, False, 5, 3.0), 24_000_000, 18_000_000))
    assert text.splitlines() == [
        "This program",
        "  CPU       12.3 % of a processor, all threads, over the last 5 s",
        "  memory    70.0 MB",
        "  threads   5",
        "  last look took 24.0 ms, 18.0 ms ago",
        "  draws     3.0 a second, 10 at the most",
    ]
    unknown = told(own_block(OwnLoad(0.0, None, None, False, 1, None), 0, None))
    assert unknown.count("unknown: this system does not tell") == 2
    assert "took 0 ns, of the past" in unknown


def test_a_recording() -> None:
    text = told(recording_block("out.pcapng", 7, 648, 1, "", is_on=True))
    assert text == "Recording   out.pcapng, on\n  frames    7 frames, 648 B"
    assert "7 frames, 648 B, 3 files so far" in told(recording_block("out.pcapng", 7, 648, 3, "", is_on=True))
    assert "✗ no space is left" in told(recording_block("out.pcapng", 7, 648, 1, "no space is left", is_on=False))


def test_texts_are_aligned_and_no_line_is_too_wide() -> None:
    info = SourceInfo("eth0", "ethernet", drops=None, is_live=True, hears_answers=False)
    lines = told(source_block(info, CLOCK, None), 40).splitlines()
    assert all(len(line) <= 40 for line in lines)
    assert all(line[:12].rstrip() == "" or line[:2] == "  " for line in lines[1:])
