"""How causes name lists, nodes and moments."""

from __future__ import annotations

import re
from collections.abc import Sequence

from nvscope.causes.case import Case
from nvscope.enumeration import joined
from nvscope.findings.facts import AnyList
from nvscope.units import count, count_of

_NAMED = 4
_MINUTES_FROM = 6000
"""From so many tenths of a second on, times are told in minutes."""

_MS_NS = 1_000_000
_ADDRESS = re.compile(r"(?<![\w.:/])(?:\d{1,3}(?:\.\d{1,3}){3}|[0-9a-fA-F:]*:[0-9a-fA-F:]+)(?![\w./]|:\w)")
"""An address in a sentence, and no part of a network or of the name of a variable."""


def nodes_by_name(case: Case, sentence: str) -> str:
    """Return a sentence with the names of nodes in place of their addresses."""
    return _ADDRESS.sub(lambda found: case.names.get(found[0], found[0]), sentence) if case.names else sentence


def moment(case: Case, time_ns: int) -> str:
    """Return a time since the beginning of the capture: ``7.5 s``, ``12 min 03 s``, ``1 h 02 min 03 s``.

    Where the case has a clock, it is told by that.
    """
    if case.clock is not None:
        return case.clock(time_ns)
    tenths = (time_ns - case.start_ns + 50 * _MS_NS) // (100 * _MS_NS)
    if tenths < _MINUTES_FROM:
        return f"{tenths // 10}.{tenths % 10} s"
    minutes, second = divmod(tenths // 10, 60)
    hours, minute = divmod(minutes, 60)
    days, hour = divmod(hours, 24)
    if not hours:
        return f"{minute} min {second:02} s"
    return f"{days} d {hour:02} h {minute:02} min" if days else f"{hour} h {minute:02} min {second:02} s"


def lists_in_words(case: Case, lists: Sequence[AnyList]) -> str:
    """Return what some lists are called in a sentence: ``list 12``, ``lists 3, 7 and 9``, ``12 lists``.

    On CAN, what no definition knows is an identifier: ``identifier 0x181``.
    """
    noun = "identifier" if case.are_nobodys(lists) else "list"
    each = {entry.number: entry for entry in lists}
    if len(each) > _NAMED:
        return f"{len(each)} {noun}s"
    names = [_name(case, entry) for entry in sorted(each.values(), key=lambda entry: entry.key)]
    return f"{noun}{'s' if len(names) > 1 else ''} {joined(names)}"


def moments_in_words(case: Case, times: int, since_ns: int, last_ns: int) -> str:
    """Return when something was so often: ``at 5.0 s``, ``2 times at 5.0 s``, ``3 times from 5.0 s to 9.0 s``."""
    if times == 1:
        return f"at {moment(case, since_ns)}"
    return f"{times_of(times)} {span_in_words(case, since_ns, last_ns)}"


def span_in_words(case: Case, since_ns: int, until_ns: int | None) -> str:
    """Return from when to when something was: ``since 5.0 s``, ``from 5.0 s to 9.0 s``, ``at 5.0 s``."""
    first = moment(case, since_ns)
    if until_ns is None:
        return f"since {first}"
    last = moment(case, until_ns)
    return f"at {first}" if first == last else f"from {first} to {last}"


def times_of(number: int) -> str:
    """Return how often something was: ``once``, ``3 times``."""
    return "once" if number == 1 else count_of(number, "time")


def multiple(value: int, of: int) -> str:
    """Return a value as a multiple of another one: ``2.6 times``, ``41 times``."""
    tenths = 10 * value // of
    return f"{tenths // 10}.{tenths % 10} times" if tenths < 100 else f"{count(tenths // 10)} times"


def capitalised(words: str) -> str:
    """Return words as they begin a sentence."""
    return words[:1].upper() + words[1:]


def _name(case: Case, entry: AnyList) -> str:
    defined = case.facts.definition_of(entry)
    if defined is not None and defined.name:
        return defined.name
    return case.short_keys[str(entry.key)]
