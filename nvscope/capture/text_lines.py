"""A text file that comes in pieces, as the lines that a reader of text files asks for."""

from __future__ import annotations

from collections.abc import Iterator

MAX_LINE_BYTES = 64 << 10


class TextLines:
    """The lines of a text, each with a line end; "" says that there is nothing for the moment.

    ``number`` is that of the last line, ``offset`` where it begins; ``ended`` tells whether the text has its end. A
    line of more than ``MAX_LINE_BYTES`` is left out and counted in ``too_long``, with the first one's number in
    ``first_too_long``. Text that is no UTF-8 is read as Windows-1252, which German months in dates are often in.
    """

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._lines = self._split(pieces)
        self.ended = True
        self.number = 0
        self.offset = 0
        self.too_long = 0
        self.first_too_long = 0

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        return next(self._lines)

    def _split(self, pieces: Iterator[bytes]) -> Iterator[str]:
        rest = b""
        skipping = False
        following = 0
        for piece in pieces:
            if not piece:
                yield ""
                continue
            lines = (rest + piece).split(b"\n")
            rest = lines.pop()
            for line in lines:
                self.number += 1
                self.offset = following
                following += len(line) + 1
                if skipping or len(line) > MAX_LINE_BYTES:
                    self._skip(1 - skipping)
                    skipping = False
                else:
                    yield _decoded(line, first=self.number == 1)
            if len(rest) > MAX_LINE_BYTES:
                if not skipping:
                    self.number += 1
                    self._skip(1)
                    self.number -= 1
                following += len(rest)
                rest, skipping = b"", True
        if rest and not skipping:
            self.number += 1
            self.offset = following
            self.ended = False
            yield _decoded(rest, first=self.number == 1)

    def _skip(self, count: int) -> None:
        if count and not self.too_long:
            self.first_too_long = self.number
        self.too_long += count


def _decoded(line: bytes, first: bool) -> str:
    if first:
        line = line.removeprefix(b"\xef\xbb\xbf")
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("cp1252", "replace")
    return text.removesuffix("\r") + "\n"
