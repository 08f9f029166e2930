"""Scanner: a thread that looks at the frames of the ring for the screen, which waits for none of them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from msgspec import Struct

from nvscope.analysis.recent_frames import FoundFrames, RecentFrames, Wanted
from nvscope.analysis.watching import Scene
from nvscope.errors import NvscopeError

_TELL_S = 0.1
_REST = 2
"""After each step it rests so many times as long as that took: whoever reads the source comes first."""

_JUDGE_AGAIN_S = 1.0
_LEAST_BETWEEN = 4

OnFound = Callable[[FoundFrames], None]
OnProblem = Callable[[Wanted, NvscopeError], None]
OnFailure = Callable[[BaseException], None]


class _Task(Struct, frozen=True):
    scene: Scene
    wanted: Wanted
    sparingly: bool


class Scanner:
    """Looks at the scenes that it is given, for what is wanted of them, and tells what it found, from its thread.

    Of a filter that goes by what was known of a scene, it judges again when there is another scene, at most every
    second. Only the newest scene that it was given counts.
    """

    def __init__(self, on_found: OnFound, on_problem: OnProblem, on_failure: OnFailure) -> None:
        self._on_found, self._on_problem, self._on_failure = on_found, on_problem, on_failure
        self._changed = threading.Condition()
        self._task: _Task | None = None
        self._stopping = False
        self._frames: RecentFrames | None = None
        self._judged: tuple[Scene, float, float] | None = None  # by which scene, when, and how long it took
        self._told_s = 0.0
        self._thread = threading.Thread(target=self._run, name="nvscope frames", daemon=True)

    def look_at(self, scene: Scene, wanted: Wanted, *, sparingly: bool) -> None:
        """Look at a scene; ``sparingly`` where somebody else needs the processor."""
        with self._changed:
            self._task = _Task(scene, wanted, sparingly)
            self._changed.notify()
        if self._thread.ident is None:
            self._thread.start()

    def stop(self) -> None:
        """End; what is being looked at is not told any more."""
        with self._changed:
            self._stopping = True
            self._changed.notify()

    def _run(self) -> None:
        try:
            while (task := self._next()) is not None:
                try:
                    self._look(task)
                except NvscopeError as error:
                    self._frames = None
                    self._on_problem(task.wanted, error)
        except BaseException as failure:  # told to the screen, which ends with it
            if not self._stopping:
                self._on_failure(failure)

    def _next(self) -> _Task | None:
        with self._changed:
            self._changed.wait_for(lambda: self._task is not None or self._stopping)
            task, self._task = self._task, None
            return None if self._stopping else task

    def _look(self, task: _Task) -> None:
        frames, recent = self._frames, task.scene.recent
        if frames is None or frames.wanted != task.wanted or not frames.fits(recent):
            began_s = time.monotonic()
            self._frames = frames = RecentFrames.of(task.scene, task.wanted)
            if self._to_the_end(frames, task, tells=True):
                self._judged = task.scene, time.monotonic(), time.monotonic() - began_s
        elif frames.judged and self._is_overdue(task.scene):
            began_s = time.monotonic()
            fresh = RecentFrames.of(task.scene, task.wanted)
            # What was found before stays until all is known.
            if self._to_the_end(fresh, task, tells=False):
                self._frames, self._judged = fresh, (task.scene, time.monotonic(), time.monotonic() - began_s)
                self._on_found(fresh.found())
        else:
            self._to_the_end(frames, task, tells=True)

    def _is_overdue(self, scene: Scene) -> bool:
        if self._judged is None:
            return True
        by, at_s, took_s = self._judged
        return by is not scene and time.monotonic() - at_s >= max(_JUDGE_AGAIN_S, _LEAST_BETWEEN * took_s)

    def _to_the_end(self, frames: RecentFrames, task: _Task, *, tells: bool) -> bool:
        """Look at all frames of a scene; False where something else is wanted meanwhile."""
        while True:
            began_s = time.monotonic()
            left = frames.step(task.scene)
            now_s = time.monotonic()
            if tells and (not left or now_s - self._told_s >= _TELL_S):
                self._told_s = now_s
                self._on_found(frames.found())
            if not left:
                return True
            if task.sparingly:
                time.sleep(_REST * (now_s - began_s))
            newer = self._task
            if self._stopping or (newer is not None and newer.wanted != task.wanted):
                return False
