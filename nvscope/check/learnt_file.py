"""Rules that captures taught, as a file that people read and edit."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence

from nvscope.check.learning import Learnt, Lesson, Value
from nvscope.duration import format_duration
from nvscope.units import count_of, duration
from nvscope.version import __version__
from nvscope.view.escape import visible

_WIDTH = 100
_ESCAPES: Mapping[str, str] = {'"': '\\"', "\\": "\\\\"}


def text(lesson: Lesson, paths: Sequence[str], warmup_ns: int) -> str:
    """Return the file: what it was learnt from, and each rule with what was seen."""
    return "\n".join(_lines(lesson, paths, warmup_ns)) + "\n"


def _lines(lesson: Lesson, paths: Sequence[str], warmup_ns: int) -> Iterator[str]:
    span_ns = (lesson.until_ns or 0) - (lesson.since_ns or 0)
    yield from _comment(
        f"Learnt by nvscope {__version__} from {', '.join(paths)}: {count_of(lesson.telegrams, 'telegram')} of "
        f"{count_of(lesson.lists, 'list')} in {duration(span_ns)}. What happened in there is taken for good: read what "
        "stands here, change what should be otherwise, and add why. Limits have some room above what was seen; rules "
        "of which too little was seen are warnings."
    )
    if lesson.left_out:
        yield "#"
        yield from _comment("Not learnt, for in these captures it is not as a rule could ask for:")
        for told in lesson.left_out:
            yield from _comment(f"- {told}", hanging="  ")
    if warmup_ns:
        yield from ("", "[defaults]", f"warmup = {_value(format_duration(warmup_ns))}")
    for title, rules in lesson.sections.items():
        yield ""
        yield from _comment(f"---- {title}")
        for rule in rules:
            yield from _rule(rule)


def _rule(rule: Learnt) -> Iterator[str]:
    yield ""
    yield from ("[[rule]]", f"id = {_value(rule.id)}", f"check = {_value(rule.check)}")
    yield from (f"{key} = {_value(value)}" for key, value in rule.keys.items())
    if rule.thin:
        yield 'severity = "warning"'
    yield from _comment(rule.told)


def _comment(told: str, hanging: str = "") -> Iterator[str]:
    lines = textwrap.wrap(visible(told), _WIDTH, break_long_words=False, subsequent_indent=hanging)
    return (f"# {line}" for line in lines)


def _value(value: Value) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return f"{value}"
    if isinstance(value, str):
        return f'"{"".join(map(_character, value))}"'
    return _array([_value(one) for one in value])


def _array(values: Sequence[str]) -> str:
    line = f"[{', '.join(values)}]"
    if len(line) <= _WIDTH:
        return line
    lines = [""]
    for one in values:
        if lines[-1] and len(lines[-1]) + len(one) > _WIDTH:
            lines.append("")
        lines[-1] += f"{' ' if lines[-1] else ''}{one},"
    return "[\n" + "\n".join(f"    {one}" for one in lines) + "\n]"


def _character(one: str) -> str:
    if one in _ESCAPES:
        return _ESCAPES[one]
    return one if one.isprintable() else f"\\U{ord(one):08X}"
