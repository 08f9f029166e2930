"""Marks: a letter for a row of a view, to come back to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nvscope.tui.app import WatchApp

_SET, _FIND = "find.mark", "find.go-to-mark"


class MarkCommands:
    """The actions of marks; without a letter behind them, the next key is one."""

    def __init__(self, app: WatchApp) -> None:
        self._app = app
        self._marks: dict[str, tuple[str, Any]] = {}
        self._waiting_for = ""

    @property
    def does(self) -> Mapping[str, Callable[[str], None]]:
        """What is done for each action, with what stands behind its name."""
        return {name: lambda told, name=name: self._do(name, told) for name in (_SET, _FIND)}  # type: ignore[misc]

    def takes(self, character: str | None) -> bool:
        """Take a key as the letter that is waited for; False where none is."""
        if not self._waiting_for:
            return False
        action, self._waiting_for = self._waiting_for, ""
        self._do(action, character or " ")
        return True

    def _do(self, action: str, letter: str) -> None:
        front = self._app.front
        if not letter:
            self._waiting_for = action
            self._app.notify("Which letter?", timeout=2)
        elif front is None or len(letter) != 1 or not letter.isalnum():
            return
        elif action == _SET:
            if (place := front.place()) is not None:
                self._marks[letter] = (front.action, place)
                self._app.notify(f"Mark {letter}", timeout=1)
        else:
            self._find(letter)

    def _find(self, letter: str) -> None:
        if letter not in self._marks:
            self._app.notify(f"There is no mark {letter}", severity="warning", timeout=2)
            return
        name, place = self._marks[letter]
        self._app.act(name)
        front = self._app.front
        if front is not None and not front.go_to(place):
            self._app.notify(f"What mark {letter} was on is gone", severity="warning", timeout=2)
        else:
            self._app.notify(f"At mark {letter}", timeout=1)
