"""What is told of a cell of the matrix: its list with each reader, and its node with what it sends and reads."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope import units
from nvscope.causes.cause import Cause
from nvscope.causes.ways import device_in_words
from nvscope.engine.keys import FrameKind
from nvscope.enumeration import first_few
from nvscope.findings.kind import Severity
from nvscope.tracker.event_kinds import EventKind
from nvscope.view.escape import visible
from nvscope.view.lines.plant.bus_load import age
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.plant.happenings import symbol
from nvscope.view.lines.plant.matrix import Matrix
from nvscope.view.lines.plant.roles import Mark
from nvscope.view.lines.table import NOTHING, Cell, Column, Line, Tone, align, wrap

_MOST_CAUSES = 3
_MOST_NAMES = 12
_COLUMNS = (
    Column(""),
    Column("reader", shortest=8, identifier=True),
    Column("answers", right=True),
    Column("p50", right=True, importance=8),
    Column("p99", right=True, importance=7),
    Column("missing", right=True),
    Column("rejected", right=True, importance=6),
    Column("requests", right=True, importance=4),
    Column("last answer", importance=5),
    Column("", importance=3),
)


def list_lines(matrix: Matrix, place: int, clock: Clock, width: int) -> list[Line]:
    """Return what is told of a list: who sends it, since when something is wrong, and each of its readers."""
    entry = matrix.lists[place]
    senders = ", ".join(matrix.name_of(node) for node in entry.senders[:_MOST_NAMES]) or "nobody"
    told = f"  sent by {senders} to {matrix.to(place)}, {units.count_of(entry.diagnosis.nSendCount, 'telegram')}"
    if entry.diagnosis.tLastSend is not None:
        told += f", the last at {clock.moment(entry.diagnosis.tLastSend)}"
    lines = list(wrap([Cell(f"List {matrix.names[place]}", Tone.STRONG), Cell(told)], width, hanging=2))
    lines += _causes(matrix.known.causes_of_list.get(entry.key, ()), width)
    return [*lines, *_readers(matrix, place, clock, width)]


def _readers(matrix: Matrix, place: int, clock: Clock, width: int) -> list[Line]:
    entry, contacts = matrix.lists[place], matrix.facts.contacts
    order = matrix.facts.summary.address_order
    others = [node for node in matrix.roles(place) if node in entry.readers or node not in entry.senders]
    rows = []
    for node in sorted(others, key=lambda one: order[one]):
        spoken, refused = contacts.spoken.get((entry.number, node), {}), matrix.known.refused(entry, node)
        answers, timed = spoken.get(FrameKind.ACKNOWLEDGEMENT), contacts.answered.get((entry.number, node))
        asked = spoken.get(FrameKind.BOOT_UP_REQUEST)
        missing = refused.get(EventKind.NO_ACKNOWLEDGEMENT)
        rejected = sum(
            refused[kind].times for kind in (EventKind.NEGATIVE_ACKNOWLEDGEMENT, EventKind.SEND_REJECTED)
            if kind in refused
        )  # fmt: skip
        mark = matrix.mark(place, node) or Mark.ADDRESSED
        rows.append(
            [
                Cell(mark.sign, mark.tone), Cell(matrix.name_of(node), Tone.STRONG),
                _count(answers.times if answers else 0),
                _duration(timed.p50_ns if timed else None), _duration(timed.p99_ns if timed else None),
                _count(missing.times if missing else 0, Tone.ERROR), _count(rejected, Tone.ERROR),
                _count(asked.times if asked else 0),
                Cell(clock.moment(answers.last_ns)) if answers else Cell(NOTHING, Tone.FAINT),
                Cell(mark.words, mark.tone),
            ]
        )  # fmt: skip
    if not rows:
        _, everybody = contacts.destinations.get(entry.number, (frozenset(), False))
        why = ": who reads a broadcast says nothing" if everybody else ""
        return [[Cell(f"  nobody was seen to read it{why}", Tone.FAINT)]]
    return align(_COLUMNS, rows, None, 2) if _fits(rows, width) else _fitted(rows, width)


def _fits(rows: Sequence[Sequence[Cell]], width: int) -> bool:
    return max(sum(len(cell.text) for cell in line) for line in align(_COLUMNS, rows, None, 2)) <= width


def _fitted(rows: Sequence[Sequence[Cell]], width: int) -> list[Line]:
    """Return a table without the line that names options of other faces."""
    return align(_COLUMNS, rows, width, 2)[: len(rows) + 1]


def node_lines(matrix: Matrix, node: int, clock: Clock, now_ns: int, width: int) -> list[Line]:
    """Return what is told of a node: what it sends and reads, which device it is, and when it was heard last."""
    address, name = visible(matrix.facts.summary.addresses[node]), matrix.name_of(node)
    head = [Cell(f"Node {name}", Tone.STRONG)]
    if name != address:
        head.append(Cell(f"  {address}", Tone.FAINT))
    facts: list[str] = []
    for verb, own in (("sends", _places(matrix, node, sends=True)), ("reads", _places(matrix, node, sends=False))):
        if own:
            facts.append(f"{verb} {first_few([matrix.names[place] for place in own], _MOST_NAMES)}")
    hardware = matrix.facts.contacts.hardware_of(node)
    if hardware:
        facts.append(f"hardware {', '.join(visible(device_in_words(one)) for one in hardware[:_MOST_NAMES])}")
    last_ns = matrix.facts.contacts.last_of_node.get(node)
    if last_ns is not None:
        facts.append(f"last heard at {clock.moment(last_ns)}, {age(now_ns - last_ns).text} ago")
    else:
        facts.append("never heard")
    lines = list(wrap([*head, Cell("  " + "; ".join(facts))], width, hanging=2))
    return [*lines, *_causes(matrix.known.causes_of_node.get(node, ()), width)]


def left_out_words(matrix: Matrix) -> list[str]:
    """Return what is said of what has no room in a matrix, nothing where all has."""
    (lists, nodes), told = matrix.left_out, []
    if lists:
        told.append(f"{units.count_of(lists, 'more list')}: a filter (/) chooses some")
    if nodes:
        told.append(f"{units.count_of(nodes, 'more node')}")
    if events := matrix.facts.contacts.left_out:
        told.append(f"{units.count_of(events, 'event')} had no room: marks may lack some")
    return told


def _places(matrix: Matrix, node: int, *, sends: bool) -> list[int]:
    """Return the lists that a node sends, or those of others that it reads or is sent."""
    found = []
    for place, entry in enumerate(matrix.lists):
        if sends:
            own = node in entry.senders
        else:
            to = matrix.facts.contacts.destinations.get(entry.number, ((),))[0]
            own = node in entry.readers or (node in to and node not in entry.senders)
        if own:
            found.append(place)
    return found


def _causes(causes: Sequence[Cause], width: int) -> list[Line]:
    """Return the titles of causes, those that are not over first."""
    told = sorted((one for one in causes if one.severity > Severity.NOTE), key=lambda one: one.until_ns is not None)
    lines: list[Line] = []
    for cause in told[:_MOST_CAUSES]:
        mark = symbol(cause.severity if cause.until_ns is None else Severity.WARNING)
        over = " (over)" if cause.until_ns is not None else ""
        lines += wrap([Cell(f"{mark.text} ", mark.tone), Cell(f"{visible(cause.title)}{over}")], width, 2, 4)
    if len(told) > _MOST_CAUSES:
        lines.append([Cell(f"  {len(told) - _MOST_CAUSES} more: view 2", Tone.FAINT)])
    return lines


def _count(number: int, tone: Tone = Tone.PLAIN) -> Cell:
    return Cell(units.count(number), tone if number else Tone.FAINT)


def _duration(duration_ns: int | None) -> Cell:
    return Cell(NOTHING, Tone.FAINT) if duration_ns is None else Cell(units.duration(duration_ns))
