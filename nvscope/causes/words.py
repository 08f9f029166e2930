"""How causes name lists and moments."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.causes.case import Case
from nvscope.findings.facts import AnyList

_NAMED = 4
_MS_NS = 1_000_000


def moment(case: Case, time_ns: int) -> str:
    """Return a time in seconds since the beginning of the capture, as the strip of the lists has it."""
    tenths = (time_ns - case.start_ns + 50 * _MS_NS) // (100 * _MS_NS)
    return f"{tenths // 10}.{tenths % 10} s"


def lists_in_words(case: Case, lists: Sequence[AnyList]) -> str:
    """Return what some lists are called in a sentence: ``list 12``, ``lists 3, 7 and 9``, ``12 lists``."""
    ordered = sorted({entry.number: entry for entry in lists}.values(), key=lambda entry: entry.key)
    names = [_name(case, entry) for entry in ordered]
    if len(names) > _NAMED:
        return f"{len(names)} lists"
    if len(names) == 1:
        return f"list {names[0]}"
    return f"lists {', '.join(names[:-1])} and {names[-1]}"


def capitalised(words: str) -> str:
    """Return words as they begin a sentence."""
    return words[:1].upper() + words[1:]


def _name(case: Case, entry: AnyList) -> str:
    defined = case.facts.definition_of(entry)
    if defined is not None and defined.name:
        return defined.name
    return str(entry.key).rpartition("/")[2]
