"""The rules' own tests: what comes of a rule on series of values that are written beside it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.check.asked_rows import Asked, AskedRows
from nvscope.check.check import Evidence, Setting
from nvscope.check.condition import compiled
from nvscope.check.first_frames import FirstFrames
from nvscope.check.moments import MomentWatcher
from nvscope.check.rules import RuleTest
from nvscope.check.verdict import Judged, Verdict, worst_of
from nvscope.definition.project import Project
from nvscope.errors import ConfigurationError, UsageError
from nvscope.expression.typed_columns import Column, FieldType, TextColumn
from nvscope.expression.words import Words
from nvscope.list_key import ListKey
from nvscope.tracker.summary import Summary
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS
from nvscope.view.rows.frames import FrameRows

_PREFIX = "var."
_NOT_SENT = "-"
_MOST_STEPS = 1_000_000
_RUN = re.compile(r"(?P<value>\"[^\"]*\"|[^\s*\"]+)(?:\*(?P<count>[0-9]{1,7}))?")
_CLOSE = 1e-9
_LONGEST_NS = 100 * 366 * 86_400 * 10**9
_LARGEST = 2**63 - 1
_LIST = ListKey.udp(0, 0)

Value = int | float | bool | str | None


class Tested(Struct, frozen=True):
    """A test of a rule, whether what was expected came, and why not, "" where it did; with what came."""

    test: RuleTest
    verdict: Verdict
    judged: Judged
    wrong: str = ""


def tested(tests: Sequence[RuleTest], project: Project) -> tuple[list[Tested], list[ConfigurationError]]:
    """Run tests; return what came of each, and the mistakes in those that cannot be run."""
    found, mistakes = [], []
    for test in tests:
        try:
            found.append(_run(test, project))
        except UsageError as error:
            where = test.place.error(error.what, error.next_step)
            mistakes.append(
                ConfigurationError(where.what, where=where.where, next_step=where.next_step, excerpt=error.excerpt)
            )
    return found, mistakes


def _run(test: RuleTest, project: Project) -> Tested:
    """Run a test. Series of nothing but 0 and 1 are taken for true and false, and if that does not fit, for numbers."""
    try:
        return _run_with(test, project, are_bool=True)
    except UsageError:
        return _run_with(test, project, are_bool=False)


def _run_with(test: RuleTest, project: Project, *, are_bool: bool) -> Tested:
    rule = test.rule
    values: dict[str, Sequence[Value]] = {}
    room = _MOST_STEPS
    for name, text in test.series.items():
        values[_named(name)] = _values(name, text, room)
        room -= len(values[_named(name)])
    fields = {name: _field(name, one, are_bool=are_bool) for name, one in values.items()}
    steps = max((len(one) for one in values.values()), default=0)
    if steps * test.step_ns > _LONGEST_NS:
        raise UsageError(f"{steps} steps of that length are longer than 100 years", next_step="shorten step, or series")
    names: Mapping[ListKey, str] = {}
    setting = Setting({}, SeriesFields(fields), AskedRows(names), names, series=fields, since_ns=0, when=rule.when)
    for text in rule.expressions.values():
        others = [field.name for field in compiled(text, setting.fields).named if field.name not in fields]
        if others:
            raise UsageError(f"{', '.join(others)}: no series has it", next_step="give it values in series")
    watcher = rule.check.watch(setting, rule.parameters) if rule.check.watch else None
    if not isinstance(watcher, MomentWatcher) or (rule.check.name == "occurrence" and rule.parameters["expr"] is None):
        raise UsageError(f"'{rule.id}' is about telegrams, and a series has values of variables")
    if not steps:
        raise UsageError("there is no series in it", next_step='Write series = { "var.x" = "0*20 1*40" }.')
    time_ns = np.arange(steps) * test.step_ns
    rows = cast("FrameRows", SeriesRows(np.arange(steps), time_ns))
    nothing = np.zeros(steps, np.int64)
    watcher.look(Asked(rows, nothing, nothing, time_ns, np.arange(steps) + 1, nothing), np.ones(steps, np.bool_))
    known = Evidence(
        Summary((), (), (), {}), (), {}, {}, (), (), FirstFrames(), project, None, lambda _: (), 0,
        int(time_ns[-1]),
    )  # fmt: skip
    told = {**rule.parameters, "watched": watcher, "list_named": False}
    judged = [
        replace(one, list=None, verdict=Verdict.PASS if rule.optional and one.vacuous else one.verdict)
        for one in rule.check.judge(known, (), told)
    ]
    verdict = worst_of(judged)
    first = next((one for one in judged if one.verdict is verdict), Judged(verdict))
    return Tested(test, verdict, first, _wrong(test, verdict, first))


def _wrong(test: RuleTest, verdict: Verdict, judged: Judged) -> str:
    """Return what came instead of what was expected; "" where it did."""
    from nvscope.check.words import value_in_words  # noqa: PLC0415

    if verdict.value != test.expect:
        why = f": {judged.reason}" if judged.reason else ""
        return f"{test.expect} was expected, and {verdict.value} came{why}"
    for name, wanted, came in (("worst", test.worst, judged.worst), ("margin", test.margin, judged.margin)):
        if wanted is not None and (came is None or abs(came - wanted) > _CLOSE * max(1.0, abs(wanted))):
            told = value_in_words(wanted, judged.unit), value_in_words(came, judged.unit)
            return f"as {name}, {told[0]} was expected, and {told[1]} came"
    return ""


class SeriesRows(Struct, frozen=True):
    """Steps in place of telegrams: ``row`` is the number of each, ``ts_ns`` when it was."""

    row: I64
    ts_ns: I64

    def __len__(self) -> int:
        return len(self.row)


class SeriesFields(Words[TelegramField]):
    """The variables of series, by name in any case; and the fields that telegrams have, which steps have not."""

    def __init__(self, fields: Mapping[str, TelegramField]) -> None:
        self._fields = {**FIELDS, **fields}
        self._lower = {name.lower(): name for name in self._fields}

    def spelled(self, text: str) -> str | None:
        return self._lower.get(text.lower())

    def __getitem__(self, name: str) -> TelegramField:
        return self._fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)


def _named(name: str) -> str:
    return name if name.lower().startswith(_PREFIX) else f"{_PREFIX}{name}"


def _values(name: str, text: str, room: int) -> list[Value]:
    """Return the values that a text says, one a step: ``0*20 1*40``; ``-`` is a step without a telegram."""
    found: list[Value] = []
    place = 0
    for match in _RUN.finditer(text):
        if text[place : match.start()].strip():
            break
        place = match.end()
        found += [_value(match["value"])] * min(int(match["count"] or 1), room + 1)
        if len(found) > room:
            raise UsageError(f"the series of a test have more than {_MOST_STEPS} steps")
    if text[place:].strip():
        raise UsageError(
            f"the series of {name} cannot be read from '{text[place:].strip()[:40]}' on",
            next_step='Write values with how often each comes: "0*20 1*40".',
        )
    return found


def _value(text: str) -> Value:
    if text == _NOT_SENT:
        return None
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text.strip('"')


def _field(name: str, values: Sequence[Value], *, are_bool: bool) -> TelegramField:
    """Return the variable that has these values; ``are_bool``: where they are 0 and 1, they are false and true."""
    sent = [one for one in values if one is not None]
    there = np.array([one is not None for one in values], np.bool_)

    def known(rows: Any) -> Bool:
        found = np.zeros(len(rows), np.bool_)
        found[: len(there)] = there[: len(rows)]
        return found

    def filled(column: Any, rows: Any) -> Any:
        found = np.zeros(len(rows), column.dtype)
        found[: len(column)] = column[: len(rows)]
        return found

    kind, read = _typed(sent, values, filled, are_bool=are_bool)
    return TelegramField(name, kind, name, "of a series", read, known, sent_in=frozenset({(_LIST, 0)}))


def _typed(sent: Sequence[Value], values: Sequence[Value], filled: Any, *, are_bool: bool) -> tuple[FieldType, Any]:
    if any(isinstance(one, str) for one in sent):
        texts = tuple(dict.fromkeys(["", *(str(one) for one in sent)]))
        code = np.array([0 if one is None else texts.index(str(one)) for one in values], np.int64)
        return FieldType.TEXT, lambda rows: TextColumn(filled(code, rows), texts)
    numbers = [0 if one is None else one for one in values]
    if all(isinstance(one, bool) or (are_bool and one in (0, 1)) for one in sent):
        column: Column = np.array(numbers, np.int64) != 0
        return FieldType.BOOL, lambda rows: filled(column, rows)
    is_real = any(isinstance(one, float) or abs(one) > _LARGEST for one in sent)  # type: ignore[arg-type]
    of_numbers = np.array(numbers, np.float64 if is_real else np.int64)
    return FieldType.REAL if is_real else FieldType.SIGNED, lambda rows: filled(of_numbers, rows)
