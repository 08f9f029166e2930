"""Files that appear under their names when all are complete, and take the place of nothing that was not meant."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import stat
from collections.abc import Callable, Iterable
from enum import Enum
from pathlib import Path
from typing import Any, BinaryIO, TypeVar
from weakref import WeakSet

from nvscope.errors import CaptureError, UsageError

_Result = TypeVar("_Result")

_BUFFER_BYTES = 64 << 10
_LONGEST_NAME_BYTES = 180
_STDIN, _STDOUT = 0, 1
_STREAMS = {"/dev/stdout": 1, "/dev/stderr": 2}
_DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/fd/(\d{1,9})", re.ASCII)
_NEXT_STEP = "check the directory, its permissions and the space left"


class Existing(Enum):
    """What becomes of a file that is there already; ``--force`` always replaces it."""

    REPLACED = "replaced"
    """It was asked for by name, and what is in it can be made again."""
    KEPT = "kept"
    """It was not asked for by name, or somebody may have changed it."""
    SAME = "same"
    """It stays, unless what is written is what is in it: that is known when the new one is complete."""


def is_stdout(path: str) -> bool:
    """Return whether a name stands for stdout: ``-``, with the suffix of a format ``-.ndjson``, or the system's own."""
    return _descriptor_of(path) == _STDOUT


_LIVE: WeakSet[WholeFiles] = WeakSet()


def discard_all() -> None:
    """Remove all that has not got its name, of whomever: the process ends at once."""
    for files in list(_LIVE):
        files.discard()


class WholeFiles:
    """The files that one command writes: all of them appear when all are complete, or none at all.

    ``inputs`` are files that it reads: none of them is written, nor is a file that is stdin. With ``force`` whatever
    exists is replaced.
    """

    def __init__(self, inputs: Iterable[str | os.PathLike[str]] = (), *, force: bool = False) -> None:
        read: list[Path | int] = [_STDIN, *map(Path, inputs)]
        self._inputs = {identity for one in read if (identity := identity_of(one))}
        self._force = force
        self._files: list[WholeFile] = []
        _LIVE.add(self)

    def open(self, path: str, existing: Existing = Existing.REPLACED) -> WholeFile:
        """Return a new file, open for writing.

        Raises UsageError where the name is that of an input, of another output, or of a file that is to be kept;
        CaptureError where it cannot be written.
        """
        return self._added(WholeFile(path), existing).open()

    def reserve(self, path: str, existing: Existing = Existing.REPLACED) -> WholeFile:
        """Return a new file that something else opens, as ``unfinished``. Raises what ``open`` does."""
        return self._added(WholeFile(path), existing).reserve()

    def write(self, path: str, content: bytes, existing: Existing = Existing.KEPT) -> None:
        """Write a whole file; one that has this content already is left as it is. Raises what ``open`` does."""
        with contextlib.suppress(OSError, ValueError):
            if Path(path).is_file() and Path(path).read_bytes() == content:
                existing = Existing.REPLACED
        self.open(path, existing).file.write(content)

    def publish(self) -> None:
        """Give all files their names."""
        for file in self._files:
            file.finish()
        for file in self._files:
            if file.existing is Existing.SAME and not self._force and file.differs():
                raise exists_already(file.path)
        for file in self._files:
            file.publish()

    def discard(self) -> None:
        """Remove what has not got its name."""
        for file in self._files:
            file.discard()

    def _added(self, file: WholeFile, existing: Existing) -> WholeFile:
        file.existing = existing
        if not file.path:
            raise UsageError("the name of a file to write is empty", next_step="name one, or leave the option out")
        identity = file.identity()
        if identity is not None and identity in self._inputs:
            raise is_input(file.path)
        if any(file.place == other.place or (identity and identity == other.identity()) for other in self._files):
            raise UsageError("two outputs have this name", where=file.path, next_step="name another file")
        if existing is Existing.KEPT and not self._force and file.is_replacing():
            raise exists_already(file.path)
        # Noted before it is there, so that no interrupt finds a file that nobody knows of.
        self._files.append(file)
        return file


def is_input(where: str) -> UsageError:
    """Return that an output, of this name, would take the place of an input or be written into it."""
    what = "the output is one of the inputs"
    return UsageError(what, where=where, next_step="name another file; inputs are never written")


def would_be_lost(path: str) -> bool:
    """Return whether something has a name that would be lost if a file were written there: no stdout, and no pipe."""
    if is_stdout(path):
        return False
    try:
        return not stat.S_ISFIFO(os.stat(path).st_mode)
    except (OSError, ValueError):
        return os.path.lexists(path)


def exists_already(where: str) -> UsageError:
    """Return that what has the name of an output is to be kept."""
    return UsageError("exists already", where=where, next_step="--force replaces it; or name another file")


class WholeFile:
    """A file being written beside the one that it replaces when it is complete.

    What is no regular file (a pipe, a terminal) is written to as it is, and so is what is open already: stdout, or
    ``/dev/fd/3``. Nothing is there before ``open``: who keeps it first can discard it whenever that ends. What goes
    wrong is a CaptureError that names the file.
    """

    file: BinaryIO
    existing = Existing.REPLACED

    def __init__(self, path: str) -> None:
        self.path = path
        self._unfinished: Path | None = None
        self._descriptor = _descriptor_of(path)
        with self._told():
            self.target = Path(path)
            if self._descriptor is not None:
                self.target = Path(f"/dev/fd/{self._descriptor}")
            elif self.target.is_file() or not self.target.exists():
                # Where the name is a link, what it leads to is replaced.
                self.target = self.target.resolve() if self.target.is_symlink() else self.target

    @property
    def unfinished(self) -> str:
        """Where the file is until it has its name."""
        return str(self._unfinished or self.target)

    def identity(self) -> tuple[int, int] | None:
        """Return what the file that has the name is known by, None where it is no regular one."""
        return identity_of(self.target if self._descriptor is None else self._descriptor)

    @property
    def place(self) -> str:
        """The one name of where the file will be, however it is spelled: nothing may be there yet."""
        return str(self.target) if self._descriptor is not None else os.path.realpath(self.target)

    def is_replacing(self) -> bool:
        """Return whether a file has the name, and is to lose it."""
        return self._descriptor is None and self.target.is_file()

    def differs(self) -> bool:
        """Return whether what was finished is something else than the file that it is to replace."""
        from filecmp import cmp  # noqa: PLC0415

        with self._told():
            return self.is_replacing() and not cmp(self.unfinished, self.target, shallow=False)

    def open(self) -> WholeFile:
        """Open ``file``, and return this one."""
        with self._told():
            if self._descriptor is not None:
                self.file = _Writer(os.fdopen(os.dup(self._descriptor), "wb", 0), self._error)
            elif self._is_written_to():
                self.file = _Writer(self.target.open("wb", 0), self._error)
            else:
                self._open_beside()
        return self

    def reserve(self) -> WholeFile:
        """Have something else open it, as ``unfinished``, and return this one."""
        with self._told():
            # Who reads a pipe takes it for ended when it is closed first.
            if self._descriptor is None and not self._is_written_to():
                self._open_beside()
                self.file.close()
        return self

    def _is_written_to(self) -> bool:
        """Return whether what has the name is written to as it is."""
        if self.target.is_dir():
            raise IsADirectoryError(None, "is a directory")
        if _is_link_of_another(Path(self.path)):
            raise PermissionError(None, "it is a link of another user")
        return self.target.exists() and not self.target.is_file()

    def _open_beside(self) -> None:
        suffix = self.target.suffix[:20]
        told = self.target.name.encode("utf-8", "surrogateescape")[:_LONGEST_NAME_BYTES].decode("utf-8", "ignore")
        name = f".{told}.{os.urandom(8).hex()}.unfinished{suffix}"
        # The name is nobody else's: it cannot be guessed, and what has it already is not written to.
        self._unfinished = self.target.with_name(name)
        self.file = _Writer(self._unfinished.open("xb", 0), self._error)

    def finish(self) -> None:
        """Write what is left, and close the file; it still has its other name."""
        if hasattr(self, "file"):
            self.file.close()

    def publish(self) -> None:
        """Give the finished file its name, and the permissions of the one that it replaces."""
        if self._unfinished:
            with self._told():
                with contextlib.suppress(OSError):
                    shutil.copymode(self.target, self._unfinished)
                os.replace(self._unfinished, self.target)
            self._unfinished = None

    def discard(self) -> None:
        """Remove the file where it has not got its name; whatever goes wrong with that has gone wrong before."""
        with contextlib.suppress(OSError, CaptureError):
            if hasattr(self, "file"):
                self.file.close()
        if self._unfinished:
            with contextlib.suppress(OSError):
                self._unfinished.unlink(missing_ok=True)
            self._unfinished = None

    @contextlib.contextmanager
    def _told(self) -> Any:
        try:
            yield
        except BrokenPipeError:
            raise
        except (OSError, ValueError, RuntimeError) as error:
            raise self._error(error) from error

    def _error(self, error: Exception) -> CaptureError:
        what = getattr(error, "strerror", None) or str(error)
        return CaptureError(f"cannot be written: {what}", where=self.path, next_step=_NEXT_STEP)


class _Writer(io.BufferedWriter):
    """A buffered file whose failures are errors that name it."""

    def __init__(self, raw: Any, error: Callable[[Exception], CaptureError]) -> None:
        super().__init__(raw, _BUFFER_BYTES)
        self._error = error

    def write(self, data: Any) -> int:
        return self._tried(lambda: super(_Writer, self).write(data))

    def flush(self) -> None:
        self._tried(super().flush)

    def close(self) -> None:
        self._tried(super().close)

    def _tried(self, action: Callable[[], _Result]) -> _Result:
        try:
            return action()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise self._error(error) from error


def _descriptor_of(path: str) -> int | None:
    """Return the descriptor that a name stands for, None where it is that of a file."""
    if path.startswith("-") and os.path.splitext(path)[0] == "-":
        return _STDOUT
    # Not opened by these names: a file that a shell appends to would be emptied, or replaced.
    match = _DESCRIPTOR.fullmatch(path) if os.name == "posix" else None
    return int(match[1]) if match else _STREAMS.get(path) if os.name == "posix" else None


def identity_of(file: str | os.PathLike[str] | int) -> tuple[int, int] | None:
    """Return what a regular file is known by whatever it is called, or the one that is open; None without one."""
    try:
        status = os.stat(file)
    except (OSError, ValueError):
        return None
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None


def _is_link_of_another(path: Path) -> bool:
    """Return whether a name is a link that another user laid: it may lead to a file of ours that he cannot write."""
    user = getattr(os, "geteuid", None)
    return user is not None and path.is_symlink() and path.lstat().st_uid not in {user(), 0}
