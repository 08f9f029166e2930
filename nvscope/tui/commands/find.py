"""The filter of the screen: what it chooses is looked up in the ring by a thread, and told to all views."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace

from nvscope.analysis.recent_frames import FoundFrames, Wanted
from nvscope.errors import NvscopeError
from nvscope.tui.look import Choice
from nvscope.tui.prompt import Prompt
from nvscope.tui.scanner import Scanner
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.escape import visible
from nvscope.view.fields.completion import completions

if TYPE_CHECKING:
    from nvscope.tui.app import WatchApp


class FindCommands:
    """The actions of the filter; ``choice`` is the one in force, None without one, ``found`` what it chooses."""

    def __init__(self, app: WatchApp, expression: str | None) -> None:
        self._app = app
        self.choice = Choice(expression) if expression else None
        self.found: FoundFrames | None = None
        self._scanner = Scanner(
            lambda found: app.call_from_thread(self._take, found),
            lambda wanted, error: app.call_from_thread(self._refuse, wanted, error),
            lambda failure: app.call_from_thread(app.end, failure),
        )

    @property
    def does(self) -> Mapping[str, Callable[[str], None]]:
        """What is done for each action, with what stands behind its name."""
        return {"find.filter": self._ask, "find.suspend": self._suspend}

    @property
    def state(self) -> str:
        """What is said of the filter, "" without one."""
        if self.choice is None:
            return ""
        return f"/{visible(self.choice.expression)}{' (off)' if self.choice.suspended else ''}"

    def scan(self, *, sparingly: bool) -> bool:
        """Have the frames of what is shown looked at, where somebody wants to know; tell whether that is so."""
        look, front = self._app.look, self._app.front
        shows_frames = front is not None and front.shows_frames
        if look is not None and (self.choice is not None or shows_frames):
            expression = self.choice.expression if self.choice else None
            wanted = Wanted(expression, front.list_key if front is not None and shows_frames else None)
            self._scanner.look_at(look.scene, wanted, sparingly=sparingly)
            return True
        return False

    def stop(self) -> None:
        """Look at nothing any more."""
        self._scanner.stop()

    def _take(self, found: FoundFrames) -> None:
        """Take which frames are to be shown."""
        self.found = found
        if self.choice is not None and found.is_whole and found.wanted.expression == self.choice.expression:
            self.choice = replace(self.choice, lists=found.lists)
        self._app.take_found()

    def _refuse(self, wanted: Wanted, error: NvscopeError) -> None:
        """Take that a filter cannot be used."""
        self._app.notify(visible(error.what), severity="warning")
        if self.choice is not None and self.choice.expression == wanted.expression:
            self.choice = None
            self._app.again()

    def _ask(self, told: str) -> None:
        if told:
            self.use(told)
        else:
            self._app.query_one(Prompt).open("/", self.choice.expression if self.choice else "")

    def _suspend(self, _: str) -> None:
        if self.choice is None:
            self._app.notify("There is no filter", timeout=2)
            return
        self.choice = replace(self.choice, suspended=not self.choice.suspended)
        self._app.again()

    def use(self, expression: str) -> None:
        """Use a filter; an empty one is none."""
        if not expression.strip():
            self.choice = None
        else:
            problem = self.problem_with(expression)
            if problem is not None:
                self._app.notify(visible(problem.what), severity="warning")
                return
            self.choice = Choice(expression)
        self._app.again()

    def problem_with(self, expression: str) -> NvscopeError | None:
        """Return what is wrong with a filter, None where nothing is."""
        if self._app.scene is not None:
            try:
                DisplayFilter(expression, self._app.scene.inquiry.fields)
            except NvscopeError as error:
                return error
        return None

    def completed(self, expression: str) -> Sequence[str]:
        """Return what a filter could go on to."""
        scene = self._app.scene
        return [] if scene is None else completions(expression, scene.inquiry.fields)
