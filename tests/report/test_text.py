from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.report import text
from nvscope.view.lines.plant import tables
from nvscope.view.lines.table import Tone
from nvscope.view.lines.text_width import display_width
from tests.laws import in_turn

from .examples import CLEAN, EXAMPLES, HOSTILE, MS, TROUBLED, at, diag, finding, interval, report, stream, udp_list

HOW_MUCH: dict[str, dict[str, bool]] = {"": {}, "all": {"everything": True}, "details": {"details": True}}

GOLDEN = [
    ("clean", 80, ""),
    ("clean", 100, "details"),
    ("troubled", 80, ""),
    ("troubled", 80, "all"),
    ("troubled", 120, ""),
    ("troubled", 120, "details"),
    ("no-telegrams", 80, ""),
    ("no-frames", 80, ""),
    ("no-frames-then", 80, ""),
    ("only-parameters", 80, ""),
    ("hostile", 80, "details"),
    ("alike", 40, ""),
    ("alike", 80, "all"),
]


@pytest.mark.parametrize(("example", "width", "much"), GOLDEN)
def test_golden(example: str, width: int, much: str, golden: Callable[[str, str], None]) -> None:
    shown = text.render(EXAMPLES[example], width=width, utc=True, **HOW_MUCH[much])
    golden(f"{example}.{width}{'.' * bool(much)}{much}.txt", shown)


@pytest.mark.parametrize("details", [False, True])
@pytest.mark.parametrize("example", EXAMPLES)
def test_no_line_is_wider_than_the_terminal(example: str, details: bool) -> None:
    for width in in_turn(range(40, 200), (2 * list(EXAMPLES).index(example) + details) % 7, 7):
        shown = text.render(EXAMPLES[example], width=width, utc=True, details=details)
        assert max(display_width(line) for line in shown.splitlines()) <= width
        assert all(line == line.rstrip() for line in shown.splitlines())


@pytest.mark.parametrize("example", EXAMPLES)
def test_colour_changes_no_character(example: str) -> None:
    for width in (40, 80, 120):
        plain = text.render(EXAMPLES[example], width=width, utc=True, details=True)
        coloured = text.render(EXAMPLES[example], colour=True, width=width, utc=True, details=True)
        assert re.sub(r"\x1b\[[0-9;]+m", "", coloured) == plain
        assert "\x1b[" in coloured


def test_colour_is_not_needed_to_tell_what_is_bad() -> None:
    shown = text.render(TROUBLED, utc=True, everything=True)
    first = next(place for place, line in enumerate(shown.splitlines()) if line.startswith("   list")) + 1
    rows = [line.split()[:2] for line in shown.splitlines()[first : first + 4]]
    assert rows == [["✗", "conveyor"], ["!", "axis"], ["●", "42"], ["●", "43"]]
    rows = [line.split()[:3] for line in shown.splitlines() if "udp/1" in line[:22]]
    assert [row[1] for row in rows[:4]] == ["error", "warning", "ok", "note"]


OWN_WORDS = {
    "severity",
    "kind",
    "since_ns",
    "until_ns",
    "status",
    "list",
    "start_ns",
    "end_ns",
    "first_ns",
    "last_ns",
    "tLastSend",
    "tLastReceive",
    "tLastError",
}


def poisoned(value: Any, poison: str, key: str = "") -> Any:
    """Return a copy of a report with every text replaced that comes from outside, or might."""
    if isinstance(value, dict):
        return {name: poisoned(item, poison, name) for name, item in value.items()}
    if isinstance(value, list):
        return [poisoned(item, poison, key) for item in value]
    return poison if isinstance(value, str) and key not in OWN_WORDS else value


@given(st.text(st.characters(), max_size=40), st.sampled_from([TROUBLED, HOSTILE]), st.integers(40, 130))
def test_whatever_the_texts_hold_the_terminal_gets_printable_lines(poison: str, report: Any, width: int) -> None:
    shown = text.render(poisoned(report, poison), width=width, utc=True, details=True)
    assert shown.endswith("\n")
    assert all(line.isprintable() for line in shown.split("\n"))
    assert max(display_width(line) for line in shown.split("\n")) <= width


def test_nothing_heavy_is_needed_to_show_a_report() -> None:
    program = "import sys, nvscope.report.text; print({'rich', 'numpy', 'scapy'} & sys.modules.keys())"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout == b"set()\n"


def test_rendering_leaves_the_report_alone() -> None:
    before = repr(HOSTILE)
    text.render(HOSTILE, details=True)
    assert repr(HOSTILE) == before


def test_every_finding_is_shown_in_the_order_given_with_its_sentences() -> None:
    shown = " ".join(text.render(TROUBLED, width=100, utc=True, everything=True).split())
    places = [shown.index(f"{one['code']} {one['name']}") for one in TROUBLED["findings"]]
    assert places == sorted(places)
    for one in TROUBLED["findings"]:
        assert one["message"] in shown
        assert f"Next: {one['hint']}" in shown
        for frame in one["frames"]:
            assert str(frame) in shown


@pytest.mark.parametrize(
    ("example", "first_line"),
    [
        ("clean", "● 2 lists, all well · 2 min 00 s · 4 801 telegrams"),
        ("troubled", "✗ 1 fault now, 3 passed · 4 lists, 2 affected"),
        ("no-telegrams", "● None of 412 frames is a telegram of network variables"),
        ("no-frames", "● The capture holds no frames"),
        ("no-frames-then", "● No frame of the capture lies in the time that was asked for"),
        ("only-parameters", "● No list: no telegram belongs to a network variables list"),
        ("hostile", "✗ 1 fault now · 1 list, affected"),
    ],
)
def test_the_first_line_is_the_verdict(example: str, first_line: str) -> None:
    assert text.render(EXAMPLES[example], width=100).splitlines()[0] == first_line


def test_times_are_local_unless_utc_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    try:
        assert "from 2024-05-02 14:03:07.123 to 14:05:07.123 +02:00" in text.render(CLEAN)
        assert "from 2024-05-02 12:03:07.123 to 12:05:07.123 Z" in text.render(CLEAN, utc=True)
    finally:
        monkeypatch.undo()
        time.tzset()


def lines_of(row: dict[str, Any], width: int = 100) -> list[str]:
    capture = {"frames": 9, "telegrams": 9, "start_ns": at(0), "end_ns": at(0)}
    return text.render(report(capture, [row], []), width=width, utc=True, details=True).splitlines()


def test_counters_are_shown_at_full_width_with_what_the_controller_shows() -> None:
    row = udp_list(1202, 1, diag=diag(nSendCount=2**32 + 5, nErrorCount=65_535, nAcknowledges=65_536))
    lines = lines_of(row)
    wrapped = lines.index("nSendCount     4 294 967 301")
    assert lines[wrapped + 1] == "  as UDINT                 5"
    errors = lines.index("nErrorCount           65 535")
    assert lines[errors + 1] == "nAcknowledges         65 536"
    assert lines[errors + 2] == "  as UINT                  0"


def test_the_interval_of_a_list_with_different_streams_is_a_range() -> None:
    def cyclic(nominal_ns: int, p99_ns: int) -> dict[str, Any]:
        return interval(9, 1, 1, 1, 1, nominal_ns, nominal_ns, p99_ns, nominal=nominal_ns)

    def row(lines: Sequence[str]) -> str:
        return lines[lines.index("Figures") + 2]

    near = [stream("10.0.0.1", sub, 10, cyclic(50 * MS + sub, 51 * MS)) for sub in (0, 1)]
    far = [stream("10.0.0.1", 2, 10, cyclic(100 * MS, 150 * MS))]
    assert "  50.0 ms" in row(lines_of(udp_list(1, 1, streams=near, senders=["10.0.0.1"])))
    apart = row(lines_of(udp_list(1, 1, streams=near + far, senders=["10.0.0.1"])))
    assert "  50.0 ms … 100.0 ms" in apart
    assert "  50 %" in apart


def test_a_list_that_is_not_sent_at_its_defined_interval_shows_both() -> None:
    """A nominal interval that is not the median comes from a definition."""

    def sent_every(median_ns: int, nominal_ns: int) -> dict[str, Any]:
        return interval(9, 1, 1, 1, 1, median_ns, median_ns, median_ns, nominal=nominal_ns)

    def table(median_ns: int, nominal_ns: int) -> list[str]:
        streams = [stream("10.0.0.1", 0, 10, sent_every(median_ns, nominal_ns))]
        lines = lines_of(udp_list(1, 1, streams=streams, senders=["10.0.0.1"]))
        first = lines.index("Figures") + 1
        return [" ".join(line.split()) for line in lines[first : first + 2]]

    slow = table(100 * MS, 50 * MS)
    assert slow[0].startswith("status list sender interval defined")
    assert slow[1].startswith("✓ ok udp/1/1 10.0.0.1 100.0 ms 50.0 ms")
    for near_ns in (45 * MS, 50 * MS, 55 * MS):
        header, row = table(near_ns, 50 * MS)
        assert "defined" not in header
        assert f"10.0.0.1 {near_ns // MS}.0 ms" in row
    assert "defined" in table(44 * MS, 50 * MS)[0]


def test_another_interval_than_the_defined_one_is_coloured_as_a_warning() -> None:
    def tones(median_ns: int) -> dict[str, Tone]:
        streams = [stream("10.0.0.1", 0, 10, interval(9, 1, 1, 1, 1, *[median_ns] * 3, nominal=50))]
        measures, rows, *_ = tables.overview(report({}, [udp_list(1, 1, streams=streams)], []))
        return {measure.column.title: cell.tone for measure, cell in zip(measures, rows[0], strict=True)}

    assert tones(60)["interval"] is Tone.WARNING
    assert tones(50)["interval"] is Tone.PLAIN


def test_of_very_many_lists_those_of_which_the_worst_was_found_are_shown() -> None:
    most = tables.MOST_LISTS
    numbers = range(1, most + 31)
    last, middle = list(numbers[-20:]), 100
    found = [finding("NV201", "loss", "error", "lost", "", list=f"udp/1/{number}") for number in last]
    found.append(finding("NV502", "jitter", "warning", "late", "", list=f"udp/1/{middle}"))
    many = report({}, [udp_list(1, number) for number in numbers], found)

    def shown(*, details: bool = False) -> list[int]:
        told = text.render(many, everything=True, details=details).partition("Figures")[2].partition("Findings:")[0]
        return [int(number) for number in re.findall(r"udp/1/(\d+)", told)]

    quiet = [number for number in numbers if number not in last and number != middle][: most - 21]
    assert shown() == sorted([*quiet, *last, middle])
    assert "30 lists more, nothing was found of them: -v shows all" in text.render(many, everything=True)
    assert shown(details=True) == list(numbers)


def test_lists_that_are_not_shown_say_how_bad_they_may_be() -> None:
    numbers = range(1, tables.MOST_LISTS + 2)
    found = [finding("NV502", "jitter", "warning", "late", "", list=f"udp/1/{number}") for number in numbers]
    told = text.render(report({}, [udp_list(1, number) for number in numbers], found), width=120, everything=True)
    assert "1 list more, none with worse than ! warning: -v shows all" in told


def test_of_a_sender_that_does_not_count_nobody_knows_what_is_lost() -> None:
    silent = stream("10.0.0.1", 0, 10, interval(9, *[50 * MS] * 7, nominal=50 * MS)) | {"counter_scope": "unused"}
    told = text.render(report({}, [udp_list(1, 1, streams=[silent])], []), width=200, details=True)
    header, row = next(pair for pair in pairwise(told.splitlines()) if pair[0].startswith("status"))
    assert row[: header.index("lost") + len("lost")].endswith(" ?")
    assert "lost ? (0 claimed)" in told.replace("\xa0", " ")
