"""Truth: what was put into simulated traffic, in the words of a report.

Only what an observer can know counts: a loss needs a telegram seen before and one after it, and what waits when the
capture ends waits for ever. ``designed`` tells what was put in, seen or not. Figures are told, and no findings: what a
report should say of them is not for who put them in. Causes are: they are what was put in.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import CHECKSUM_PRESENT
from nvscope.list_key import ListKey
from nvscope.simulate.can.truth import can_buses, can_list_truth
from nvscope.simulate.cause_truth import cause_truth
from nvscope.simulate.faults import Label
from nvscope.simulate.frames import IPAddress, address_order
from nvscope.simulate.list_facts import ListFacts
from nvscope.simulate.network_facts import NetworkFacts
from nvscope.simulate.scenario_facts import ScenarioFacts
from nvscope.simulate.template import Role, Template
from nvscope.simulate.visu.truth import visu_truth
from nvscope.version import head

SCHEMA = "nvscope.truth/1"
_FIGURES = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts")
_STREAM_FIGURES = ("lost", "duplicates", "overtaken", "restarts")


def make_truth(facts: ScenarioFacts) -> dict[str, Any]:
    """Return the truth as values for JSON; keys are those of a report (``nvscope.report/2``) where they mean the same.

    ``exact`` is false for a wild scenario: its figures of loss are then what was put in, not what can be observed.
    Values are null where the rules leave an observer without a chance: figures of a sender whose way of counting cannot
    be told, intervals where a node that counts across streams was restarted. ``visu`` is what pages say; there where
    there are any.
    """
    scenario, network, can = facts.scenario, facts.network, facts.can_table
    lists = [] if can is None else [can_list_truth(can, entry) for entry in facts.can_lists]
    if network is not None:
        telling = _Telling(network)
        lists += [telling.list_truth(entry) for entry in network.lists]
    telegrams = 0 if network is None else int(network.seen.telegram.sum())
    can_frames = 0 if can is None else len(can)
    return {
        **head(SCHEMA),
        "title": scenario.title,
        "seed": scenario.seed,
        "exact": not scenario.wild,
        "capture": {
            "frames": facts.frames,
            "telegrams": telegrams,
            "other_frames": facts.frames - telegrams,
            **({"can_frames": can_frames} if can_frames else {}),
            "start_ns": str(facts.start_ns) if facts.frames else None,
            "end_ns": str(facts.end_ns) if facts.frames else None,
        },
        "lists": lists,
        "causes": cause_truth(facts),
        **({} if can is None else {"buses": list(can_buses(scenario, can))}),
        **({"visu": visu} if (visu := visu_truth(scenario)) else {}),
    }


class _Telling:
    """The lists of an observation as values for JSON."""

    def __init__(self, facts: NetworkFacts) -> None:
        self.facts = facts
        self.seen = facts.seen
        self.figures = facts.figures
        arrived = self.seen.data & (self.seen.table.label != Label.COPY)
        self.arrived_of = np.bincount(self.seen.stream[arrived], minlength=len(self.seen.streams))
        self.streams_of: dict[ListKey, list[int]] = {}
        for number, stream in enumerate(self.seen.streams):
            self.streams_of.setdefault(self.seen.scenario.list[stream.entry].list_key, []).append(number)
        self.written: Bool = self.seen.data.copy()
        for one in facts.lists:
            self.written[one.mismatches] = False

    def list_truth(self, entry: ListFacts) -> dict[str, Any]:
        seen, key, judged = self.seen, entry.key, entry.judged
        role = seen.role[judged]
        errors = self._errors(entry)
        written = self.written
        return {
            "key": str(key),
            "transport": key.transport.value,
            "port": key.port,
            "id": key.identifier,
            "senders": [str(address) for address in entry.senders],
            "readers": [str(address) for address in entry.readers],
            "diag": self._diag(judged, judged, written, errors.total()),
            "counters": self._counters(entry.streams)
            | {
                "malformed": int(np.isin(role, (Role.MALFORMED, Role.MALFORMED_DATA)).sum()),
                "truncated": int(seen.truncated[entry.rows].sum()),
                "missing_acknowledgements": entry.missing.total(),
                "negative_acknowledgements": entry.negative.total(),
                "checksum_mismatches": len(entry.mismatches),
                "bootup_requests": len(entry.requests),
                "bootup_unanswered": len(entry.unanswered),
                "send_rejected": len(entry.rejected),
            },
            "nodes": self._nodes(judged, written, errors, set(entry.readers)),
            "streams": [self._stream_truth(number) for number in entry.streams],
            "designed": self._designed(key) | {"unexpected_acknowledgements": entry.unexpected.total()},
        }

    def _errors(self, entry: ListFacts) -> Counter[IPAddress | None]:
        """Return the errors of a list by whose they are; None where nobody can know it."""
        errors: Counter[IPAddress | None] = Counter()
        for (node, _), count in (entry.missing + entry.negative).items():
            errors[node] += count
        for template, count in self.seen.by_template(entry.mismatches):
            errors[template.source] += count
        for template, count in self.seen.by_template(entry.rejected):
            errors[template.destination] += count
        errors[None] += len(entry.unanswered)
        return errors

    def _counters(self, streams: list[int]) -> dict[str, int | None]:
        if not all(self.facts.recognisable[self.seen.streams[number].node] for number in streams):
            return dict.fromkeys(_FIGURES)
        columns = {name: getattr(self.figures, name)[streams] for name in _FIGURES}
        return {
            name: int(column.max(initial=0) if name == "longest_gap" else column.sum())
            for name, column in columns.items()
        }

    def _designed(self, key: ListKey) -> dict[str, int]:
        """Return how many telegrams of a list were sent, and how many of them are never seen."""
        own = self.streams_of.get(key, [])
        sent, arrived = int(self.seen.table.sent_of[own].sum()), int(self.arrived_of[own].sum())
        return {"telegrams_sent": sent, "telegrams_lost": sent - arrived}

    def _diag(self, own: I64, received: I64, written: Bool, errors: int) -> dict[str, Any]:
        """Return the components that follow from what somebody sent, received and did wrong."""
        role = self.seen.role[own]
        sent = own[np.isin(role, (Role.DATA, Role.MALFORMED_DATA))]
        return {
            "nSendCount": len(sent),
            "tLastSend": self._last_time(sent),
            "nReceiveCount": len(received),
            "tLastReceive": self._last_time(received),
            "nWriteCount": int(written[received].sum()),
            "nErrorCount": errors,
            "nAcknowledges": int((role == Role.ACKNOWLEDGEMENT).sum()),
        }

    def _last_time(self, rows: I64) -> str | None:
        return str(self.seen.table.ts_ns[rows[-1]]) if len(rows) else None

    def _nodes(
        self, judged: I64, written: Bool, errors: Counter[IPAddress | None], readers: set[IPAddress]
    ) -> list[dict[str, Any]]:
        used = [template for template, _ in self.seen.by_template(judged)]
        addresses = {entry.source for entry in used} | {entry.destination for entry in used}
        addresses |= {address for address in errors if address is not None}
        nodes = []
        for address in sorted(addresses, key=address_order):

            def is_delivered(entry: Template, address: IPAddress = address) -> bool:
                reached = address in readers if entry.broadcast else entry.destination == address
                return reached and entry.source != address

            own = self.seen.where(judged, lambda entry, address=address: entry.source == address)  # type: ignore[misc]
            diag = self._diag(own, self.seen.where(judged, is_delivered), written, errors[address])
            if any(value not in (0, None) for value in diag.values()):
                nodes.append({"address": str(address), "diag": diag})
        return nodes

    def _stream_truth(self, number: int) -> dict[str, Any]:
        seen, table = self.seen, self.seen.table
        entry = seen.streams[number]
        rows = seen.rows_of_stream(number)
        last = rows[-1]
        template = seen.templates[table.template[last]]
        scope: str | None = None
        figures: dict[str, int | None] = dict.fromkeys(_STREAM_FIGURES)
        if self.facts.recognisable[entry.node]:
            scope = self.facts.scope(number)
            figures = {name: int(getattr(self.figures, name)[number]) for name in _STREAM_FIGURES}
        return {
            "node": str(seen.addresses[entry.node]),
            "subindex": entry.subindex,
            "telegrams": len(rows),
            "counter_scope": scope,
            **figures,
            "interval_ns": self._intervals(number),
            "items": template.items,
            "length": template.frame.payload_bytes,
            "checksum": int(table.checksum[last]) if table.flags[last] & CHECKSUM_PRESENT.mask else None,
        }

    def _intervals(self, number: int) -> dict[str, int | None]:
        intervals = self.facts.intervals(number)
        if intervals is None:
            return dict.fromkeys(("count", "min", "max"))
        return {
            "count": len(intervals),
            "min": int(intervals.min()) if len(intervals) else None,
            "max": int(intervals.max()) if len(intervals) else None,
        }
