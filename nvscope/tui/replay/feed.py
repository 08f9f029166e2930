"""Scenes of a capture while it is played; beside that it is read once as a whole, to know what is to come."""

from __future__ import annotations

import threading
import time

from msgspec.structs import replace

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, Watched, Watching, scene_at, session_of
from nvscope.capture.played import Played
from nvscope.capture.player import Player
from nvscope.capture.source import SourceInfo
from nvscope.engine.session import Session
from nvscope.errors import NvscopeError
from nvscope.tui.feed import LOOK_S, OnEnd, OnScene, Span

_LEAST_REST = 4
_LONGEST_REST_S = 2.0
_PATIENCE_S = 2.0
_WHOLE_RING_BYTES = 1 << 20


class ReplayFeed:
    """Looks at captures while a ``player`` plays them.

    Where that goes back, they are read again from their beginning; until they are where somebody wants them, what was
    shown last stays.
    """

    is_live = True

    def __init__(self, inquiry: Inquiry, how: Watching, player: Player) -> None:
        self.player: Player | None = player
        self._player = player
        self._inquiry, self._how = inquiry, how
        self._turns, self._session = self._begun()
        self._last: Scene | None = None
        self._whole: Scene | None = None
        self._stopping = threading.Event()

    def _begun(self) -> tuple[int, Session[Scene]]:
        turns, inquiry = self._player.turns, self._inquiry
        source = Played(inquiry.open(), self._player)
        return turns, session_of(Watched(inquiry, source, self._how, overdue=False))

    @property
    def whole(self) -> Scene | None:
        """What is known at the end of the captures, None as long as nobody knows."""
        return self._whole

    def start(self, on_scene: OnScene, on_end: OnEnd) -> None:
        self._session.start()
        threading.Thread(target=self._look, args=(on_scene, on_end), name="nvscope looks", daemon=True).start()
        threading.Thread(target=self._read_whole, name="nvscope whole", daemon=True).start()

    def _look(self, on_scene: OnScene, on_end: OnEnd) -> None:
        error: BaseException | None = None
        try:
            while not self._stopping.is_set():
                changes = self._player.changes
                if self._turns != self._player.turns:
                    self._session.stop()
                    self._turns, self._session = self._begun()
                    self._session.start()
                began_s = time.monotonic()
                if not self._session.ended and self._player.place.is_going:
                    self._player.wait_for_change(changes, LOOK_S)
                    continue
                scene = self._session.snapshot(_PATIENCE_S)
                ended = self._session.ended
                if ended:
                    scene = self._session.stop()
                if self._turns != self._player.turns or self._player.place.is_going:
                    continue
                # A session begins with a look at nothing, which is not where the capture is.
                is_there = scene.snapshot.summary.capture.frames or not self._player.place.frames
                if scene is not self._last and is_there:
                    self._last = scene
                    on_scene(scene)
                took_s = time.monotonic() - began_s
                rest_s = min(max(LOOK_S, _LEAST_REST * took_s), _LONGEST_REST_S)
                self._player.wait_for_change(changes, _PATIENCE_S if ended else rest_s)
                if not ended and changes == self._player.changes:
                    self._session.wait_for_news(rest_s)
        except BaseException as failure:  # told to the screen, which ends with it
            error = failure
        if error is not None and not self._stopping.is_set():
            on_end(error)

    def _read_whole(self) -> None:
        how = replace(self._how, ring_bytes=_WHOLE_RING_BYTES, others=())
        try:
            self._whole = scene_at(self._inquiry, None, how, lambda: not self._stopping.is_set())
        except NvscopeError:
            return  # who plays it meets that, too, and tells it

    def span(self) -> Span | None:
        whole, last = self._whole, self._last
        known = whole or last
        if known is None or known.at_ns is None:
            return None
        start_ns = known.snapshot.summary.start_ns
        return Span(known.at_ns if start_ns is None else start_ns, known.at_ns)

    def at(self, time_ns: int, on_scene: OnScene) -> None:
        self._player.go(time_ns)

    def reset(self) -> None:
        """Nothing: a capture is counted from its beginning."""

    def stop(self) -> list[SourceInfo]:
        """End, and return what is known of the captures as a whole, if that is known."""
        self._stopping.set()
        self._player.stop()
        last = self._session.stop()
        return list((self._whole or last).snapshot.infos)
