"""Bytes as offset, hexadecimal digits and characters: the form that text2pcap reads back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope.view.lines.table import Cell, Line, Tone

PER_LINE = 16
_CHARACTERS = bytes(code if 0x20 <= code < 0x7F else ord(".") for code in range(256))

TonedSpan = tuple[int, Tone]
"""Up to which offset bytes have a tone."""


def dump(
    data: bytes, parts: Sequence[TonedSpan] = (), indent: int = 0, first: int = 0, per_line: int = PER_LINE
) -> Iterator[Line]:  # fmt: skip
    """Yield the lines of a dump of ``data``, whose first byte is at offset ``first``.

    ``parts`` lie one behind the other; what is behind the last of them is plain.
    """
    spare = " " * (3 * per_line)
    for at in range(0, len(data), per_line):
        piece = data[at : at + per_line]
        digits = piece.hex(" ")
        characters = piece.translate(_CHARACTERS).decode("ascii")
        line = [Cell(f"{'':{indent}}{first + at:04x}  ", Tone.FAINT)]
        spans = list(_spans(at, at + len(piece), parts)) if parts else [(0, len(piece), Tone.PLAIN)]
        line += (Cell(digits[3 * begin : 3 * end], tone) for begin, end, tone in spans)
        line.append(Cell(spare[len(digits) :] + "  "))
        line += (Cell(characters[begin:end], tone) for begin, end, tone in spans)
        yield line


def _spans(begin: int, end: int, parts: Sequence[TonedSpan]) -> Iterator[tuple[int, int, Tone]]:
    """Yield the parts within a line, as positions in the line."""
    at = begin
    for stop, tone in (*parts, (end, Tone.PLAIN)):
        here = min(stop, end)
        if here > at:
            yield at - begin, here - begin, tone
            at = here
