"""The line to type in: a filter or a command, with what is wrong with it while it is typed, and completion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.suggester import Suggester
from textual.widgets import Input

from nvscope.tui.actions import ACTIONS
from nvscope.tui.bars import Bar
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Tone

_MOST_KEPT = 100


class Prompt(Vertical):
    """A line to type in, which is there only while somebody types; ``:`` is a command, ``/`` a filter.

    Enter answers, Escape gives up; up and down bring back what was typed before.
    """

    DEFAULT_CSS = """
    Prompt { height: auto; display: none; }
    Prompt Input { border: none; height: 1; padding: 0; background: $foreground 10%; }
    Prompt Input:focus { border: none; }
    """

    class Answered(Message):
        """Somebody typed a line behind a mark."""

        def __init__(self, mark: str, text: str) -> None:
            super().__init__()
            self.mark, self.text = mark, text

    def __init__(self) -> None:
        super().__init__(id="prompt")
        self.mark = ""
        self._before: dict[str, list[str]] = {":": [], "/": []}
        self._place = 0

    def compose(self) -> ComposeResult:
        yield Bar(id="prompt-told")
        self._input = Input(id="prompt-input", select_on_focus=False, disabled=True)
        yield self._input

    @property
    def is_open(self) -> bool:
        return bool(self.mark)

    def open(self, mark: str, text: str) -> None:
        """Let somebody type; ``text`` is there already."""
        self.mark = mark
        self._place = len(self._before[mark])
        self._input.disabled = False
        self._input.suggester = _Suggester(self._known())
        self._input.value = text
        self.display = True
        self._input.focus()
        self._input.cursor_position = len(text)
        self._tell()

    def close(self) -> None:
        """Let nobody type any more."""
        self.mark = ""
        self._input.disabled = True
        self.display = False
        self.screen.set_focus(None)

    def _known(self) -> Sequence[str]:
        if self.mark == ":":
            return [action.name for action in ACTIONS]
        names: Sequence[str] = self.app.field_names()  # type: ignore[attr-defined]
        return names

    def on_input_changed(self) -> None:
        self._tell()

    def on_input_submitted(self, event: Any) -> None:
        event.stop()
        text, mark = self._input.value, self.mark
        if text.strip() and text not in self._before[mark][-1:]:
            self._before[mark] = [*self._before[mark], text][-_MOST_KEPT:]
        self.close()
        self.post_message(self.Answered(mark, text))

    def on_key(self, event: Any) -> None:
        if event.key == "escape":
            event.stop()
            self.close()
        elif event.key in ("up", "down"):
            event.stop()
            before = self._before[self.mark]
            self._place = min(max(self._place + (1 if event.key == "down" else -1), 0), len(before))
            self._input.value = before[self._place] if self._place < len(before) else ""
            self._input.cursor_position = len(self._input.value)
        elif event.key == "tab":
            event.stop()
            event.prevent_default()
            self._input.action_cursor_right()

    def _tell(self) -> None:
        """Tell what is wrong with the line so far, or what it would do."""
        bar, text = self.query_one("#prompt-told", Bar), self._input.value
        if self.mark == "/":
            problem = self.app.problem_with(text) if text.strip() else ""  # type: ignore[attr-defined]
            told = Cell(f" ✗ {visible(problem)}", Tone.ERROR) if problem else Cell(" ✓ a filter", Tone.GOOD)
            if not text.strip():
                told = Cell(" a filter such as nv.index == 7, as for -Y; an empty one is none", Tone.FAINT)
            bar.tell([told])
            return
        word = text.split(" ", 1)[0]
        found = [action for action in ACTIONS if action.name.startswith(word)] if word else []
        if len(found) == 1:
            bar.tell([Cell(f" {found[0].name} {found[0].takes}  ", Tone.STRONG), Cell(found[0].help, Tone.FAINT)])
        else:
            names = "  ".join(action.name for action in found) or "any action by its name; ? shows all"
            bar.tell([Cell(f" {names}", Tone.FAINT)])


class _Suggester(Suggester):
    """Completes the last word of a line."""

    def __init__(self, known: Sequence[str]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._known = sorted(known)

    async def get_suggestion(self, value: str) -> str | None:
        word = value[max(value.rfind(sign) for sign in " (!") + 1 :]
        if not word:
            return None
        found = next((name for name in self._known if name.startswith(word) and name != word), None)
        return None if found is None else value[: len(value) - len(word)] + found
