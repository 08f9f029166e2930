"""What a screen tells of where packets come from, how they are kept, and what the program itself takes.

A block is a title and rows of a name and text beside it; names of all blocks are aligned.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from msgspec import Struct

from nvscope import units
from nvscope.capture.content import STDIN
from nvscope.capture.source import DropsPart, SourceInfo
from nvscope.engine.ring import Recent
from nvscope.tracker.summary import Summary
from nvscope.view.escape import visible
from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.table import Cell, Line, Tone, wrap

_NAMES = 12
_S_NS = 1_000_000_000
_RATE_S = 5
_MOST_TIMES = 3
_MOST_COMMENTS = 3

HEARS_NO_ANSWERS = (
    "what others answer to each other: it gets what is for everybody and for this machine. Acknowledgements and "
    "rejections are unknown; an interface shows them (-i eth0, on a mirror port)"
)
_DROPS_UNKNOWN_LIVE = "unknown: the system tells of a socket only how many there were, at its end"
_DROPS_UNKNOWN = "unknown: the format has no place for them"


class OwnLoad(NamedTuple):
    """What the program took of the machine, over the last ``seconds``; None where the system does not tell.

    ``cpu_percent`` is of one processor, over all threads; ``memory_bytes`` what is resident of it now (``at_most``:
    what it was at the most).
    """

    seconds: float
    cpu_percent: float | None
    memory_bytes: int | None
    at_most: bool
    threads: int
    draws_per_s: float | None


class Row(NamedTuple):
    """A name, and what is told beside it."""

    name: str
    cells: Sequence[Cell]


class Block(Struct, frozen=True):
    """What is told of one thing."""

    title: Sequence[Cell]
    rows: Sequence[Row]


def lines_of(blocks: Iterable[Block], width: int) -> list[Line]:
    """Return blocks as lines of at most so many columns, an empty one between two."""
    lines: list[Line] = []
    for block in blocks:
        lines += [[]] if lines else []
        lines += wrap(block.title, width)
        for name, cells in block.rows:
            head = Cell(f"  {name}".ljust(_NAMES).replace(" ", "\u00a0"), Tone.FAINT)
            lines += wrap([head, *cells], width, hanging=_NAMES)
    return lines


def source_block(info: SourceInfo, clock: Clock, at_ns: int | None) -> Block:
    """Return what is known of a source."""
    how = "stream" if info.path == STDIN else "file"
    if info.is_live:
        how = "ended" if info.failure else "live"
    title = [Cell(visible(info.path), Tone.STRONG), Cell(f"   {visible(info.format)}, {how}", Tone.FAINT)]
    rows = []
    if info.failure:
        rows.append(Row("ended", [Cell(f"✗ {visible(info.failure)}", Tone.ERROR)]))
    if info.start_ns is not None and info.end_ns is not None:
        told = f"{clock.moment(info.start_ns)} to {clock.moment(info.end_ns)}"
        length_ns = info.end_ns - info.start_ns
        rows.append(Row("packets", [Cell(f"{told}, {units.duration(max(length_ns, 0))}")]))
    else:
        rows.append(Row("packets", [Cell("none yet" if info.is_live else "none", Tone.FAINT)]))
        length_ns = 0
    frames = [Cell(units.count_of(info.frames, "frame")), Cell(f", {units.data_size(info.bytes)}")]
    if length_ns > 0 and info.frames > 1:
        frames.append(Cell(f", {units.rate((info.frames - 1) * _S_NS / length_ns)} in the mean", Tone.FAINT))
    rows.append(Row("frames", frames))
    rows.append(Row("dropped", _drops(info)))
    if info.without_carrier:
        rows.append(Row("no cable", _without_carrier(info, clock)))
    if info.clock_steps:
        told = f"! its clock was set {units.count_of(info.clock_steps, 'time')} while it was watched (NV902)"
        rows.append(Row("clock", [Cell(told, Tone.WARNING)]))
    if info.truncation is not None:
        what = f"! {visible(info.truncation.message)}"
        where = "" if info.truncation.is_whole else f", at byte {units.count(info.truncation.offset)}"
        rows.append(Row("cut off", [Cell(f"{what}{where}", Tone.WARNING)]))
    if not info.hears_answers:
        rows.append(Row("hears not", [Cell(HEARS_NO_ANSWERS, Tone.WARNING)]))
    for _, text in info.comments[:_MOST_COMMENTS]:
        rows.append(Row("comment", [Cell(visible(text), Tone.FAINT)]))
    if len(info.comments) > _MOST_COMMENTS:
        rows.append(Row("", [Cell(f"{len(info.comments) - _MOST_COMMENTS} more comments", Tone.FAINT)]))
    return Block(title, rows)


def _drops(info: SourceInfo) -> list[Cell]:
    if info.drops is None:
        return [Cell(_DROPS_UNKNOWN_LIVE if info.is_live else _DROPS_UNKNOWN, Tone.FAINT)]
    if not info.drops:
        return [Cell("none", Tone.FAINT)]
    told = f"✗ {units.count(info.drops)}, {units.percent(info.drops, info.frames + info.drops)} of all"
    cells = [Cell(told, Tone.ERROR)]
    for part in DropsPart:
        if number := info.drops_by.get(part.value):
            cells.append(Cell(f"; {units.count(number)} {part.label}"))
    return cells


def _without_carrier(info: SourceInfo, clock: Clock) -> list[Cell]:
    times = info.without_carrier[-_MOST_TIMES:]
    told = [
        f"since {clock.moment(since_ns)}" if until_ns is None
        else f"{clock.moment(since_ns)} to {clock.moment(until_ns)}"
        for since_ns, until_ns in times
    ]  # fmt: skip
    now = info.without_carrier[-1][1] is None
    before = len(info.without_carrier) - len(times)
    more = f", and {units.count_of(before, 'time')} before" if before else ""
    text = f"{', '.join(told)}{more} (NV907)"
    return [Cell(f"✗ {text}" if now else f"! {text}", Tone.ERROR if now else Tone.WARNING)]


def recorded_in_words(frames: int, files: int, path: str) -> str:
    """Return how many frames were recorded, and where to; ``path`` is the last of the files."""
    several = f"{units.count_of(files, 'file')}, the last is " if files > 1 else ""
    return f"{units.count_of(frames, 'frame')} in {several}{visible(path)}"


def recording_block(path: str, frames: int, size_bytes: int, files: int, failure: str, *, is_on: bool) -> Block:
    """Return what is known of a recording; ``path`` is the last of its files."""
    several = f", {units.count(files)} files so far" if files > 1 else ""
    rows = [Row("frames", [Cell(f"{units.count_of(frames, 'frame')}, {units.data_size(size_bytes)}{several}")])]
    if failure:
        rows.append(Row("ended", [Cell(f"✗ {visible(failure)}", Tone.ERROR)]))
    how = "on" if is_on else "ended"
    return Block([Cell("Recording", Tone.STRONG), Cell(f"   {visible(path)}, {how}", Tone.FAINT)], rows)


def ring_block(recent: Recent, clock: Clock, at_ns: int | None) -> Block:
    """Return what is kept of the last frames, and how many came over the last seconds."""
    size = f"{units.data_size(recent.bytes)} of {units.data_size(recent.most_bytes)}"
    share = units.percent(recent.bytes, recent.most_bytes)
    rows = [Row("frames", [Cell(f"{units.count_of(len(recent), 'frame')} in {size} ({share})")])]
    first_ns = recent.first_ns
    if first_ns is not None and at_ns is not None:
        told = f"{clock.moment(first_ns)}, {units.duration(max(at_ns - first_ns, 0))} ago"
        rows.append(Row("oldest", [Cell(told)]))
        since_ns = max(at_ns - _RATE_S * _S_NS, first_ns)
        if at_ns > since_ns:
            frames = recent.stop_frame - recent.frame_at(since_ns) - 1
            rows.append(
                Row("rate", [Cell(f"{units.rate(frames * _S_NS / (at_ns - since_ns))}"), Cell(
                    f", frames of all sources over the last {units.duration(at_ns - since_ns)}", Tone.FAINT)])
            )  # fmt: skip
    if recent.passed:
        rows.append(Row("let go", [Cell(f"{units.count_of(recent.passed, 'frame')}, the oldest, for newer ones")]))
    else:
        rows.append(Row("let go", [Cell("none: all that came is still there", Tone.FAINT)]))
    return Block([Cell("Kept frames", Tone.STRONG), Cell("   for packets, for saving (--ring)", Tone.FAINT)], rows)


def limits_block(summary: Summary, most: int, left_out: int) -> Block:
    """Return how many streams are told apart of how many can be; ``left_out`` frames are of further ones."""
    streams = sum(len(entry.streams) for entry in summary.lists) + sum(len(one.streams) for one in summary.can.lists)
    lists = len(summary.lists) + len(summary.can.lists)
    rows = [
        Row("streams", [Cell(f"{units.count(streams)} of {units.count(most)}"),
                        Cell(f" at most (limits.max_streams), in {units.count_of(lists, 'list')}", Tone.FAINT)])
    ]  # fmt: skip
    if left_out:
        told = f"! {units.count_of(left_out, 'frame')} of further streams: figures lack them (NV906)"
        rows.append(Row("left out", [Cell(told, Tone.WARNING)]))
    else:
        rows.append(Row("left out", [Cell("none", Tone.FAINT)]))
    return Block([Cell("Limits", Tone.STRONG)], rows)


def own_block(load: OwnLoad, took_ns: int, old_ns: int | None) -> Block:
    """Return what the program takes; a look took ``took_ns``, and is ``old_ns`` old, None for one of the past."""
    unknown = Cell("unknown: this system does not tell", Tone.FAINT)
    cpu = unknown
    if load.cpu_percent is not None:
        cpu = Cell(f"{units.load(load.cpu_percent)} of a processor")
    over = Cell(f", all threads, over the last {load.seconds:.0f} s", Tone.FAINT)
    memory = unknown
    if load.memory_bytes is not None:
        memory = Cell(f"{units.data_size(load.memory_bytes)}{' at the most' if load.at_most else ''}")
    age = ", of the past" if old_ns is None else f", {units.duration(old_ns)} ago"
    draws = Cell("-", Tone.FAINT) if load.draws_per_s is None else Cell(f"{load.draws_per_s:.1f} a second")
    return Block(
        [Cell("This program", Tone.STRONG)],
        [
            Row("CPU", [cpu, over] if load.cpu_percent is not None else [cpu]),
            Row("memory", [memory]),
            Row("threads", [Cell(str(load.threads))]),
            Row("last look", [Cell(f"took {units.duration(took_ns)}{age}")]),
            Row("draws", [draws, Cell(", 10 at the most", Tone.FAINT)]),
        ],
    )
