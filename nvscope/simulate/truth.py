"""Truth: what was put into simulated traffic, in the words of a report.

Only what an observer can know counts: a loss needs a telegram seen before and one after it, and what waits when the
capture ends waits for ever. ``designed`` tells what was put in, seen or not.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import CHECKSUM_PRESENT
from nvscope.findings.answers import SEND_REJECTED
from nvscope.findings.consistency import CHECKSUM_CHANGED, SEVERAL_SENDERS
from nvscope.findings.loss import COUNTER_UNUSED, DUPLICATE_TELEGRAM, OVERTAKEN_TELEGRAM, SENDER_RESTART
from nvscope.list_key import ListKey
from nvscope.simulate.can.frame_table import CanFrameTable
from nvscope.simulate.can.truth import can_buses, can_lists
from nvscope.simulate.expected import (
    UNUSED_TELEGRAMS,
    ExpectedFindings,
    checksum_mismatches,
    expect_capture,
    expect_clock,
    expect_single,
    expect_swapped,
    expect_timing,
    expect_torn,
    kind_of_gaps,
)
from nvscope.simulate.faults import Label
from nvscope.simulate.figures import Figures, count_figures, is_recognisable, seems_to_count_sends
from nvscope.simulate.frame_table import FrameTable
from nvscope.simulate.frames import IPAddress
from nvscope.simulate.observation import Observation
from nvscope.simulate.replies import (
    missing_acknowledgements,
    negative_acknowledgements,
    unanswered_requests,
    unexpected_acknowledgements,
)
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.template import Role, Template

SCHEMA = "nvscope.truth/1"
_FIGURES = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts")
_STREAM_FIGURES = ("lost", "duplicates", "overtaken", "restarts")
_FIGURE_KINDS = {"duplicates": DUPLICATE_TELEGRAM, "overtaken": OVERTAKEN_TELEGRAM, "restarts": SENDER_RESTART}


def make_truth(scenario: Scenario, table: FrameTable | None, can: CanFrameTable | None = None) -> dict[str, Any]:
    """Return the truth as values for JSON; keys are those of a report (``nvscope.report/1``) where they mean the same.

    ``table`` are the frames of all links but CAN, ``can`` those of CAN: of these it is the truth for who knows the
    definitions of their lists (``can_definition``).
    ``exact`` is false for a wild scenario: its figures of loss are then what was put in, not what can be observed.
    Values are null where the rules leave an observer without a chance: figures of a sender whose way of counting cannot
    be told, intervals where a node that counts across streams was restarted.
    """
    parts = ([] if table is None else [table.ts_ns]) + ([] if can is None else [can.frames.ts_ns])
    ends = [(int(part.min()), int(part.max())) for part in parts if len(part)]
    start_ns, end_ns = min((first for first, _ in ends), default=0), max((last for _, last in ends), default=0)
    found = ExpectedFindings()
    lists: list[dict[str, Any]] = []
    telegrams = 0
    if can is not None:
        lists += can_lists(scenario, can, end_ns, found)
    if table is not None:
        seen = Observation(scenario, table, end_ns)
        telling = _Telling(seen, found)
        lists += [telling.list_truth(key) for key in seen.rows_of_lists]
        expect_capture(seen, found)
        telegrams = int(seen.telegram.sum())
    frames = sum(len(part) for part in parts)
    can_frames = 0 if can is None else len(can)
    truth = {
        "schema": SCHEMA,
        "title": scenario.title,
        "seed": scenario.seed,
        "exact": not scenario.wild,
        "capture": {
            "frames": frames,
            "telegrams": telegrams,
            "other_frames": frames - telegrams,
            **({"can_frames": can_frames} if can_frames else {}),
            "start_ns": str(start_ns) if frames else None,
            "end_ns": str(end_ns) if frames else None,
        },
        "lists": lists,
    }
    if can is not None:
        expect_clock(can.frames.ts_ns, found)
        truth["buses"] = list(can_buses(scenario, can, found))
    return truth | {"findings": found.rows()}


class _Telling:
    """The lists of an observation as values for JSON; their findings go to ``found`` on the way."""

    def __init__(self, seen: Observation, found: ExpectedFindings) -> None:
        self.seen = seen
        self.found = found
        self.figures: Figures = count_figures(seen)
        self.recognisable = [is_recognisable(seen, node) for node in range(len(seen.addresses))]
        arrived = seen.data & (seen.table.label != Label.COPY)
        self.arrived_of = np.bincount(seen.stream[arrived], minlength=len(seen.streams))

    def list_truth(self, key: ListKey) -> dict[str, Any]:
        seen, found = self.seen, self.found
        rows = seen.rows_of_lists[key]
        judged = rows[seen.judged[rows]]
        role = seen.role[judged]
        requests = judged[role == Role.BOOT_UP_REQUEST]
        rejected = rows[seen.rejected[rows]]
        mismatches = checksum_mismatches(seen, rows)
        missing = missing_acknowledgements(seen, key, rows, found)
        negative = negative_acknowledgements(seen, key, rows, found)
        unanswered = unanswered_requests(seen, key, requests, rows, found)
        unexpected = unexpected_acknowledgements(seen, key, rows, found)
        errors = missing + negative
        for template, count in seen.by_template(mismatches):
            errors[template.source] += count
        for template, count in seen.by_template(rejected):
            errors[template.destination] += count
            found.add(SEND_REJECTED, key, template.destination, template.subindex, count)
        errors[None] += unanswered
        written = seen.data.copy()
        written[mismatches] = False
        readers = self._sources(judged[np.isin(role, (Role.ACKNOWLEDGEMENT, Role.BOOT_UP_REQUEST))])
        senders = self._sources(judged[np.isin(role, (Role.DATA, Role.MALFORMED_DATA))])
        streams = sorted(np.unique(seen.stream[judged[seen.data[judged]]]).tolist(), key=self._stream_order)
        stream_rows = [self._stream_truth(key, number) for number in streams]
        expect_single(seen, key, rows, found)
        expect_torn(seen, key, streams, found)
        found.add_rows(CHECKSUM_CHANGED, key, seen, mismatches)
        found.add(SEVERAL_SENDERS, key, None, None, max(len(senders) - 1, 0))
        return {
            "key": str(key),
            "transport": key.transport.value,
            "port": key.port,
            "id": key.identifier,
            "senders": [str(address) for address in senders],
            "readers": [str(address) for address in readers],
            "diag": self._diag(judged, judged, written, errors.total()),
            "counters": self._counters(streams)
            | {
                "malformed": int(np.isin(role, (Role.MALFORMED, Role.MALFORMED_DATA)).sum()),
                "truncated": int(seen.truncated[rows].sum()),
                "missing_acknowledgements": missing.total(),
                "negative_acknowledgements": negative.total(),
                "checksum_mismatches": len(mismatches),
                "bootup_requests": len(requests),
                "bootup_unanswered": unanswered,
                "send_rejected": len(rejected),
            },
            "nodes": self._nodes(judged, written, errors, set(readers)),
            "streams": stream_rows,
            "designed": self._designed(key) | {"unexpected_acknowledgements": unexpected},
        }

    def _sources(self, rows: I64) -> list[IPAddress]:
        return sorted({template.source for template, _ in self.seen.by_template(rows)}, key=_address_order)

    def _stream_order(self, number: int) -> tuple[int, int, int]:
        entry = self.seen.streams[number]
        return (*_address_order(self.seen.addresses[entry.node]), entry.subindex)

    def _counters(self, streams: list[int]) -> dict[str, int | None]:
        if not all(self.recognisable[self.seen.streams[number].node] for number in streams):
            return dict.fromkeys(_FIGURES)
        columns = {name: getattr(self.figures, name)[streams] for name in _FIGURES}
        return {
            name: int(column.max(initial=0) if name == "longest_gap" else column.sum())
            for name, column in columns.items()
        }

    def _designed(self, key: ListKey) -> dict[str, int]:
        """Return how many telegrams of a list were sent, and how many of them are never seen."""
        lists = self.seen.scenario.list
        own = [number for number, entry in enumerate(self.seen.streams) if lists[entry.entry].list_key == key]
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
        for address in sorted(addresses, key=_address_order):

            def is_delivered(entry: Template, address: IPAddress = address) -> bool:
                reached = address in readers if entry.broadcast else entry.destination == address
                return reached and entry.source != address

            own = self.seen.where(judged, lambda entry, address=address: entry.source == address)  # type: ignore[misc]
            diag = self._diag(own, self.seen.where(judged, is_delivered), written, errors[address])
            if any(value not in (0, None) for value in diag.values()):
                nodes.append({"address": str(address), "diag": diag})
        return nodes

    def _stream_truth(self, key: ListKey, number: int) -> dict[str, Any]:
        seen, table = self.seen, self.seen.table
        entry = seen.streams[number]
        rows = seen.rows_of_stream(number)
        address, last = seen.addresses[entry.node], rows[-1]
        template = seen.templates[table.template[last]]
        scope: str | None = entry.scope
        if scope == "unused" and len(rows) < UNUSED_TELEGRAMS:
            scope = "node-send" if seems_to_count_sends(seen, entry.node) else "stream"
        elif scope == "unused":
            self.found.add(COUNTER_UNUSED, key, address, entry.subindex)
        figures: dict[str, int | None] = dict.fromkeys(_STREAM_FIGURES)
        if self.recognisable[entry.node]:
            figures = {name: int(getattr(self.figures, name)[number]) for name in _STREAM_FIGURES}
            kinds = {"gaps": kind_of_gaps(seen, number, int(self.figures.lost[number]))} | _FIGURE_KINDS
            for name, kind in kinds.items():
                self.found.add(kind, key, address, entry.subindex, int(getattr(self.figures, name)[number]))
        else:
            scope = None
            expect_swapped(seen, key, number, self.found)
        return {
            "node": str(address),
            "subindex": entry.subindex,
            "telegrams": len(rows),
            "counter_scope": scope,
            **figures,
            "interval_ns": self._intervals(key, number),
            "items": template.items,
            "length": template.frame.payload_bytes,
            "checksum": int(table.checksum[last]) if table.flags[last] & CHECKSUM_PRESENT.mask else None,
        }

    def _intervals(self, key: ListKey, number: int) -> dict[str, int | None]:
        """Return the intervals of a stream.

        Timing leaves out what the stream's own counters call late, whatever the node counts; after a restart of a node
        that counts across streams this hangs on where its streams stood.
        """
        entry = self.seen.streams[number]
        restarted = self.figures.restarts[self.seen.streams_of_node(entry.node)].any()
        if not self.recognisable[entry.node] or (restarted and entry.scope != "stream"):
            return dict.fromkeys(("count", "min", "max"))
        intervals = expect_timing(self.seen, key, number, self.found)
        return {
            "count": len(intervals),
            "min": int(intervals.min()) if len(intervals) else None,
            "max": int(intervals.max()) if len(intervals) else None,
        }


def _address_order(address: IPAddress) -> tuple[int, int]:
    return address.version, int(address)
