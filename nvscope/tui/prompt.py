"""The line to type in: a filter or a command, with what is wrong with it while it is typed, and completion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.suggester import Suggester
from textual.widgets import Input

from nvscope.errors import NvscopeError
from nvscope.tui.actions import ACTIONS
from nvscope.tui.bars import Bar
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Tone

_MOST_KEPT = 100
_TEXT_AND_CARETS = 2
_EDITS = {
    key: binding.action
    for binding in Input.BINDINGS if isinstance(binding, Binding) for key in binding.key.split(",")
}  # fmt: skip
"""What keys do in a line that type nothing."""


class Prompt(Vertical):
    """A line to type in, which is there only while somebody types; ``:`` is a command, ``/`` a filter.

    Enter answers, Escape gives up; up and down bring back what was typed before.
    """

    DEFAULT_CSS = """
    Prompt { height: auto; display: none; }
    Prompt Input { border: none; height: 1; padding: 0; background: $foreground 10%; }
    Prompt Input:focus { border: none; }
    """

    def __init__(self, answer: Callable[[str, str], None]) -> None:
        """``answer`` takes a mark and what was typed behind it."""
        super().__init__(id="prompt")
        self._answer = answer
        self.mark = ""
        self._before: dict[str, list[str]] = {":": [], "/": []}
        self._place = 0

    def compose(self) -> ComposeResult:
        yield Bar(id="prompt-told")
        self._input = Input(id="prompt-input", select_on_focus=False, disabled=True)
        yield self._input
        self._carets = Bar(id="prompt-carets")
        yield self._carets

    @property
    def is_open(self) -> bool:
        return bool(self.mark)

    def open(self, mark: str, text: str) -> None:
        """Let somebody type; ``text`` is there already."""
        self.mark = mark
        self._place = len(self._before[mark])
        self._input.disabled = False
        self._input.suggester = _Suggester(self._completed)
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

    def _completed(self, text: str) -> Sequence[str]:
        """Return what a line could go on to."""
        if self.mark == ":":
            return [action.name for action in ACTIONS if text and action.name.startswith(text)]
        found: Sequence[str] = self.app.find.completed(text)  # type: ignore[attr-defined]
        return found

    def on_input_changed(self) -> None:
        self._tell()

    async def press(self, key: events.Key) -> bool:
        """Take a key; False where it is not open."""
        if not self.is_open:
            return False
        if key.key == "enter":
            self._submit()
        elif key.key == "escape":
            self.close()
        elif key.key in ("up", "down"):
            before = self._before[self.mark]
            self._place = min(max(self._place + (1 if key.key == "down" else -1), 0), len(before))
            self._input.value = before[self._place] if self._place < len(before) else ""
            self._input.cursor_position = len(self._input.value)
        elif key.key == "tab":
            self._input.action_cursor_right()
        elif key.is_printable and key.character is not None:
            self._type(key.character)
        elif (action := _EDITS.get(key.key)) is not None:
            await self._input.run_action(action)
        return True

    def paste(self, text: str) -> bool:
        """Take the first line of a text; False where it is not open."""
        if self.is_open:
            self._type(text.partition("\n")[0].rstrip("\r"))
        return self.is_open

    def _type(self, text: str) -> None:
        self._input.replace(text, *self._input.selection)

    def _submit(self) -> None:
        text, mark = self._input.value, self.mark
        if text.strip() and text not in self._before[mark][-1:]:
            self._before[mark] = [*self._before[mark], text][-_MOST_KEPT:]
        self.close()
        self._answer(mark, text)

    def _tell(self) -> None:
        """Tell what is wrong with the line so far, or what it would do."""
        bar, text = self.query_one("#prompt-told", Bar), self._input.value
        if self.mark == "/":
            problem: NvscopeError | None = self.app.find.problem_with(text) if text.strip() else None  # type: ignore[attr-defined]
            if not text.strip():
                bar.tell([Cell(" a filter such as nv.index == 7, as for -Y; an empty one is none", Tone.FAINT)])
            elif problem is None:
                bar.tell([Cell(" ✓ a filter", Tone.GOOD)])
            else:
                hint = f"; {visible(problem.next_step)}" if problem.next_step else ""
                bar.tell([Cell(f" ✗ {visible(problem.what)}", Tone.ERROR), Cell(hint, Tone.FAINT)])
            self._mark(problem, text)
            return
        self._mark(None, text)
        word = text.split(" ", 1)[0]
        found = [action for action in ACTIONS if action.name.startswith(word)] if word else []
        if len(found) == 1:
            bar.tell([Cell(f" {found[0].name} {found[0].takes}  ", Tone.STRONG), Cell(found[0].help, Tone.FAINT)])
        else:
            names = "  ".join(action.name for action in found) or "any action by its name; ? shows all"
            bar.tell([Cell(f" {names}", Tone.FAINT)])

    def _mark(self, problem: NvscopeError | None, text: str) -> None:
        """Show carets beneath what is wrong with the line, where all of it is seen."""
        shown = problem.excerpt if problem is not None else ()
        fits = len(shown) == _TEXT_AND_CARETS and shown[0] == text and len(text) < self.size.width
        self._carets.display = fits
        if fits:
            self._carets.tell([Cell(shown[1], Tone.ERROR)])


class _Suggester(Suggester):
    """Completes a line, by what is ``completed`` of it."""

    def __init__(self, completed: Callable[[str], Sequence[str]]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._completed = completed

    async def get_suggestion(self, value: str) -> str | None:
        if not value or value[-1] in " (!":
            found = [text for text in self._completed(value) if text.endswith('"')]  # the texts of a field
        else:
            found = [text for text in self._completed(value) if text != value]
        return min((text for text in found if text.startswith(value)), default=None)
