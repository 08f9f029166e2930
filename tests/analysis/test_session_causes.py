"""What a live session says of what happened: in each snapshot the causes so far, with those that are over."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.causes.mark import Mark
from nvscope.report import text
from nvscope.tracker.evidence.witness import Witness
from tests.causes.told import causes_of
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]


def test_a_snapshot_has_the_causes_with_those_that_are_over(tmp_path: Path) -> None:
    inquiry = simulated(ROOT / "tests" / "scenarios" / "causes" / "five-at-once.toml").inquiry(tmp_path)
    session = inquiry.session()
    session.start()
    assert session.wait(60)
    seen = session.stop()
    assert seen.happened is not None
    told = [(cause.kind.name, cause.title, cause.until_ns) for cause in seen.happened.causes]
    assert told == [(cause.kind.name, cause.title, cause.until_ns) for cause in causes_of(inquiry)[1]]
    assert {until_ns is None for _, _, until_ns in told} == {True, False}


def test_a_snapshot_stays_as_it_is_while_its_session_goes_on(tmp_path: Path) -> None:
    inquiry = simulated(ROOT / "tests" / "scenarios" / "restart.toml").inquiry(tmp_path)
    session = inquiry.session()
    session.start()
    first = session.snapshot()
    assert session.wait(60)
    last = session.stop()
    for seen in (first, last):
        assert seen.happened is not None
        strips = seen.happened.chronicle.strips([str(entry.key) for entry in seen.summary.lists], 40)
        assert all(len(strip) == 40 for strip in strips)
    assert last.happened is not None
    (strip,) = last.happened.chronicle.strips([str(entry.key) for entry in last.summary.lists], 40)
    assert {Mark.RESTARTED, Mark.SILENT} <= set(strip)


def test_what_there_is_no_room_for_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inquiry = simulated(ROOT / "tests" / "scenarios" / "causes" / "five-at-once.toml").inquiry(tmp_path)
    whole = inquiry.report(inquiry.analyze())
    assert "evidence_left_out" not in whole
    monkeypatch.setattr(Witness, "left_out", 7)
    document = inquiry.report(inquiry.analyze())
    assert document == whole | {"evidence_left_out": 7}
    assert "7 events left out, for which there was no room: causes may lack some" in text.render(document)
