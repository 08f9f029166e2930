"""Lists that ask for acknowledgements, and that nobody acknowledges at all: acknowledgement-impossible."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from nvscope.causes.case import Case, Draft, Explained, slack_ns
from nvscope.causes.kind import CauseKind, many_as_one
from nvscope.causes.words import capitalised, lists_in_words
from nvscope.engine.runs import distinct
from nvscope.enumeration import joined
from nvscope.findings.answers import NO_ACKNOWLEDGEMENT
from nvscope.tracker.summary import ListSummary
from nvscope.units import count_of

ACKNOWLEDGEMENT_IMPOSSIBLE = CauseKind(
    "acknowledgement-impossible",
    "never acknowledged",
    "Every telegram of a list asks for an acknowledgement, and none ever comes.",
    "Not one acknowledgement of the list in the whole capture.",
    "Switch 'acknowledgement' off for the list, or give it a reader that acknowledges.",
)
_NEXT_OF_MANY = "switch 'acknowledgement' off for these lists, or give them a reader that acknowledges."


class _Never(NamedTuple):
    """A list that was never acknowledged, and the nodes that it goes to, each alone.

    ``own`` are the symptoms of it that nothing has explained, ``every`` all of them: nor was it acknowledged while
    something else explains why.
    """

    entry: ListSummary
    to: tuple[int, ...]
    own: I64
    every: I64


def judge_impossible(case: Case) -> Iterator[Explained]:
    """Explain lists of which no telegram was ever acknowledged; as one, where many of a sender go to the same nodes."""
    alike: dict[object, list[_Never]] = defaultdict(list)
    for one in _never_acknowledged(case):
        answers = any(node in case.last_acknowledgement_ns for node in one.to)
        # What a reader does not know of its lists is another thing for each.
        alike[one.entry.number if answers else (tuple(one.entry.senders), one.to)].append(one)
    for together in alike.values():
        for lists in many_as_one(together):
            yield _draft(case, lists), case.only(np.concatenate([one.own for one in lists]))


def _never_acknowledged(case: Case) -> Iterator[_Never]:
    symptoms = case.symptoms
    for number in distinct(symptoms.list[case.free(NO_ACKNOWLEDGEMENT)]).tolist():
        entry = case.lists[number]
        if isinstance(entry, ListSummary) and not entry.diagnosis.nAcknowledges:
            own = np.flatnonzero(case.free(NO_ACKNOWLEDGEMENT) & (symptoms.list == number))
            every = np.flatnonzero(symptoms.of_kinds(NO_ACKNOWLEDGEMENT) & (symptoms.list == number))
            yield _Never(entry, tuple(node for node in distinct(symptoms.peer[own]).tolist() if node >= 0), own, every)


def _draft(case: Case, together: Sequence[_Never]) -> Draft:
    lists, to = [one.entry for one in together], together[0].to
    every = np.concatenate([one.every for one in together])
    name, is_one = lists_in_words(case, lists), len(lists) == 1
    of, asks, usual = "", "asks", ACKNOWLEDGEMENT_IMPOSSIBLE.next_step
    it_goes, it_is = "it goes", "it is a broadcast"
    if not is_one:
        of = f" of node{'s' if len(lists[0].senders) > 1 else ''} {joined([*map(case.address, lists[0].senders)])}"
        asks, usual, it_goes, it_is = "ask", _NEXT_OF_MANY, "they go", "they are broadcasts"
    usual = usual[0].lower() + usual[1:]
    checked = [f"not one of {count_of(sum(one.diagnosis.nSendCount for one in lists), 'telegram')} was acknowledged"]
    answers = [node for node in to if node in case.last_acknowledgement_ns]
    if answers:
        checked.append(f"{case.address(answers[0])} acknowledges other lists: it does not know this one")
        step = f"The definition of {name} at {case.address(answers[0])}."
    elif to:
        seen = any(case.life.is_heard(node) or node in case.streams_of_node for node in to)
        checked.append(f"{it_goes} to {case.address(to[0])}, which {'is there' if seen else 'was never seen'}")
        step = (
            f"Whether this capture sees what {case.address(to[0])} sends to one node alone: a mirror port of one "
            f"direction shows no answers. If it does: {usual}"
        )
    else:
        checked.append(f"{it_is}: nobody has to answer")
        step = (
            "Whether this capture sees answers at all: they go to the sender alone, and a switch shows them at a "
            f"mirror port only. If it does: {usual}"
        )
    return Draft(
        ACKNOWLEDGEMENT_IMPOSSIBLE, f"{capitalised(name)}{of} {asks} for acknowledgements that nobody sends",
        step, checked, lists, to, since_ns=int(case.symptoms.since_ns[every].min()),
        until_ns=case.end_of(case.symptoms.time_ns[every], slack_ns(lists)),
    )  # fmt: skip
