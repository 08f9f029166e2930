"""What is known of a telegram's list, of its sender, of its bus and of what it shows, as fields: ``list.lost``,
``node.jitter``, ``bus.load``, ``finding.code``, ``cause.kind``.

Keys and names are known as a telegram is read, the rest when the whole capture was: such fields are ``judged``, and can
be read where ``Verdicts`` are given.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, Bool
from dissectors.can.pdo import EXTENDED
from nvscope.expression.typed_columns import Column, FieldType, TextColumn
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.figures import Figure, Of, Unit, Value, figures_of
from nvscope.tracker.measured import Measured
from nvscope.tracker.subjects import Measures
from nvscope.tracker.summary import Summary
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS
from nvscope.view.fields.named_parameters import named_parameter_fields
from nvscope.view.fields.places import NodeKey, in_list, on_can, on_udp, senders_and_lists, sent_by_node
from nvscope.view.fields.shown import NONE, Lasting, Looks, Shown, looks
from nvscope.view.fields.shown_fields import cause_fields, finding_fields
from nvscope.view.rows.frames import IP, FrameRows

if TYPE_CHECKING:
    from nvscope.causes.cause import Cause
    from nvscope.definition.parameters import Parameters

_UNSIGNED, _SIGNED, _TEXT = FieldType.UNSIGNED, FieldType.SIGNED, FieldType.TEXT


class Names(Struct, frozen=True):
    """The names that people gave to lists, by key, and to nodes, by the halves of their address; and to parameters."""

    lists: Mapping[ListKey, str] = field(default_factory=dict)
    nodes: Mapping[NodeKey, str] = field(default_factory=dict)
    parameters: Parameters | None = None


class Verdicts:
    """What is known when a capture was read: the figures of lists and nodes, the findings, and the causes.

    ``nodes`` are the halves of the addresses by number of the node; ``causes`` are there only for who asks for them.
    """

    def __init__(
        self, summary: Summary, nodes: Sequence[NodeKey], findings: Sequence[Finding], causes: Sequence[Cause] = ()
    ) -> None:
        self.findings = list(findings)
        self.causes = list(causes)
        measures = Measures(summary)
        self._lists: dict[ListKey, Measured] = {}
        self._nodes: dict[tuple[NodeKey, ListKey], Measured] = {}
        self._buses = {bus.channel: measures.of_bus(bus) for bus in summary.can.buses}
        self._nobody = measures.of_nobody()
        keys: dict[int, ListKey] = {}
        for entry in summary.lists:
            key = keys[entry.number] = entry.key
            self._lists[key] = measures.of_list(entry)
            for node, diagnosis in entry.nodes:
                self._nodes[nodes[node], key] = measures.of_node(entry, node, diagnosis)
        for can_entry in summary.can.lists:
            key = keys[can_entry.number] = can_entry.key
            self._lists[key] = measures.of_list(can_entry)
        number_of = {id(finding): number for number, finding in enumerate(self.findings)}
        self._cause_of = np.full(len(self.findings), NONE)
        for number, cause in enumerate(self.causes):
            self._cause_of[[number_of[id(finding)] for finding in cause.findings]] = number
        self._findings_shown = Shown(
            [finding.frames for finding in self.findings],
            [
                Lasting(number, {keys[place]: _some(one.node, nodes)}, one.subindex)
                for number, one in enumerate(self.findings)
                if not one.frames
                for place in (one.lists if one.list_number is None else (one.list_number,))
            ],
        )
        self._causes_shown = Shown(
            [cause.frames for cause in self.causes],
            [
                Lasting(number, self._sent(cause.lists, {nodes[node] for node in cause.nodes}))
                for number, cause in enumerate(self.causes)
                if not cause.frames
            ],
        )

    def _sent(self, lists: Collection[ListKey], nodes: Collection[NodeKey]) -> dict[ListKey, frozenset[NodeKey]]:
        """Return which of some nodes send telegrams of each of some lists; of all lists, if nodes are named alone."""
        sent: dict[ListKey, set[NodeKey]] = {key: set() for key in lists}
        if nodes:
            for node, key in self._nodes:
                if node in nodes and (key in sent or not lists):
                    sent.setdefault(key, set()).add(node)
        return {key: frozenset(some) for key, some in sent.items()}

    def measured(self, of: Of, node: NodeKey, key: ListKey) -> Measured:
        """Return what was measured of a telegram's list, of its sender on that list, or of its bus.

        A node that a list's diagnosis does not name has counted nothing there.
        """
        if of is Of.BUS:
            found = self._buses.get(str(key.port))
        else:
            found = self._lists.get(key) if of is Of.LIST else self._nodes.get((node, key))
        return found or self._nobody

    def looks(self, rows: FrameRows, *, findings: bool, causes: bool) -> Looks:
        """Return how telegrams are looked at by who asks for the findings that they show, for the causes, or both."""
        return looks(
            len(rows), self._findings_shown.by(rows) if findings else None,
            self._causes_shown.by(rows) if causes else None, self._cause_of,
        )  # fmt: skip

    def pairs(self, *, findings: bool, causes: bool) -> tuple[I64, I64]:
        """Return the numbers of all findings and causes there are, each finding beside its cause if asked for both."""
        finding = np.arange(len(self.findings) if findings else 0)
        cause = self._cause_of[finding] if causes else np.full(len(finding), NONE)
        alone = np.setdiff1d(np.arange(len(self.causes) if causes else 0), cause)
        return np.append(finding, np.full(len(alone), NONE)), np.append(cause, alone)

    def explained_by(self, causes: Collection[int]) -> set[int]:
        """Return the numbers of the findings that some causes explain."""
        return set(np.flatnonzero(np.isin(self._cause_of, list(causes))).tolist())


def _some(node: int | None, nodes: Sequence[NodeKey]) -> frozenset[NodeKey]:
    return frozenset() if node is None else frozenset([nodes[node]])


def verdict_fields(
    names: Names | None = None, verdicts: Verdicts | None = None, further: Iterable[FindingKind] = ()
) -> dict[str, TelegramField]:
    """Return the fields ``list.*``, ``node.*``, ``bus.*``, ``finding.*`` and ``cause.*`` by name, and ``sdo.name``.

    ``further`` are kinds of findings that the catalogue has not.
    """
    known = names or Names()
    lists = [
        TelegramField(
            "list.key", _TEXT, "List", "transport, port (or CAN channel) and list identifier: udp/1202/7, can/can0/385",
            _of_list(str), in_list, constant=True,
        ),
        TelegramField(
            "list.port", _UNSIGNED, "Port of the list", "destination port", lambda rows: rows.carried.port, on_udp,
            constant=True,
        ),
        TelegramField(
            "list.id", _UNSIGNED, "List identifier", "Index of a telegram that belongs to a list, on CAN the COB-ID",
            lambda rows: rows.carried.identifier & ~EXTENDED, in_list, constant=True,
        ),
        TelegramField(
            "list.name", _TEXT, "Name of the list", "from definition or project file",
            _of_list(lambda key: told_of(known.lists, key) or ""), _named(known), constant=True,
        ),
    ]  # fmt: skip
    nodes = [
        TelegramField(
            "node.address", FieldType.ADDRESS, "Node", "address of the sender", FIELDS["ip.src"].read, of=IP,
            constant=True,
        ),
        TelegramField(
            "node.name", _TEXT, "Name of the node", "of the sender, from the project file",
            _of_both(lambda node, _: known.nodes.get(node, "")), _node_named(known), constant=True,
        ),
    ]  # fmt: skip
    lists += [_figure(Of.LIST, "of the list", figure, verdicts) for figure in figures_of(Of.LIST)]
    nodes += [_figure(Of.NODE, "of the sender on that list", figure, verdicts) for figure in figures_of(Of.NODE)]
    buses = [_figure(Of.BUS, "of the CAN bus", figure, verdicts) for figure in figures_of(Of.BUS)]
    findings, causes = (verdicts.findings, verdicts.causes) if verdicts else ((), ())
    shown = (*finding_fields(findings, further), *cause_fields(causes))
    return {entry.name: entry for entry in (*lists, *nodes, *buses, *named_parameter_fields(known.parameters), *shown)}


def _of_both(tell: Callable[[NodeKey, ListKey], str]) -> Callable[[FrameRows], Column]:
    def read(rows: FrameRows) -> TextColumn:
        keys, code = senders_and_lists(rows)
        return TextColumn(code, tuple(tell(*key) for key in keys))

    return read


def _of_list(tell: Callable[[ListKey], str]) -> Callable[[FrameRows], Column]:
    return _of_both(lambda _, key: tell(key))


def _named(names: Names) -> Callable[[FrameRows], Bool]:
    def known(rows: FrameRows) -> Bool:
        keys, code = senders_and_lists(rows)
        return np.array([bool(told_of(names.lists, key)) for _, key in keys], np.bool_)[code] & in_list(rows)

    return known


def _node_named(names: Names) -> Callable[[FrameRows], Bool]:
    def known(rows: FrameRows) -> Bool:
        keys, code = senders_and_lists(rows)
        return np.array([node in names.nodes for node, _ in keys], np.bool_)[code] & sent_by_node(rows)

    return known


TYPES: dict[Unit, FieldType] = {
    "time": FieldType.TIME,
    "ns": FieldType.DURATION,
    "percent": FieldType.REAL,
    "per second": FieldType.REAL,
    "": _TEXT,
}
"""By unit; the others are whole numbers."""


def _figure(of: Of, whose: str, figure: Figure, verdicts: Verdicts | None) -> TelegramField:
    """Return the field of one figure of telegrams' lists, senders or buses."""
    kind = TYPES.get(figure.unit, _SIGNED)
    name = f"{of.value}.{figure.name}"

    def values(rows: FrameRows) -> tuple[list[Value], I64]:
        if verdicts is None:
            raise LookupError(f"{name} is read before the capture was judged")
        keys, code = senders_and_lists(rows)
        return [figure.read(verdicts.measured(of, *key)) for key in keys], code

    def read(rows: FrameRows) -> Column:
        told, code = values(rows)
        if kind is _TEXT:
            return TextColumn(code, tuple(str(value or "") for value in told))
        return np.array([value or 0 for value in told], np.float64 if kind is FieldType.REAL else np.int64)[code]

    def known(rows: FrameRows) -> Bool:
        told, code = values(rows)
        return np.array([value is not None for value in told], np.bool_)[code] & _BELONGS[of](rows)

    return TelegramField(
        name,
        kind,
        figure.name,
        f"{figure.help}, {whose}",
        read,
        known,
        calendar=kind is FieldType.TIME,
        constant=True,
        judged=True,
        texts=figure.texts,
    )


_BELONGS = {Of.LIST: in_list, Of.NODE: on_udp, Of.BUS: on_can}
"""Which telegrams have a list, a sender on a list, or a bus."""
