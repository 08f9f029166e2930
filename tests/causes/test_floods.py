"""Very many made-up senders and faults: what is told stays short and right, and nothing is left without a cause."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.causes import judge
from tests.causes.plants import causes_in
from tests.causes.test_at_the_edges import PRESS, SAW, sent, titles


def test_very_many_senders_of_a_list_are_one_cause(tmp_path: Path) -> None:
    flood = [
        frame
        for at in range(300)
        for frame in sent(f"10.1.{at // 200}.{1 + at % 200}", 1 + at % 2, [at], since_ms=5000 + 100 * at)
    ]
    frames = [*sent(PRESS, 1, list(range(400))), *sent(SAW, 2, list(range(400))), *flood]
    (cause,) = causes_in(frames, tmp_path)
    assert titles([cause]) == [
        (
            "second-sender",
            "300 further nodes sent lists 1 and 2 from 5.0 s to 34.9 s: 10.1.0.1, 10.1.0.2 and 298 others",
        )
    ]
    assert cause.checked == (
        "all from one hardware address, 02:00:00:00:00:02: one device, or a router in between",
        "they sent 300 telegrams, one each",
    )
    assert cause.next == "Find 02:00:00:00:00:02: the address table of the switch tells its port."
    assert len(cause.nodes) < 20


def test_who_stands_out_among_them_is_told_by_itself(tmp_path: Path) -> None:
    flood = [frame for at in range(60) for frame in sent(f"10.1.0.{1 + at}", 1, [at], since_ms=5000 + 100 * at)]
    other = sent("10.0.0.95", 1, list(range(200)), since_ms=10_040)
    causes = causes_in([*sent(PRESS, 1, list(range(400))), *other, *flood], tmp_path)
    assert sorted(title for _, title in titles(causes)) == [
        "60 further nodes sent list 1 from 5.0 s to 10.9 s: 10.1.0.1, 10.1.0.2 and 58 others",
        "A further node sent list 1 from 10.0 s to 29.9 s: 10.0.0.95",
    ]


def test_where_there_are_too_many_causes_the_rest_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [frame for at in range(8) for frame in sent(f"10.0.1.{at}", 10 + at, list(range(30 + 5 * at)))]
    frames += sent(PRESS, 1, list(range(400)))
    every = causes_in(frames, tmp_path)
    assert {cause.kind.name for cause in every} == {"node-silent"}
    assert len(every) == 8
    monkeypatch.setattr(judge, "MOST_CAUSES", 3)
    *told, rest = sorted(causes_in(frames, tmp_path), key=lambda cause: cause.kind.name)
    assert len(told) == 3
    assert {cause.title for cause in told} <= {cause.title for cause in every}
    assert rest.title == "5 events without a cause: no more than 3 are told"
    assert {finding.code for finding in rest.findings} <= {"NV504"}
