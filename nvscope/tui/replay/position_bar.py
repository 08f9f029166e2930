"""The line that shows where in a capture its player is, and where causes begin."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from nvscope import units
from nvscope.capture.player import Place, Player
from nvscope.causes.cause import Cause
from nvscope.findings.kind import Severity
from nvscope.tui.bars import Bar
from nvscope.tui.feed import Feed, Span
from nvscope.view.lines.plant.happenings import symbol
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.text_width import display_width

_LEAST_STRIP = 8
_PASSED, _TO_COME, _HERE = "━", "─", "╋"
_REFRESH_S = 0.1


class PositionBar(Bar):
    """Where a feed's player is, drawn ten times a second."""

    def __init__(self, feed: Feed, player: Player) -> None:
        super().__init__(id="position")
        self._feed, self._player = feed, player

    def on_mount(self) -> None:
        self.set_interval(_REFRESH_S, self.draw)

    def draw(self) -> None:
        """Show where it is now."""
        whole = self._feed.whole
        happened = None if whole is None else whole.snapshot.happened
        causes = () if happened is None else happened.causes
        self.tell(position(self._player.place, self._feed.span(), causes, self.size.width))


def rate_in_words(place: Place) -> str:
    """Return how fast it goes on: ``2×``; as fast as this machine can, where that is slower."""
    told = f"{place.rate:g}×"
    return f"{told}, slower here" if place.is_behind else told


def position(place: Place, span: Span | None, causes: Sequence[Cause], width: int) -> Line:
    """Return the line in so many columns: how it goes on, the time, a strip with the causes, and how long it is all.

    ``span`` is that of the whole capture, None as long as nobody knows.
    """
    if place.is_going:
        how = Cell(" … ", Tone.WARNING)
    elif place.at_end:
        how = Cell(" end ", Tone.WARNING)
    elif place.paused:
        how = Cell(f" paused {rate_in_words(place)} ", Tone.WARNING)
    else:
        how = Cell(f" ▶ {rate_in_words(place)} ", Tone.STRONG)
    line = [how]
    if place.loops and place.b_ns is None:
        line.append(Cell("loop ", Tone.FAINT))
    if span is None or place.at_ns is None:
        return line
    length_ns = max(span.end_ns - span.start_ns, 1)
    whole = units.duration(length_ns)
    now = units.duration(min(max(place.at_ns - span.start_ns, 0), length_ns))
    line.append(Cell(f" {now:>{len(whole)}} "))
    end = Cell(f" {whole} ", Tone.FAINT)
    room = width - sum(display_width(cell.text) for cell in (*line, end))
    if room >= _LEAST_STRIP:
        line += _strip(place, span, causes, room)
    return [*line, end]


def _strip(place: Place, span: Span, causes: Sequence[Cause], room: int) -> Iterable[Cell]:
    def column(time_ns: int) -> int:
        share = (time_ns - span.start_ns) / max(span.end_ns - span.start_ns, 1)
        return min(max(int(share * room), 0), room - 1)

    assert place.at_ns is not None
    here = column(place.at_ns)
    cells = [Cell(_PASSED) if at < here else Cell(_TO_COME, Tone.FAINT) for at in range(room)]
    # The worst of a column is on top.
    for cause in sorted(causes, key=lambda one: one.severity):
        if cause.since_ns is not None and cause.severity > Severity.NOTE:
            cells[column(cause.since_ns)] = symbol(cause.severity)
    for letter, time_ns in (("A", place.a_ns), ("B", place.b_ns)):
        if time_ns is not None:
            cells[column(time_ns)] = Cell(letter, Tone.STRONG)
    cells[here] = Cell(_HERE, Tone.STRONG)
    return cells
