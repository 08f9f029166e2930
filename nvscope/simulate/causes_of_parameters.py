"""The truth about requests of the Parameter Manager: which partners did not answer, or refused."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from dissectors.batch import I64, Bool
from nvscope.engine.reading import PARAMETER_TIMEOUT_NS
from nvscope.simulate.parameters import asked_ns, chosen
from nvscope.simulate.put_in import MOST_APART, Plant, PutIn
from nvscope.simulate.scenario import ParameterRequests

_Place = tuple[str, int]
"""Who is asked, on which port."""


def causes_of_parameters(plant: Plant) -> Iterator[PutIn]:
    """Yield what goes wrong with requests, by partner and port; of many partners of a host it is one, of that host."""
    for kind, struck in (("parameters-unanswered", _not_answered), ("parameters-refused", _refused)):
        asked: dict[tuple[str, _Place], list[tuple[ParameterRequests, I64, Bool]]] = defaultdict(list)
        for position, one in enumerate(plant.scenario.parameter):
            at = asked_ns(plant.scenario, position)
            place = plant.addresses[one.to], one.port
            asked[plant.addresses[one.node], place].append((one, at, struck(one, len(at))))
        alike: dict[tuple[str, object], list[tuple[str, _Place]]] = defaultdict(list)
        for ends, conversations in asked.items():
            alike[ends[0], _how(kind, conversations)].append(ends)
        found: dict[tuple[str, object], list[int]] = defaultdict(list)
        for (asking, how), every in alike.items():
            for ends in every:
                together = how is not None and len(every) > MOST_APART
                where = (asking, how) if together else (ends[1][0], ends[1])
                found[where] += [time for _, at, own in asked[ends] for time in at[own].tolist()]
        for (node, _), times in found.items():
            if times:
                yield PutIn(kind, min(times), plant.ended(min(times), max(times), len(times), 0), nodes=(node,))


def _how(kind: str, conversations: Sequence[tuple[ParameterRequests, I64, Bool]]) -> object:
    """Return by what partners are alike: that they answer nothing, or what they refuse; None of what is by itself."""
    if kind == "parameters-refused":
        return frozenset((one.error, one.index, one.subindex) for one, _, own in conversations if own.any()) or None
    silent = all(own.all() and not chosen(one.late, len(at)).any() for one, at, own in conversations)
    return "silent" if silent else None


def _not_answered(one: ParameterRequests, count: int) -> Bool:
    late = chosen(one.late, count) & (one.late_by_ns > PARAMETER_TIMEOUT_NS)
    return chosen(one.unanswered, count) | chosen(one.undeliverable, count) | late


def _refused(one: ParameterRequests, count: int) -> Bool:
    return chosen(one.refused, count) & ~_not_answered(one, count)
