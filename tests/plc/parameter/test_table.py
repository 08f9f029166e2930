"""Tables of parameters: what they say, and what they must not, with the line of it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from nvscope.errors import ConfigurationError
from nvscope.plc.parameter.table import document, read_served


def read(folder: Path, text: str) -> dict[tuple[int, int], tuple[int, bytes]]:
    path = folder / "t.toml"
    path.write_text(text, encoding="utf-8")
    return {place: (one.items, one.data) for place, one in read_served(path).by_place.items()}


def test_values_are_those_of_their_types(tmp_path: Path) -> None:
    assert read(
        tmp_path,
        """
        [parameters]
        "0x2000:1" = { type = "real", value = 12.5 }
        "16#2000:2" = { type = "REAL", value = 2 }
        "8192:3" = { type = "BOOL", value = true }
        "0x2000:4" = { type = "TIME", value = "T#1s" }
        "0x2000:5" = { type = "WORD", value = "0xBEEF" }
        "0x2000:6" = { type = "STRING(4)", value = "'a'" }
        "0x2000:7" = { type = "WSTRING(1)", value = '"' }
        "0x2000:8" = { type = "USINT", value = [1, 2, "0x3"] }
        "0x2000:9" = { type = "LREAL" }
        """,
    ) == {
        (0x2000, 1): (1, b"\0\0\x48\x41"), (0x2000, 2): (1, b"\0\0\0\x40"), (0x2000, 3): (1, b"\1"),
        (0x2000, 4): (1, b"\xe8\3\0\0"), (0x2000, 5): (1, b"\xef\xbe"), (0x2000, 6): (1, b"'a'\0\0"),
        (0x2000, 7): (1, b'"\0\0\0'), (0x2000, 8): (3, b"\1\2\3"), (0x2000, 9): (1, bytes(8)),
    }  # fmt: skip


def test_the_smallest_table_has_nothing(tmp_path: Path) -> None:
    assert read(tmp_path, "[parameters]\n") == {}


@pytest.mark.parametrize(
    ("text", "line", "told"),
    [
        ("", 0, "the key 'parameters' is missing"),
        ("[parameter]\n", 1, "unknown key 'parameter'"),
        ('[parameters]\n"0x2000:1" = { tipe = "REAL" }\n', 2, "unknown key 'tipe'"),
        ('[parameters]\n"0x2000:1" = { value = 1 }\n', 2, "the key 'type' is missing"),
        ('[parameters]\n\n"0x2000:1" = { type = "POINTER" }\n', 3, "'POINTER' is no type"),
        ('[parameters]\n"0x2000" = { type = "REAL" }\n', 2, "is no parameter"),
        ('[parameters]\n"0x12000:1" = { type = "REAL" }\n', 2, "is no parameter"),
        ('[parameters]\n"press/0x2000:1" = { type = "REAL" }\n', 2, "is no parameter"),
        ('[parameters]\n"1:1" = { type = "REAL" }\n"0x1:1" = { type = "INT" }\n', 3, "is there twice"),
        ('[parameters]\n"1:1" = { type = "USINT", value = 256 }\n', 2, "256 is out of the range of USINT: 0 to 255"),
        ('[parameters]\n"1:1" = { type = "REAL", value = nan }\n', 2, "'nan' is no REAL"),
        ('[parameters]\n"1:1" = { type = "REAL", value = 1979-05-27 }\n', 2, "a number, true, false or a text"),
        ('[parameters]\n"1:1" = { type = "REAL", value = {} }\n', 2, "found a table"),
        ('[parameters]\n"1:1" = { type = "STRING(3)", value = "abcd" }\n', 2, "room for 3"),
        ('[parameters]\n"1:1" = { type = "STRING(3)", value = 1 }\n', 2, "a text is expected"),
        ('[parameters]\n"1:1" = { type = "REAL", value = [] }\n', 2, "1 element or more"),
        ('[parameters]\n"1:1" = { type = "STRING(1400)", value = ["a", "b", "c"] }\n', 2, "at most 4096 bytes"),
        ('[parameters]\n"1:1" = { type = "REAL", access = "r" }\n', 2, "none of the choices"),
        ('[parameters]\n"1:1" = { type = "REAL", fault = "ODErrorIdx" }\n', 2, "ODErrorReplyIdx"),
        ('[parameters]\n"1:1" = { type = "REAL", fault = "ODStateBusy" }\n', 2, "none of the choices"),
        ('[parameters]\n"1:1" = { type = "REAL", delay = "2min" }\n', 2, "no more than a minute"),
        ('[parameters]\n"1:1" = { type = "REAL", delay = "-1s" }\n', 2, "cannot be negative"),
        ('[parameters]\n"1:1" = { type = "REAL", busy = -1 }\n', 2, "out of range"),
        ('[parameters]\n"1:1" = { type = "REAL", silent = 1 }\n', 2, "true or false"),
        ('unknown_subindex = "ODErrorReplyLen"\n[parameters]\n', 1, "none of the choices"),
        ("[parameters\n", 1, "no TOML"),
    ],
)
def test_mistakes_are_told_with_their_line(tmp_path: Path, text: str, line: int, told: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        read(tmp_path, text)
    error = raised.value
    assert told in f"{error.what} {error.next_step}"
    assert error.where.startswith(str(tmp_path / "t.toml"))
    found = re.search(r", line (\d+), column \d+", error.where)
    assert int(found[1] if found else 0) == line


def test_there_are_no_more_than_so_many(tmp_path: Path) -> None:
    rows = "".join(f'"{number}:0" = {{ type = "BOOL" }}\n' for number in range(10_001))
    with pytest.raises(ConfigurationError, match="more than 10000"):
        read(tmp_path, f"[parameters]\n{rows}")


def test_all_keys_are_told() -> None:
    told = document()
    for name in ("unknown_subindex", "value", "access", "fault", "delay", "silent", "busy", "duplicate", "stuck"):
        assert f"- `{name}` (" in told
