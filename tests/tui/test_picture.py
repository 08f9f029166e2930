"""The picture in the README is one of this program."""

from __future__ import annotations

from tests.tui.picture import PICTURE, ROOT, drawn, texts_of


def test_the_picture_shows_what_the_screen_shows_now() -> None:
    kept = texts_of(PICTURE.read_text(encoding="utf-8"))
    assert kept == texts_of(drawn()), "run `python -m tests.tui.picture`"
    assert f"({PICTURE.relative_to(ROOT)})" in (ROOT / "README.md").read_text(encoding="utf-8")
