"""Acknowledgements that came, and too late: nobody waited for them any more, or the next telegram was out already."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nvscope.causes.case import Case, slack_ns
from nvscope.findings.answers import UNEXPECTED_ACKNOWLEDGEMENT
from nvscope.findings.facts import AnyList
from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.tracker.summary import ListSummary
from nvscope.units import count_of, duration


def late_answers(
    case: Case, lists: Sequence[AnyList], readers: Sequence[int], since_ns: int, last_ns: int
) -> list[int]:  # fmt: skip
    """Return the acknowledgements that readers sent in a time when nobody waited for them any more."""
    symptoms = case.symptoms
    late = case.free(UNEXPECTED_ACKNOWLEDGEMENT) & np.isin(symptoms.node, readers)
    late &= np.isin(symptoms.list, [entry.number for entry in lists])
    late &= (symptoms.time_ns >= since_ns) & (symptoms.time_ns <= last_ns + slack_ns(lists))
    rows: list[int] = np.flatnonzero(late).tolist()
    return rows


def how_late(case: Case, rows: Sequence[int], late: Sequence[int]) -> str:
    """Return how long late answers took: from the last telegram before each that waited in vain."""
    symptoms = case.symptoms
    sent_ns = np.sort(symptoms.since_ns[np.asarray(rows)])
    came_ns = symptoms.time_ns[np.asarray(late)]
    place = np.searchsorted(sent_ns, came_ns, "right") - 1
    took_ns = (came_ns - sent_ns[place])[place >= 0]
    middle = f", {duration(int(np.median(took_ns)))} behind their telegrams" if len(took_ns) else ""
    return f"{count_of(len(late), 'acknowledgement')} came when nobody waited any more{middle}"


def answered_all(case: Case, readers: Sequence[int], lists: Sequence[AnyList]) -> bool:
    """Tell whether the only reader of lists sent an acknowledgement for each telegram, in time or not."""
    for entry in lists:
        assert isinstance(entry, ListSummary), "nobody acknowledges on CAN"
        telegrams = sum(stream.telegrams for stream in entry.streams)
        if len(readers) != 1 or [*entry.readers] != [*readers] or entry.diagnosis.nAcknowledges < telegrams:
            return False
    # Where the capture lacks telegrams, nobody knows how many there were.
    of_lists = np.isin(case.symptoms.list, [entry.number for entry in lists])
    return not (case.symptoms.of_kinds(TELEGRAM_GAP) & of_lists).any()
