"""Rules that are judged only at times: telegrams, silences, intervals and losses while something is so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.check.rules import read_rules
from nvscope.check.run import checked
from nvscope.check.verdict import Verdict
from nvscope.definition.project_file import read_project
from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import BEGIN_NS, Sending, captured, definitions, judged, packed, ruled
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram

WHEN = 'when = "var.safety.nMode == 3"\n'
"""Mode 3 is from 2.0 s to 4.0 s, and from 6.0 s to 8.0 s: list 7 says so every 100 ms."""


def plant(**valve: Any) -> list[Sending]:
    """Return 10 s of both lists; the valve's list is sent every 100 ms, at those ms, and not at these."""
    left_out, extra = valve.get("left_out", ()), valve.get("extra", ())
    found: list[Sending] = [
        (at_ms, 7, [False, 3 if 2000 <= at_ms < 4000 or 6000 <= at_ms < 8000 else 1]) for at_ms in range(0, 10_000, 100)
    ]
    times = [at_ms for at_ms in range(50, 10_000, 100) if not any(a <= at_ms < b for a, b in left_out)]
    return found + [(at_ms, 8, []) for at_ms in sorted([*times, *extra])]


OUTSIDE, INSIDE = {"left_out": [(4500, 5500)]}, {"left_out": [(2500, 3500)]}
FAST_OUTSIDE, FAST_INSIDE = {"extra": [5060]}, {"extra": [3060]}


@pytest.mark.parametrize(
    ("rule", "outside", "inside", "worst"),
    [
        ('check = "cycle"\nlist = 8\ninterval = "100ms"\ntolerance = "10%"', OUTSIDE, INSIDE, 1.1),
        ('check = "silence"\nlist = 8\nmax = "500ms"', OUTSIDE, INSIDE, 1.1),
        ('check = "min_gap"\nlist = 8\nmin = "50ms"', FAST_OUTSIDE, FAST_INSIDE, 0.01),
        ('check = "absent"\nlist = 8', {"left_out": [(2000, 4100), (6000, 8100)]}, {}, 40),
        ('check = "occurrence"\nlist = 8\nper = "2s"\nmax = 19', {"left_out": [(2300, 2400), (6300, 6400)]}, {}, 20),
        ('check = "occurrence"\nlist = 8\nper = "1s"\nmin = 9', OUTSIDE, INSIDE, 5),
        ('check = "always"\nlist = 8\nexpr = "list.telegrams > 8"\nwindow = "1s"', OUTSIDE, INSIDE, 2.0),
        ('check = "always"\nlist = 8\nexpr = "list.interval_max < 0.5"\nwindow = "1s"', OUTSIDE, INSIDE, 1.0),
    ],
)
def test_what_happens_at_other_times_breaks_nothing(
    rule: str, outside: dict[str, Any], inside: dict[str, Any], worst: float, tmp_path: Path
) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    (kept,) = judged(captured(tmp_path, plant(**outside)), ruled(tmp_path, f"{rule}\n{WHEN}"), *options)["rules"]
    assert kept["verdict"] == "pass", kept
    (broken,) = judged(captured(tmp_path, plant(**inside)), ruled(tmp_path, f"{rule}\n{WHEN}"), *options)["rules"]
    (subject,) = broken["subjects"]
    assert (broken["verdict"], subject["worst"]) == ("fail", pytest.approx(worst)), broken
    (always,) = judged(captured(tmp_path, plant(**outside)), ruled(tmp_path, rule), *options)["rules"]
    assert always["verdict"] == "fail"


def counted(at_ms: int) -> list[Sending]:
    """Return the plant with one telegram of the valve lost at a time: its counter goes on."""
    return [one for one in plant() if one[:2] != (at_ms, 8)]


@pytest.mark.parametrize(("check", "worst"), [("loss", 1 / 41), ("gap", 1)])
@pytest.mark.parametrize(("at_ms", "verdict"), [(5050, "pass"), (3050, "fail")])
def test_what_is_lost_at_other_times_does_not_count(
    check: str, worst: float, at_ms: int, verdict: str, tmp_path: Path
) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    whole = captured(tmp_path, plant(), "whole.pcap").read_bytes()
    packets, place = [], 24
    while place < len(whole):
        length = int.from_bytes(whole[place + 8 : place + 12], "little")
        packets.append(whole[place : place + 16 + length])
        place += 16 + length
    sent = sorted(plant(), key=lambda one: one[0])
    lost = next(number for number, one in enumerate(sent) if one[:2] == (at_ms, 8))
    capture = tmp_path / "lossy.pcap"
    capture.write_bytes(whole[:24] + b"".join(packets[:lost] + packets[lost + 1 :]))
    (one,) = judged(capture, ruled(tmp_path, f'check = "{check}"\nlist = 8\n{WHEN}'), *options)["rules"]
    (subject,) = one["subjects"]
    assert one["verdict"] == verdict
    if verdict == "fail":
        assert subject["worst"] == pytest.approx(1 / 40 if check == "loss" else worst)
        assert subject["first_ns"] == str(BEGIN_NS + 3150 * 10**6)


def test_what_is_never_so_leaves_nothing_to_judge(tmp_path: Path) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    rule = 'check = "loss"\nlist = 8\nwhen = "var.safety.nMode == 9"'
    (one,) = judged(captured(tmp_path, plant()), ruled(tmp_path, rule), *options)["rules"]
    assert (one["verdict"], one["subjects"][0]["reason"]) == ("inconclusive", "when was never so")
    (one,) = judged(captured(tmp_path, plant()), ruled(tmp_path, f"{rule}\noptional = true"), *options)["rules"]
    assert one["verdict"] == "pass"


@given(
    modes=st.lists(st.sampled_from([1, 3]), min_size=30, max_size=60),
    sent=st.lists(st.integers(0, 299), min_size=2, max_size=60, unique=True),
)
@examples(30)
def test_silences_and_intervals_are_those_within(
    tmp_path_factory: pytest.TempPathFactory, modes: list[int], sent: list[int]
) -> None:
    """A second time, in steps of 10 ms, by what is so at each of them."""
    folder = tmp_path_factory.mktemp("when")
    sendings: list[Sending] = [(number * 100, 7, [False, mode]) for number, mode in enumerate(modes)]
    sent = sorted(one for one in sent if one * 20 + 10 < len(modes) * 100)
    sendings += [(one * 20 + 10, 8, []) for one in sent]
    end_ms = max(one[0] for one in sendings)
    longest = silent = 0
    intervals, last = [], None
    times = {one * 20 + 10 for one in sent}
    for at_ms in range(0, end_ms + 10, 10):
        is_so = modes[min(at_ms // 100, len(modes) - 1)] == 3
        was_so = at_ms > 0 and modes[min((at_ms - 10) // 100, len(modes) - 1)] == 3
        silent = silent + 10 if was_so else 0
        longest = max(longest, silent)
        if not is_so:
            silent, last = 0, None
        if at_ms in times:
            silent = 0
            if is_so:
                intervals += [] if last is None else [at_ms - last]
                last = at_ms
    rules = ruled(
        folder, f'check = "silence"\nlist = 8\nmax = "1h"\n{WHEN}', f'check = "min_gap"\nlist = 8\nmin = "1h"\n{WHEN}',
    )  # fmt: skip
    project = read_project(None, definitions=[str(one) for one in definitions(folder)])
    capture = captured(folder, sendings)
    found = checked(Inquiry([str(capture)], project), read_rules([str(rules)]))
    silence, gap = found.decided
    if 3 not in modes[: end_ms // 100 + 1]:
        assert [one.verdict for one in found.decided] == [Verdict.INCONCLUSIVE] * 2
        return
    if sent and any(modes[min(one * 20 + 10, len(modes) * 100 - 1) // 100] == 3 for one in sent):
        assert silence.subjects[0].worst == pytest.approx(longest / 1000)
    assert gap.subjects[0].worst == (pytest.approx(min(intervals) / 1000) if intervals else None)


@given(
    modes=st.lists(st.sampled_from([1, 3]), min_size=30, max_size=60),
    sent=st.lists(st.integers(0, 299), min_size=2, max_size=60, unique=True),
    length=st.sampled_from([100, 150, 300, 700]),
)
@examples(30)
def test_windows_are_those_that_lie_wholly_within(
    tmp_path_factory: pytest.TempPathFactory, modes: list[int], sent: list[int], length: int
) -> None:
    """A second time, window by window: those of figures lie on one grid, those of occurrences begin with each time."""
    folder = tmp_path_factory.mktemp("windows")
    sent = sorted(one * 20 + 10 for one in sent if one * 20 + 10 < len(modes) * 100)
    sendings: list[Sending] = [(number * 100, 7, [False, mode]) for number, mode in enumerate(modes)]
    sendings += [(one, 8, []) for one in sent]
    end_ms = max(one[0] for one in sendings)
    spans: list[list[int]] = []
    for number, mode in enumerate(modes):
        if mode == 3 and (not number or modes[number - 1] != 3):
            spans.append([number * 100, end_ms])
        elif mode != 3 and number and modes[number - 1] == 3:
            spans[-1][1] = number * 100
    on_grid = [
        at for at in range(0, end_ms - length + 1, length)
        if any(begin <= at and at + length <= end for begin, end in spans)
    ]  # fmt: skip
    anew = [at for begin, end in spans for at in range(begin, end - length + 1, length)]

    def counts(begins: list[int]) -> list[int]:
        return [sum(at <= one < at + length for one in sent) for at in begins]

    window = f'window = "{length}ms"'
    rules = ruled(
        folder, f'check = "never"\nlist = 8\nexpr = "list.telegrams > 1"\n{window}\n{WHEN}',
        f'check = "occurrence"\nlist = 8\nper = "{length}ms"\nmax = 1\nmin = 1\n{WHEN}',
    )  # fmt: skip
    project = read_project(None, definitions=[str(one) for one in definitions(folder)])
    capture = captured(folder, sendings)
    never, occurrence = checked(Inquiry([str(capture)], project), read_rules([str(rules)])).decided
    if not spans:
        assert [one.verdict for one in (never, occurrence)] == [Verdict.INCONCLUSIVE] * 2
        return
    broken = sum(one > 1 for one in counts(on_grid))
    assert never.subjects[0].count == broken
    assert (never.verdict is Verdict.FAIL) == (broken > 0)
    assert occurrence.subjects[0].count == sum(one != 1 for one in counts(anew))


def swapped(at_ms: int, lost_ms: int | None = None) -> list[Sending]:
    """Return the valve's list with two telegrams that overtook each other, and perhaps one that was lost."""
    times = [number * 100 + 50 for number in range(100)]
    counters = list(range(100))
    place = times.index(at_ms)
    counters[place], counters[place + 1] = counters[place + 1], counters[place]
    return [(at, counter, 0) for at, counter in zip(times, counters, strict=True) if at != lost_ms]  # type: ignore[misc]


def written(folder: Path, sendings: list[Sending]) -> Path:
    """Write the modes, and the valve's list with counters of its own."""
    packets = []
    events = [(at_ms, 7, mode, number) for number, (at_ms, _, (_, mode)) in enumerate(plant()[:100])]
    events += [(at_ms, 8, 0, counter) for at_ms, counter, _ in sendings]  # type: ignore[list-item]
    for at_ms, index, mode, counter in sorted(events):
        values = [False, mode] if index == 7 else []
        payload = telegram(list_id=index, counter=counter + 1, data=packed(index, values), items=2 if index == 7 else 5)
        one = data_frame(BEGIN_NS + at_ms * 10**6, f"10.0.0.{index}", "10.0.0.255", payload)
        packets.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return write(folder / "x.pcap", packets)


@pytest.mark.parametrize(
    ("at_ms", "lost_ms", "when", "warmup", "verdict"),
    [
        (1950, None, WHEN, "0s", "pass"),
        (3950, None, WHEN, "0s", "pass"),
        (1950, 3050, WHEN, "0s", "fail"),
        (1950, 1050, WHEN, "0s", "pass"),
        (1950, None, "", "2s", "pass"),
        (1950, 6050, "", "2s", "fail"),
    ],
)
@pytest.mark.parametrize("check", ["loss", "gap"])
def test_what_came_late_is_taken_from_where_it_was_missing(
    check: str, at_ms: int, lost_ms: int | None, when: str, warmup: str, verdict: str, tmp_path: Path
) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    rules = ruled(tmp_path, f'check = "{check}"\nlist = 8\n{when}', defaults=f'warmup = "{warmup}"')
    (one,) = judged(written(tmp_path, swapped(at_ms, lost_ms)), rules, *options)["rules"]
    assert one["verdict"] == verdict, one


def test_a_value_is_not_frozen_while_nobody_looks(tmp_path: Path) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    sendings = [one for one in plant() if one[1] == 7]
    sendings += [
        (at_ms, 8, [False, 0.0, 7 if 2000 <= at_ms < 4000 or 6000 <= at_ms < 8000 else at_ms // 50])
        for at_ms in range(50, 10_000, 100)
    ]
    for most, verdict in (("1950ms", "pass"), ("3s", "inconclusive")):
        rule = f'check = "frozen"\nvariable = "valve.nCount"\nmax = "{most}"\n{WHEN}'
        (one,) = judged(captured(tmp_path, sendings), ruled(tmp_path, rule), *options)["rules"]
        assert (one["verdict"], one["subjects"][0]["worst"]) == (verdict, pytest.approx(1.9))


def test_a_list_that_never_came_is_silent_while_somebody_looks(tmp_path: Path) -> None:
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    capture = captured(tmp_path, [one for one in plant() if one[1] == 7])
    for limit, verdict in (("1s", "fail"), ("5s", "inconclusive")):
        rules = ruled(tmp_path, f'check = "silence"\nlist = "valve"\nmax = "{limit}"\n{WHEN}')
        (one,) = judged(capture, rules, *options)["rules"]
        assert (one["verdict"], one["subjects"][0]["worst"]) == (verdict, pytest.approx(2.0))
