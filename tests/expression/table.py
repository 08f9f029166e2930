"""Some telegrams as a table of made-up fields: as columns for expressions, and row for row for what checks them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from dissectors.batch import Bool
from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import AddressColumn, BytesColumn, Column, FieldType, Named, TextColumn

Row = dict[str, Any]
"""What a telegram has, by name; a field that it lacks is not in it. Addresses are (version, number)."""

TYPES = {
    "n.byte": FieldType.UNSIGNED,
    "n.word": FieldType.UNSIGNED,
    "n.lword": FieldType.UNSIGNED,
    "n.dint": FieldType.SIGNED,
    "n.lreal": FieldType.REAL,
    "t.at": FieldType.TIME,
    "t.took": FieldType.DURATION,
    "a.src": FieldType.ADDRESS,
    "a.dst": FieldType.ADDRESS,
    "b.data": FieldType.BYTES,
    "b.more": FieldType.BYTES,
    "s.name": FieldType.TEXT,
    "s.other": FieldType.TEXT,
    "f.on": FieldType.BOOL,
    "f.ready": FieldType.BOOL,
    "f.sent": FieldType.BOOL,
}
EITHER = {"n.small": ("n.byte", "n.word"), "a.addr": ("a.src", "a.dst"), "b.any": ("b.data", "b.more")}
NAMES = {
    **{name: Named(kind) for name, kind in TYPES.items()},
    **{name: Named(TYPES[parts[0]], parts) for name, parts in EITHER.items()},
    "proto": Named(FieldType.BOOL, test="n.byte == 4"),
    "s.torn": Named(
        FieldType.BYTES, refused="lists a and b have it with different types", instead="write s.a.torn or s.b.torn"
    ),
}
_DTYPES = {
    "n.byte": "u1",
    "n.word": "u2",
    "n.lword": "u8",
    "n.dint": "i4",
    "n.lreal": "f8",
    "t.at": "i8",
    "t.took": "i8",
}
_SECOND = 1_000_000_000

VALUES: dict[str, st.SearchStrategy[Any]] = {
    "n.byte": st.sampled_from([0, 1, 2, 3, 7, 128, 255]),
    "n.word": st.sampled_from([0, 1, 2, 7, 256, 65535]),
    "n.lword": st.sampled_from([0, 1, 5, 2**31, 2**62, 2**63 - 1, 2**63, 2**64 - 1]),
    "n.dint": st.sampled_from([0, 1, -1, -7, 7, 3, -(2**31), 2**31 - 1]),
    "n.lreal": st.sampled_from([0.0, -0.5, 1.0, 2.5, 7.0, -1e6, 1e6]),
    "t.at": st.sampled_from(
        [0, _SECOND, 1_700_000_000 * _SECOND, 1_700_000_000 * _SECOND + 1, 1_800_000_000 * _SECOND]
    ),
    "t.took": st.sampled_from([0, 1, 50_000_000, _SECOND, 5 * _SECOND, -_SECOND]),
    "a.src": st.sampled_from([(4, 0x0A000001), (4, 0x0A000002), (4, 0x0A0000FF), (6, 1), (6, 0x20010DB8 << 96 | 1)]),
    "b.data": st.sampled_from([b"", b"\0", b"\1\2", b"\1\2\3", b"\0\0\1\2", b"ab\0\1\2\xff", b"abab" * 3]),
    "s.name": st.sampled_from(["", "a", "press", "Press 1", "pump", "ü"]),
    "f.on": st.booleans(),
}
VALUES["a.dst"], VALUES["b.more"], VALUES["s.other"] = VALUES["a.src"], VALUES["b.data"], VALUES["s.name"]
VALUES["f.ready"] = VALUES["f.sent"] = VALUES["f.on"]


@dataclass(frozen=True)
class Table:
    """Rows, and how an expression reads them; ``reads`` notes every name that was read."""

    rows: list[Row]
    reads: list[str]

    def read(self, name: str) -> tuple[Column, Bool | None]:
        self.reads.append(name)
        known = np.array([name in row for row in self.rows], np.bool_)
        return self._column(name), None if known.all() else known

    def chosen(self, expression: str) -> list[bool]:
        mask = compile_expression(expression, NAMES).mask(self.read)
        assert mask.shape == (len(self.rows),)
        assert mask.dtype == np.bool_
        found: list[bool] = mask.tolist()
        return found

    def _column(self, name: str) -> Column:
        kind = TYPES[name]
        if kind is FieldType.BYTES:
            parts = [row.get(name, b"") for row in self.rows]
            data = np.frombuffer(b"#" + b"".join(parts) + b"#", np.uint8)
            stop = 1 + np.cumsum([len(part) for part in parts], dtype=np.int64)
            return BytesColumn(data, stop - [len(part) for part in parts], stop)
        if kind is FieldType.TEXT:
            texts = [row.get(name, "") for row in self.rows]
            table = sorted(set(texts))
            return TextColumn(np.array([table.index(text) for text in texts], np.int64), tuple(table))
        if kind is FieldType.ADDRESS:
            halves = [_halves(*row.get(name, (4, 0))) for row in self.rows]
            return AddressColumn(*(np.array([pair[at] for pair in halves], np.uint64) for at in (0, 1)))
        dtype = "?" if kind is FieldType.BOOL else _DTYPES[name]
        return np.array([row.get(name, 0) for row in self.rows], dtype)


def _halves(version: int, number: int) -> tuple[int, int]:
    if version == 4:
        return 2**64 - 1, 0xFFFFFFFF << 32 | number
    return number >> 64, number & (2**64 - 1)


def rows() -> st.SearchStrategy[list[Row]]:
    """Return a strategy of a few rows, in which any field may be missing."""
    return st.lists(st.fixed_dictionaries({}, optional=VALUES), min_size=1, max_size=12)
