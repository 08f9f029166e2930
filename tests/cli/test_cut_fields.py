"""``packets -e`` of fields that a frame may have more often than they are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line
from tests.program_here import run_text


def asking(folder: Path, *counts: int) -> Path:
    """Return a capture of a page that asks for so many variables each time."""
    line = Line().open()
    for count in counts:
        body = (
            f"|0|{count}".encode() + b"".join(b"|%d|4|%d|2|1" % (number, 2 * number) for number in range(count)) + b"|"
        )
        line.ask(b"POST /webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
        answer = b"".join(b"|%d" % number for number in range(count)) + b"|"
        line.answer(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (len(answer), answer))
    write_pcap(line.frames, folder / "c.pcap")
    return folder / "c.pcap"


@pytest.mark.parametrize(("counts", "frames"), [((257,), 2), ((256, 300, 300), 4), ((256,), 0)])
def test_what_is_not_told_is_told_to_be(tmp_path: Path, counts: tuple[int, ...], frames: int) -> None:
    done = run_text("packets", str(asking(tmp_path, *counts)), "-T", "fields", "-e", "visu.variable")
    told = f"nvscope: {frames} frames have more than 256 times visu.variable: the first ones that differ are told; "
    assert (told in done.stderr) == (frames > 0)
    assert ("visu.variable:" in done.stderr) == (frames > 0)


def test_values_and_indexes_are_cut_alike(tmp_path: Path) -> None:
    path = str(asking(tmp_path, 300))
    done = run_text("packets", path, "-T", "csv", "-e", "visu.value", "-e", "visu.index", "-e", "frame.number")
    assert "1 frame has more than 256 times visu.value" in done.stderr
    assert "2 frames have more than 256 times visu.index" in done.stderr
