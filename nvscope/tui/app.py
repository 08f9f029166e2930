"""The screen: views in front of each other, a line to type in, and what keys do that all views share."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Mapping, Sequence

from msgspec.structs import replace
from textual import events
from textual.app import App, ComposeResult
from textual.containers import Vertical
from textual.theme import BUILTIN_THEMES
from textual.widgets import ContentSwitcher

from nvscope.analysis.watching import Scene
from nvscope.errors import NvscopeError
from nvscope.tui.actions import BY_NAME, Keymap, matching
from nvscope.tui.bars import Bar, Tabs, foot, head
from nvscope.tui.commands.find import FindCommands
from nvscope.tui.commands.marks import MarkCommands
from nvscope.tui.commands.play import PlayCommands
from nvscope.tui.commands.program import ProgramCommands
from nvscope.tui.commands.record import RecordCommands
from nvscope.tui.commands.time import TimeCommands
from nvscope.tui.feed import Feed
from nvscope.tui.last_resort import LastResort
from nvscope.tui.lines_view import LinesView
from nvscope.tui.look import Look
from nvscope.tui.painting import PALETTES
from nvscope.tui.prompt import Prompt
from nvscope.tui.recording import Recorder, Recording
from nvscope.tui.replay.position_bar import PositionBar
from nvscope.tui.views.all_views import make_views
from nvscope.tui.views.view import View
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Line, Tone

_DRAW_S = 0.1
"""The screen is drawn ten times a second at most."""

_ANSI = "ansi-dark" if "ansi-dark" in BUILTIN_THEMES else "textual-ansi"  # Textual has renamed it
_FRAMES_S = 0.1
"""So long a scene waits to be shown with the frames that are looked for in it."""

_THEMES = {"dark": "textual-dark", "light": "textual-light", "ansi": _ANSI, "mono": _ANSI}
_HELP = "help"


class WatchApp(App[None], inherit_bindings=False):
    """Shows the scenes of a feed, and does what keys and the command line ask for.

    ``keymap`` says which key does what; ``expression`` is a filter to begin with; ``recorder`` writes what comes;
    ``last_resort`` takes signals.
    """

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { layout: vertical; }
    #views { height: 1fr; }
    #head { background: $foreground 10%; }
    #foot, #position { background: $foreground 10%; }
    """

    def __init__(
        self, feed: Feed, keymap: Keymap, *, recorder: Recorder, expression: str | None = None,
        theme: str = "dark", utc: bool = False, last_resort: LastResort | None = None,
    ) -> None:  # fmt: skip
        super().__init__(ansi_color=theme in ("ansi", "mono"))
        self.feed, self.keymap, self._last_resort = feed, keymap, last_resort
        self._time = TimeCommands(self) if feed.player is None else PlayCommands(self, feed.player)
        self._marks, self._records = MarkCommands(self), RecordCommands(self, recorder)
        self.find, self._program = FindCommands(self, expression), ProgramCommands(self)
        self._does: Mapping[str, Callable[[str], None]] = {
            **self._time.does, **self._marks.does, **self._records.does, **self.find.does, **self._program.does,
            "program.command": self._ask_command,
            "show.theme": self._change_theme,
        }  # fmt: skip
        self._prompt = Prompt(self._answer)
        self.utc = utc
        self._first_theme = theme
        self._palette = theme
        self.scene: Scene | None = None
        """The newest one."""
        self._look: Look | None = None  # what is shown
        self._shown: Scene | None = None  # that of the look which the view in front has shown
        self._ended = False
        self._drawn_s = 0.0
        self.draws = 0
        """How often the screen was drawn so far."""
        self._draw_due = False
        self.error: BaseException | None = None
        self.ended_by = 0
        """The signal that ended it, 0 for none."""
        self.views: Sequence[View] = make_views()

    def on_unmount(self) -> None:
        self.find.stop()

    def compose(self) -> ComposeResult:
        yield Bar(id="head")
        yield Tabs(
            [view.title for view in self.views], [self.keymap.key_of(view.action) or "" for view in self.views]
        )  # fmt: skip
        with ContentSwitcher(initial=self.views[0].id, id="views"):
            yield from self.views
            with Vertical(id=_HELP):
                yield LinesView(id="help-lines")
        yield self._prompt
        if self.feed.player is not None:
            yield PositionBar(self.feed, self.feed.player)
        yield Bar(id="foot")

    def on_mount(self) -> None:
        self._paint(self._first_theme)
        self.query_one(Tabs).front(0)
        self._tell_bars()
        self.feed.start(
            lambda scene: self.call_from_thread(self._take, scene),
            lambda error: self.call_from_thread(self.end, error),
        )
        self.set_interval(1.0, self._tell_frozen)
        self.app_resume_signal.subscribe(self.screen, self._draw_all)
        self._end_in_order()

    def _draw_all(self, _: App[object]) -> None:
        """Draw everything: nothing is left of it where the shell wrote meanwhile."""
        for widget in self.query("*"):
            widget.refresh()
        self.screen.refresh(layout=True)

    def _tell_frozen(self) -> None:
        """Tell for how long time has stood still: nothing else is drawn meanwhile."""
        if self._time.frozen:
            self._tell_bars()

    def _end_in_order(self) -> None:
        """End as a person ends it where the system asks for that, so that the terminal and files are whole."""
        if self._last_resort is not None:
            loop = asyncio.get_running_loop()
            self._last_resort.listen(lambda number: loop.call_soon_threadsafe(self._end_by, number))

    def _end_by(self, number: int) -> None:
        self.ended_by = number
        self.exit()

    # What comes from the feed.

    def _take(self, scene: Scene) -> None:
        """Take the newest scene."""
        self.scene = scene
        if self._time.follows:
            self.draw()

    def take_past(self, scene: Scene) -> None:
        """Take the scene of a moment from whichever thread: what is kept comes at once."""
        if threading.get_ident() == self._thread_id:
            self._show_past(scene)
        else:
            self.call_from_thread(self._show_past, scene)

    def _show_past(self, scene: Scene) -> None:
        """Take the scene of a moment that was asked for."""
        if self._time.at_ns is not None:
            self._show(scene)

    def end(self, error: BaseException | None) -> None:
        """Take that nothing follows any more."""
        self._ended = True
        if error is not None:
            self.error = error
            self.exit()
            return
        for info in self.scene.snapshot.infos if self.scene else ():
            if info.failure:
                self.notify(f"{visible(info.path)}: {visible(info.failure)}", severity="error", timeout=60)
        self._tell_bars()

    def draw(self) -> None:
        """Show the newest scene, now or as soon as the last drawing is a tenth of a second old."""
        left_s = self._drawn_s + _DRAW_S - time.monotonic()
        if left_s <= 0:
            self._draw_due = False
            if self.scene is not None:
                self._show(self.scene)
        elif not self._draw_due:
            self._draw_due = True
            self.set_timer(left_s, self._draw_later)

    def _draw_later(self) -> None:
        self._draw_due = False  # a timer may be early: then there has to be another one
        self.draw()

    def _show(self, scene: Scene) -> None:
        if not self._is_whole:
            return
        self._drawn_s = time.monotonic()
        self.draws += 1
        self._look = Look.of(
            scene, utc=self.utc, choice=self.find.choice, live=self.feed.is_live, at_ns=self._time.at_ns,
            frozen=self._time.frozen, found=self.find.found,
        )  # fmt: skip
        looks_for_frames = self.find.scan(sparingly=not self._ended)
        front = self.front
        if front is not None and front.shows_frames and looks_for_frames:
            # They are mostly there at once, and would be drawn twice.
            self.set_timer(_FRAMES_S, lambda: self._show_without_frames(scene))
        else:
            self._show_in_front(self._look)
        self._tell_bars()

    def _show_without_frames(self, scene: Scene) -> None:
        """Show a scene whose frames are still being looked for."""
        if self._is_whole and self._look is not None and self._look.scene is scene and self._shown is not scene:
            self._show_in_front(self._look)

    def _show_in_front(self, look: Look) -> None:
        self._shown = look.scene
        if self.front is not None:
            self.front.show(look)

    def take_found(self) -> None:
        """Take that it is known, or known better, which frames are to be shown."""
        if self._is_whole and self._look is not None:
            self._look = replace(self._look, found=self.find.found, choice=self.find.choice)
            self._show_in_front(self._look)

    def on_resize(self) -> None:
        self.call_after_refresh(self._tell_bars)

    def on_view_changed(self) -> None:
        self.again()

    @property
    def _is_whole(self) -> bool:
        """Whether the screen is there, and not being taken down: a timer or a thread may come meanwhile."""
        return all(self.query(one) for one in ("#head", "#views", "#foot"))

    def _tell_bars(self) -> None:
        if not self._is_whole:
            return
        top, bottom = self.query_one("#head", Bar), self.query_one("#foot", Bar)
        if self._look is not None:
            top.tell(*head(self._look, self._state, self.size.width))
        else:
            top.tell([Cell(" nvscope ", Tone.STRONG), Cell("waiting for the first look …", Tone.FAINT)])
        hints = self.front.hints() if self.front else ()
        bottom.tell(*foot(self.keymap, hints, self._states_below, self.size.width, plays=self.feed.player is not None))

    @property
    def _state(self) -> str:
        return self._time.state or ("ended" if self._ended and self.feed.is_live else "")

    @property
    def _states_below(self) -> list[str]:
        parts = []
        if filtered := self.find.state:
            parts.append(filtered)
        if recording := self._records.state():
            parts.append(recording)
        if self.feed.player is None:  # where that is has a line of its own
            parts.append(self._state or ("live" if self.feed.is_live else "end of capture"))
        return parts

    @property
    def recording(self) -> Recording | None:
        """What is recorded, or was; None where nothing was."""
        return self._records.recorder.state

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

    async def on_event(self, event: events.Event) -> None:
        """Take keys at once, and not by messages: each has its effect before the next one, however fast they come."""
        taken = False
        if isinstance(event, events.Key) and not event.is_forwarded and self._prompt.is_attached:
            taken = await self._prompt.press(event) or self.press(event)
        elif isinstance(event, events.Paste) and self._prompt.is_open:
            taken = self._prompt.paste(event.text)
        if not taken:
            await super().on_event(event)

    def press(self, key: events.Key) -> bool:
        """Do what a key asks for; False where it asks for nothing."""
        if self._marks.takes(key.character):
            return True
        name = self.keymap.action_of(key.key, key.character)
        if name is not None:
            self.act(name)
        return name is not None

    def on_view_asked(self, message: View.Asked) -> None:
        self.act(message.action, message.told)

    def act(self, name: str, told: str = "") -> None:
        """Do what an action says, with what stands behind its name on the command line."""
        front = self.front
        if name.startswith("view.") and any(view.action == name for view in self.views):
            self.to_front(next(view for view in self.views if view.action == name), told)
        elif (does := self._does.get(name)) is not None:
            does(told)
        elif name == "show.explain" and told:
            self._program.explain(told)
        elif front is None:
            self.query_one("#help-lines", LinesView).move(name)
        elif not front.act(name, told):
            key = self.keymap.key_of(name) or name
            self.notify(f"{key} does nothing in {front.title}", severity="warning", timeout=2)
        self._tell_bars()

    def to_front(self, view: View, told: str = "") -> None:
        """Show a view, restricted to what is told."""
        self.query_one("#views", ContentSwitcher).current = view.id
        self.query_one(Tabs).front(self.views.index(view))
        if told:
            view.restrict(told)
        self.find.scan(sparingly=not self._ended)
        if self._look is not None:
            view.show(self._look)

    def show_page(self, lines: Sequence[Line]) -> None:
        """Show lines in place of a view."""
        self.query_one("#help-lines", LinesView).show(lines)
        self.query_one("#views", ContentSwitcher).current = _HELP
        self.query_one(Tabs).front(-1)

    def _ask_command(self, _: str) -> None:
        self._prompt.open(":", "")

    def _change_theme(self, told: str) -> None:
        names = list(PALETTES)
        if told and told not in names:
            self.notify(f"There are: {', '.join(names)}", severity="warning")
            return
        self._paint(told or names[(names.index(self._palette) + 1) % len(names)])

    def on_notify(self) -> None:
        """Let what was told of one key give way to what is told of the next; errors stay for their time."""
        for one in [one for one in self._notifications if one.severity != "error"]:
            self._unnotify(one, refresh=False)

    def complain(self, error: NvscopeError) -> None:
        """Tell an error, with what to do about it."""
        where = f"{error.where}: " if error.where else ""
        self.notify(visible(f"{where}{error.what}. {error.next_step}"), severity="error", timeout=10)

    def _answer(self, mark: str, text: str) -> None:
        """Do what a line says that somebody typed."""
        if mark == "/":
            self.find.use(text)
        elif text.strip():
            self._command(text.strip())
        self._tell_bars()

    def _command(self, text: str) -> None:
        word, _, told = text.partition(" ")
        found = [BY_NAME[word]] if word in BY_NAME else list(matching(text))
        if len(found) != 1:
            names = ", ".join(action.name for action in found[:6])
            self.notify(f"{visible(word)}: {names or 'no action has this name'}", severity="warning")
            return
        self.act(found[0].name, told.strip())

    def again(self) -> None:
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
