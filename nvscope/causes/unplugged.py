"""Times in which the capturing computer itself had no cable: what was not seen then is nobody's fault."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nvscope.causes.case import Case, Draft, Explained, longest_ns
from nvscope.causes.incomplete import CAPTURE_INCOMPLETE
from nvscope.causes.words import span_in_words
from nvscope.findings.answers import BOOT_UP_UNANSWERED, NO_ACKNOWLEDGEMENT
from nvscope.findings.can import INCOMPLETE_CYCLE
from nvscope.findings.capture import CARRIER_LOST
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.timing import JITTER, LATE, STOPPED, TORN_CYCLE
from nvscope.units import count_of

_UNSEEN = (
    TELEGRAM_GAP, LATE, JITTER, STOPPED, TORN_CYCLE, INCOMPLETE_CYCLE, NO_ACKNOWLEDGEMENT, BOOT_UP_UNANSWERED,
)  # fmt: skip
_NOTICED_NS = 500_000_000
"""A lost carrier is noticed so late at most, and one that is back."""

_INTERVALS = 3
_Span = tuple[int, int | None]


def judge_without_carrier(case: Case) -> Iterator[Explained]:
    """Explain what is missing from times in which no interface had a carrier."""
    symptoms = case.symptoms
    for since_ns, until_ns in _without_any(case):
        end_ns = None if until_ns is None else until_ns + _NOTICED_NS
        chosen = case.free(*_UNSEEN) & case.overlapping(since_ns - _NOTICED_NS, end_ns)
        # Of a slow list the last telegram came a while before.
        stopped = np.flatnonzero(case.free(STOPPED))
        due_ns = symptoms.since_ns[stopped] + _INTERVALS * case.nominal_ns(stopped) + _NOTICED_NS
        chosen |= case.only(stopped[(due_ns >= since_ns) & (symptoms.since_ns[stopped] <= (end_ns or case.end_ns))])
        lists = case.lists_of(np.flatnonzero(chosen & (symptoms.list >= 0)))
        # What had stopped long before did not stop by that.
        before_ns = since_ns - _NOTICED_NS - _INTERVALS * (longest_ns(lists) if lists else 0)
        chosen &= ~(symptoms.of_kinds(STOPPED) & (symptoms.since_ns < before_ns))
        chosen |= case.free(CARRIER_LOST)
        lists = case.lists_of(np.flatnonzero(chosen & (symptoms.list >= 0)))
        names = " and ".join(source.path for source in case.facts.sources if source.is_live)
        has = "has" if until_ns is None else "had"
        checked = ["the interface tells it itself: no cable, or nobody at its other end"]
        if lists:
            checked.append(f"{count_of(len(lists), 'list')} could not be seen: what the plant did, nobody knows")
        draft = Draft(
            CAPTURE_INCOMPLETE,
            f"Nothing could be captured {span_in_words(case, since_ns, until_ns)}: {names} {has} no carrier",
            "The cable of this computer, and the switch port at its other end.",
            checked, lists, since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        yield draft, chosen


def was_unplugged(case: Case, since_ns: int, until_ns: int | None, slack_ns: int) -> bool:
    """Tell whether a silence lies in a time without a carrier, but for so much at both ends: then it is none."""
    slack_ns += _NOTICED_NS
    return any(
        since_ns >= begin_ns - slack_ns and (end_ns is None or (until_ns is not None and until_ns <= end_ns + slack_ns))
        for begin_ns, end_ns in _without_any(case)
    )


def _without_any(case: Case) -> list[_Span]:
    """Return the times in which none of the sources had a carrier; none where one of them is no interface."""
    sources = case.facts.sources
    if not sources or not all(source.is_live for source in sources):
        return []
    common: list[_Span] = list(sources[0].without_carrier)
    for source in sources[1:]:
        common = [
            both for one in common for other in source.without_carrier if (both := _overlap(one, other)) is not None
        ]
    return common


def _overlap(one: _Span, other: _Span) -> _Span | None:
    since_ns = max(one[0], other[0])
    ends = [end for end in (one[1], other[1]) if end is not None]
    until_ns = min(ends) if ends else None
    return None if until_ns is not None and until_ns <= since_ns else (since_ns, until_ns)
