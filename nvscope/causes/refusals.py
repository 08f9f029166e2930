"""Writes that a web server refuses: one cause for all variables of a client that are refused alike."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np
from msgspec.structs import replace

from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.other import OTHER
from nvscope.causes.symptoms import AS_A_WHOLE
from nvscope.causes.words import nodes_by_name
from nvscope.findings.finding import Finding
from nvscope.findings.visu import VISU_ERROR
from nvscope.findings.visu_refusals import refused_writes, together
from nvscope.tracker.event_kinds import FRAMES_KEPT


def judge_refusals(case: Case) -> Iterator[Explained]:
    """Explain refused writes of several variables by client, controller and what is to be done."""
    symptoms = case.symptoms
    free = np.flatnonzero(case.free(VISU_ERROR) & (symptoms.detail == AS_A_WHOLE))
    alike: dict[tuple[int | None, str, str], list[int]] = defaultdict(list)
    for row in free.tolist():
        finding = case.findings[int(symptoms.finding[row])]
        _, server, *variable = finding.variable.split("/", 2)
        if variable and finding.statuses:
            alike[finding.node, server, finding.hint].append(row)
    for (node, server, hint), rows in alike.items():
        if len(rows) < 2 or node is None:
            continue
        parts = sorted(
            (case.findings[int(symptoms.finding[row])] for row in rows),
            key=lambda one: (one.first_ns or 0, one.variable),
        )
        names = [one.variable.split("/", 2)[2] for one in parts]
        title = refused_writes(case.facts.address(node), server, names, together([one.statuses for one in parts]))
        whole = _whole(parts)
        first_ns, last_ns = whole.first_ns or 0, whole.last_ns or 0
        draft = Draft(
            OTHER, nodes_by_name(case, title), hint, nodes=[node], since_ns=first_ns or None,
            until_ns=case.end_of_many(first_ns, last_ns, whole.count, 0) or None, at_most=case.at_most(()), whole=whole,
        )  # fmt: skip
        yield draft, case.only(np.array(rows, np.int64))


def _whole(parts: list[Finding]) -> Finding:
    """Return several findings as one: how often, when, and the first frames."""
    frames = sorted({frame for one in parts for frame in one.frames})[:FRAMES_KEPT]
    first = [one.first_ns for one in parts if one.first_ns is not None]
    last = [one.last_ns for one in parts if one.last_ns is not None]
    return replace(
        parts[0], count=sum(one.count for one in parts), first_ns=min(first, default=None),
        last_ns=max(last, default=None), frames=tuple(frames),
    )  # fmt: skip
