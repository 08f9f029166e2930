"""One line a telegram, aligned and fitted to the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors import address
from dissectors.batch import Bool
from dissectors.headers import IPV4_HIGH
from dissectors.netvar import HEADER, PORT, Service, TelegramBatch
from nvscope.view.documents.parameter_values import ParameterValues
from nvscope.view.escape import visible
from nvscope.view.fields.frame import FIELDS
from nvscope.view.lines import cells, moments, words
from nvscope.view.lines.fit import cut
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.parameter_names import WITH_VALUE, parameter_of, value_text
from nvscope.view.lines.short_names import short_address, short_names
from nvscope.view.lines.shown import NO_WORDING, Wording
from nvscope.view.lines.table import GAP, Cell, Line, Tone
from nvscope.view.rows.frames import FrameRows

_REMARK_WIDTH = 24
"""So much of what is wrong with a telegram goes before other columns."""

_RARE = 4
_BESIDE, _INSTEAD = "beside the figures", "instead of the figures"

_LEAST_ADDRESS = 9
_LEAST_BESIDE_LIST = 4
"""So little is left of addresses where the list would have to be cut."""
_ADDRESSES = ("source", "destination")
_UNKNOWN = "?"
_EVERYBODY = int(IPV4_HIGH)  # 255.255.255.255, and the upper half of every IPv4 address
_ACKNOWLEDGEMENT = words.SERVICE_WORDS[Service.ODAcknowledgement].word
_COUNTER_END = HEADER.offset_of("counter") + HEADER["counter"].size_bytes


class _Form(Struct, frozen=True):
    """What a line shows of the columns that can do with less."""

    time_digits: int = 6
    subindex_word: bool = True
    usual_port: bool = True
    items: bool = True
    length: bool = True


# From what there is room for mostly, to what fits nearly everywhere: what is least missed goes first.
_FORMS = (
    _Form(),
    _Form(subindex_word=False),
    _Form(subindex_word=False, usual_port=False),
    _Form(subindex_word=False, usual_port=False, time_digits=3),
    _Form(subindex_word=False, usual_port=False, time_digits=3, items=False),
    _Form(subindex_word=False, usual_port=False, time_digits=3, items=False, length=False),
)
_LAST_WITH_ALL_FIGURES = max(place for place, form in enumerate(_FORMS) if form.items and form.length)


class _Column(NamedTuple):
    """The texts of a column; their tone, or one for each."""

    name: str
    texts: list[str]
    tone: Tone | list[Tone] = Tone.PLAIN
    right: bool = False
    before: str = " " * GAP


class _Tail(NamedTuple):
    """What a line ends with: flags, what is wrong or remarkable, and the value of a parameter, as far as it fits."""

    flags: str
    remark: str = ""
    tone: Tone = Tone.PLAIN
    value: str = ""

    @property
    def text(self) -> str:
        return " ".join(part for part in (self.flags, self.remark, self.value) if part)

    def cells(self) -> list[Cell]:
        parts = [(self.flags, Tone.FAINT), (self.remark, self.tone), (self.value, Tone.PLAIN)]
        told = [(text, tone) for text, tone in parts if text]
        return [Cell(f" {text}" if place else text, tone) for place, (text, tone) in enumerate(told)]


class _Fitted(Struct, frozen=True):
    """The columns of a piece and their widths, and what its lines end with."""

    columns: list[_Column]
    widths: list[int]
    tails: list[_Tail | None]

    @property
    def to_service(self) -> int:
        """How many columns there are up to the service; behind it come figures."""
        return 1 + next(place for place, column in enumerate(self.columns) if column.name == "service")

    @property
    def to_list(self) -> int:
        """How many columns there are up to list and SubIndex."""
        return self.to_service - 1

    def width(self, count: int) -> int:
        """Return how wide the first ``count`` columns are together."""
        gaps = sum(len(column.before) for column in self.columns[1:count])
        return sum(self.widths[:count]) + gaps

    def pattern(self) -> str:
        """Return the columns as a format of their texts."""
        return "".join(
            f"{column.before if place else ''}%{'' if column.right else '-'}{width}s"
            for place, (column, width) in enumerate(zip(self.columns, self.widths, strict=True))
        )


class LineWriter:
    """Makes the lines of pieces that follow each other; columns never get narrower, so that lines stay aligned.

    No line is wider than ``width`` (None: as wide as it takes): first columns say less or go, then addresses are
    shortened. What is wrong with a telegram takes the place of its figures where there is no room for both. Nodes that
    ``wording`` has names for are called by these.
    """

    ends = True

    def __init__(self, moment: Moment = "r", width: int | None = None, wording: Wording = NO_WORDING) -> None:
        self._moment: Moment = moment
        self._names = {node: visible(name) for node, name in wording.names.items()}
        self._parameters = wording.parameters
        self._values = ParameterValues()
        self._width = width
        self._form = 0
        self._widths: dict[str, int] = {}

    def texts(self, rows: FrameRows) -> Iterator[str]:
        """Yield the lines of a piece as text without a line break."""
        fitted = self._fitted(rows)
        pattern = fitted.pattern()
        texts = zip(*(column.texts for column in fitted.columns), strict=True)
        for row, (head, tail) in enumerate(zip(map(pattern.__mod__, texts), fitted.tails, strict=True)):
            text = f"{head}{' ' * GAP}{tail.text}" if tail else head.rstrip()
            if self._width is None or len(text) <= self._width:
                yield text
            else:
                yield "".join(cell.text for cell in self._line(fitted, row))

    def lines(self, rows: FrameRows) -> Iterator[Line]:
        """Yield the same lines as toned cells. An acknowledgement is faint as a whole."""
        fitted = self._fitted(rows)
        for row in range(len(fitted.tails)):
            yield self._line(fitted, row)

    def _line(self, fitted: _Fitted, row: int) -> list[Cell]:
        tail = fitted.tails[row]
        count = len(fitted.columns)
        if tail and self._width is not None:
            if fitted.width(count) + GAP + len(tail.text) > self._width and tail.remark:
                tail = tail._replace(flags="", value="")
            if fitted.width(count) + GAP + len(tail.text) > self._width and tail.remark:
                count = fitted.to_service
        line = []
        for place in range(count):
            column, width = fitted.columns[place], fitted.widths[place]
            text, tone = column.texts[row], column.tone
            padded = text.rjust(width) if column.right else text.ljust(width)
            line.append(
                Cell(f"{column.before if place else ''}{padded}", tone if isinstance(tone, Tone) else tone[row])
            )
        if fitted.columns[fitted.to_service - 1].texts[row] == _ACKNOWLEDGEMENT:
            line = [Cell(cell.text, Tone.FAINT) for cell in line]
        if tail:
            line += [Cell(" " * GAP), *tail.cells()]
        return _without_end(line if self._width is None else cut(line, self._width))

    def _fitted(self, rows: FrameRows) -> _Fitted:
        """Return the columns in the first form that fits."""
        tails = self._tails(rows)
        remarks = [min(len(tail.remark), _REMARK_WIDTH) for tail in tails if tail and tail.remark]
        self._grow(_BESIDE, max((len(tail.flags) for tail in tails if tail), default=0))
        # What is wrong now and then may cover figures; in a capture that is full of it, they stand beside each other.
        self._grow(_INSTEAD if _RARE * len(remarks) < len(tails) else _BESIDE, max(remarks, default=0))
        while True:
            columns = self._columns(rows, _FORMS[self._form])
            for column in columns:
                self._grow(column.name, max(map(len, column.texts), default=0))
            fitted = _Fitted(columns, [self._widths[column.name] for column in columns], tails)
            surplus = self._surplus(fitted)
            if surplus <= 0:
                return fitted
            if self._form + 1 == len(_FORMS):
                beyond = fitted.width(fitted.to_list) - (self._width or 0)
                return _with_short_addresses(fitted, surplus, beyond, self._names.values())
            self._form += 1
            self._widths = {name: self._widths[name] for name in (_BESIDE, _INSTEAD) if name in self._widths}

    def _parameter_names(self, telegrams: TelegramBatch, code: list[int]) -> dict[int, str]:
        """Return the names of the parameters that telegrams are about, by row, of those that have one."""
        if not self._parameters:
            return {}
        asked = [row for row, number in enumerate(code) if number in words.PARAMETER_CODES]
        known = ((row, parameter_of(self._parameters, telegrams, row)) for row in asked)
        return {row: visible(one.name) for row, one in known if one is not None and one.name}

    def _tails(self, rows: FrameRows) -> list[_Tail | None]:
        """Return what lines end with."""
        tails, telegrams = _tails(rows), rows.telegrams
        for row in np.flatnonzero(np.isin(telegrams.header["id"], WITH_VALUE)).tolist():
            if text := value_text(self._parameters, self._values, telegrams, row):
                tails[row] = (tails[row] or _Tail(""))._replace(value=f"= {visible(text)}")
        return tails

    def _surplus(self, fitted: _Fitted) -> int:
        """Return by how much lines with what is beside the figures, or in their place, are too wide."""
        if self._width is None:
            return 0
        beside, instead = self._widths.get(_BESIDE, 0), self._widths.get(_INSTEAD, 0)
        with_figures = fitted.width(len(fitted.columns)) + (GAP + beside if beside else 0)
        without_figures = fitted.width(fitted.to_service) + (GAP + instead if instead else 0)
        if self._form >= _LAST_WITH_ALL_FIGURES:
            return with_figures - self._width  # to leave out figures gives no room to what is in their place
        return max(with_figures, without_figures) - self._width

    def _grow(self, name: str, width: int) -> None:
        self._widths[name] = max(self._widths.get(name, 0), width)

    def _columns(self, rows: FrameRows, form: _Form) -> list[_Column]:
        telegrams = rows.telegrams
        header, datagram = telegrams.header, telegrams.datagram
        code = words.word_codes(telegrams).tolist()
        known = datagram.captured_bytes >= _COUNTER_END
        columns = [
            _Column("number", cells.texts(FIELDS["frame.number"], rows), Tone.FAINT, right=True),
            _Column("time", moments.told(rows, self._moment, form.time_digits), right=True),
            _Column("source", [self._names.get(text, text) for text in cells.texts(FIELDS["ip.src"], rows)]),
            _Column("destination", _destinations(rows, form.usual_port, self._names), before=" → "),
            *_places(
                code,
                header["index"].tolist(),
                header["subindex"].tolist(),
                form.subindex_word,
                self._parameter_names(telegrams, code),
            ),
            _Column(
                "service",
                [words.WORD_OF_CODE[number].word for number in code],
                [words.WORD_OF_CODE[number].tone for number in code],
            ),
        ]
        if form.items:
            counted = [f"{count} item " if count == 1 else f"{count} items" for count in header["items"].tolist()]
            columns.append(_Column("items", _where(known, counted), right=True))
        if form.length:
            columns.append(
                _Column("length", _where(known, [f"{size} B" for size in header["length"].tolist()]), right=True)
            )
        columns.append(
            _Column("counter", _where(known, [f"#{count}" for count in header["counter"].tolist()]), right=True)
        )
        return columns


def _places(
    code: list[int], index: list[int], subindex: list[int], subindex_word: bool, called: Mapping[int, str]
) -> list[_Column]:  # fmt: skip
    """Return list and SubIndex, in two columns or, without the word, in one; ``called`` are parameters by row."""
    # Index and SubIndex of parameters are people's numbers, and written as findings do.
    names = ["param" if number in words.PARAMETER_CODES else "list" for number in code]
    if subindex_word:
        lists = [
            f"{name} 0x{number:04x}" if name == "param" else f"{name} {number}"
            for name, number in zip(names, index, strict=True)
        ]
        parts = [f"sub {number}" for number in subindex]
        for row, name in called.items():
            lists[row], parts[row] = f"param {name}", ""
        return [_Column("list", lists, Tone.STRONG), _Column("subindex", parts, before=" ")]
    triples = zip(names, index, subindex, strict=True)
    told = [
        f"{name} 0x{number:04x}/{sub}" if name == "param" else f"{name} {number}/{sub}" for name, number, sub in triples
    ]
    for row, name in called.items():
        told[row] = f"param {name}"
    return [_Column("list", told, Tone.STRONG)]


def _with_short_addresses(fitted: _Fitted, surplus: int, beyond: int, names: Collection[str]) -> _Fitted:
    """Take ``surplus`` columns away from the addresses, from the wider one first, as far as they can give them.

    They give more for the ``beyond`` columns by which the list ends behind the edge. What all ``names`` of nodes have
    in common goes first: whichever of them a piece has, they are cut alike.
    """
    columns, widths = list(fitted.columns), list(fitted.widths)
    places = [place for place, column in enumerate(columns) if column.name in _ADDRESSES]
    # Two more are for a blank behind the list and the ellipsis of what follows it.
    for taken in range(surplus):
        widest = max(places, key=widths.__getitem__)
        if widths[widest] <= (_LEAST_BESIDE_LIST if taken <= beyond + 1 else _LEAST_ADDRESS):
            break
        widths[widest] -= 1
    for place in places:
        forms = short_names(names, widths[place])
        texts = [forms.get(text) or short_address(text, widths[place]) for text in columns[place].texts]
        columns[place] = columns[place]._replace(texts=texts)
    return _Fitted(columns, widths, fitted.tails)


def _destinations(rows: FrameRows, usual_port: bool, names: Mapping[str, str]) -> list[str]:
    """Return name or address, and port, or that a telegram goes to everybody in the network."""
    datagram = rows.telegrams.datagram
    high, low, ports = datagram.destination_hi, datagram.destination_lo, datagram.destination_port
    keys = list(zip(high.tolist(), low.tolist(), ports.tolist(), strict=True))
    told = {key: _destination(*key, usual_port=usual_port, names=names) for key in set(keys)}
    return [told[key] for key in keys]


def _destination(high: int, low: int, port: int, *, usual_port: bool, names: Mapping[str, str]) -> str:
    """Return where a telegram goes; the usual port goes without saying with a broadcast, or always."""
    if high == low == _EVERYBODY:
        return "broadcast" if port == PORT else f"broadcast:{port}"
    text = address.text(high, low)
    name = names.get(text)
    if port == PORT and not usual_port:
        return name or text
    return f"[{text}]:{port}" if ":" in text and not name else f"{name or text}:{port}"


def _tails(rows: FrameRows) -> list[_Tail | None]:
    flags = words.flag_words(rows.telegrams)
    distinct = {text: _Tail(text) if text else None for text in set(flags)}
    tails = [distinct[text] for text in flags]
    for row, (remark, tone) in words.remarks(rows.telegrams).items():
        tails[row] = _Tail(flags[row], remark, tone)
    return tails


def _where(known: Bool, texts: list[str]) -> list[str]:
    for row in np.flatnonzero(~known).tolist():
        texts[row] = _UNKNOWN
    return texts


def _without_end(line: list[Cell]) -> list[Cell]:
    """Return a line without the spaces at its end."""
    while line and not line[-1].text.rstrip(" "):
        line.pop()
    if line:
        line[-1] = Cell(line[-1].text.rstrip(" "), line[-1].tone)
    return line
