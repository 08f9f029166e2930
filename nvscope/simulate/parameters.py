"""Conversations by the Parameter Manager: who asks whom for which value, and what comes of each request."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import HEADER, Service
from nvscope.simulate.draft import Draft
from nvscope.simulate.frames import Values
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.scenario import ParameterRequests, Scenario
from nvscope.simulate.template import Role

_REPLY_OF = {Service.ODReadRequest: Service.ODReadRequestReply, Service.ODWriteRequest: Service.ODWriteRequestReply}


def asked_ns(scenario: Scenario, position: int) -> I64:
    """Return when one of the conversations asks, request by request."""
    one = scenario.parameter[position]
    end_ns = scenario.duration_ns if one.until_ns is None else min(scenario.duration_ns, one.until_ns)
    at: I64 = np.arange(one.from_ns, max(end_ns, one.from_ns), one.interval_ns, dtype=np.int64)
    return at + uniform(noise_key(scenario.seed, "parameter", position), np.arange(len(at)), one.jitter_ns + 1)


def add_parameters(draft: Draft) -> None:
    """Add requests, and their replies, which carry the value that was read."""
    for position, one in enumerate(draft.scenario.parameter):
        numbers = draft.scenario.node_numbers
        asking, asked = numbers[one.node], numbers[one.to]
        at = asked_ns(draft.scenario, position)
        ordinal = np.arange(len(at))
        counter = ((ordinal + one.first_value) & 0xFFFF).astype(np.uint16)
        service = Service.ODWriteRequest if one.write else Service.ODReadRequest
        request = _template(draft, asking, asked, one, service, one.value_bytes if one.write else 0)
        draft.add(request, at, ordinal=ordinal, counter=counter)
        refused, silent = chosen(one.refused, len(at)), chosen(one.unanswered, len(at))
        late = chosen(one.late, len(at))
        took_ns = np.where(late, one.late_by_ns, one.latency_ns)
        for reply, size, rows in (
            (_REPLY_OF[service], 0 if one.write else one.value_bytes, ~refused & ~silent),
            (Service[one.error], 0, refused & ~silent),
        ):  # fmt: skip
            template = _template(draft, asked, asking, one, reply, size)
            draft.add(template, (at + took_ns)[rows], ordinal=ordinal[rows], counter=counter[rows])


def chosen(numbers: tuple[int, ...], count: int) -> Bool:
    """Return which of so many requests have one of some numbers, from 1 on."""
    return np.isin(np.arange(1, count + 1), numbers)


def _template(
    draft: Draft, source: int, target: int, one: ParameterRequests, service: Service, size: int
) -> int:  # fmt: skip
    header = HEADER.pack(
        id=service, index=one.index, subindex=one.subindex, items=1, length=HEADER.size_bytes + size
    ).tobytes()  # fmt: skip
    payload = header + bytes(size)
    return draft.telegram_template(
        source, draft.hosts[target].address, one.port, payload, Role.PARAMETER, Values.CONSTANT
    )
