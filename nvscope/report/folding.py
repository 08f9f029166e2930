"""Findings that say the same of many places, as one entry of a report for people; JSON has each of them.

Findings of one code, severity and next step are folded where they have the same message, from two on, and whatever
their figures are, from four on. Then an entry shows the message of the worst (``badness``); of several that are
equally bad it shows the first, as an example.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from msgspec import Struct

from nvscope import units
from nvscope.findings.badness import badness
from nvscope.findings.cob_ids import OF_ONE_LIST
from nvscope.view.lines.plant import content
from nvscope.view.lines.plant.content import Row

_MANY = 4
"""From so many findings on, one stands for others that have other figures."""

_MOST_NAMED = 4
_MOST_RANGES = 12
_SHOWN_FRAMES = 10
_BY_THEMSELVES = {kind.code for kind in OF_ONE_LIST}


class Entry(Struct):
    """A finding, or what is said at once of several.

    ``shown`` is the one whose message stands for all, with how bad it is; ``differ``: others have other messages,
    ``worst``: some are less bad. ``places`` are lists, nodes and SubIndexes as findings have them, in order.
    """

    order: int
    shown: Row
    badness: float
    places: list[tuple[str | None, str | None, str | None]]
    count: int
    first_ns: int | None
    last_ns: int | None
    frames: list[int]
    frames_cut: int
    differ: bool = False
    worst: bool = False

    def add(self, other: Entry) -> None:
        """Take in what is said in further places."""
        self.differ |= other.differ or other.shown["message"] != self.shown["message"]
        self.worst |= other.worst or other.badness != self.badness
        if other.badness > self.badness:
            self.shown, self.badness = other.shown, other.badness
        self.order = min(self.order, other.order)
        self.places += other.places
        self.count += other.count
        self.first_ns = min((one for one in (self.first_ns, other.first_ns) if one is not None), default=None)
        self.last_ns = max((one for one in (self.last_ns, other.last_ns) if one is not None), default=None)
        frames = sorted({*self.frames, *other.frames})
        self.frames = frames[:_SHOWN_FRAMES]
        self.frames_cut += other.frames_cut + len(frames[_SHOWN_FRAMES:])

    @property
    def row(self) -> Row:
        """The finding, with the events of all of them."""
        if len(self.places) == 1:
            return self.shown
        first, last = (None if one is None else str(one) for one in (self.first_ns, self.last_ns))
        return {
            **{key: self.shown[key] for key in ("code", "name", "severity", "message", "hint")},
            "count": self.count,
            "first_ns": first,
            "last_ns": last,
            "frames": self.frames,
            "frames_cut": self.frames_cut,
        }

    @property
    def parts(self) -> list[Row]:
        """What is said of each identifier, as findings of their own, where the finding is about many lists."""
        whole = {key: value for key, value in self.shown.items() if key not in ("lists", "parts")}
        return [{**whole, **part} for part in self.shown.get("parts", ())]

    def title(self) -> str:
        """Return what stands behind code and name: how many findings there are, and how many events they have."""
        told = [units.count_of(len(self.places), "finding")] if len(self.places) > 1 else []
        if self.count > len(self.places):
            told.append(units.count_of(self.count, "time"))
        return "".join(f", {part}" for part in told)

    def about(self, lists: Mapping[str, str | None], nodes: Mapping[str, str]) -> tuple[list[str], list[str]]:
        """Return what it is about, as ``content.about`` does: names of lists and nodes, then parts of lists."""
        if len(self.places) == 1:
            return content.about(self.shown, lists, nodes)
        keys = _distinct(key for key, _, _ in self.places)
        addresses = _distinct(node for _, node, _ in self.places)
        parts = _distinct(part for _, _, part in self.places) if self._has_cob_ids_beside_keys else []
        named = _lists(keys, lists) + _nodes(addresses, nodes)
        if parts and all(part.isdecimal() for part in parts):
            return named, [f"SubIndex {_enumerated(units.ranges(map(int, parts)))}"]
        return named, parts if len(parts) <= _MOST_NAMED else []

    @property
    def _has_cob_ids_beside_keys(self) -> bool:
        """Whether some part is more than the identifier of its list, which the list's key tells already."""
        return any(
            part is not None and (key is None or part != f"COB-ID {units.list_key(key).rpartition('/')[2]}")
            for key, _, part in self.places
        )

    def message(self, lists: Mapping[str, str | None], nodes: Mapping[str, str]) -> str:
        """Return the sentence with the figures, and whether these are of each place or of which one."""
        message = str(self.shown["message"])
        if len(self.places) == 1:
            return message
        if not self.differ:
            return f"Each: {message}"
        named, part = content.about(self.shown, lists, nodes)
        part = part if self._has_cob_ids_beside_keys else []
        return f"{'Worst' if self.worst else 'For example'}: {', '.join(named + part)}: {message}"


def entries(findings: Iterable[Row], *, each: bool = False) -> list[Entry]:
    """Return the entries of findings in their order, that of the first of several; with ``each``, none is folded."""
    alike: dict[tuple[str, ...], dict[str, Entry]] = {}
    for order, finding in enumerate(findings):
        entry = _entry(order, finding)
        key: tuple[str, ...] = (finding["code"], finding["severity"], finding["hint"])
        message = finding["message"]
        if each or "lists" in finding or (finding["list"] is None and finding["node"] is None):
            key, message = (*key, str(order)), ""
        known = alike.setdefault(key, {}).setdefault(message, entry)
        if known is not entry:
            known.add(entry)
    return sorted((entry for same in alike.values() for entry in _folded(same)), key=lambda entry: entry.order)


def identifier(finding: Row) -> str:
    """Return the COB-ID that a finding on CAN is about."""
    return "".join(content.part(finding)) or f"COB-ID {units.list_key(finding['list']).rpartition('/')[2]}"


def remark(shown: Sequence[Entry]) -> str:
    """Return what is said of folded findings, "" where there are none."""
    folded = {place: len(entry.parts) or len(entry.places) for place, entry in enumerate(shown)}
    folded = {place: number for place, number in folded.items() if number > 1}
    if not folded:
        return ""
    findings = units.count_of(sum(folded.values()), "finding")
    entries = units.count_of(len(folded), "entry", "entries")
    return f"{findings} are folded into {entries}: -v shows each."


def _entry(order: int, finding: Row) -> Entry:
    part = content.part(finding)
    subindex = None if not part else part[0].removeprefix("SubIndex ")
    return Entry(
        order, finding, badness(finding["code"], finding["extent"], finding["count"]),
        [(finding["list"], finding["node"], subindex)], finding["count"],
        content.nanoseconds(finding["first_ns"]), content.nanoseconds(finding["last_ns"]), list(finding["frames"]),
        finding["frames_cut"],
    )  # fmt: skip


def _folded(same: Mapping[str, Entry]) -> Iterator[Entry]:
    """Yield the entries of one code, severity and next step, of each message one: as one where there are many."""
    first, *others = same.values()
    if sum(len(entry.places) for entry in same.values()) < _MANY or first.shown["code"] in _BY_THEMSELVES:
        yield from same.values()
        return
    for entry in others:
        first.add(entry)
    yield first


def _distinct(values: Iterable[str | None]) -> list[str]:
    return [value for value in dict.fromkeys(values) if value is not None]


def _lists(keys: Sequence[str], names: Mapping[str, str | None]) -> list[str]:
    """Return some lists with their names, more as ranges of identifiers and how many there are."""
    if len(keys) <= _MOST_NAMED:
        return [" ".join(filter(None, (units.list_key(key), names.get(key)))) for key in keys]
    groups: dict[tuple[str, bool], list[int]] = {}
    for key in keys:
        head, _, number = key.rpartition("/")
        groups.setdefault((head, number.endswith("x")), []).append(int(number.removesuffix("x")))
    told = []
    for (head, extended), numbers in groups.items():

        def identifier(number: int, head: str = head, extended: bool = extended) -> str:
            return units.list_key(f"{head}/{number}{'x' * extended}").rpartition("/")[2]

        told.append(f"{head}/{_enumerated(units.ranges(numbers, identifier))}")
    return [f"{', '.join(told)} ({units.count_of(len(keys), 'list')})"]


def _enumerated(ranges: Sequence[str]) -> str:
    return ", ".join(ranges[:_MOST_RANGES]) + (", …" if len(ranges) > _MOST_RANGES else "")


def _nodes(addresses: Sequence[str], names: Mapping[str, str]) -> list[str]:
    shown = addresses if len(addresses) <= _MOST_NAMED else addresses[: _MOST_NAMED - 1]
    told = [" ".join(filter(None, (address, names.get(address)))) for address in shown]
    if len(shown) < len(addresses):
        told[-1] += f" and {units.count(len(addresses) - len(shown))} more nodes"
    return told
