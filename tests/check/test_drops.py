"""What a capture lost itself explains what is missing then, and no more of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import pytest

from nvscope.capture.open import open_source
from nvscope.capture.source import SourceInfo
from tests.capture import build
from tests.check.plants import judged, ruled
from tests.oracle.builders import data_frame, telegram

BEGIN_US = 1_700_000_000 * 10**6


def capture(folder: Path, missing: Collection[int], told: Sequence[tuple[int, int]]) -> Path:
    """Write 8 s of a list that is sent every 100 ms.

    ``told`` is how many frames were lost by when, in ms; 0 where that is not said.
    """
    parts = [build.section("<"), build.interface("<", 1)]
    blocks = [(number * 100 + 1, build.enhanced("<", BEGIN_US + number * 100_000, frame(number)))
              for number in range(80) if number not in missing]  # fmt: skip
    for at_ms, count in told:
        head = BEGIN_US + at_ms * 1000 if at_ms else 0
        body = (
            (0).to_bytes(4, "little") + (head >> 32).to_bytes(4, "little") + (head & 0xFFFFFFFF).to_bytes(4, "little")
        )
        block = build.block("<", 5, body + build.option("<", 5, count.to_bytes(8, "little")))
        blocks.append((at_ms or 10_000, block))
    path = folder / "x.pcapng"
    path.write_bytes(b"".join([*parts, *(block for _, block in sorted(blocks, key=lambda one: one[0]))]))
    return path


def frame(number: int) -> bytes:
    payload = telegram(list_id=7, counter=number + 1, data=b"\1\2")
    return data_frame(0, "10.0.0.1", "10.0.0.255", payload).data


RULES = 'check = "loss"', 'check = "gap"', 'check = "cycle"\ninterval = "100ms"', 'check = "silence"\nmax = "150ms"'


@pytest.mark.parametrize(
    ("told", "verdict"),
    [
        ([(8000, 1)], "inconclusive"),
        ([(0, 1)], "inconclusive"),
        ([(3000, 0), (5000, 1), (8000, 1)], "inconclusive"),
        ([(500, 0), (600, 1), (8000, 1)], "fail"),
        ([(6000, 0), (8000, 1)], "fail"),
        ([(8000, 0)], "fail"),
    ],
)
def test_it_matters_when_frames_were_lost(told: list[tuple[int, int]], verdict: str, tmp_path: Path) -> None:
    found = judged(capture(tmp_path, {40}, told), ruled(tmp_path, *RULES))
    assert [one["verdict"] for one in found["rules"]] == [verdict] * len(RULES)


@pytest.mark.parametrize(("drops", "verdict"), [(1, "fail"), (3, "fail"), (4, "inconclusive")])
def test_it_matters_how_many_were(drops: int, verdict: str, tmp_path: Path) -> None:
    found = judged(capture(tmp_path, {40, 41, 42, 43}, [(8000, drops)]), ruled(tmp_path, RULES[0], RULES[1]))
    assert [one["verdict"] for one in found["rules"]] == [verdict] * 2


def test_what_was_seen_was_so(tmp_path: Path) -> None:
    rules = ruled(tmp_path, 'check = "always"\nexpr = "nv.counter != 30"', 'check = "absent"\nlist = 7')
    found = judged(capture(tmp_path, {40}, [(8000, 5)]), rules)
    assert [one["verdict"] for one in found["rules"]] == ["fail", "fail"]


def test_spans_are_told_by_statistics(tmp_path: Path) -> None:
    source = open_source([str(capture(tmp_path, set(), [(500, 0), (600, 2), (3000, 2), (8000, 5)]))])
    assert sum(len(batch) for batch in source) == 80
    (info,) = source.infos
    begin_ns = BEGIN_US * 1000
    assert [tuple(one[:3]) for one in info.lost if not one.at_packet] == [
        (begin_ns + 500 * 10**6, begin_ns + 600 * 10**6, 2), (begin_ns + 3000 * 10**6, begin_ns + 8000 * 10**6, 3),
    ]  # fmt: skip
    assert info.drops == 5


def test_a_break_at_another_time_is_none_of_the_capture_s(tmp_path: Path) -> None:
    told = [(2000, 0), (4000, 2), (7900, 2)]
    rules = ruled(
        tmp_path, *RULES, 'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"',
        'check = "occurrence"\nper = "1s"\nmin = 10',
    )  # fmt: skip
    both = judged(capture(tmp_path, {30, 31, 60}, told), rules)
    silence = both["rules"][3]["subjects"][0]
    assert (silence["worst"], silence["frames"]) == (pytest.approx(0.2), [59])
    assert [one["verdict"] for one in both["rules"]] == ["fail"] * 6
    first = judged(capture(tmp_path, {30, 31}, told), rules)
    assert [one["verdict"] for one in first["rules"]] == ["inconclusive"] * 6


def with_counts(folder: Path, missing: Collection[int], counts: dict[int, int], *, interfaces: int = 1) -> Path:
    """Write the same capture, whose packets say how many were lost in front of them."""
    parts = [build.section("<"), *[build.interface("<", 1)] * interfaces]
    for number in range(80):
        if number in missing:
            continue
        told = build.option("<", 4, counts[number].to_bytes(8, "little")) if number in counts else b""
        parts.append(build.enhanced("<", BEGIN_US + number * 100_000, frame(number), options=told))
    path = folder / "x.pcapng"
    path.write_bytes(b"".join(parts))
    return path


@pytest.mark.parametrize(
    ("missing", "counts", "verdict"),
    [
        ({40}, {41: 1}, "inconclusive"),
        ({40}, {70: 1}, "fail"),
        ({40}, {41: 1, 70: 5}, "inconclusive"),
        ({40}, {}, "fail"),
        ({20, 60}, {21: 1, 61: 1}, "inconclusive"),
        ({20, 60}, {21: 2}, "fail"),
        ({40, 41, 42}, {43: 3}, "inconclusive"),
        ({40, 41, 42}, {43: 1}, "fail"),
    ],
)
def test_packets_tell_where_others_were_lost(
    missing: set[int], counts: dict[int, int], verdict: str, tmp_path: Path
) -> None:
    found = judged(with_counts(tmp_path, missing, counts), ruled(tmp_path, *RULES))
    assert [one["verdict"] for one in found["rules"]] == [verdict] * len(RULES)


MORE = (
    *RULES, 'check = "occurrence"\nper = "1s"\nmin = 10', 'check = "never"\nexpr = "list.lost > 0"\nwindow = "1s"',
)  # fmt: skip


@pytest.mark.parametrize(("lost", "verdict"), [(1, "fail"), (6, "fail"), (7, "inconclusive"), (70, "inconclusive")])
def test_drops_explain_no_more_than_they_are(lost: int, verdict: str, tmp_path: Path) -> None:
    """Seven telegrams are missing, each by itself: nobody says when the capture lost so many frames."""
    found = judged(capture(tmp_path, range(5, 75, 10), [(0, lost)]), ruled(tmp_path, *MORE))
    assert [one["verdict"] for one in found["rules"]] == [verdict] * len(MORE)


@pytest.mark.parametrize(("lost", "verdict"), [(1, "fail"), (9, "fail"), (10, "inconclusive")])
def test_one_long_gap_takes_as_many_drops(lost: int, verdict: str, tmp_path: Path) -> None:
    rules = [one for one in MORE if "cycle" not in one and "silence" not in one and "occurrence" not in one]
    found = judged(capture(tmp_path, range(40, 50), [(0, lost)]), ruled(tmp_path, *rules))
    assert [one["verdict"] for one in found["rules"]] == [verdict] * len(rules)


def test_an_interval_that_is_too_short_is_nobody_s_loss(tmp_path: Path) -> None:
    path = capture(tmp_path, (), [(0, 50)])
    twice = build.enhanced("<", BEGIN_US + 7_910_000, frame(80))
    path.write_bytes(path.read_bytes() + twice)
    (one,) = judged(path, ruled(tmp_path, 'check = "cycle"\ninterval = "100ms"'))["rules"]
    assert one["verdict"] == "fail"


def test_where_packets_say_it_the_times_are_theirs(tmp_path: Path) -> None:
    (info,) = _read(with_counts(tmp_path, {40}, {41: 3, 70: 2}))
    times = [(BEGIN_US + at * 100_000) * 1000 for at in (39, 41, 69, 70)]
    assert info.lost == ((times[0], times[1], 3, True), (times[2], times[3], 2, True))
    assert info.drops == 5
    # Of an interface that has sent nothing before, nobody knows since when.
    (info,) = _read(with_counts(tmp_path, (), {0: 4}, interfaces=2))
    assert [tuple(one[:3]) for one in info.lost] == [(None, BEGIN_US * 1000, 4)]


def _read(path: Path) -> list[SourceInfo]:
    source = open_source([str(path)])
    for _ in source:
        pass
    return list(source.infos)
