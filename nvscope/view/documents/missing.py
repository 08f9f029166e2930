"""What is missing of what is defined, as data: rows of ``missing`` in reports and in the variables of a capture.

Lists that never came, each with the one that is sent in its place, readers that have no program, senders that no
controller can read, and variables that never change although others of their list do.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from nvscope.findings.answers import SEND_REJECTED
from nvscope.findings.definition import DEFINITION_MISMATCH, SILENT_LIST, UNKNOWN_LIST
from nvscope.findings.header import BIG_ENDIAN_HEADER, LENGTH_MISMATCH
from nvscope.findings.kind import Severity
from nvscope.list_key import ListKey, Transport
from nvscope.units import count, count_of, list_key, short_list_keys
from nvscope.view.documents.variables import streams_of
from nvscope.view.missing_kinds import FOREIGN, NEVER_CHANGED, NEVER_SEEN, WITHOUT_PROGRAM

if TYPE_CHECKING:
    from nvscope.causes.cause import Cause
    from nvscope.findings.facts import AnyList, Facts
    from nvscope.findings.finding import Finding
    from nvscope.tracker.state import TrackerState
    from nvscope.tracker.variables.values import Values

LEAST_TELEGRAMS = 10
"""A variable that did not change in fewer telegrams says nothing."""

MOST_NAMED = 10
"""So many variables of a list are named, the others counted."""

_OVER_NS = 2_000_000_000  # a stack tells no more often than this that nobody listens
_INDEX = re.compile(r"\[[^\]]*\]")


class Shown(NamedTuple):
    """What of captures is shown: findings, causes, and the keys of lists that came.

    ``causes`` know which reader has no program, None where nobody judged them.
    """

    findings: Sequence[Finding]
    causes: Sequence[Cause] | None
    lists: Collection[ListKey]


def missing_rows(
    facts: Facts, findings: Sequence[Finding], shown: Shown, values: Values | None = None, *,
    node_names: Mapping[str, str] = MappingProxyType({}),
) -> list[dict[str, Any]]:  # fmt: skip
    """Return a row for each thing that is missing of what is shown, by kind, then by list.

    ``facts`` and ``findings`` are those of everything; ``values`` are those of all telegrams, None where these are not
    known.
    """
    rows = _Rows(facts, findings, shown, node_names)
    found = [*rows.never_seen(), *rows.without_program(), *rows.foreign()]
    return found + list(rows.never_changed(values) if values is not None else ())


class _Rows:
    """Makes the rows: knows what lists and nodes are called."""

    def __init__(
        self, facts: Facts, findings: Sequence[Finding], shown: Shown, node_names: Mapping[str, str]
    ) -> None:  # fmt: skip
        self._facts, self._findings, self._shown, self._node_names = facts, findings, shown, node_names
        every: Iterable[AnyList] = (*facts.summary.can.lists, *facts.summary.lists)
        self._lists = {entry.number: entry for entry in every}
        keys = {entry.key for entry in self._lists.values()}
        keys |= {key for key in facts.defined if key.transport is Transport.UDP}
        self._short = short_list_keys(sorted(map(str, keys)))
        # Only what is missing needs what judges it; of most captures, nothing is.
        self._foreign: list[tuple[int, int, int, int]] = []
        if any(finding.kind in (LENGTH_MISMATCH, BIG_ENDIAN_HEADER) for finding in findings):
            from nvscope.causes.headers import foreign_senders  # noqa: PLC0415

            self._foreign = list(foreign_senders(facts, findings))

    def never_seen(self) -> Iterator[dict[str, Any]]:
        """Yield the lists that are defined and never came."""
        unread = {self._lists[number].key for number, *_ in self._foreign}
        silent = {
            finding.key: finding
            for finding in self._shown.findings
            if finding.kind is SILENT_LIST and finding.key is not None and finding.key not in unread
        }
        if not silent:
            return
        from nvscope.causes.elsewhere import differences, matches  # noqa: PLC0415

        odd = [one.list_number for one in self._findings if one.kind in (UNKNOWN_LIST, DEFINITION_MISMATCH)]
        strange = [self._lists[number] for number in dict.fromkeys(odd) if number is not None]
        values = self._facts.state.values
        layouts = values.layouts if values else None
        found = {match.key: match for match in matches(list(silent), strange, layouts)}
        for key, finding in sorted(silent.items()):
            what = f"{self._called(key)} was never seen"
            why: str | None = None
            if match := found.get(key):
                nodes = list(dict.fromkeys(stream.node for stream in match.sent.streams))
                ways, steps = differences(match)
                why = f"{self._node(nodes[0])} sends it {' and '.join(ways)}"
                yield self._row(NEVER_SEEN, finding, [key, match.sent.key], nodes, what, why, " ".join(steps))
            else:
                if len(strange) > len(found) and layouts and layouts.candidates_of(key):
                    why = "no list without a definition has its shape"
                step = finding.hint or SILENT_LIST.next_steps[1]
                yield self._row(NEVER_SEEN, finding, [key], [], what, why, step)

    def without_program(self) -> Iterator[dict[str, Any]]:
        """Yield readers that have no program at the port, as long as it is so; without causes nobody knows which."""
        causes = self._shown.causes
        rejected = [one for one in self._shown.findings if one.kind is SEND_REJECTED]
        if not rejected:
            return
        from nvscope.causes.readers import READER_WITHOUT_PROGRAM as KIND  # noqa: PLC0415

        for cause in causes or ():
            if cause.kind is KIND and cause.until_ns is None:
                nodes, why = list(cause.nodes), "; ".join(cause.checked) or None
                yield self._row(WITHOUT_PROGRAM, rejected[0], list(cause.lists), nodes, cause.title, why, cause.next)
        if causes is not None:
            return
        by_list: dict[int, list[Finding]] = defaultdict(list)
        for finding in rejected:
            if finding.list_number is not None and self._goes_on(finding):
                by_list[finding.list_number].append(finding)
        for number, own in sorted(by_list.items(), key=lambda one: self._lists[one[0]].key):
            key = self._lists[number].key
            senders = sorted({one.node for one in own if one.node is not None})
            of = f" of {self._node(senders[0])}" if len(senders) == 1 else ""
            times = count_of(sum(one.count for one in own), "time")
            why = f"nobody listens there, or there is no way to it, as ICMP says, {times}"
            what = f"A reader does not get {self._called(key)}{of}"
            yield self._row(WITHOUT_PROGRAM, own[0], [key], senders, what, why, KIND.next_step)

    def _goes_on(self, finding: Finding) -> bool:
        """Tell whether the events of a finding go on to the end, as far as one can tell."""
        end_ns = self._facts.at_ns
        first_ns, last_ns = finding.first_ns or 0, finding.last_ns or end_ns
        return end_ns - last_ns <= max(2 * (last_ns - first_ns) // max(finding.count - 1, 1), _OVER_NS)

    def foreign(self) -> Iterator[dict[str, Any]]:
        """Yield senders with headers that no controller can read."""
        if not self._foreign:
            return
        from nvscope.causes.headers import HEADER_FOREIGN  # noqa: PLC0415
        from nvscope.findings.foreign_headers import foreign_header  # noqa: PLC0415

        for number, node, malformed, telegrams in self._foreign:
            key, header = self._lists[number].key, foreign_header(self._facts, number, node)
            if key not in self._shown.lists:
                continue
            own = next(one for one in self._findings if (one.list_number, one.node) == (number, node))
            what = f"No controller can read {self._called(key)} of {self._node(node)}"
            why = f"Length does not fit in {count(malformed)} of {count_of(telegrams, 'telegram')}"
            why = header.words if header else why
            yield self._row(FOREIGN, own, [key], [node], what, why, HEADER_FOREIGN.next_step)

    def never_changed(self, values: Values) -> Iterator[dict[str, Any]]:
        """Yield the lists of which some variables changed, and others never."""
        for rest in resting(self._facts.state, values):
            if rest.key not in self._shown.lists:
                continue
            number, telegrams = count_of(len(rest.names), "variable"), count_of(rest.telegrams, "telegram")
            what = f"{number} of {self._called(rest.key)} never changed in {telegrams}, others of it did"
            step = "If they should change, look whether the program of the sender writes them."
            yield self._row(NEVER_CHANGED, None, [rest.key], [], what, None, step, rest.names)

    def _called(self, key: ListKey) -> str:
        """Return a list's name with what people call it without one."""
        text, name = str(key), self._name(key)
        number = self._short.get(text) or list_key(text).rpartition("/")[2]
        return f"{name} ({number})" if name else f"list {number}"

    def _name(self, key: ListKey) -> str | None:
        known = self._facts.defined.get(key) or self._facts.defined.get(key.on_any_channel)
        return known.name if known and known.name else None

    def _node(self, node: int) -> str:
        address = self._facts.address(node)
        return self._node_names.get(address, address)

    def _row(
        self, kind: str, told_by: Finding | None, keys: Sequence[ListKey], nodes: Sequence[int], what: str,
        why: str | None, step: str, names: Sequence[str] = (),
    ) -> dict[str, Any]:  # fmt: skip
        return {
            "kind": kind,
            "severity": (told_by.kind.severity if told_by else Severity.NOTE).word,
            "lists": [str(key) for key in keys],
            "list_name": self._name(keys[0]) if keys else None,
            "nodes": [self._facts.address(node) for node in nodes],
            "variables": list(names[:MOST_NAMED]),
            "variables_cut": max(len(names) - MOST_NAMED, 0),
            "what": what,
            "why": why,
            "next": step,
        }


class Resting(NamedTuple):
    """A list, and what of it never changed while others did: variables, whole structures, all elements of arrays.

    ``telegrams`` are the fewest of those that one of its parts was sent in.
    """

    key: ListKey
    names: Sequence[str]
    telegrams: int


def resting(state: TrackerState, values: Values) -> Iterator[Resting]:
    """Yield lists of which some variables never changed and others did, in the order of their variables.

    An array changes if one of its elements does. Parts that were sent seldom say nothing.
    """
    lists: dict[ListKey, dict[str, bool]] = defaultdict(dict)
    fewest: dict[ListKey, int] = {}
    for stream in streams_of(state, values):
        known = stream.sequence[-1]
        if known.telegrams < LEAST_TELEGRAMS:
            continue
        fewest[stream.list] = min(known.telegrams, fewest.get(stream.list, known.telegrams))
        changed = lists[stream.list]
        for (_, element), changes in zip(known.layout.spans(), known.changes.tolist(), strict=True):
            name = _INDEX.sub("[*]", element.name)
            changed[name] = changed.get(name, False) or changes > 0
    for key, changed in lists.items():
        names = list(_whole(changed))
        if names and any(changed.values()):
            yield Resting(key, names, fewest[key])


def _whole(changed: Mapping[str, bool]) -> Iterator[str]:
    """Yield what never changed, each structure of which nothing did as one."""
    moved = {prefix for name, one in changed.items() if one for prefix in _prefixes(name)}
    resting = [next(prefix for prefix in _prefixes(name) if prefix not in moved)
               for name, one in changed.items() if not one]  # fmt: skip
    for name in dict.fromkeys(resting):
        yield name.removesuffix("[*]")


def _prefixes(name: str) -> Iterator[str]:
    """Yield a name's structures from outside in, then the name itself."""
    parts = name.split(".")
    return (".".join(parts[: place + 1]) for place in range(len(parts)))
