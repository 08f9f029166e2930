"""What lines of ``packets`` keep on a narrow terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.test_widths import PLANT, on_terminal, terminals

pytestmark = terminals


@pytest.mark.parametrize("columns", [40, 50, 60, 80])
def test_what_kind_of_can_frame_it_is_goes_before_its_bytes(columns: int, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    frames = [
        "110#0102030405060708",
        "110#R",
        "20000004#0004000000000000",
        f"110##1{'AB' * 64}",
        f"12345678##3{'00' * 12}",
    ]
    log.write_text("".join(f"({second}.000000) can0 {frame}\n" for second, frame in enumerate(frames)))
    lines = on_terminal(["packets", str(log)], columns).splitlines()[:5]
    assert max(map(len, lines)) <= columns
    plain, *others = lines
    assert "  01 " in plain
    for line, kind in zip(others, ["remote", "error", "FD BRS", "FD BRS ESI"], strict=True):
        assert f"  {kind}" in line


def test_the_list_goes_before_long_addresses_and_is_never_cut_inside_its_number() -> None:
    lines = on_terminal(["packets", PLANT, "-Y", "nv.index == 12", "-c", "20"], 40).splitlines()
    telegrams = [line for line in lines if "→" in line]
    assert telegrams
    assert all("  list 12/0" in line and len(line) <= 40 for line in telegrams)


def test_whole_lines_are_there_where_they_are_asked_for() -> None:
    narrow, wide = (on_terminal(["packets", PLANT, "-c", "3", *more], 40) for more in ([], ["--wide"]))
    assert max(map(len, narrow.splitlines())) <= 40
    assert "…" in narrow
    assert "…" not in wide
    assert "broadcast" in wide
