"""Lines and trees as pages: golden files, and what is told of a telegram that the capture cut."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from nvscope.report.packets.text import Text
from tests.oracle.builders import data_frame, telegram
from tests.packets import Batches, batch_of
from tests.report.packets.written import INTERFACES, PUBLIC, READER, SENDER, written, written_of


@pytest.mark.parametrize(
    ("path", "width"), [(PUBLIC, 80), (PUBLIC, 120), (INTERFACES, 80)], ids=["public-80", "public-120", "interfaces-80"]
)
def test_golden_lines(path: Path, width: int, golden: Callable[[str, str], None]) -> None:
    golden(f"packets-{path.stem}.{width}.txt", written_of(Text(width=width, moment="u"), path))


@pytest.mark.parametrize("width", [80, 120])
def test_golden_tree(width: int, golden: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    try:
        golden(f"packets-telegrams.{width}.tree.txt", written_of(Text(width=width, trees=True), PUBLIC))
        golden(f"packets-interfaces.{width}.tree.txt", written_of(Text(width=width, trees=True), INTERFACES))
    finally:
        monkeypatch.undo()
        time.tzset()


def test_what_the_capture_cut_is_told() -> None:
    frame = data_frame(0, SENDER, READER, telegram(data=bytes(40)))
    for kept, told in ((12, "  ?  ?  ?  cut: 12 of 60 bytes"), (30, "  60 B  #1  cut: 30 of 60 bytes")):
        cut = frame._replace(data=frame.data[: 42 + kept])
        assert told in written(Text(), Batches([batch_of([cut])]))
        tree = written(Text(trees=True), Batches([batch_of([cut])]))
        assert ("Counter                 not captured" in tree) == (kept == 12)
        assert ("Data  10 bytes, 30 more not captured" in tree) == (kept == 30)
