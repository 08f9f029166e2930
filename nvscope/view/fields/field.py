"""TelegramField: something that a telegram or a CAN frame has, with name and type, and how to read it as a column."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

import numpy as np

from dissectors.batch import Bool
from nvscope.expression.columns import Column, FieldType
from nvscope.view.rows.frames import TelegramRows


@dataclass(frozen=True, slots=True)
class TelegramField:
    """One field.

    ``read`` gives the column: unsigned integers of any width (UNSIGNED), int64 nanoseconds since 1970-01-01 UTC (TIME)
    or between two moments (DURATION), bool (BOOL), or the column class of the type. ``known`` tells in which telegrams
    the field exists, None for in all of them; where it does not, the column holds anything. ``hex_digits`` other than
    0: people write the number in hexadecimal. ``calendar``: they write the time as a date. ``constant``: it is the same
    in all telegrams of a variety (``dissectors.varieties``). ``judged``: it is known when the whole capture was read.
    ``values`` are names of its numbers. ``refused`` says why the name can be neither filtered by nor written out,
    ``instead`` which can.
    """

    name: str
    type: FieldType
    label: str
    help: str
    read: Callable[[TelegramRows], Column]
    known: Callable[[TelegramRows], Bool | None] = lambda _: None
    hex_digits: int = 0
    calendar: bool = False
    constant: bool = False
    judged: bool = False
    values: Mapping[str, int] = dataclass_field(default_factory=dict)
    refused: str = ""
    instead: str = ""


def on_udp(field: TelegramField) -> TelegramField:
    """Return a field as one that only telegrams on UDP have."""

    def known(rows: TelegramRows) -> Bool | None:
        own = field.known(rows)
        if rows.can is None:
            return own
        return ~rows.can.on_can if own is None else own & ~rows.can.on_can

    return replace(field, known=known)


def on_can(field: TelegramField) -> TelegramField:
    """Return a field as one that only CAN frames have; it is neither read nor asked of anything else."""

    def known(rows: TelegramRows) -> Bool:
        if rows.can is None or rows.can.frames is None:
            return np.zeros(len(rows), np.bool_)
        own = field.known(rows)
        return rows.can.on_can if own is None else own & rows.can.on_can

    return replace(field, known=known)
