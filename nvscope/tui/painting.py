"""Toned lines on a screen: the only place where a tone becomes a style of Rich."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from nvscope.view.lines.table import Line, Tone
from nvscope.view.lines.text_width import display_width

Palette = Mapping[Tone, Style]

DARK: Palette = {
    Tone.PLAIN: Style(),
    Tone.STRONG: Style(bold=True),
    Tone.FAINT: Style(color="#8a8f98"),
    Tone.GOOD: Style(color="#5fb878"),
    Tone.NOTE: Style(color="#5fb3d9"),
    Tone.WARNING: Style(color="#e5b95c"),
    Tone.ERROR: Style(color="#f0716a", bold=True),
}
LIGHT: Palette = {
    Tone.PLAIN: Style(),
    Tone.STRONG: Style(bold=True),
    Tone.FAINT: Style(color="#6b7078"),
    Tone.GOOD: Style(color="#1a7f37"),
    Tone.NOTE: Style(color="#0b6aa2"),
    Tone.WARNING: Style(color="#8a5a00"),
    Tone.ERROR: Style(color="#b3261e", bold=True),
}
ANSI: Palette = {
    Tone.PLAIN: Style(),
    Tone.STRONG: Style(bold=True),
    Tone.FAINT: Style(dim=True),
    Tone.GOOD: Style(color="green"),
    Tone.NOTE: Style(color="cyan"),
    Tone.WARNING: Style(color="yellow"),
    Tone.ERROR: Style(color="red", bold=True),
}
MONO: Palette = {
    Tone.PLAIN: Style(),
    Tone.STRONG: Style(bold=True),
    Tone.FAINT: Style(dim=True),
    Tone.GOOD: Style(),
    Tone.NOTE: Style(),
    Tone.WARNING: Style(bold=True),
    Tone.ERROR: Style(bold=True),
}
PALETTES: Mapping[str, Palette] = {"dark": DARK, "light": LIGHT, "ansi": ANSI, "mono": MONO}
"""The styles of tones, by theme; ``ansi`` are the sixteen colours of the terminal, ``mono`` none."""

CURSOR = Style(reverse=True)
CHANGED = Style(underline=True)


class MarkedSpans(NamedTuple):
    """Stretches of the columns of a line, which rise, and the style that lies over them."""

    spans: Sequence[tuple[int, int]]
    style: Style


class DrawnLine(NamedTuple):
    """A line as it is drawn: ``over`` lies over the styles of all its cells, ``marks`` over some columns."""

    line: Line = ()
    over: Style | None = None
    marks: Sequence[MarkedSpans] = ()


def strip_of_drawn(drawn: DrawnLine, width: int, palette: Palette) -> Strip:
    """Return a line as it is drawn, as exactly ``width`` columns."""
    strip = strip_of(drawn.line, width, palette, drawn.over)
    for spans, style in drawn.marks:
        if spans:
            strip = marked(strip, spans, style)
    return strip


def marked(strip: Strip, spans: Iterable[tuple[int, int]], style: Style) -> Strip:
    """Return a strip with a style over some stretches of its columns, which rise."""
    parts, at, width = [], 0, strip.cell_length
    for start, stop in spans:
        if start >= width:
            break
        parts += [strip.crop(at, start), strip.crop(start, min(stop, width)).apply_style(style)]
        at = stop
    return Strip.join([*parts, strip.crop(at, width)]) if at < width else Strip.join(parts)


def strip_of(line: Line, width: int, palette: Palette, over: Style | None = None) -> Strip:
    """Return a line as exactly ``width`` columns; ``over`` lies over the styles of all its cells."""
    segments: list[Segment] = []
    room = width
    for text, tone in line:
        taken = display_width(text)
        if taken > room:
            strip = Strip([*segments, Segment(text, _style(palette[tone], over))])
            return strip.crop(0, width)
        segments.append(Segment(text, _style(palette[tone], over)))
        room -= taken
    if room > 0:
        segments.append(Segment(" " * room, over))
    return Strip(segments, width)


@lru_cache(256)
def _style(tone: Style, over: Style | None) -> Style:
    return tone if over is None else tone + over
