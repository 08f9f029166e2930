"""The truth about requests of the Parameter Manager: which partners did not answer, or refused."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.batch import Bool
from nvscope.engine.reading import PARAMETER_TIMEOUT_NS
from nvscope.simulate.parameters import asked_ns, chosen
from nvscope.simulate.put_in import Plant, PutIn
from nvscope.simulate.scenario import ParameterRequests


def causes_of_parameters(plant: Plant) -> Iterator[PutIn]:
    """Yield what goes wrong with requests, by partner and port."""
    scenario = plant.scenario
    for kind, struck in (("parameters-unanswered", _not_answered), ("parameters-refused", _refused)):
        by_partner: dict[tuple[str, int], list[int]] = {}
        for position, one in enumerate(scenario.parameter):
            at = asked_ns(scenario, position)
            partner = scenario.node[scenario.node_numbers[one.to]].address
            by_partner.setdefault((partner, one.port), []).extend(at[struck(one, len(at))].tolist())
        for (partner, _), times in by_partner.items():
            if times:
                yield PutIn(kind, min(times), plant.ended(min(times), max(times), len(times), 0), nodes=(partner,))


def _not_answered(one: ParameterRequests, count: int) -> Bool:
    late = chosen(one.late, count) & (one.late_by_ns > PARAMETER_TIMEOUT_NS)
    return chosen(one.unanswered, count) | chosen(one.undeliverable, count) | late


def _refused(one: ParameterRequests, count: int) -> Bool:
    return chosen(one.refused, count) & ~_not_answered(one, count)
