"""Position: where something stands in a definition file."""

from __future__ import annotations

from msgspec import Struct


class Position(Struct, frozen=True):
    """Where something stands in a file; line and column count from 1. Line 0 is the file as a whole."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}, column {self.column}" if self.line else self.file
