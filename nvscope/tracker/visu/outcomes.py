"""Outcomes: what replies say, by what they hold and what was asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64
from dissectors.webvisu import Answer, Request, answer_of, fields_in_reply
from nvscope.tracker.visu.counted_octets import count_of
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.messages import Kind, Outcome

_SEPARATOR = ord("|")
_OUTCOMES = {
    Answer.DONE: Outcome.DONE, Answer.MISCOUNTED: Outcome.MISCOUNTED, Answer.AMBIGUOUS: Outcome.AMBIGUOUS,
    Answer.REFUSED: Outcome.REFUSED,
}  # fmt: skip


def outcomes(
    kind: I64, asked: I64, requests: Sequence[Request], status: I64, data: bytes, start: I64, stop: I64
) -> tuple[I64, I64]:
    """Return what each reply says (``Outcome``), and how many fields it has, -1 of what has none to count.

    ``asked`` is a place in ``requests``; the content of its body lies from ``start`` to ``stop`` in ``data``.
    """
    outcome, fields = np.full(len(kind), int(Outcome.NONE)), np.full(len(kind), -1)
    replies = np.flatnonzero(kind == Kind.REPLY)
    outcome[replies] = int(Outcome.STATUS)
    good = replies[status[replies] == OK]
    counted = np.array([not (one.writes or one.query) for one in requests], np.bool_)
    for row in good[~counted[asked[good]]].tolist():
        content = data[int(start[row]) : int(stop[row])]
        outcome[row] = int(_OUTCOMES[answer_of(requests[int(asked[row])], content)])
    rows = good[counted[asked[good]]]
    fields[rows] = _fields(data, start[rows], stop[rows])
    entries = np.array([len(one.entries) for one in requests], np.int64)[asked[rows]]
    strings = np.array([min(one.strings, 2) for one in requests], np.int64)[asked[rows]]
    surplus = fields[rows] - entries
    outcome[rows] = np.where(
        (surplus == 0) | ((surplus > 0) & (strings == 1)), int(Outcome.DONE),
        np.where((surplus > 0) & (strings > 1), int(Outcome.AMBIGUOUS), int(Outcome.MISCOUNTED)),
    )  # fmt: skip
    return outcome, fields


def _fields(data: bytes, start: I64, stop: I64) -> I64:
    """Return how many fields replies have (``dissectors.webvisu.fields_in_reply``)."""
    fields = np.empty(len(start), np.int64)
    octets = np.frombuffer(data, np.uint8)
    usual = stop - start >= 2  # one in front of all, one behind them
    usual[usual] = (octets[start[usual]] == _SEPARATOR) & (octets[stop[usual] - 1] == _SEPARATOR)
    fields[usual] = count_of(_SEPARATOR, octets, start[usual], stop[usual]) - 1
    for row in np.flatnonzero(~usual).tolist():
        fields[row] = fields_in_reply(data[int(start[row]) : int(stop[row])])
    return fields
