"""How often what was put in is told, and nothing else: precision and recall by kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from nvscope.causes.cause import Cause
from nvscope.findings.kind import Severity
from nvscope.tracker.summary import Summary
from tests.causes.drawn.truth import Fault


class Score:
    """What was put in, found and told without reason, by kind."""

    def __init__(self) -> None:
        self.put: Counter[str] = Counter()
        self.found: Counter[str] = Counter()
        self.told: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.plants = 0

    def count(self, plant: object, faults: Sequence[Fault], summary: Summary, causes: Sequence[Cause]) -> bool:
        """Count one plant; tell whether all was right."""
        self.plants += 1
        left = list(causes)
        missed = []
        for fault in faults:
            self.put[fault.kind] += 1
            fitting = [cause for cause in left if not misfit(fault, summary, cause)]
            if fitting:
                self.found[fault.kind] += 1
                self.told[fault.kind] += 1
                left.remove(fitting[0])
            else:
                near = [reason for cause in causes if (reason := misfit(fault, summary, cause)) and reason != "kind"]
                missed.append(f"plant {plant}: not told {told(fault)} {near}")
        surplus = [cause for cause in left if cause.severity > Severity.NOTE]
        self.told.update(cause.kind.name for cause in surplus)
        missed += [f"plant {plant}: not put in {said(cause, summary)}" for cause in surplus]
        self.wrong += missed
        return not missed

    def recall(self, kind: str) -> float:
        return self.found[kind] / self.put[kind] if self.put[kind] else 1.0

    def precision(self, kind: str) -> float:
        return self.found[kind] / self.told[kind] if self.told[kind] else 1.0

    def table(self) -> str:
        """Return recall and precision of each kind, for people."""
        rows = [f"{'kind':28} put in  recall  precision"]
        for kind in sorted({*self.put, *self.told}):
            rows.append(f"{kind:28} {self.put[kind]:6}  {self.recall(kind):6.3f}  {self.precision(kind):9.3f}")
        rows.append(f"{'all':28} {self.put.total():6}  on {self.plants} plants")
        return "\n".join([*rows, *self.wrong])


def misfit(fault: Fault, summary: Summary, cause: Cause) -> str:
    """Return why a cause is not what was put in, empty where it is."""
    if cause.kind.name != fault.kind:
        return "kind"
    lists = {str(key) for key in cause.lists}
    nodes = {summary.addresses[node] for node in cause.nodes}
    if fault.lists and not lists & set(fault.lists):
        return f"lists {sorted(lists)}"
    if fault.nodes and nodes and not nodes & set(fault.nodes):
        return f"nodes {sorted(nodes)}"
    if fault.nodes and not fault.lists and not nodes:
        return "no nodes"
    if fault.channel and cause.channel != fault.channel:
        return f"channel {cause.channel}"
    begins = summary.start_ns is not None and fault.since_ns - summary.start_ns <= 2 * fault.interval_ns
    if begins and cause.since_ns == summary.start_ns:
        pass  # what is so nearly from the beginning may have been so before
    elif cause.since_ns is None or abs(cause.since_ns - fault.since_ns) > fault.slack_ns:
        return f"since {seconds(cause.since_ns)}"
    if (cause.until_ns is None) != fault.ongoing:
        return f"until {seconds(cause.until_ns)}"
    return ""


def seconds(ts_ns: int | None) -> str:
    return "null" if ts_ns is None else f"{ts_ns % 10**15 / 1e9:.2f}"


def told(fault: Fault) -> str:
    until = "null" if fault.ongoing else "ended"
    return f"{fault.kind} {[*fault.nodes]} {[*fault.lists]} {seconds(fault.since_ns)} {until} {fault.note}"


def said(cause: Cause, summary: Summary) -> str:
    nodes = [summary.addresses[node] for node in cause.nodes]
    lists = [str(key) for key in cause.lists]
    where = f"{nodes} {lists} {seconds(cause.since_ns)}..{seconds(cause.until_ns)}"
    return f"{cause.kind.name} {where}: {cause.title} | {'; '.join(cause.checked)}"
