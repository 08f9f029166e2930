"""Recording from the screen, and writing the frames that are kept."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from nvscope import units
from nvscope.errors import NvscopeError
from nvscope.tui.prompt import Prompt
from nvscope.tui.recording import Recorder
from nvscope.view.escape import visible
from nvscope.view.lines.plant.source_blocks import recorded_in_words

if TYPE_CHECKING:
    from nvscope.tui.app import WatchApp


class RecordCommands:
    """The actions of recording, over a ``recorder``."""

    def __init__(self, app: WatchApp, recorder: Recorder) -> None:
        self._app = app
        self.recorder = recorder
        self._told = ""  # of which file it was told that it failed

    @property
    def does(self) -> Mapping[str, Callable[[str], None]]:
        """What is done for each action, with what stands behind its name."""
        return {"record.toggle": self._toggle, "record.save": self._save}

    def _toggle(self, told: str) -> None:
        app, recorder = self._app, self.recorder
        if not app.feed.is_live or app.feed.player is not None:
            app.notify("A capture is a recording already", timeout=3)
            return
        state = recorder.state
        try:
            if state is not None and state.is_on:
                state = recorder.stop()
                assert state is not None
                app.notify(recorded_in_words(state.frames, state.files, state.path), timeout=6)
            else:
                recorder.start(told or time.strftime("nvscope-%Y%m%d-%H%M%S.pcapng"))
                state = recorder.state
                assert state is not None
                app.notify(f"Recording to {visible(state.path)}", timeout=4)
        except NvscopeError as error:
            app.complain(error)

    def _save(self, told: str) -> None:
        app = self._app
        if not told:
            app.query_one(Prompt).open(":", "record.save ")
        elif app.look is not None:
            scene = app.look.scene
            try:
                frames = self.recorder.save(told, scene.frames(), scene.channels)
            except NvscopeError as error:
                app.complain(error)
                return
            app.notify(recorded_in_words(frames, 1, told), timeout=6)

    def state(self) -> str:
        """Return what is said of a recording, "" where there is none; its failure is told once, and stays."""
        state = self.recorder.state
        if state is None:
            return ""
        if state.failure and self._told != state.path:
            self._told = state.path
            told = f"{state.path}: {state.failure}. It ends with frame {units.count(state.frames)}."
            self._app.notify(visible(told), severity="error", timeout=60)
        if state.is_on:
            return f"R {units.data_size(state.bytes)}"
        return "R failed" if state.failure else ""
