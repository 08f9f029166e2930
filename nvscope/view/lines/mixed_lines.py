"""Lines of frames of several protocols, as they were captured: what all begin with stands in columns of all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.short_names import short_address
from nvscope.view.lines.shown import LineMaker, MakeLines, Wording
from nvscope.view.lines.table import GAP, Cell, Line
from nvscope.view.rows.frames import NETVAR, FrameRows

_ARROW = " → "
_NUMBER_AND_TIME, _WITH_ENDS = 2, 4
_TIME = 1
_FEWER_DIGITS = 3
_MOST_DIGITS = 9
_LEAST_INFO = 24
"""So much of what a line says of a frame goes before whole addresses."""

_LEAST_SHARED = 6
_LEAST_ADDRESS = 4


class _Told(NamedTuple):
    """A line, what stands in the columns that all lines have, and whether it is a telegram's."""

    line: Line
    head: list[str]
    telegram: bool

    @property
    def has_ends(self) -> bool:
        return len(self.head) == _WITH_ENDS

    @property
    def behind(self) -> list[int]:
        """How wide the cells are behind the columns of all."""
        return [len(cell.text) for cell in self.line[len(self.head) :]]


class MixedLines:
    """Puts the lines of pieces together that follow each other; columns never get narrower.

    Number and time stand in one column whatever a frame is of, with as many decimals, and so do sources and
    destinations, unless telegrams would have to be cut for that in ``width`` columns (None: a line may be as wide as it
    takes). Of other frames addresses are shortened before the protocol is cut.
    """

    def __init__(self, makers: Mapping[str, LineMaker], width: int | None) -> None:
        self._makers = makers
        self._width = width
        self._digits = _MOST_DIGITS
        self._restart()
        self.mixed = False
        """Whether a piece of several protocols was seen: from there on, columns are common."""

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the lines of a piece."""
        parts = list(rows.by_protocol())
        self.mixed |= len(parts) > 1
        if not self.mixed and all(name == NETVAR or not self._makers[name].ends for name, _, _ in parts):
            for name, _, own in parts:
                yield from self._makers[name].lines(own)
            return
        made: list[_Told] = [_Told((), [], telegram=False)] * len(rows)
        for name, position, own in parts:
            maker = self._makers[name]
            for row, line in zip(position.tolist(), maker.lines(own), strict=True):
                made[row] = _Told(line, _head(line, ends=maker.ends), name == NETVAR)
        if self._width is not None:
            self._shorten_times(made, self._width)
        self._grow(made)
        of_telegrams, of_others = self._ends(made)
        for told in made:
            line = self._aligned(told, of_telegrams if told.telegram else of_others)
            yield line if self._width is None else cut(line, self._width)

    def _restart(self) -> None:
        self._widths = [0] * _WITH_ENDS
        self._of_telegrams = [0, 0]
        self._of_others = [0, 0]
        self._behind = 0
        self._protocol = self._info = 0
        self._shared = True

    def _shorten_times(self, made: Sequence[_Told], width: int) -> None:
        """Tell all times with as few decimals as any of them, or fewer where short addresses are not enough."""
        digits = min([self._digits, *(len(told.head[_TIME].rpartition(".")[2]) for told in made)])
        for told in made:
            if told.has_ends and not told.telegram:
                ends = sum(min(len(end), _LEAST_SHARED) for end in told.head[_NUMBER_AND_TIME:])
                head = sum(map(len, told.head[:_NUMBER_AND_TIME])) + GAP + ends + GAP + len(_ARROW)
                if head + sum(told.behind[:1]) + min(sum(told.behind[1:]), _LEAST_INFO) > width:
                    digits = min(digits, _FEWER_DIGITS)
                    break
        if digits < self._digits:
            self._digits = digits
            self._restart()
        for told in made:
            whole, point, decimals = told.head[_TIME].rpartition(".")
            told.head[_TIME] = f"{whole}{point}{decimals[:digits]}"

    def _grow(self, made: Sequence[_Told]) -> None:
        for told in made:
            self._widths[: len(told.head)] = map(max, self._widths, map(len, told.head))
            if not told.has_ends:
                continue
            ends = [len(end) for end in told.head[_NUMBER_AND_TIME:]]
            if told.telegram:
                self._of_telegrams = list(map(max, self._of_telegrams, ends))
                self._behind = max(self._behind, sum(told.behind))
            else:
                self._of_others = list(map(max, self._of_others, ends))
                self._protocol = max(self._protocol, *told.behind[:1])
                self._info = max(self._info, min(sum(told.behind[1:]), _LEAST_INFO))

    def _ends(self, made: Sequence[_Told]) -> tuple[list[int] | None, list[int]]:
        """Return the widths of sources and destinations of telegrams (None: as they are), and of other frames."""
        natural = self._widths[_NUMBER_AND_TIME:]
        if self._width is None:
            return natural, natural
        room = self._width - sum(self._widths[:_NUMBER_AND_TIME]) - 2 * GAP - len(_ARROW)
        for_protocol = room - self._protocol
        hard = min(room - self._behind, for_protocol)
        if self._shared:
            least = [
                max(own, min(other, _LEAST_SHARED))
                for own, other in zip(self._of_telegrams, self._of_others, strict=True)
            ]
            shared = _narrowed(natural, least, min(hard, for_protocol - self._info))
            if sum(shared) <= hard:
                return shared, shared
            self._shared = not any(told.telegram for told in made)
        least = [min(width, _LEAST_ADDRESS) for width in self._of_others]
        wanted = [min(width, _LEAST_SHARED) for width in self._of_others]
        own = _narrowed(self._of_others, wanted, for_protocol - self._info)
        return None, _narrowed(own, least, for_protocol)

    def _aligned(self, told: _Told, ends: Sequence[int] | None) -> Line:
        head = told.head if ends else told.head[:_NUMBER_AND_TIME]
        texts = [text.rjust(width) for text, width in zip(head[:_NUMBER_AND_TIME], self._widths, strict=False)]
        texts += [
            short_address(text, width).ljust(width)
            for text, width in zip(head[_NUMBER_AND_TIME:], ends or (), strict=False)
        ]
        before = ("", " " * GAP, " " * GAP, _ARROW)
        return [
            *(Cell(gap + text, cell.tone) for gap, text, cell in zip(before, texts, told.line, strict=False)),
            *told.line[len(texts) :],
        ]


def line_makers(
    make: Mapping[str, MakeLines], moment: Moment, width: int | None, wording: Wording
) -> dict[str, LineMaker]:  # fmt: skip
    """Return what makes the lines that ``MixedLines`` puts together, by protocol.

    Telegrams and CAN frames know what to leave out in ``width`` columns; of all others that is known beside them only.
    """
    makers = {name: lines(moment, width, wording) for name, lines in make.items()}
    whole = {name for name, maker in makers.items() if maker.ends and name != NETVAR}
    return makers | {name: make[name](moment, None, wording) for name in whole}


def _head(line: Line, *, ends: bool) -> list[str]:
    """Return what stands in the columns that all lines have."""
    number, time, *others = (cell.text for cell in line[:_WITH_ENDS])
    if not ends or len(others) < _WITH_ENDS - _NUMBER_AND_TIME:
        return [number.strip(), time.strip()]
    source, destination = others
    return [number.strip(), time.strip(), source.strip(), destination.removeprefix(_ARROW).strip()]


def _narrowed(widths: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Return widths that take ``room`` together, the wider made narrower first, none below its ``least``."""
    narrowed = list(widths)
    while sum(narrowed) > room:
        places = [place for place, width in enumerate(narrowed) if width > least[place]]
        if not places:
            break
        narrowed[max(places, key=narrowed.__getitem__)] -= 1
    return narrowed
