"""Goldens: what the faces make of the examples, as files to look at.

After an intended change, ``NVSCOPE_UPDATE_GOLDEN=1 pytest tests/report`` writes them anew; read the difference.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "golden"


@pytest.fixture
def golden() -> Callable[[str, str], None]:
    """Return a check that a text is, byte for byte, that of a file in ``golden/``."""

    def check(name: str, text: str) -> None:
        path = FOLDER / name
        if os.environ.get("NVSCOPE_UPDATE_GOLDEN"):
            path.write_bytes(text.encode())
        assert text == path.read_bytes().decode()

    return check
