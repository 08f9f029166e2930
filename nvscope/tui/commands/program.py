"""The program itself: back, end, stop as a shell does, count anew, help, explanations, copy."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from nvscope.tui.help_page import key_lines
from nvscope.view.escape import visible
from nvscope.view.lines.plant.explain_finding import explained

if TYPE_CHECKING:
    from nvscope.tui.app import WatchApp
    from nvscope.tui.views.view import View

_NARROWEST = 40


class ProgramCommands:
    """The actions that are about the program."""

    def __init__(self, app: WatchApp) -> None:
        self._app = app
        self._before_page: View | None = None  # where help or an explanation was asked for

    @property
    def does(self) -> Mapping[str, Callable[[str], None]]:
        """What is done for each action, with what stands behind its name."""
        return {
            "program.back": self._go_back_or_end,
            "program.close": self._close,
            "program.quit": lambda _: self._app.exit(),
            "program.reset": self._count_anew,
            "program.suspend": self._rest,
            "program.help": self._show_help,
            "show.copy": self._copy_row,
        }

    def explain(self, name: str) -> None:
        """Show what a cause or a finding of a name or code means."""
        lines = explained(name, self._width)
        if lines:
            self._leave_for_page()
            self._app.show_page(lines)
        else:
            self._app.notify(f"{visible(name)}: no cause or finding is called so", severity="warning")

    @property
    def _width(self) -> int:
        return max(self._app.size.width - 2, _NARROWEST)

    def _leave_for_page(self) -> None:
        self._before_page = self._app.front or self._before_page

    def _close(self, _: str) -> None:
        self._go_back()

    def _go_back(self) -> bool:
        """Leave a page, what is open in a view, or a view; return whether there was one."""
        app, front = self._app, self._app.front
        if front is None:
            app.to_front(self._before_page or app.views[0])
        elif not front.act("program.back"):
            if front is app.views[0]:
                return False
            app.to_front(app.views[0])
        return True

    def _go_back_or_end(self, _: str) -> None:
        recording = self._app.recording
        if self._go_back():
            return
        if recording is not None and recording.is_on:
            key = self._app.keymap.key_of("program.quit")
            self._app.notify(f"Recording to {visible(recording.path)}: {key} ends it and the screen", timeout=6)
        else:
            self._app.exit()

    def _count_anew(self, _: str) -> None:
        if not self._app.feed.is_live or self._app.feed.player is not None:
            told = "" if self._app.feed.player is not None else "; --from-time cuts it"
            self._app.notify(f"A capture is counted from its beginning{told}", timeout=3)
            return
        self._app.feed.reset()
        self._app.notify("Counted from now on", timeout=2)

    def _rest(self, _: str) -> None:
        """Stop as Ctrl-Z stops other programs, until a shell says go on."""
        driver = self._app._driver  # there is no other way to know
        if driver is None or not driver.can_suspend:
            return
        if os.getsid(os.getppid()) != os.getsid(0):
            self._app.notify("There is no shell to come back from", severity="warning", timeout=3)
            return
        # All of the job stop, or its shell waits for those that do not: tcpdump in front of it, a script around it.
        before = signal.signal(signal.SIGTSTP, signal.SIG_IGN)
        os.kill(0, signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, before)
        self._app.action_suspend_process()

    def _show_help(self, _: str) -> None:
        self._leave_for_page()
        self._app.show_page(list(key_lines(self._app.keymap, self._width)))

    def _copy_row(self, _: str) -> None:
        front = self._app.front
        text = front.copied() if front is not None else ""
        if text:
            self._app.copy_to_clipboard(text)
            self._app.notify("Copied", timeout=1)
