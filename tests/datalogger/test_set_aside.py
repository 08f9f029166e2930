"""Files that others are to take the place of: where they cannot be moved, nothing is lost, and that is said."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nvscope.datalogger.set_aside import SetAside
from nvscope.errors import CaptureError


def files_of(database: str) -> list[str]:
    return [path for path in (database, f"{database}.0") if os.path.lexists(path)]


def series(folder: Path) -> str:
    """Write a database with a closed file; return its path."""
    for name in ("x.db", "x.db.0"):
        (folder / name).write_text(f"old {name}")
    return str(folder / "x.db")


def refusing(do: Callable[..., None], ending: str) -> Callable[..., None]:
    """Return what refuses to touch files whose names end so, and does all else."""

    def refuse(path: str, *others: Any) -> None:
        if str(path).endswith(ending):
            raise PermissionError(13, "Permission denied", path)
        do(path, *others)

    return refuse


def content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_what_cannot_be_put_back_stays_and_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = series(tmp_path)
    aside = SetAside([database], files_of)
    monkeypatch.setattr(os, "rename", refusing(os.rename, "x.db.replaced"))
    stays, (told,) = aside.settle()
    assert not stays
    assert told.startswith(
        f"{database}: what was there cannot be put back: Permission denied; it is {database}.replaced"
    )
    # The other file is where it was.
    assert content(tmp_path) == {"x.db.replaced": "old x.db", "x.db.0": "old x.db.0"}


def test_what_cannot_be_removed_stays_beside_and_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database = series(tmp_path)
    aside = SetAside([database], files_of)
    Path(database).write_text("new")
    monkeypatch.setattr(os, "unlink", refusing(os.unlink, "x.db.replaced"))
    stays, (told,) = aside.settle()
    assert not stays
    assert told == (
        f"{database}.replaced: this file was replaced and cannot be removed: Permission denied; remove it by hand"
    )
    assert content(tmp_path) == {"x.db": "new", "x.db.replaced": "old x.db"}


def test_where_one_file_cannot_be_set_aside_all_are_where_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    database = series(tmp_path)
    monkeypatch.setattr(os, "rename", refusing(os.rename, "x.db.0"))
    with pytest.raises(CaptureError, match="cannot be replaced: Permission denied"):
        SetAside([database], files_of)
    assert content(tmp_path) == {"x.db": "old x.db", "x.db.0": "old x.db.0"}


def test_a_folder_that_cannot_be_looked_into_is_told(tmp_path: Path) -> None:
    database, looks = series(tmp_path), iter([True])

    def look(path: str) -> list[str]:
        if next(looks, False):
            return files_of(path)
        raise PermissionError(13, "Permission denied", path)

    stays, (told,) = SetAside([database], look).settle()
    assert (stays, told) == (
        [], f"{database}: what was there stays as {database}.replaced, {database}.0.replaced: Permission denied"
    )  # fmt: skip


@pytest.mark.parametrize("suffix", ["-journal", "-wal", "-shm"])
def test_nothing_becomes_a_part_of_what_is_set_aside_and_nothing_is_written_over(tmp_path: Path, suffix: str) -> None:
    """Another run that was killed has left something of its own: SQLite would play it into what has its name."""
    database = series(tmp_path)
    (tmp_path / f"x.db{suffix}").write_text("of x.db")
    (tmp_path / f"x.db.replaced{suffix}").write_text("of somebody else")
    aside = SetAside([database], files_of)
    assert content(tmp_path) == {
        "x.db.replaced-1": "old x.db", f"x.db.replaced-1{suffix}": "of x.db",
        f"x.db.replaced{suffix}": "of somebody else", "x.db.0.replaced": "old x.db.0",
    }  # fmt: skip
    Path(database).write_text("new")
    assert not aside.settle().troubles
    assert content(tmp_path) == {"x.db": "new", f"x.db.replaced{suffix}": "of somebody else"}
