"""The screen: views in front of each other, a line to type in, and what keys do that all views share."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from textual.app import App, ComposeResult
from textual.containers import Vertical
from textual.theme import BUILTIN_THEMES
from textual.widgets import ContentSwitcher

from nvscope import units
from nvscope.analysis.recent_frames import FoundFrames, Wanted
from nvscope.analysis.watching import Scene
from nvscope.errors import NvscopeError
from nvscope.tui.actions import BY_NAME, Keymap, matching
from nvscope.tui.bars import Bar, Tabs, foot, head
from nvscope.tui.feed import Feed
from nvscope.tui.help_page import key_lines
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Choice, Look
from nvscope.tui.painting import PALETTES
from nvscope.tui.prompt import Prompt
from nvscope.tui.recording import Recorder, Recording
from nvscope.tui.scanner import Scanner
from nvscope.tui.views.can import CanView
from nvscope.tui.views.causes import CausesView
from nvscope.tui.views.lists import ListsView
from nvscope.tui.views.nodes import NodesView
from nvscope.tui.views.packets import PacketsView
from nvscope.tui.views.source import SourceView
from nvscope.tui.views.variables import VariablesView
from nvscope.tui.views.view import View
from nvscope.view.escape import visible
from nvscope.view.fields.completion import completions
from nvscope.view.lines.table import Cell, Tone

_DRAW_S = 0.1
"""The screen is drawn ten times a second at most."""

_FILE_STEPS = 40
_LIVE_STEP_NS = 5_000_000_000
_ANSI = "ansi-dark" if "ansi-dark" in BUILTIN_THEMES else "textual-ansi"  # Textual has renamed it
_THEMES = {"dark": "textual-dark", "light": "textual-light", "ansi": _ANSI, "mono": _ANSI}
_HELP = "help"


class WatchApp(App[None], inherit_bindings=False):
    """Shows the scenes of a feed, and does what keys and the command line ask for.

    ``keymap`` says which key does what; ``expression`` is a filter to begin with; ``recorder`` writes what comes.
    """

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { layout: vertical; }
    #views { height: 1fr; }
    #head { background: $foreground 10%; }
    #foot { background: $foreground 10%; }
    """

    def __init__(
        self, feed: Feed, keymap: Keymap, *, recorder: Recorder, expression: str | None = None,
        theme: str = "dark", utc: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(ansi_color=theme in ("ansi", "mono"))
        self.feed, self.keymap = feed, keymap
        self._recorder = recorder
        self._recorded: str = ""  # of which failure was told
        self._utc = utc
        self._first_theme = theme
        self._palette = theme
        self._scene: Scene | None = None  # the newest one
        self._look: Look | None = None  # what is shown
        self._choice = Choice(expression) if expression else None
        self._frozen = False
        self._frozen_s = 0.0
        self._at_ns: int | None = None
        self._marks: dict[str, tuple[str, Any]] = {}
        self._waiting_for = ""  # an action that takes the next key
        self._ended = False
        self._drawn_s = 0.0
        self.draws = 0
        """How often the screen was drawn so far."""
        self._draw_due = False
        self.error: BaseException | None = None
        self.ended_by = 0
        """The signal that ended it, 0 for none."""
        self.views: Sequence[View] = make_views()
        self._found: FoundFrames | None = None
        self._scanner = Scanner(
            lambda found: self.call_from_thread(self._take_found, found),
            lambda wanted, error: self.call_from_thread(self._refuse, wanted, error),
            lambda failure: self.call_from_thread(self._end, failure),
        )

    def on_unmount(self) -> None:
        self._scanner.stop()

    def compose(self) -> ComposeResult:
        yield Bar(id="head")
        yield Tabs([view.title for view in self.views])
        with ContentSwitcher(initial=self.views[0].id, id="views"):
            yield from self.views
            with Vertical(id=_HELP):
                yield LinesView(id="help-lines")
        yield Prompt()
        yield Bar(id="foot")

    def on_mount(self) -> None:
        self._paint(self._first_theme)
        self.query_one(Tabs).front(0)
        self._tell_bars()
        self.feed.start(
            lambda scene: self.call_from_thread(self._take, scene),
            lambda error: self.call_from_thread(self._end, error),
        )

        self._end_in_order()

    def _end_in_order(self) -> None:
        """End as a person ends it where the system asks for that, so that the terminal and files are whole."""
        loop = asyncio.get_running_loop()
        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
                    loop.add_signal_handler(number, self._end_by, int(number))

    def _end_by(self, number: int) -> None:
        self.ended_by = number
        self.exit()

    # What comes from the feed.

    def _take(self, scene: Scene) -> None:
        """Take the newest scene."""
        self._scene = scene
        if not self._frozen and self._at_ns is None:
            self._draw()

    def _past_came(self, scene: Scene) -> None:
        """Take the scene of a moment from whichever thread: what is kept comes at once."""
        if threading.get_ident() == self._thread_id:
            self._take_past(scene)
        else:
            self.call_from_thread(self._take_past, scene)

    def _take_past(self, scene: Scene) -> None:
        """Take the scene of a moment that was asked for."""
        if self._at_ns is not None:
            self._show(scene)

    def _end(self, error: BaseException | None) -> None:
        """Take that nothing follows any more."""
        self._ended = True
        if error is not None:
            self.error = error
            self.exit()
            return
        for info in self._scene.snapshot.infos if self._scene else ():
            if info.failure:
                self.notify(f"{visible(info.path)}: {visible(info.failure)}", severity="error", timeout=60)
        self._tell_bars()

    def _draw(self) -> None:
        """Show the newest scene, now or as soon as the last drawing is a tenth of a second old."""
        left_s = self._drawn_s + _DRAW_S - time.monotonic()
        if left_s <= 0:
            self._draw_due = False
            if self._scene is not None:
                self._show(self._scene)
        elif not self._draw_due:
            self._draw_due = True
            self.set_timer(left_s, self._draw)

    def _show(self, scene: Scene) -> None:
        self._drawn_s = time.monotonic()
        self.draws += 1
        self._look = Look.of(
            scene, utc=self._utc, choice=self._choice, live=self.feed.is_live, at_ns=self._at_ns, frozen=self._frozen,
            found=self._found,
        )  # fmt: skip
        self._scan()
        front = self.front
        if front is not None:
            front.show(self._look)
        self._tell_bars()

    def _scan(self) -> None:
        """Have the frames of what is shown looked at, where somebody wants to know."""
        look, front = self._look, self.front
        shows_frames = front is not None and front.shows_frames
        if look is not None and (self._choice is not None or shows_frames):
            expression = self._choice.expression if self._choice else None
            wanted = Wanted(expression, front.list_key if front is not None and shows_frames else None)
            self._scanner.look_at(look.scene, wanted, sparingly=not self._ended)

    def _take_found(self, found: FoundFrames) -> None:
        """Take which frames are to be shown."""
        self._found = found
        if self._choice is not None and found.is_whole and found.wanted.expression == self._choice.expression:
            self._choice = replace(self._choice, lists=found.lists)
        if self._look is not None:
            self._look = replace(self._look, found=found, choice=self._choice)
            if self.front is not None:
                self.front.show(self._look)

    def _refuse(self, wanted: Wanted, error: NvscopeError) -> None:
        """Take that a filter cannot be used."""
        self.notify(visible(error.what), severity="warning")
        if self._choice is not None and self._choice.expression == wanted.expression:
            self._choice = None
            self._again()

    def on_view_changed(self) -> None:
        self._again()

    def _tell_bars(self) -> None:
        top, bottom = self.query_one("#head", Bar), self.query_one("#foot", Bar)
        if self._look is not None:
            top.tell(*head(self._look, self._state, self.size.width))
        else:
            top.tell([Cell(" nvscope ", Tone.STRONG), Cell("waiting for the first look …", Tone.FAINT)])
        front = self.front
        state = [Cell(f"{self._state_below} ", Tone.FAINT)]
        bottom.tell(*foot(self.keymap, front.hints() if front else (), state))

    @property
    def _state(self) -> str:
        if self._at_ns is not None:
            return "past"
        if self._frozen:
            return f"frozen {time.monotonic() - self._frozen_s:.0f} s"
        return "ended" if self._ended and self.feed.is_live else ""

    @property
    def _state_below(self) -> str:
        parts = []
        if self._choice is not None:
            off = " (off)" if self._choice.suspended else ""
            parts.append(f"/{visible(self._choice.expression)}{off}")
        if recording := self._look_at_recording():
            parts.append(recording)
        parts.append(self._state or ("live" if self.feed.is_live else "end of capture"))
        return "   ".join(parts)

    @property
    def recording(self) -> Recording | None:
        """What is recorded, or was; None where nothing was."""
        return self._recorder.state

    @property
    def look(self) -> Look | None:
        """What is shown."""
        return self._look

    @property
    def front(self) -> View | None:
        """The view in front, None where that is the help."""
        current = self.query_one("#views", ContentSwitcher).current
        return next((view for view in self.views if view.id == current), None)

    # What keys and the command line ask for.

    def on_key(self, event: Any) -> None:
        if self.query_one(Prompt).is_open:
            return
        if self._waiting_for:
            action, self._waiting_for = self._waiting_for, ""
            event.stop()
            self._mark(action, event.character or "")
            return
        name = self.keymap.action_of(event.key, event.character)
        if name is not None:
            event.stop()
            event.prevent_default()
            self.act(name)

    def on_view_asked(self, message: View.Asked) -> None:
        self.act(message.action, message.told)

    def act(self, name: str, told: str = "") -> None:
        """Do what an action says, with what stands behind its name on the command line."""
        front = self.front
        if name.startswith("view.") and any(view.action == name for view in self.views):
            self._to_front(next(view for view in self.views if view.action == name), told)
        elif (own := getattr(self, f"_do_{name.replace('.', '_').replace('-', '_')}", None)) is not None:
            own(told)
        elif front is None:
            self.query_one("#help-lines", LinesView).move(name)
        elif not front.act(name, told):
            self.notify(f"{name} does nothing in {front.title}", severity="warning", timeout=2)
        self._tell_bars()

    def _to_front(self, view: View, told: str = "") -> None:
        self.query_one("#views", ContentSwitcher).current = view.id
        self.query_one(Tabs).front(self.views.index(view))
        if told:
            view.restrict(told)
        self._scan()
        if self._look is not None:
            view.show(self._look)

    def _do_program_back(self, _: str) -> None:
        front = self.front
        if front is None:
            self._to_front(self.views[0])
        elif front.act("program.back"):
            pass
        elif front is not self.views[0]:
            self._to_front(self.views[0])
        else:
            self.exit()

    def _do_program_quit(self, _: str) -> None:
        self.exit()

    def _do_program_reset(self, _: str) -> None:
        if not self.feed.is_live:
            self.notify("A capture is counted from its beginning; --from-time cuts it", timeout=3)
            return
        self.feed.reset()
        self.notify("Counted from now on", timeout=2)

    def _do_program_suspend(self, _: str) -> None:
        self.action_suspend_process()

    def _do_program_help(self, _: str) -> None:
        lines = list(key_lines(self.keymap, max(self.size.width - 2, 40)))
        self.query_one("#help-lines", LinesView).show(lines)
        self.query_one("#views", ContentSwitcher).current = _HELP
        self.query_one(Tabs).front(-1)

    def _do_program_command(self, _: str) -> None:
        self.query_one(Prompt).open(":", "")

    def _do_find_filter(self, told: str) -> None:
        if told:
            self._filter(told)
        else:
            self.query_one(Prompt).open("/", self._choice.expression if self._choice else "")

    def _do_find_suspend(self, _: str) -> None:
        if self._choice is None:
            self.notify("There is no filter", timeout=2)
            return
        self._choice = replace(self._choice, suspended=not self._choice.suspended)
        self._again()

    def _do_find_mark(self, told: str) -> None:
        self._mark("find.mark", told) if told else self._wait_for("find.mark")

    def _do_find_go_to_mark(self, told: str) -> None:
        self._mark("find.go-to-mark", told) if told else self._wait_for("find.go-to-mark")

    def _do_show_theme(self, told: str) -> None:
        names = list(PALETTES)
        if told and told not in names:
            self.notify(f"There are: {', '.join(names)}", severity="warning")
            return
        self._paint(told or names[(names.index(self._palette) + 1) % len(names)])

    def _do_show_copy(self, _: str) -> None:
        front = self.front
        text = front.copied() if front is not None else ""
        if text:
            self.copy_to_clipboard(text)
            self.notify("Copied", timeout=1)

    def _do_time_freeze(self, _: str) -> None:
        self._frozen = not self._frozen
        self._frozen_s = time.monotonic()
        if not self._frozen and self._at_ns is None:
            self._draw()

    def _do_time_follow(self, _: str) -> None:
        self._frozen, self._at_ns = False, None
        if self.front is not None:
            self.front.act("time.follow")
        self._draw()

    def _do_time_back(self, _: str) -> None:
        self._step(-1)

    def _do_time_forward(self, _: str) -> None:
        self._step(1)

    def _do_time_previous_finding(self, _: str) -> None:
        self._to_cause(-1)

    def _do_time_next_finding(self, _: str) -> None:
        self._to_cause(1)

    def _do_time_go_to_ns(self, told: str) -> None:
        self._go(int(told))

    def _do_time_go(self, told: str) -> None:
        from nvscope.view.asked_time import Reference, parse_time  # noqa: PLC0415

        span = self.feed.span()
        if not told or span is None:
            self.query_one(Prompt).open(":", "time.go ")
            return
        try:
            asked = parse_time("time.go", told, utc=self._utc, frames=False)
        except NvscopeError as error:
            self.notify(f"{error.what}. {error.next_step}", severity="warning")
            return
        assert asked.reference is not Reference.FRAME
        self._go(asked.absolute_ns(span.start_ns, span.end_ns, utc=self._utc))

    def _step(self, direction: int) -> None:
        span, look = self.feed.span(), self._look
        if span is None or look is None:
            return
        step_ns = _LIVE_STEP_NS if self.feed.is_live else max((span.end_ns - span.start_ns) // _FILE_STEPS, 1)
        now_ns = look.now_ns if self._at_ns is None else self._at_ns
        self._go(now_ns + direction * step_ns)

    def _to_cause(self, direction: int) -> None:
        """Go to when the cause before or behind the moment that is shown began."""
        scene, look = self._scene, self._look
        if scene is None or look is None or scene.snapshot.happened is None:
            return
        now_ns = look.now_ns if self._at_ns is None else self._at_ns
        begun = sorted({cause.since_ns for cause in scene.snapshot.happened.causes if cause.since_ns is not None})
        found = [time_ns for time_ns in begun if (time_ns > now_ns if direction > 0 else time_ns < now_ns)]
        if not found:
            self.notify("No cause began " + ("later" if direction > 0 else "before"), timeout=2)
            return
        self._go(found[0] if direction > 0 else found[-1])

    def _go(self, time_ns: int) -> None:
        """Show a moment; behind the last one, that is what is now."""
        span = self.feed.span()
        if span is None:
            return
        if time_ns >= span.end_ns:
            self._do_time_follow("")
            return
        self._frozen = False
        self._at_ns = max(time_ns, span.start_ns)
        self.feed.at(self._at_ns, self._past_came)

    def _do_record_toggle(self, told: str) -> None:
        recorder = self._recorder
        if not self.feed.is_live:
            self.notify("A capture is a recording already", timeout=3)
            return
        state = recorder.state
        try:
            if state is not None and state.is_on:
                state = recorder.stop()
                assert state is not None
                self.notify(f"{units.count_of(state.frames, 'frame')} in {visible(state.path)}", timeout=6)
            else:
                path = told or time.strftime("nvscope-%Y%m%d-%H%M%S.pcapng")
                recorder.start(path)
                self.notify(f"Recording to {visible(path)}", timeout=4)
        except NvscopeError as error:
            self._complain(error)

    def _do_record_save(self, told: str) -> None:
        scene = self._look.scene if self._look else None
        if not told:
            self.query_one(Prompt).open(":", "record.save ")
        elif scene is not None:
            try:
                frames = self._recorder.save(told, scene.frames(), scene.channels)
            except NvscopeError as error:
                self._complain(error)
                return
            self.notify(f"{units.count_of(frames, 'frame')} in {visible(told)}", timeout=6)

    def _complain(self, error: NvscopeError) -> None:
        where = f"{error.where}: " if error.where else ""
        self.notify(visible(f"{where}{error.what}. {error.next_step}"), severity="error", timeout=10)

    def _look_at_recording(self) -> str:
        """Return what is said of a recording; its failure is told once, and stays."""
        state = self._recorder.state
        if state is None:
            return ""
        if state.failure and self._recorded != state.path:
            self._recorded = state.path
            told = f"{state.path}: {state.failure}. It ends with frame {units.count(state.frames)}."
            self.notify(visible(told), severity="error", timeout=60)
        if state.is_on:
            return f"R {units.data_size(state.bytes)}"
        return "R failed" if state.failure else ""

    def _wait_for(self, action: str) -> None:
        self._waiting_for = action
        self.notify("Which letter?", timeout=2)

    def _mark(self, action: str, letter: str) -> None:
        front = self.front
        if front is None or len(letter) != 1 or not letter.isalnum():
            return
        if action == "find.mark":
            if (place := front.place()) is not None:
                self._marks[letter] = (front.action, place)
                self.notify(f"Mark {letter}", timeout=1)
            return
        if letter not in self._marks:
            self.notify(f"There is no mark {letter}", severity="warning", timeout=2)
            return
        name, place = self._marks[letter]
        self.act(name)
        front = self.front
        if front is not None and not front.go_to(place):
            self.notify(f"What mark {letter} was on is gone", severity="warning", timeout=2)

    def _filter(self, expression: str) -> None:
        """Use a filter; an empty one is none."""
        if not expression.strip():
            self._choice = None
        else:
            problem = self.problem_with(expression)
            if problem is not None:
                self.notify(visible(problem.what), severity="warning")
                return
            self._choice = Choice(expression)
        self._again()

    def problem_with(self, expression: str) -> NvscopeError | None:
        """Return what is wrong with a filter, None where nothing is."""
        if self._scene is not None:
            try:
                self._scene.inquiry.check_filter(expression)
            except NvscopeError as error:
                return error
        return None

    def completed(self, expression: str) -> Sequence[str]:
        """Return what a filter could go on to."""
        return [] if self._scene is None else completions(expression, self._scene.inquiry.fields)

    def on_prompt_answered(self, message: Prompt.Answered) -> None:
        if message.mark == "/":
            self._filter(message.text)
        elif message.text.strip():
            self._command(message.text.strip())
        self._tell_bars()

    def _command(self, text: str) -> None:
        word, _, told = text.partition(" ")
        found = [BY_NAME[word]] if word in BY_NAME else list(matching(text))
        if len(found) != 1:
            names = ", ".join(action.name for action in found[:6])
            self.notify(f"{visible(word)}: {names or 'no action has this name'}", severity="warning")
            return
        self.act(found[0].name, told.strip())

    def _again(self) -> None:
        """Show the same once more, since how it is shown has changed."""
        if self._look is not None:
            self._show(self._look.scene)

    def _paint(self, name: str) -> None:
        self._palette = name
        self.theme = _THEMES[name]
        palette = PALETTES[name]
        for widget in self.query("*"):
            if hasattr(widget, "palette"):
                widget.palette = palette
                widget.refresh()


def make_views() -> list[View]:
    """Return the views, in the order of their numbers."""
    return [
        ListsView(), CausesView(), VariablesView(), PacketsView(), NodesView(), CanView(), SourceView(),
    ]  # fmt: skip
