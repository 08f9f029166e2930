"""What takes long to make is made once for a run: one process makes it, the others that run tests take it over.

``@made_once`` is ``functools.cache`` for all processes of ``pytest -n``; what a function returns is pickled.
"""

from __future__ import annotations

import atexit
import os
import pickle
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache, wraps
from hashlib import sha256
from pathlib import Path
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Made = TypeVar("Made")


@cache
def folder() -> Path:
    """Return a folder for all processes of a run, which is there as long as the run is."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    if run is None:
        own = Path(tempfile.mkdtemp(prefix="nvscope-tests-"))
        atexit.register(shutil.rmtree, own, ignore_errors=True)
        return own
    shared = _of_run(run)
    shared.mkdir(mode=0o700, exist_ok=True)
    return shared


def forget(run: str) -> None:
    """Throw away what the processes of a run have shared."""
    shutil.rmtree(_of_run(run), ignore_errors=True)


def made_once(make: Callable[Given, Made]) -> Callable[Given, Made]:
    """Have a function called once with the same arguments, by whichever process of a run; they are told by repr."""

    @cache
    @wraps(make)
    def made(*given: Given.args, **named: Given.kwargs) -> Made:
        if sys.platform == "win32" or "PYTEST_XDIST_TESTRUNUID" not in os.environ:
            return make(*given, **named)
        import fcntl  # noqa: PLC0415  # not on Windows, where each process makes its own

        asked = repr((make.__module__, make.__qualname__, given, sorted(named.items())))
        kept = folder() / sha256(asked.encode()).hexdigest()
        with kept.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not kept.exists():
                kept.write_bytes(pickle.dumps(make(*given, **named)))
        found: Made = pickle.loads(kept.read_bytes())
        return found

    return made


def _of_run(run: str) -> Path:
    return Path(tempfile.gettempdir()) / f"nvscope-tests-{run}"
