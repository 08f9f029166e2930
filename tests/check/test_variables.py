"""Rules about variables: values, how they change, how one follows another."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.stretches import Stretches
from nvscope.check.variables import overtaken
from tests.capture.mcap.recordings import Packet, write
from tests.check.plants import BEGIN_NS, Sending, captured, definitions, judged, of_plant, packed, ruled
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.program_here import run_text


def valve(values: Callable[[int], list[Any]], count: int = 50) -> list[Sending]:
    """Send the valve's list every 100 ms, with what a function gives of the number of the telegram."""
    return [(number * 100, 8, values(number)) for number in range(count)]


def position(number: int) -> list[Any]:
    return [False, float(number), number]


@pytest.mark.parametrize(
    ("rule", "verdict", "worst", "limit", "frames"),
    [
        ('check = "range"\nvariable = "fPos"\nmin = 0\nmax = 60', "pass", 0.0, 0, []),
        ('check = "range"\nvariable = "fPos"\nmin = -30\nmax = 60', "pass", 49.0, 60, []),
        ('check = "range"\nvariable = "valve.fPos"\nmax = 47.5', "fail", 49.0, 47.5, [49, 50]),
        ('check = "range"\nvariable = "valve:fPos"\nmin = 1.5', "fail", 0.0, 1.5, [1, 2]),
        ('check = "range"\nvariable = "var.valve.fPos"\nmin = 10\nmax = 47', "fail", 0.0, 10, list(range(1, 11))),
        ('check = "enum"\nvariable = "nCount"\nvalues = [0, 1, 2]', "fail", 3, None, list(range(4, 14))),
        ('check = "monotonic"\nvariable = "nCount"', "pass", 0, 0, []),
        ('check = "monotonic"\nvariable = "nCount"\ndirection = "down"', "fail", 1, 0, list(range(2, 12))),
        ('check = "rate_of_change"\nvariable = "fPos"\nmax = 10', "pass", 10, 10, []),
        ('check = "rate_of_change"\nvariable = "fPos"\nmax = 9.5', "fail", 10, 9.5, list(range(2, 12))),
        ('check = "frozen"\nvariable = "nCount"\nmax = "200ms"', "pass", 0.0, 0.2, []),
        ('check = "frozen"\nvariable = "bClosed"\nmax = "200ms"', "fail", 4.9, 0.2, [4]),
        ('check = "frozen"\nvariable = "bClosed"\nmax = "1min"', "inconclusive", 4.9, 60, []),
    ],
)
def test_a_variable(
    rule: str, verdict: str, worst: float, limit: float | None, frames: list[int], tmp_path: Path
) -> None:
    told, subject = of_plant(tmp_path, valve(position), rule)
    assert (told, subject["frames"]) == (verdict, frames), subject
    assert (subject["worst"], subject["limit"]) == (
        pytest.approx(worst), None if limit is None else pytest.approx(limit),
    )  # fmt: skip
    assert subject["list"] == "udp/1202/8"
    assert subject["variable"]


def test_what_is_no_number_is_outside_of_every_range(tmp_path: Path) -> None:
    sent = valve(lambda number: [False, float("nan") if number == 20 else 1.0])
    told, subject = of_plant(tmp_path, sent, 'check = "range"\nvariable = "fPos"\nmin = 0\nmax = 2')
    assert (told, subject["frames"], subject["reason"]) == ("fail", [21], "1 value is no number (NaN)")


def test_times_are_told_with_units(tmp_path: Path) -> None:
    sent = valve(lambda number: [False, 0.0, 0, b"", 40 + number])
    told, subject = of_plant(tmp_path, sent, 'check = "range"\nvariable = "tRun"\nmax = "80ms"')
    assert (told, subject["worst"], subject["limit"], subject["unit"]) == ("fail", 0.089, 0.08, "s")
    assert of_plant(tmp_path, sent, 'check = "range"\nvariable = "tRun"\nmax = 0.089')[0] == "pass"


def test_texts_have_values_too(tmp_path: Path) -> None:
    sent = valve(lambda number: [False, 0.0, 0, b"open" if number < 30 else b"shut"])
    assert of_plant(tmp_path, sent, 'check = "enum"\nvariable = "sText"\nvalues = ["open", "shut"]')[0] == "pass"
    told, subject = of_plant(tmp_path, sent, 'check = "enum"\nvariable = "sText"\nvalues = "open"')
    assert (told, subject["worst"], subject["reason"]) == ("fail", None, "the first other value is shut")
    assert subject["frames"][0] == 31


def test_counters_wrap(tmp_path: Path) -> None:
    sent = valve(lambda number: [False, 0.0, (65530 + number) % 65536])
    assert of_plant(tmp_path, sent, 'check = "monotonic"\nvariable = "nCount"')[0] == "fail"
    rule = 'check = "monotonic"\nvariable = "nCount"\nwrap = 65536\nstrict = true'
    assert of_plant(tmp_path, sent, rule)[0] == "pass"
    stands = valve(lambda number: [False, 0.0, min(number, 20)])
    told, subject = of_plant(tmp_path, stands, 'check = "monotonic"\nvariable = "nCount"\nstrict = true')
    assert (told, subject["reason"], subject["frames"][0]) == ("fail", "it stayed as it was", 22)


def test_a_silence_is_not_frozen(tmp_path: Path) -> None:
    sent = valve(lambda number: [number >= 10])
    sent = [one for one in sent if not 1500 <= one[0] < 4000]
    told, subject = of_plant(tmp_path, sent, 'check = "frozen"\nvariable = "bClosed"\nmax = "1s"')
    assert (told, subject["worst"]) == ("pass", pytest.approx(0.9))


def test_a_telegram_that_comes_late_is_no_step_back(tmp_path: Path) -> None:
    """The network has turned two telegrams around: the value has not gone back."""
    found = []
    for at, counter in enumerate([*range(1, 20), 21, 20, *range(22, 40)]):
        data = packed(8, [False, 0.0, counter])
        payload = telegram(list_id=8, counter=counter, data=data, items=5)
        one = data_frame(BEGIN_NS + at * 10**8, "10.0.0.8", "10.0.0.255", payload)
        found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    capture = write(tmp_path / "turned.pcap", found)
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    rules = ruled(tmp_path, 'check = "monotonic"\nvariable = "nCount"', 'check = "overtaken"\nlist = 8')
    monotonic, late = judged(capture, rules, *options)["rules"]
    assert (monotonic["verdict"], late["verdict"]) == ("pass", "fail")


@pytest.mark.parametrize(
    ("delay", "verdict", "worst"), [(50, "pass", 0.05), (150, "pass", 0.15), (250, "fail", 0.25), (None, "fail", 3.9)]
)
def test_one_variable_follows_another(delay: int | None, verdict: str, worst: float, tmp_path: Path) -> None:
    sent: list[Sending] = []
    for at in range(0, 6000, 50):
        sent.append((at, 7, [at >= 2000]))
        sent.append((at, 8, [delay is not None and at >= 2000 + delay]))
    rule = 'check = "hops"\nfrom = "bStop"\nto = "valve:bClosed"\nmax_delay = "200ms"'
    told, subject = of_plant(tmp_path, [one for one in sent if one[0] < 5901], rule)
    assert (told, subject["worst"]) == (verdict, pytest.approx(worst))
    assert subject["variable"] == "bStop → valve:bClosed"
    assert subject["reason"] == "they differ by up to 1"


@pytest.mark.parametrize(
    ("rule", "key", "what"),
    [
        ('check = "range"\nvariable = "fPso"\nmax = 3', "variable", "no variable is called 'fPso'"),
        ('check = "range"\nvariable = "sText"\nmax = 3', "variable", "'sText' is no number"),
        ('check = "enum"\nvariable = "nCount"', "variable", "'nCount' has no names for its values"),
        ('check = "enum"\nvariable = "nCount"\nvalues = ["x"]', "values", "'x' is no value of 'nCount'"),
        ('check = "hops"\nfrom = "close"\nto = "bStop"\nmax_delay = "1s"', "from", "no variable is called 'close'"),
        ('check = "hops"\nfrom = "*"\nto = "bStop"\nmax_delay = "1s"', "from", "'sText' is no number"),
        ('check = "always"\nexpr = "var.valve.fPso > 3"', "expr", "no field is called"),
        ('check = "always"\nexpr = "var.fPos >"', "expr", ""),
        ('check = "implies"\nif = "var.fPos"\nthen = "var.bStop"', "if", "rose is for what is true or false"),
        ('check = "always"\nexpr = "list.lost == 0"', "expr", "list.lost: known of a whole capture"),
        ('check = "always"\nexpr = "var.bStop"\nwindow = "1s"', "expr", ""),
        ('check = "always"\nexpr = "cause.kind == \\"x\\""', "expr", ""),
        ('check = "capture_quality"\nwhen = "var.bStop"', "when", "capture_quality counts over all of the time"),
        (
            'check = "loss"\nlist = "aixs"',
            "list",
            "no list is called 'aixs', neither by definitions nor in the capture",
        ),
        ('check = "loss"\nlist = 99', "list", "no list is called '99'"),
    ],
)
def test_what_nothing_is_called_is_a_mistake_with_its_place(rule: str, key: str, what: str, tmp_path: Path) -> None:
    rules = ruled(tmp_path, rule)
    options = [text for path in definitions(tmp_path) for text in ("--gvl", path)]
    done = run_text("check", captured(tmp_path, valve(position)), "--rules", rules, *options)
    line = next(number for number, text in enumerate(rules.read_text().splitlines(), 1) if text.startswith(f"{key} "))
    assert done.returncode == 2, done.stdout
    assert f"{rules}, line {line}, column 1: rule[0].{key}: {what}" in done.stderr


def test_without_definitions_nobody_knows(tmp_path: Path) -> None:
    capture = captured(tmp_path, valve(position))
    rules = ruled(tmp_path, 'check = "range"\nvariable = "fPos"\nmax = 3', 'check = "always"\nexpr = "var.fPos > 3"')
    for one in judged(capture, rules)["rules"]:
        assert one["verdict"] == "inconclusive"
        assert one["subjects"][0]["reason"] == "no definition is given"


@examples(100)
@given(st.data())
def test_stretches_are_measured_one_by_one(data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 40))
    so = data.draw(st.lists(st.booleans(), min_size=count, max_size=count))
    anew = data.draw(st.lists(st.booleans(), min_size=count, max_size=count))
    times = np.cumsum(data.draw(st.lists(st.integers(0, 5), min_size=count, max_size=count))).tolist()
    limit = data.draw(st.integers(0, 6))
    found = []
    begin: int | None = None
    for time, own, new in zip(times, so, anew, strict=True):
        if begin is not None and (not own or new):
            found.append((begin, time))
            begin = None
        if own and begin is None:
            begin = time
    end = times[-1] + data.draw(st.integers(0, 5))
    if begin is not None:
        found.append((begin, end))
    stretches = Stretches(limit)
    at = 0
    while at < count:
        size = data.draw(st.integers(1, 7))
        part = slice(at, at + size)
        frame = np.arange(at, min(at + size, count))
        stretches.take(np.array(times[part]), frame, np.array(so[part]), np.array(anew[part]))
        at += size
    stretches = stretches.up_to(end)
    lengths = [last - first for first, last in found]
    assert stretches.longest_ns == max(lengths, default=None)
    over = [first for first, last in found if last - first > limit or not limit]
    assert (stretches.count, stretches.first_ns) == (len(over), over[0] if over else None)


@examples(100)
@given(st.lists(st.tuples(st.integers(0, 2), st.integers(-3, 4)), min_size=1, max_size=60), st.integers(1, 9))
def test_late_telegrams_are_those_behind_a_later_one(steps: list[tuple[int, int]], size: int) -> None:
    """Whatever the batches, and also where Counters wrap."""
    counters = {0: 65530, 1: 10, 2: 65535}
    stream, counter = [], []
    for number, step in steps:
        counters[number] += step
        stream.append(number)
        counter.append(counters[number] % 65536)
    highest: dict[int, int] = {}
    wanted, position = [], dict(counters)
    position = {0: 65530, 1: 10, 2: 65535}
    for number, step in steps:
        position[number] += step
        if highest.get(number) is None or not -16 <= position[number] - highest[number] < 0:
            wanted.append(False)
            highest[number] = position[number]
        else:
            wanted.append(True)
    kept: dict[int, int] = {}
    told: list[bool] = []
    for at in range(0, len(stream), size):
        part = slice(at, at + size)
        told += overtaken(np.array(stream[part]), np.array(counter[part]), kept).tolist()
    if all(abs(step) <= 4 for _, step in steps) and all(
        position - first > -16 for position, first in zip(_lowest(steps), (65530, 10, 65535), strict=True)
    ):
        assert told == wanted


def _lowest(steps: list[tuple[int, int]]) -> list[int]:
    """Return how low each Counter falls below its highest, as the lowest position beyond the beginning."""
    first = [65530, 10, 65535]
    return [one + min(0, *(step for _, step in steps)) for one in first]


def test_structures_of_bytes() -> None:
    assert struct.calcsize("<?dH8sI") == len(packed(8, []))
