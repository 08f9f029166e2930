"""What is no HTTP on the ports of pages, and has no end of a line: labelled with its first bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.oracle.tcp_line import Line
from tests.tracker.visu.test_encodings import Page, asked

MODBUS = bytes.fromhex("000100000006010300000002")


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (MODBUS, "no HTTP"), (b"P\0", "no HTTP"), (b"SSH:2", "no HTTP"), (b"\x16\x03\x01" + bytes(60), "TLS"),
    ],
)  # fmt: skip
def test_it_is_labelled_where_it_begins(said: bytes, told: str, tmp_path: Path) -> None:
    line = Line(("10.0.0.9", 50_000), ("10.0.0.5", 80)).open().ask(said).answer(said)
    assert f"{told}, not decoded" in asked("packets", line.frames, tmp_path)
    (row,) = asked("report", line.frames, tmp_path, "--json")["visu_others"]
    assert (row["first_frame"], row["count"]) == (4, 1)


@pytest.mark.parametrize("said", [b"P", b"POS", b"GET", b"\r\n", b"GET /x", b"PROPFIND ", b"HELLO", b"PRI * HTTP/2.0"])
def test_what_may_still_become_a_request_is_not(said: bytes, tmp_path: Path) -> None:
    line = Line(("10.0.0.9", 50_000), ("10.0.0.5", 80)).open().ask(said)
    assert "not decoded" not in asked("packets", line.frames, tmp_path)


def test_a_request_behind_such_bytes_is_found(tmp_path: Path) -> None:
    line = Page()
    line.ask(MODBUS).reads(b"1", "4|0|2|1")
    shown = asked("packets", line.frames, tmp_path)
    assert "no HTTP, not decoded" in shown
    assert "read 1 variable" in shown
