"""Tool: one way to read a capture, and the programs that tools need."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Tool:
    """One way to read a capture: how it is called, and how many telegrams it says it saw."""

    name: str
    command: Callable[[Path], list[str]]
    missing: str | None = None
    seen: Callable[[Path], int | None] = lambda _: None
    expected: Callable[[dict[str, Any]], int | None] = lambda _: None
    frames: int | None = None  # reads only so many frames, and is extrapolated
    slow: bool = False


def python(*arguments: str) -> list[str]:
    return [sys.executable, *arguments]


def nvscope_path() -> str | None:
    beside = Path(sys.executable).with_name("nvscope")
    return str(beside) if beside.exists() else shutil.which("nvscope")


def not_found(program: str | None, name: str) -> str | None:
    return None if program else f"{name} is not installed"


def printed_number(output: Path) -> int:
    return int(output.read_text())
