"""What is known of a telegram's list, of its sender, of its bus and of the findings it shows, as fields: ``list.lost``,
``node.jitter``, ``bus.load``, ``finding.code``.

Keys and names are known as a telegram is read, the rest when the whole capture was: such fields are ``judged``, and can
be read where ``Verdicts`` are given. A telegram shows a finding where its frame is one of those that the finding names;
a finding that names none shows in all telegrams of its list, node and SubIndex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.pdo import EXTENDED
from dissectors.carried import Carrier
from nvscope.expression.typed_columns import Column, FieldType, TextColumn
from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.figures import Figure, Of, Unit, Value, figures_of
from nvscope.tracker.measured import Measured
from nvscope.tracker.subjects import Measures
from nvscope.tracker.summary import Summary
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS
from nvscope.view.rows.frames import IP, FrameRows

NodeKey = tuple[int, int]
_UNSIGNED, _SIGNED, _TEXT = FieldType.UNSIGNED, FieldType.SIGNED, FieldType.TEXT


@dataclass(frozen=True, slots=True)
class Names:
    """The names that people gave to lists, by key, and to nodes, by the halves of their address."""

    lists: Mapping[ListKey, str] = field(default_factory=dict)
    nodes: Mapping[NodeKey, str] = field(default_factory=dict)


class Verdicts:
    """What is known when a capture was read: the figures of lists and nodes, and the findings.

    ``nodes`` are the halves of the addresses by number of the node.
    """

    def __init__(self, summary: Summary, nodes: Sequence[NodeKey], findings: Sequence[Finding]) -> None:
        self.findings = list(findings)
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
        for on_can in summary.can.lists:
            key = keys[on_can.number] = on_can.key
            self._lists[key] = measures.of_list(on_can)
        frames = [(frame, number) for number, finding in enumerate(self.findings) for frame in finding.frames]
        frames.sort()
        self._frame = np.array([frame for frame, _ in frames], np.int64)
        self._finding = np.array([number for _, number in frames], np.int64)
        self._lasting = [
            _Lasting(number, keys[place], None if one.node is None else nodes[one.node], one.subindex)
            for number, one in enumerate(self.findings)
            if not one.frames
            for place in (one.lists if one.list_number is None else (one.list_number,))
        ]

    def measured(self, of: Of, node: NodeKey, key: ListKey) -> Measured:
        """Return what was measured of a telegram's list, of its sender on that list, or of its bus.

        A node that a list's diagnosis does not name has counted nothing there.
        """
        if of is Of.BUS:
            found = self._buses.get(str(key.port))
        else:
            found = self._lists.get(key) if of is Of.LIST else self._nodes.get((node, key))
        return found or self._nobody

    def findings_of(self, rows: FrameRows) -> tuple[I64, I64]:
        """Return positions of telegrams, each as often as it shows findings (at least once), and their numbers or -1.

        Positions rise; numbers are those of ``findings``.
        """
        frame = rows.frame_number
        first = np.searchsorted(self._frame, frame)
        count = np.searchsorted(self._frame, frame, "right") - first
        position = np.repeat(np.arange(len(frame)), count)
        place = np.arange(len(position)) - np.repeat(np.cumsum(count) - count - first, count)
        positions, numbers = [position], [self._finding[place]]
        if self._lasting:
            keys, code = _keys(rows)
            subindex = rows.carried.subindex
            for one in self._lasting:
                concerned = np.array([one.concerns(*key) for key in keys], np.bool_)[code]
                if one.subindex is not None:
                    concerned &= subindex == one.subindex
                positions.append(np.flatnonzero(concerned & _in_list(rows)))
                numbers.append(np.full(len(positions[-1]), one.number))
        position = np.concatenate(positions)
        without = np.ones(len(frame), np.bool_)
        without[position] = False
        positions.append(np.flatnonzero(without))
        numbers.append(np.full(len(positions[-1]), -1))
        position = np.concatenate(positions)
        order = np.argsort(position, kind="stable")
        return position[order], np.concatenate(numbers)[order]


@dataclass(frozen=True, slots=True)
class _Lasting:
    """A finding without frames, on a list: its number, and the node and SubIndex that it concerns, None for all."""

    number: int
    key: ListKey
    node: NodeKey | None
    subindex: int | None

    def concerns(self, node: NodeKey, key: ListKey) -> bool:
        return key == self.key and self.node in (None, node)


def verdict_fields(
    names: Names | None = None, verdicts: Verdicts | None = None, further: Iterable[FindingKind] = ()
) -> dict[str, TelegramField]:
    """Return the fields ``list.*``, ``node.*``, ``bus.*`` and ``finding.*`` by name.

    ``further`` are kinds of findings that the catalogue has not.
    """
    known = names or Names()
    lists = [
        TelegramField(
            "list.key", _TEXT, "List", "transport, port (or CAN channel) and list identifier: udp/1202/7, can/can0/385",
            _of_list(str), _in_list, constant=True,
        ),
        TelegramField(
            "list.port", _UNSIGNED, "Port of the list", "destination port", lambda rows: rows.carried.port, _on_udp,
            constant=True,
        ),
        TelegramField(
            "list.id", _UNSIGNED, "List identifier", "Index of a telegram that belongs to a list, on CAN the COB-ID",
            lambda rows: rows.carried.identifier & ~EXTENDED, _in_list, constant=True,
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
    return {entry.name: entry for entry in (*lists, *nodes, *buses, *_finding_fields(verdicts, further))}


def _in_list(rows: FrameRows) -> Bool:
    """Tell which frames belong to a list: telegrams but for those of the Parameter Manager, and data frames of CAN."""
    return rows.carried.of_list


def _on_udp(rows: FrameRows) -> Bool:
    """Tell which frames belong to a list on UDP."""
    own: Bool = rows.carried.of_list & (rows.carried.carrier == Carrier.UDP)
    return own


def _keys(rows: FrameRows) -> tuple[list[tuple[NodeKey, ListKey]], I64]:
    """Return the (sender, list) pairs that occur, and which of them each frame is of."""
    carried = rows.carried
    key = np.empty(
        len(rows), [("high", "u8"), ("low", "u8"), ("transport", "u1"), ("port", "u4"), ("identifier", "u4")]
    )
    key["high"], key["low"] = rows.senders
    key["transport"], key["port"], key["identifier"] = carried.carrier, carried.port, carried.identifier
    found, code = np.unique(key, return_inverse=True)
    return [
        ((high, low), ListKey.of(Carrier(carrier), port, identifier, rows.channel))
        for high, low, carrier, port, identifier in found.tolist()
    ], code


def _of_both(tell: Callable[[NodeKey, ListKey], str]) -> Callable[[FrameRows], Column]:
    def read(rows: FrameRows) -> TextColumn:
        keys, code = _keys(rows)
        return TextColumn(code, tuple(tell(*key) for key in keys))

    return read


def _of_list(tell: Callable[[ListKey], str]) -> Callable[[FrameRows], Column]:
    return _of_both(lambda _, key: tell(key))


def _named(names: Names) -> Callable[[FrameRows], Bool]:
    def known(rows: FrameRows) -> Bool:
        keys, code = _keys(rows)
        return np.array([bool(told_of(names.lists, key)) for _, key in keys], np.bool_)[code] & _in_list(rows)

    return known


def _node_named(names: Names) -> Callable[[FrameRows], Bool]:
    def known(rows: FrameRows) -> Bool:
        keys, code = _keys(rows)
        return np.array([node in names.nodes for node, _ in keys], np.bool_)[code] & _sent_by_node(rows)

    return known


def _sent_by_node(rows: FrameRows) -> Bool:
    """Tell which frames have a sender: nobody knows it on CAN."""
    return rows.have(IP)


_TYPES: dict[Unit, FieldType] = {
    "time": FieldType.TIME,
    "ns": FieldType.DURATION,
    "percent": FieldType.REAL,
    "per second": FieldType.REAL,
    "": _TEXT,
}
"""By unit; the others are whole numbers."""


def _figure(of: Of, whose: str, figure: Figure, verdicts: Verdicts | None) -> TelegramField:
    """Return the field of one figure of telegrams' lists, senders or buses."""
    kind = _TYPES.get(figure.unit, _SIGNED)
    name = f"{of.value}.{figure.name}"

    def values(rows: FrameRows) -> tuple[list[Value], I64]:
        if verdicts is None:
            raise LookupError(f"{name} is read before the capture was judged")
        keys, code = _keys(rows)
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


def _on_can(rows: FrameRows) -> Bool:
    """Tell which rows are CAN frames, of any kind."""
    own: Bool = rows.carried.carrier == Carrier.CAN
    return own


_BELONGS = {Of.LIST: _in_list, Of.NODE: _on_udp, Of.BUS: _on_can}
"""Which telegrams have a list, a sender on a list, or a bus."""


def _code(finding: Finding) -> str:
    return finding.code


def _finding_fields(verdicts: Verdicts | None, further: Iterable[FindingKind]) -> list[TelegramField]:
    findings = verdicts.findings if verdicts else []

    def column(tell: Callable[[Finding], str]) -> Callable[[FrameRows], Column]:
        texts = ("", *(tell(finding) for finding in findings))
        return lambda rows: TextColumn(_number(rows) + 1, texts)

    def count(rows: FrameRows) -> Column:
        return np.array([0, *(finding.count for finding in findings)], np.int64)[_number(rows) + 1]

    def known(rows: FrameRows) -> Bool:
        return _number(rows) >= 0

    def entry(
        name: str, kind: FieldType, text: str, read: Callable[[FrameRows], Column], texts: Iterable[str] = ()
    ) -> TelegramField:
        told = tuple(dict.fromkeys(texts))
        return TelegramField(f"finding.{name}", kind, f"Finding's {name}", text, read, known, judged=True, texts=told)

    kinds = [*CATALOGUE.values(), *further]
    codes = [kind.code for kind in kinds]
    severities = column(lambda one: one.kind.severity.word)
    return [
        entry("code", _TEXT, "such as NV201; shown by the telegrams of its first ten events", column(_code), codes),
        entry("name", _TEXT, "such as telegram-gap", column(lambda one: one.kind.name), (kind.name for kind in kinds)),
        entry("severity", _TEXT, "error, warning or note", severities, (kind.severity.word for kind in kinds)),
        entry("count", _SIGNED, "how many events it has", count),
        entry("message", _TEXT, "its sentence", column(lambda finding: finding.message)),
    ]


def _number(rows: FrameRows) -> I64:
    """Return the number of the finding with which each telegram is looked at, -1 where there is none."""
    return np.full(len(rows), -1) if rows.finding is None else rows.finding
