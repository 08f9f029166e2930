"""Conversations by the Parameter Manager: who asks whom for which value, and what comes of each request."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U16, Bool
from dissectors.netvar import HEADER, Service
from nvscope.simulate.draft import Draft
from nvscope.simulate.frames import Values
from nvscope.simulate.noise import noise_key, uniform
from nvscope.simulate.refusals import QUOTED_AFTER_NS, refuse
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
    """Add requests, and what comes of them: replies, which carry the value that was read, and messages of hosts."""
    for position, one in enumerate(draft.scenario.parameter):
        numbers = draft.scenario.node_numbers
        asking, asked = numbers[one.node], numbers[one.to]
        at = asked_ns(draft.scenario, position)
        every = np.ones(len(at), np.bool_)
        back = chosen(one.undeliverable, len(at))
        refused, silent = chosen(one.refused, len(at)), chosen(one.unanswered, len(at)) | back
        late = chosen(one.late, len(at))
        answered_ns = at + np.where(late, one.late_by_ns, one.latency_ns)
        service = Service.ODWriteRequest if one.write else Service.ODReadRequest
        template = _add(draft, (asking, asked), one, service, at, every, valued=one.write)
        _add(draft, (asked, asking), one, _REPLY_OF[service], answered_ns, ~refused & ~silent, valued=not one.write)
        _add(draft, (asked, asking), one, Service[one.error], answered_ns, refused & ~silent, valued=False)
        host = draft.hosts[numbers[one.host or one.to]]
        draft.check_room(int(np.count_nonzero(back)))
        for row in np.flatnonzero(back).tolist():
            columns = (np.array([row], np.int32), _counter(one, np.array([row])), *np.zeros((2, 1), np.uint8))
            frame = draft.one(int(template[row]), *columns)
            refuse(draft, host, int(template[row]), frame, int(at[row]) + QUOTED_AFTER_NS)


def _add(
    draft: Draft, ends: tuple[int, int], one: ParameterRequests, service: Service, at: I64, rows: Bool, *, valued: bool
) -> I64:  # fmt: skip
    """Add the telegrams of a service in those rows where it is; return the templates of all rows, -1 in the others.

    ``at`` are the times of all requests, or of their replies; ``valued``: telegrams carry a value, each its own.
    """
    found = np.full(len(at), -1)
    values = (one.values or (0,)) if valued else (None,)
    for place, value in enumerate(values):
        own = np.flatnonzero(rows & (np.arange(len(at)) % len(values) == place))
        if len(own):
            draft.check_room(1)
            found[own] = _template(draft, *ends, one, service, value)
            draft.add(int(found[own[0]]), at[own], ordinal=own, counter=_counter(one, own))
    return found


def _counter(one: ParameterRequests, ordinal: I64) -> U16:
    return ((ordinal + one.first_value) & 0xFFFF).astype(np.uint16)


def chosen(numbers: tuple[int, ...], count: int) -> Bool:
    """Return which of so many requests have one of some numbers, from 1 on."""
    return np.isin(np.arange(1, count + 1), numbers)


def _template(
    draft: Draft, source: int, target: int, one: ParameterRequests, service: Service, value: int | None
) -> int:  # fmt: skip
    size = 0 if value is None else one.value_bytes
    header = HEADER.pack(
        id=service, index=one.index, subindex=one.subindex, items=1, length=HEADER.size_bytes + size
    ).tobytes()  # fmt: skip
    data = ((value or 0) % (1 << 8 * size)).to_bytes(size, "little")
    return draft.telegram_template(
        source, draft.hosts[target].address, one.port, header + data, Role.PARAMETER, Values.CONSTANT
    )
