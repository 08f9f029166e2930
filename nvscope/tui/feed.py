"""Where the screen gets its scenes from: a thread that looks at what is read, and keeps the looks of a while."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol

from msgspec import Struct
from msgspec.structs import replace

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, Watched, Watching, scene_at, session_of
from nvscope.capture.player import Player
from nvscope.capture.source import SourceInfo
from nvscope.errors import NvscopeError
from nvscope.tui.kept_scenes import KeptScenes

LOOK_S = 0.2
"""Looks are at least so far apart, or four times as long as they take."""

_LEAST_REST = 4
_LONGEST_REST_S = 2.0
_PATIENCE_S = 2.0


class Span(Struct, frozen=True):
    """From when to when there is something to be looked at."""

    start_ns: int
    end_ns: int


OnScene = Callable[[Scene], None]
OnEnd = Callable[[BaseException | None], None]


class Feed(Protocol):
    """Gives scenes to a screen, from a thread of its own: ``on_scene`` for each look, ``on_end`` when nothing follows.

    ``is_live``: time goes on by itself. ``player`` says how, where a capture is played; None where none is.
    """

    is_live: bool
    player: Player | None

    def start(self, on_scene: OnScene, on_end: OnEnd) -> None:
        """Begin to look."""
        ...

    def span(self) -> Span | None:
        """Return from when to when scenes can be had, None before the first."""
        ...

    @property
    def whole(self) -> Scene | None:
        """What is known of all that is there so far, None before the first look."""
        ...

    def at(self, time_ns: int, on_scene: OnScene) -> None:
        """Ask for the scene at a time; it comes by ``on_scene`` unless another one is asked for before it is there."""
        ...

    def reset(self) -> None:
        """Count from now on."""
        ...

    def stop(self) -> list[SourceInfo]:
        """End, and return what is known of the sources then."""
        ...


class SessionFeed:
    """Looks at a session while it runs: live sources, streams, and files while they are read.

    One scene a second is kept for a while, and told with the frames that are there now; of files any moment can be read
    again (``past``).
    """

    player: Player | None = None

    def __init__(self, inquiry: Inquiry, how: Watching) -> None:
        self._inquiry, self._how = inquiry, how
        self._watched = Watched(inquiry, inquiry.open(), how)
        self._session = session_of(self._watched)
        self.is_live = not (inquiry.paths and "-" not in inquiry.paths)
        self._kept = KeptScenes()
        self._last: Scene | None = None
        self._stopping = threading.Event()
        self._wanted_ns: int | None = None
        self._wanted = threading.Condition()
        self._threads: list[threading.Thread] = []

    def start(self, on_scene: OnScene, on_end: OnEnd) -> None:
        self._session.start()
        self._begin(lambda: self._look(on_scene, on_end), "nvscope looks")

    def _begin(self, work: Callable[[], None], name: str) -> None:
        thread = threading.Thread(target=work, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _look(self, on_scene: OnScene, on_end: OnEnd) -> None:
        error: BaseException | None = None
        try:
            while not self._stopping.is_set():
                began_s = time.monotonic()
                scene = self._session.snapshot(_PATIENCE_S)
                ended = self._session.ended
                if ended:
                    scene = self._session.stop()
                if scene is not self._last:
                    self._keep(scene)
                    on_scene(scene)
                if ended:
                    break
                took_s = time.monotonic() - began_s
                self._stopping.wait(min(max(LOOK_S, _LEAST_REST * took_s), _LONGEST_REST_S))
                # Behind the next batch at once: what it brought is not to wait for a look.
                self._session.wait_for_news(_PATIENCE_S)
        except BaseException as failure:  # told to the screen, which ends with it
            error = failure
        if not self._stopping.is_set():
            on_end(error)

    def _keep(self, scene: Scene) -> None:
        self._last = scene
        if self.is_live:
            self._kept.add(scene)

    @property
    def whole(self) -> Scene | None:
        return self._last

    def span(self) -> Span | None:
        last = self._last
        if last is None or last.at_ns is None:
            return None
        if not self.is_live:
            start_ns = last.snapshot.summary.start_ns
            return Span(last.at_ns if start_ns is None else start_ns, last.at_ns)
        first_ns = self._kept.first_ns or last.at_ns
        return Span(min(first_ns, last.at_ns), last.at_ns)

    def at(self, time_ns: int, on_scene: OnScene) -> None:
        if self.is_live:
            kept = self._kept.at(time_ns)
            if kept is not None and self._last is not None:
                on_scene(replace(kept, recent=self._last.recent))
            return
        with self._wanted:
            self._wanted_ns = time_ns
            self._wanted.notify_all()
        if len(self._threads) == 1:
            self._begin(lambda: self._read_again(on_scene), "nvscope past")

    def _read_again(self, on_scene: OnScene) -> None:
        while not self._stopping.is_set():
            with self._wanted:
                self._wanted.wait_for(lambda: self._wanted_ns is not None or self._stopping.is_set())
                time_ns, self._wanted_ns = self._wanted_ns, None
            if self._stopping.is_set() or time_ns is None:
                return
            try:
                scene = scene_at(
                    self._inquiry, time_ns, self._how,
                    lambda: self._wanted_ns is None and not self._stopping.is_set(),
                )  # fmt: skip
            except NvscopeError:
                continue  # the file is gone, or changed: what is shown stays
            if scene is not None:
                on_scene(scene)

    def reset(self) -> None:
        self._watched.reset()

    def stop(self) -> list[SourceInfo]:
        self._stopping.set()
        with self._wanted:
            self._wanted.notify_all()
        return list(self._session.stop().snapshot.infos)
