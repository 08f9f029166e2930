"""Filters and exports say where frames were not captured whole, or bytes of pages are missing, as a report does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.check.requests import READ_X, VALUE, file, page, post, reply, sent
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import snapped
from tests.program import run_text

FRAMES = "2 frames were not captured whole (a snap length): what is behind the end of one is not looked at."
GAP = "the capture lacks {} bytes of web visualization: what was said there is not looked at."


def talk(hole: int = 0) -> list[Frame]:
    """Return what a page says, with a hole in what it is told, and telegrams of a list."""
    line = page().ask(post(READ_X)).answer(reply(VALUE)).lose(False, hole)
    line.ask(post(READ_X)).answer(reply(VALUE)).ask(post(READ_X)).answer(reply(VALUE))
    return [*line.frames, *(sent(1000 * number) for number in range(1, 4))]


def told(frames: Sequence[Frame], directory: Path, *words: str) -> list[str]:
    """Return what is said of what was not looked at."""
    capture = file(frames, directory / "x.pcap")
    done = run_text(words[0], capture, *words[1:], "-q", cwd=directory)
    assert done.returncode == 0, done.stderr
    said = (line.removeprefix("nvscope: ") for line in done.stderr.splitlines())
    return [line for line in said if "not looked at" in line]


VERBS = [
    ("packets", "-Y", 'visu.value == "1"'), ("packets", "-Y", "nv.index == 12"),
    ("packets", "-Y", "visu", "-w", "y.pcapng"),
    ("export", "-w", "y.csv", "--what", "telegrams"), ("export", "-w", "y.csv", "--what", "values"),
    ("export", "-w", "y.csv", "--what", "telegrams", "-Y", "visu"),
]  # fmt: skip


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_what_was_not_looked_at_is_told(words: Sequence[str], tmp_path: Path) -> None:
    assert told(talk(), tmp_path, *words) == []
    assert told(talk(hole=30), tmp_path, *words) == [GAP.format(30)]
    frames = talk()
    frames[-1], frames[-2] = snapped(frames[-1], 1), snapped(frames[-2], 2)
    assert told(frames, tmp_path, *words) == [FRAMES]


def test_of_pages_a_snap_length_is_told_in_frames_and_in_bytes(tmp_path: Path) -> None:
    frames = talk()
    replies = [place for place, frame in enumerate(frames) if frame.data.endswith(VALUE)][1:]
    for place in replies:
        frames[place] = snapped(frames[place], 5)
    assert len(replies) == 2
    assert told(frames, tmp_path, *VERBS[0]) == [FRAMES, GAP.format(10)]
    assert told(frames, tmp_path, "packets") == []
