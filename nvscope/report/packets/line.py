"""One line a telegram, aligned and fitted to the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from dissectors.batch import Bool
from dissectors.link import IPV4_HIGH
from dissectors.netvar import HEADER, PORT, Service
from nvscope.report.packets import cells, moments, words
from nvscope.report.packets.fit import cut
from nvscope.tracker import address
from nvscope.view.fields import FIELDS
from nvscope.view.table import GAP, Cell, Line, Tone, shorten
from nvscope.view.telegrams import TelegramRows

Moment = Literal["a", "ad", "d", "e", "r", "u", "ud"]
"""How times are told: a local time of day, ad with date, u and ud the same in UTC, e seconds since 1970, r since the
first frame of the capture, d since the telegram shown before."""

_REMARK_WIDTH = 24
"""So much of what is wrong with a telegram goes before other columns."""

_LEAST_ADDRESS = 9
_ADDRESSES = ("source", "destination")
_UNKNOWN = "?"
_EVERYBODY = int(IPV4_HIGH)  # 255.255.255.255, and the upper half of every IPv4 address
_COUNTER_END = HEADER.offset_of("counter") + HEADER["counter"].size_bytes


@dataclass(frozen=True, slots=True)
class _Form:
    """What a line shows of the columns that can do with less."""

    time_digits: int = 6
    subindex_word: bool = True
    items: bool = True
    length: bool = True


# From what there is room for mostly, to what fits nearly everywhere: what is least missed goes first.
_FORMS = (
    _Form(),
    _Form(subindex_word=False),
    _Form(subindex_word=False, items=False),
    _Form(subindex_word=False, items=False, time_digits=3),
    _Form(subindex_word=False, items=False, time_digits=3, length=False),
)


class _Column(NamedTuple):
    """The texts of a column; their tone, or one for each."""

    name: str
    texts: list[str]
    tone: Tone | list[Tone] = Tone.PLAIN
    right: bool = False
    before: str = " " * GAP


class _Tail(NamedTuple):
    """What a line ends with: flags, and what is remarkable."""

    flags: str
    remark: str = ""
    tone: Tone = Tone.PLAIN

    def cells(self, room: int | None) -> list[Cell]:
        """Return the tail in at most ``room`` columns; a remark is worth more than flags."""
        flags, remark = self.flags, self.remark
        if room is not None and remark and len(flags) + len(remark) + 1 > room:
            flags = ""
        parts = [Cell(flags, Tone.FAINT)] if flags else []
        if remark:
            parts.append(Cell(f" {remark}" if flags else remark, self.tone))
        return parts if room is None else cut(parts, room)


class LineWriter:
    """Makes the lines of pieces that follow each other; columns never get narrower, so that lines stay aligned.

    No line is wider than ``width`` (None: as wide as it takes): first columns say less or go, then addresses are
    shortened, then lines are cut at their end.
    """

    def __init__(self, moment: Moment = "r", width: int | None = None) -> None:
        self._moment: Moment = moment
        self._width = width
        self._form = 0
        self._widths: dict[str, int] = {}

    def texts(self, rows: TelegramRows) -> Iterator[str]:
        """Yield the lines of a piece as text without a line break."""
        columns, widths, tails = self._fitted(rows)
        pattern = "".join(
            f"{column.before if place else ''}%{'' if column.right else '-'}{width}s"
            for place, (column, width) in enumerate(zip(columns, widths, strict=True))
        )
        room = self._room(columns, widths)
        for row, head in enumerate(map(pattern.__mod__, zip(*(column.texts for column in columns), strict=True))):
            tail = tails[row]
            if tail is None:
                yield self._clipped(head.rstrip())
            else:
                yield self._clipped(f"{head}{' ' * GAP}{''.join(part.text for part in tail.cells(room))}".rstrip())

    def lines(self, rows: TelegramRows) -> Iterator[Line]:
        """Yield the same lines as toned cells. An acknowledgement is faint as a whole."""
        columns, widths, tails = self._fitted(rows)
        room = self._room(columns, widths)
        acknowledgement = words.SERVICE_WORDS[Service.ODAcknowledgement].word
        services = next(column.texts for column in columns if column.name == "service")
        for row, tail in enumerate(tails):
            faint = services[row] == acknowledgement
            line = []
            for place, (column, width) in enumerate(zip(columns, widths, strict=True)):
                text, tone = column.texts[row], column.tone
                padded = text.rjust(width) if column.right else text.ljust(width)
                tone = Tone.FAINT if faint else tone if isinstance(tone, Tone) else tone[row]
                line.append(Cell(f"{column.before if place else ''}{padded}", tone))
            if tail is not None:
                line += [Cell(" " * GAP), *tail.cells(room)]
            yield _without_end(line if self._width is None else cut(line, self._width))

    def _clipped(self, text: str) -> str:
        if self._width is None or len(text) <= self._width:
            return text
        return text[: self._width - 1] + "…"

    def _room(self, columns: Sequence[_Column], widths: Sequence[int]) -> int | None:
        """Return how wide a tail can be, None for as wide as it likes."""
        return None if self._width is None else max(self._width - _head_width(columns, widths) - GAP, 0)

    def _fitted(self, rows: TelegramRows) -> tuple[list[_Column], list[int], list[_Tail | None]]:
        """Return the columns in a form that fits, their widths, and the tails."""
        tails = _tails(rows)
        told = [tail for tail in tails if tail is not None]
        flags_width = max((len(tail.flags) for tail in told), default=0)
        remark_width = max((len(tail.remark) for tail in told), default=0)
        self._grow("tail", max(flags_width, min(remark_width, _REMARK_WIDTH)))
        while True:
            columns = self._columns(rows, _FORMS[self._form])
            for column in columns:
                self._grow(column.name, max(map(len, column.texts), default=0))
            widths = [self._widths[column.name] for column in columns]
            tail_width = self._widths["tail"]
            total = _head_width(columns, widths) + (GAP + tail_width if tail_width else 0)
            if self._width is None or total <= self._width:
                return columns, widths, tails
            if self._form + 1 == len(_FORMS):
                return *_with_short_addresses(columns, widths, total - self._width), tails
            self._form += 1
            self._widths = {"tail": tail_width}

    def _grow(self, name: str, width: int) -> None:
        self._widths[name] = max(self._widths.get(name, 0), width)

    def _columns(self, rows: TelegramRows, form: _Form) -> list[_Column]:
        telegrams = rows.telegrams
        header, datagram = telegrams.header, telegrams.datagram
        code = words.word_codes(telegrams).tolist()
        known = datagram.captured_bytes >= _COUNTER_END
        columns = [
            _Column("number", cells.texts(FIELDS["frame.number"], rows), Tone.FAINT, right=True),
            _Column("time", _moments(rows, self._moment, form.time_digits), right=True),
            _Column("source", cells.texts(FIELDS["ip.src"], rows)),
            _Column("destination", _destinations(rows), before=" → "),
            *_places(code, header["index"].tolist(), header["subindex"].tolist(), form.subindex_word),
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


def _places(code: list[int], index: list[int], subindex: list[int], subindex_word: bool) -> list[_Column]:
    """Return list and SubIndex, in two columns or, without the word, in one."""
    names = ["list" if number in words.LIST_CODES else "param" for number in code]
    if subindex_word:
        lists = [f"{name} {number}" for name, number in zip(names, index, strict=True)]
        return [
            _Column("list", lists, Tone.STRONG),
            _Column("subindex", [f"sub {number}" for number in subindex], before=" "),
        ]
    triples = zip(names, index, subindex, strict=True)
    return [_Column("list", [f"{name} {number}/{sub}" for name, number, sub in triples], Tone.STRONG)]


def _head_width(columns: Sequence[_Column], widths: Sequence[int]) -> int:
    return sum(widths) + sum(len(column.before) for column in columns[1:])


def _with_short_addresses(columns: list[_Column], widths: list[int], surplus: int) -> tuple[list[_Column], list[int]]:
    """Take ``surplus`` columns away from the addresses, from the wider one first, as far as they can give them."""
    places = [place for place, column in enumerate(columns) if column.name in _ADDRESSES]
    for _ in range(surplus):
        widest = max(places, key=widths.__getitem__)
        if widths[widest] <= _LEAST_ADDRESS:
            break
        widths[widest] -= 1
    for place in places:
        texts = [shorten(text, widths[place]) for text in columns[place].texts]
        columns[place] = columns[place]._replace(texts=texts)
    return columns, widths


def _moments(rows: TelegramRows, moment: Moment, digits: int) -> list[str]:
    ts_ns = rows.telegrams.ts_ns
    if moment == "e":
        return moments.seconds(ts_ns, digits)
    if moment == "r":
        return moments.seconds(rows.since_start_ns, digits)
    if moment == "d":
        return moments.seconds(rows.since_shown_ns, digits)
    return moments.clock(ts_ns, digits, utc=moment.startswith("u"), date=moment.endswith("d"))


def _destinations(rows: TelegramRows) -> list[str]:
    """Return address and port, or that a telegram goes to everybody in the network."""
    datagram = rows.telegrams.datagram
    high, low, ports = datagram.destination_hi, datagram.destination_lo, datagram.destination_port
    keys = list(zip(high.tolist(), low.tolist(), ports.tolist(), strict=True))
    told = {key: _destination(*key) for key in set(keys)}
    return [told[key] for key in keys]


def _destination(high: int, low: int, port: int) -> str:
    if high == low == _EVERYBODY:
        return "broadcast" if port == PORT else f"broadcast:{port}"
    text = address.text(high, low)
    return f"[{text}]:{port}" if ":" in text else f"{text}:{port}"


def _tails(rows: TelegramRows) -> list[_Tail | None]:
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
