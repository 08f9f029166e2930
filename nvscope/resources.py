"""What the system gives a process of, and what is said where it gives no more: memory, address space, descriptors."""

from __future__ import annotations

import errno
import os
import re
from contextlib import suppress

from nvscope.errors import CaptureError

NO_DESCRIPTORS = (errno.EMFILE, errno.ENFILE)

_NO_MEMORY = re.compile("failed to map segment|cannot allocate memory|out of memory", re.IGNORECASE)
_NO_FILES = re.compile("too many open files", re.IGNORECASE)


def too_many_open(where: str = "") -> CaptureError:
    """Return what is told where no more files can be open at a time."""
    return CaptureError(
        "too many files are open at a time", where=where,
        next_step="raise the limit (ulimit -n), or read fewer files at a time",
    )  # fmt: skip


def no_memory() -> CaptureError:
    """Return what is told where there is no more memory."""
    return CaptureError("there is not enough memory", next_step="read a part with --from-time and --to-time")


def shortage(error: BaseException) -> CaptureError | None:
    """Return what is told of an error that came of a shortage of the system, None of any other.

    Libraries that cannot be loaded for it tell so in words only, and some of them in an error of an error.
    """
    seen: set[int] = set()
    reason: BaseException | None = error
    while reason is not None and id(reason) not in seen:
        seen.add(id(reason))
        number = getattr(reason, "errno", None)
        loading = str(reason) if isinstance(reason, ImportError) else ""
        # The interpreter's own words where it has no memory for the error that says so.
        lost = isinstance(reason, SystemError) and "without" in str(reason) and "exception" in str(reason)
        if lost or isinstance(reason, MemoryError) or number == errno.ENOMEM or _NO_MEMORY.search(loading):
            return no_memory()
        if number in NO_DESCRIPTORS or _NO_FILES.search(loading):
            return too_many_open(str(getattr(reason, "filename", None) or ""))
        reason = reason.__cause__ or reason.__context__
    return None


def allow_all_descriptors() -> None:
    """Let as many files be open as the system lets this user have: the usual limit is for programs of another time."""
    with suppress(ImportError, OSError, ValueError):
        import resource  # noqa: PLC0415

        hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def require_room(what: str, size_bytes: int, next_step: str) -> None:
    """Raise CaptureError where a limit of address space leaves less than ``what`` needs.

    It is for libraries that end the process where they do not get it. Without a limit nothing is known.
    """
    with suppress(ImportError, OSError, ValueError):
        import resource  # noqa: PLC0415

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit == resource.RLIM_INFINITY:
            return
        with open("/proc/self/statm", "rb") as file:
            used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        if limit - used < size_bytes:
            raise CaptureError(
                f"there is not enough memory: {what} needs {size_bytes / 1e9:.1f} GB of address space, and the limit "
                f"leaves {max(limit - used, 0) / 1e9:.1f}",
                next_step=next_step,
            )
