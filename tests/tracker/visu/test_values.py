"""Values of WebVisu variables: what they are, when they change, against the rules written one value after the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.engine.run import run
from nvscope.tracker.readings.last_values import LastValues
from nvscope.tracker.readings.observed import Observed
from nvscope.tracker.readings.value_history import ValueHistory
from nvscope.tracker.visu.on_demand import NAME
from nvscope.tracker.visu.readings import ReadPages
from nvscope.view.documents.read_rows import last_rows, row_of_reading
from tests.analysis.transactions.talk import NAMES, PANEL, PRESS, post, reply
from tests.laws import examples, some
from tests.oracle.builders import MILLISECOND, START
from tests.oracle.frame import Frame
from tests.oracle.rules.visu_values import VisuValues
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import Batches, batch_of, cut, recorded
from tests.records import replace
from tests.tracker.visu.followed import reading

SEEDS = st.integers(0, 20_000)
SETPOINT = "|0|1|0|4|0|4|6|"


def last_values(batches: Iterable[PacketBatch]) -> list[dict[str, Any]]:
    """Return the rows of all variables that batches tell of, with all that is secret."""
    observer = Observed({NAME: lambda: LastValues(ReadPages())})
    for _ in run(Batches(batches), reading(), [observer]):
        pass
    return [row for rows in last_rows(observer.known, secrets=True).values() for row in rows]


def history(batches: Iterable[PacketBatch], *, every: bool = False, secrets: bool = True) -> list[dict[str, Any]]:
    """Return what is told of each value, or each change."""
    observer = Observed({NAME: lambda: ValueHistory(ReadPages(), every=every)})
    told = []
    for _ in run(Batches(batches), reading(), [observer]):
        told += [
            row_of_reading(entry, secrets=secrets) for known in observer.known.values() for entry in known.entries()
        ]
    return told


def by_the_rules(frames: Sequence[Frame]) -> VisuValues:
    rules = VisuValues()
    for frame in frames:
        rules.observe(frame)
    return rules


def as_json(value: Any, unit: str | None, place: str) -> Any:
    """Return a value of the rules as documents have it: TIME and TOD in ns."""
    return value * MILLISECOND if unit == "ns" and value is not None else value


def check(frames: Sequence[Frame]) -> None:
    rules = by_the_rules(frames)
    rows = {(row["list"], row["place"]): row for row in last_values([batch_of(frames)])}
    wanted = {(row["list"], row["place"]): row for row in rules.rows()}
    assert rows.keys() == wanted.keys()
    for key, row in rows.items():
        rule, unit = wanted[key], row["unit"]
        assert (row["name"], row["telegrams"], row["unreadable"], row["changes"]) == (
            rule["name"], rule["readings"], rule["unreadable"], rule["changes"]
        )  # fmt: skip
        assert row["value"] == as_json(rule["value"], unit, row["place"])
        assert (row["last_ns"], row["changed_ns"]) == tuple(
            None if rule[name] is None else str(rule[name]) for name in ("last", "changed")
        )
        bounds = None if row["min"] is None else (row["min"], row["max"])
        assert bounds == (rule["bounds"] and tuple(as_json(one, unit, row["place"]) for one in rule["bounds"]))
    series = [(str(one.time), one.frame, one.server, one.name, one.place, one.changed) for one in rules.series]
    columns = ("time_ns", "frame", "list", "name", "place", "changed")
    assert [tuple(row[name] for name in columns) for row in history([batch_of(frames)], every=True)] == series


@pytest.mark.parametrize("seed", some(range(120)))
def test_values_are_what_the_rules_say(seed: int) -> None:
    check(visu_traffic(seed))


@examples(40)
@given(seed=SEEDS)
def test_so_they_are_of_any_traffic(seed: int) -> None:
    check(visu_traffic(seed))


@examples(40)
@given(seed=SEEDS, packets=st.integers(1, 90))
def test_any_cut_gives_the_same(seed: int, packets: int) -> None:
    frames = visu_traffic(seed)
    whole, parts = [batch_of(frames)], cut(batch_of(frames), packets)
    assert last_values(parts) == last_values(whole)
    assert history(parts) == history(whole)


def talk() -> Line:
    return Line((PANEL, 50_000), (PRESS, 80), now=START).open()


def test_a_change_is_another_value_and_not_another_text() -> None:
    line = talk()
    for text in ("1.0", "1.00", "+1", "1e0", "-0.0", "0", "2.5", "2.5 "):
        line.ask(post(SETPOINT)).answer(reply(f"|{text}|"))
    told = history([batch_of(line.frames)])
    assert [(row["old"], row["new"]) for row in told] == [(None, 1.0), (1.0, 0.0), (0.0, 2.5)]


def test_what_cannot_be_read_is_no_value_and_changes_nothing() -> None:
    line = talk()
    for text in ("???", "5.0", "???", "5.0"):
        line.ask(post(SETPOINT)).answer(reply(f"|{text}|"))
    (row,) = last_values([batch_of(line.frames)])
    assert (row["value"], row["telegrams"], row["unreadable"], row["changes"]) == (5.0, 2, 2, 0)


def test_a_confirmed_write_is_a_value_a_refused_one_is_none() -> None:
    line = talk().ask(post(SETPOINT)).answer(reply("|1.0|"))
    line.ask(post("|1|1|0|4|0|4|6|7.5|")).answer(reply("|0|"))
    line.ask(post("|1|1|0|4|0|4|6|99|")).answer(reply("|1|"))
    assert [row["new"] for row in history([batch_of(line.frames)])] == [1.0, 7.5]


def test_what_is_none_of_its_type_is_told_as_it_came() -> None:
    line = talk()
    for text in ("1.#QNAN", "12,5", "1e999", ""):
        line.ask(post(SETPOINT)).answer(reply(f"|{text}|"))
    assert [(row["new"], row["new_text"]) for row in history([batch_of(line.frames)])] == [
        (None, "1.#QNAN"), (None, "12,5"), (None, "1e999"), (None, "")
    ]  # fmt: skip


def test_a_name_holds_from_when_it_is_known() -> None:
    line = talk().ask(post(SETPOINT)).answer(reply("|1.0|"))
    line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    line.ask(post(SETPOINT)).answer(reply("|2.0|"))
    told = history([batch_of(line.frames)])
    assert told[0]["name"] == "4,0,4,6" != told[1]["name"]
    (row,) = last_values([batch_of(line.frames)])
    assert row["name"] == told[1]["name"]


def test_passwords_and_texts_without_a_name_are_hidden() -> None:
    line = talk().ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    line.ask(post("|0|2|0|4|8|41|8|1|4|900|21|8|")).answer(reply("|secret|unnamed|"))
    hidden = history([batch_of(line.frames)], secrets=False)
    assert not any(text in str(hidden) for text in ("secret", "unnamed"))
    assert {(row["hidden"], row["new"], row["new_text"]) for row in hidden} == {(True, None, "(hidden)")}
    assert [row["new"] for row in history([batch_of(line.frames)])] == ["secret", "unnamed"]


def test_behind_a_time_in_which_nobody_listened_nothing_is_a_change() -> None:
    first = talk().ask(post(SETPOINT)).answer(reply("|1.0|")).frames
    later = Line((PANEL, 50_000), (PRESS, 80), now=START + 10**13).open()
    second = later.ask(post(SETPOINT)).answer(reply("|2.0|")).frames
    told = history(recorded([batch_of(first)], [batch_of(second)]))
    assert [(row["old"], row["new"], row["changed"]) for row in told] == [(None, 1.0, False), (None, 2.0, False)]
    (row,) = last_values(recorded([batch_of(first)], [batch_of(second)]))
    assert (row["changes"], row["min"], row["max"]) == (0, 1.0, 2.0)


def test_variables_beyond_the_limit_are_left_out_and_told() -> None:
    line = talk()
    for number in range(5):
        line.ask(post(f"|0|1|0|4|{number}|1|2|")).answer(reply("|7|"))
    observer = Observed({NAME: lambda: LastValues(ReadPages())})
    for _ in run(Batches([batch_of(line.frames)]), replace(reading(), max_streams=2), [observer]):
        pass
    assert observer.known[NAME].read.left_out
    assert [row["place"] for row in last_rows(observer.known)["page_variables"]] == ["4,0,1,2", "4,1,1,2"]
