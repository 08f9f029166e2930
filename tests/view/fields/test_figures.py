"""Figures as words of expressions: each is readable, and says of a telegram what the report says of its list."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dissectors import address
from nvscope.analysis.inquiry import Inquiry
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.tracker.figures import FIGURES, Figure, Of, Value
from nvscope.tracker.subjects import subjects
from nvscope.view.fields.verdicts import Verdicts, verdict_fields
from nvscope.view.fields.vocabulary import vocabulary
from nvscope.view.rows.frames import FrameRows, PacketRows

ROOT = Path(__file__).parents[3]
CAPTURES = ("plant.pcapng.gz", "peers/peers.pcap", "can/press.log", "interfaces.pcapng")
WORDS = [(figure, of) for figure in FIGURES for of in figure.of if of is not Of.STREAM]


@cache
def read(capture: str) -> tuple[list[FrameRows], Verdicts, dict[Any, dict[str, Value]]]:
    """Return the telegrams of a capture, what is known of them, and all figures by what they are of."""
    inquiry = Inquiry([str(ROOT / "captures" / capture)])
    found = inquiry.analyze()
    summary = found.summary
    verdicts = Verdicts(summary, [address.halves(text) for text in summary.addresses], found.findings)
    rows, pieces = PacketRows(), []
    for _ in inquiry.run(inquiry.open(), [rows]):
        pieces += list(rows.pieces())
    keys = {entry.number: str(entry.key) for entry in (*summary.lists, *summary.can.lists)}
    known: dict[Any, dict[str, Value]] = {}
    for one in subjects(summary):
        node = None if one.node is None else summary.addresses[one.node]
        key: Any = one.channel if one.list is None else keys[one.list]
        values = {figure.name: figure.read(one.measured) for figure in FIGURES if one.of in figure.of}
        known[one.of, key, node] = values
    return pieces, verdicts, known


def told(name: str, rows: FrameRows, verdicts: Verdicts | None) -> list[Any]:
    """Return what a field says of each row, None where there is nothing."""
    field = vocabulary(None, None, verdicts)[name]
    column, known = field.column(rows), field.exists(rows)
    if isinstance(column, TextColumn):
        values: list[Any] = [column.texts[code] for code in column.code]
    else:
        assert isinstance(column, np.ndarray)
        expected = {FieldType.REAL: "f"}.get(field.type, "i")
        assert name in {"list.key", "can.channel", "ip.src"} or column.dtype.kind == expected
        values = column.tolist()
    return values if known is None else [value if there else None for value, there in zip(values, known, strict=True)]


def senders(rows: FrameRows) -> list[str]:
    return [address.text(high, low) for high, low in zip(*(half.tolist() for half in rows.senders), strict=True)]


@pytest.mark.parametrize("capture", CAPTURES)
@pytest.mark.parametrize(("figure", "of"), WORDS, ids=lambda part: getattr(part, "name", None))
def test_a_word_says_of_a_telegram_what_is_known_of_its_list_sender_or_bus(
    figure: Figure, of: Of, capture: str
) -> None:  # fmt: skip
    pieces, verdicts, known = read(capture)
    for rows in pieces:
        lists, channels = told("list.key", rows, verdicts), told("can.channel", rows, verdicts)
        values = told(f"{of.value}.{figure.name}", rows, verdicts)
        for value, key, channel, sender in zip(values, lists, channels, senders(rows), strict=True):
            if of is Of.BUS:
                expected = None if channel is None else known[of, channel, None][figure.name]
            elif key is None or (of is Of.NODE and channel is not None):
                expected = None
            else:
                expected = known[of, key, sender if of is Of.NODE else None][figure.name]
            assert value == expected


@pytest.mark.parametrize("of", [Of.LIST, Of.NODE, Of.BUS])
def test_the_words_are_those_of_the_table(of: Of) -> None:
    names = [name.removeprefix(f"{of.value}.") for name in verdict_fields() if name.startswith(f"{of.value}.")]
    figures = [figure.name for figure in FIGURES if of in figure.of]
    assert names[len(names) - len(figures) :] == figures


def test_figures_are_read_when_the_capture_was_judged() -> None:
    (rows, *_), _, _ = read(CAPTURES[0])
    with pytest.raises(LookupError):
        told("list.jitter", rows, None)


@pytest.mark.parametrize(
    ("capture", "expression", "lists"),
    [
        ("plant.pcapng.gz", "node.restarts > 0", {"udp/1202/9"}),
        ("plant.pcapng.gz", "list.interval_p50 > 0.15", {"udp/1202/3", "udp/1202/9"}),
        ("can/press.log", "bus.frames > 1000 && list.jitter > 20", {"can/can0/273"}),
    ],
)
def test_expressions_choose_by_figures(capture: str, expression: str, lists: set[str]) -> None:
    inquiry = Inquiry([str(ROOT / "captures" / capture)])
    shown = inquiry.report(inquiry.analyze(expression, causes=True))["lists"]
    assert {entry["key"] for entry in shown} == lists
