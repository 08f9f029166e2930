"""``python -m tests.tui.picture``: draw the picture of the screen that the README shows.

It is Textual's own export of the screen over a capture of the repository, so that it shows what the program does.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from tests.tui.screen import Screen, on_screen

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / ".github" / "watch.svg"
_SIZE = 104, 30
_CAPTURE = "captures/plant.pcapng.gz"
_UNIQUE = re.compile(r"terminal-\d+-")
_TEXT = re.compile(r"<text[^>]*>(.*?)</text>")


def drawn() -> str:
    """Return the picture as SVG; what Textual numbers anew each time has one number."""
    found: list[str] = []

    async def look(screen: Screen) -> None:
        found.append(screen.app.export_screenshot(title="nvscope watch"))

    before = Path.cwd()
    os.chdir(ROOT)
    try:
        on_screen(Inquiry([_CAPTURE]), look, size=_SIZE)
    finally:
        os.chdir(before)
    return _UNIQUE.sub("terminal-", found[0])


def texts_of(picture: str) -> list[str]:
    """Return what is written in a picture, in its order."""
    return _TEXT.findall(picture)


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
    print(f"{PICTURE.relative_to(ROOT)}: {PICTURE.stat().st_size} bytes")
