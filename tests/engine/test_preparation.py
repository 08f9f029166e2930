"""What a process prepares that is ahead is what is prepared here, whatever befalls it."""

from __future__ import annotations

import os
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from dissectors import sorter
from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture import read_ahead
from nvscope.capture.capture_file import CaptureFile
from nvscope.capture.reader import ReadingSizes
from nvscope.engine import preparation
from nvscope.engine.recogniser import Recogniser
from nvscope.tracker.visu import follower
from tests.capture import build
from tests.capture.dying import let_it_die
from tests.capture.reference import Packet
from tests.laws import crossed, some
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import tcp_frame
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of
from tests.tracker.visu.drawn_losses import captured

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot copy a process")
CAPTURES = Path(__file__).parents[2] / "captures"
_AHEAD = ReadingSizes(batch_packets=50, stride_bytes=3000, ahead_bytes=0)
_HERE = replace(_AHEAD, ahead_bytes=1 << 60)


@pytest.fixture(autouse=True)
def _in_small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let all files be read ahead, also on one core; some packets are told before, and many times some behind."""
    monkeypatch.setattr(read_ahead, "is_worth_it", lambda rest, least: rest >= least)
    monkeypatch.setattr(preparation.Preparation, "is_worth_it", lambda *_: True)
    monkeypatch.setattr(read_ahead, "_FEW", 7)
    monkeypatch.setattr(preparation, "_FOLLOWED", 11)
    monkeypatch.setattr(preparation, "MAX_BATCH", 23)


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What was taken from a process that is ahead."""
    taken: list[Any] = []
    take = preparation.Preparation.take

    def noted(own: preparation.Preparation, done: Any, data: memoryview) -> Any:
        taken.append(done)
        return take(own, done, data)

    monkeypatch.setattr(preparation.Preparation, "take", noted)
    return taken


def reported(path: Path, sizes: ReadingSizes) -> dict[str, Any]:
    """Return the report on a capture file."""
    inquiry = Inquiry(CaptureFile(str(path), sizes=sizes, small_file_bytes=0))
    return inquiry.report(inquiry.analyze(values=True))


def written(path: Path, frames: Sequence[Frame]) -> Path:
    """Return a file with Ethernet frames."""
    path.write_bytes(build.pcap([Packet(one.ts_ns, max(one.original, len(one.data)), 1, one.data) for one in frames]))
    return path


def plant_and_page(seed: int) -> list[Frame]:
    """Return what nodes of a plant send, mutated here and there, and the conversations of a page, by time."""
    chance = random.Random(seed)
    plant = generate(seed, frames=300, link=1)
    plant = mutate(seed, plant) if chance.random() < 0.5 else plant
    page, _ = captured(seed)
    begin_ns = plant[0].ts_ns - page[0].ts_ns
    moved = [one._replace(ts_ns=one.ts_ns + begin_ns) for one in page]
    return sorted([*plant, *moved], key=lambda one: one.ts_ns)


@pytest.mark.parametrize(("seed", "slot_bytes"), crossed(some(range(12)), [1, 3000, 1 << 20]))
def test_a_report_is_the_same_by_whoever_it_is_prepared(
    tmp_path: Path, handed: list[Any], seed: int, slot_bytes: int
) -> None:
    path = written(tmp_path / "a.pcap", plant_and_page(seed))
    here = reported(path, _HERE)
    assert not handed
    assert reported(path, replace(_AHEAD, slot_bytes=slot_bytes)) == here
    assert len(handed) > 3
    assert here["visu"]
    assert here["lists"]


@pytest.mark.parametrize("name", ["visu/panel.pcap", "peers/peers.pcap", "telegrams.pcap", "interfaces.pcapng"])
def test_a_real_capture_is_told_the_same(handed: list[Any], name: str) -> None:
    here = reported(CAPTURES / name, _HERE)
    assert reported(CAPTURES / name, _AHEAD) == here
    assert handed


@pytest.mark.parametrize("after", [0, 1, 5, 20])
def test_what_is_left_is_prepared_here_where_the_process_dies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    path = written(tmp_path / "a.pcap", plant_and_page(3))
    here = reported(path, _HERE)
    let_it_die(monkeypatch, after)
    assert reported(path, _AHEAD) == here


@pytest.mark.parametrize("after", [None, 2, 9])
def test_varieties_may_become_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, handed: list[Any], after: int | None
) -> None:
    """They are let go of then, and numbered anew, wherever packets are told."""
    monkeypatch.setattr(sorter, "MOST_VARIETIES", 8)
    path = written(tmp_path / "a.pcap", plant_and_page(5))
    here = reported(path, _HERE)
    if after is not None:
        let_it_die(monkeypatch, after)
    assert reported(path, _AHEAD) == here
    assert sum(one.varieties is not None and one.varieties.anew for one in handed) > 3


@pytest.mark.parametrize("most", [1, 3])
def test_connections_may_become_too_many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Some of them are forgotten then, and the others numbered anew."""
    monkeypatch.setattr(follower, "ENOUGH", most)
    frames = sorted((one for seed in range(6) for one in captured(seed)[0]), key=lambda one: one.ts_ns)
    path = written(tmp_path / "a.pcap", frames)
    assert reported(path, _AHEAD) == reported(path, _HERE)


def test_large_packets_are_told_where_they_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """To find them takes as long as all that is to be done with them, but for those whose bytes are put in order."""
    monkeypatch.undo()
    small, large = (PacketBatch.of([bytes(size)] * 4, 1) for size in (200, 1400))
    pages = batch_of([tcp_frame(0, ("10.0.0.1", 5000), ("10.0.0.2", 8080), seq=1, data=bytes(1400))] * 4)
    recogniser = Recogniser(Inquiry([]).reading())
    for batch, is_worth_it in ((small, True), (large, False), (pages, True)):
        assert list(recogniser.tell(batch))
        assert recogniser.preparation.is_worth_it(batch) == is_worth_it
