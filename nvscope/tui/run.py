"""Runs the screen, and gives the terminal back as it was, whatever happens."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Watching
from nvscope.capture.source import SourceInfo
from nvscope.errors import UsageError
from nvscope.tui.actions import Keymap
from nvscope.view.display_filter import DisplayFilter

if TYPE_CHECKING:
    from typing import Literal

    from nvscope.capture.player import Player
    from nvscope.tui.recording import Recorder


class Left(NamedTuple):
    """What is known when the screen has ended: of the sources, and by which signal, 0 for none."""

    infos: Sequence[SourceInfo]
    signal: int


def run_screen(
    inquiry: Inquiry, how: Watching, recorder: Recorder, *, expression: str | None = None, theme: str | None = None,
    utc: bool = False, colour: Literal["auto", "always", "never"] = "auto", player: Player | None = None,
) -> Left:  # fmt: skip
    """Show the screen until somebody ends it; return what is known then.

    ``recorder`` is one of the observers of ``how``, where the source is live. ``player`` plays it, where it is a
    capture that is to be played. Raises ConfigurationError for keys of the project that cannot be, UsageError for a
    theme that there is not and a filter that cannot be understood, and what reading the source raises.
    """
    project = inquiry.project
    if expression is not None:
        DisplayFilter(expression, inquiry.fields)
    keymap = Keymap(project.keys, str(project.path or ""))
    if theme is not None:
        from nvscope.tui.painting import PALETTES  # noqa: PLC0415  not for a wrong key

        if theme not in PALETTES:
            known = ", ".join(PALETTES)
            raise UsageError(f"--theme {theme[:40]}: there is no such theme", next_step=f"there are {known}")
    from nvscope.tui.app import WatchApp  # noqa: PLC0415  not for a wrong key
    from nvscope.tui.feed import Feed, SessionFeed  # noqa: PLC0415
    from nvscope.tui.last_resort import LastResort  # noqa: PLC0415
    from nvscope.tui.replay.feed import ReplayFeed  # noqa: PLC0415

    feed: Feed = SessionFeed(inquiry, how) if player is None else ReplayFeed(inquiry, how, player)
    last_resort = LastResort(recorder.stop)
    app = WatchApp(
        feed, keymap, recorder=recorder, expression=expression, theme=theme or _theme(colour), utc=utc,
        last_resort=last_resort,
    )  # fmt: skip
    # Textual draws on stderr, which may go to a file; that stdout is a terminal was looked at.
    errors, sys.__stderr__ = sys.__stderr__, sys.__stdout__  # type: ignore[misc]
    try:
        app.run()
    finally:
        sys.__stderr__ = errors  # type: ignore[misc]
        infos = feed.stop()
        recorder.stop()
        last_resort.over()
    if app.error is not None:
        raise app.error
    return Left(infos, app.ended_by)


def _theme(colour: str) -> str:
    """Return the theme that fits a terminal: its own sixteen colours where it may have no more, none where asked."""
    if colour == "never" or (colour == "auto" and os.environ.get("NO_COLOR")):
        return "mono"
    many = os.environ.get("COLORTERM") in ("truecolor", "24bit") or "256" in os.environ.get("TERM", "")
    return "dark" if many else "ansi"
