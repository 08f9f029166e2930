"""Claims: one logger at a time writes to a series of files.

While one does, ``x.db.lock`` lies beside ``x.db``, and the system holds a lock on it for that process, as long as it
lives and no longer. So a file that one left that was killed keeps nobody out, and goes with the next one: who makes it
writes that into it, and what does not say so is somebody else's, and stays. Readers take no notice of it. Where a file
system knows no locks, nobody is kept apart, and that is told.

Of the files of a series not only ``x.db`` is its logger's: who would log to ``x.db.3`` or ``x.db.begun`` shares the
lock of ``x.db`` with others of such names, and not with its logger.
"""

from __future__ import annotations

import errno
import os
import re
import socket
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from types import TracebackType

from nvscope.capture.datalogger.names import LOCK, owners_of
from nvscope.errors import CaptureError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_OURS = re.compile(rb"logged by nvscope: process ([0-9]+) on ([^\n]*)\n")
_MADE = b"made by nvscope\n"
_LONGEST = 400
_IS_HELD = frozenset({errno.EACCES, errno.EAGAIN, errno.EDEADLK})
_NO_LOCKS = frozenset({errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOTSUP, errno.EINVAL, errno.EBADF})
"""What file systems say that know no locks, or none on what can only be read; on these, nobody is kept apart."""

_NO_FILE = frozenset({errno.ELOOP, errno.EISDIR, errno.ENXIO})
_HELD: set[int] = set()
"""The open files of this process that hold locks: a copy of it, which reads ahead, must not hold them longer."""


class Claims:
    """The files of some databases, for as long as it is entered.

    Entering raises CaptureError where somebody else logs to one of them, or where nothing can be written beside one;
    then nothing is claimed, and nothing has changed. ``unguarded`` are databases that others may log to all the same.
    """

    def __init__(self, databases: Sequence[str]) -> None:
        self._databases = databases
        self.unguarded: list[str] = []
        self._held: list[tuple[str, int]] = []

    def __enter__(self) -> Claims:
        own = {path: database for database in self._databases for path in _names_of(database)}
        others = {base: database for path, database in own.items() for base in owners_of(path)}
        try:
            # In one order: of several that begin at once, one gets all.
            for path in sorted({**others, **own}):
                self._claim(path, others[path] if path not in own else own[path], shared=path not in own)
        except BaseException:
            self._release()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._release()

    def _claim(self, path: str, database: str, *, shared: bool) -> None:
        lock = path + LOCK
        while True:
            try:
                file = _opened(lock)
            except OSError as error:
                raise _cannot_be_made(lock, database, error) from None
            try:
                told = _lock(file, shared=shared)
            except OSError as error:
                os.close(file)
                raise _cannot_be_made(lock, database, error) from None
            if told is None and database not in self.unguarded:
                self.unguarded.append(database)
            if told is False:
                who = _whose(file)
                os.close(file)
                if not who:
                    what = "another program holds a lock on it, which keeps loggers apart; nothing was changed"
                    raise CaptureError(what, where=lock, next_step="wait for its end, or log to another file")
                raise CaptureError(
                    f"another nvscope logs to this series of files{who}, and nothing was changed", where=database,
                    next_step="wait for its end, or stop it; or log to another file, with -w or --folder",
                )  # fmt: skip
            if _is_at(file, lock):
                break
            # Whoever held it has removed it in between: what is locked has no name any more.
            os.close(file)
        self._held.append((lock, file))
        _HELD.add(file)
        if not shared:
            _sign(file)

    def _release(self) -> None:
        while self._held:
            lock, file = self._held.pop()
            _HELD.discard(file)
            with suppress(OSError):
                # As long as others share it, it is theirs.
                if _lock(file, shared=False) is not False and _is_ours(file) and _is_at(file, lock):
                    _remove(lock, file)
            with suppress(OSError):
                os.close(file)


def _names_of(database: str) -> Iterator[str]:
    """Yield by which paths other programs may know a database: its own, and where a link of this name leads."""
    folder, name = os.path.split(database)
    yield os.path.join(os.path.realpath(folder or os.curdir), name)
    target = os.path.realpath(database)
    if os.access(os.path.dirname(target), os.W_OK):
        yield target


def _opened(lock: str) -> int:
    """Open a file to be locked, made where there is none."""
    flags = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    while True:
        with suppress(FileExistsError):
            file = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_EXCL | flags, 0o666)
            with suppress(OSError):
                os.write(file, _MADE)
            return file
        with suppress(FileNotFoundError):  # whoever had it has removed it in between
            file = _opened_again(lock, flags)
            break
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.ENXIO, os.strerror(errno.ENXIO))
    return file


def _opened_again(lock: str, flags: int) -> int:
    try:
        return os.open(lock, os.O_RDWR | flags)
    except PermissionError:
        # Another user's, who may have been killed: it can be locked all the same, where it can be read.
        return os.open(lock, os.O_RDONLY | flags)


def _cannot_be_made(lock: str, database: str, error: OSError) -> CaptureError:
    if error.errno in _NO_FILE or os.path.isdir(lock):
        what = "is no file, and one of this name keeps loggers apart that would write to one database"
        return CaptureError(what, where=lock, next_step="give it another name, or log to another file")
    if isinstance(error, PermissionError) and os.path.lexists(lock):
        what = "cannot be opened, and keeps loggers apart that would write to one database: permission denied"
        return CaptureError(what, where=lock, next_step="remove it if no nvscope logs there, or log to another file")
    folder = os.path.dirname(lock)
    if isinstance(error, FileNotFoundError) and not os.path.isdir(folder):
        return CaptureError(
            "its folder does not exist, and none is made", where=database, next_step="make it, or name a file with -w"
        )
    what = f"nothing can be written in its folder: {error.strerror}"
    return CaptureError(what, where=database, next_step=f"check the folder, {folder}, or log elsewhere")


def _is_at(file: int, path: str) -> bool:
    """Return whether an open file is the one that has a name."""
    try:
        return os.path.samestat(os.fstat(file), os.lstat(path))
    except FileNotFoundError:
        return False


def _whose(file: int) -> str:
    """Say which process has written that it holds a lock, '' where that is not known."""
    try:
        os.lseek(file, 0, os.SEEK_SET)
        found = _OURS.fullmatch(os.read(file, _LONGEST))
    except OSError:
        return ""
    if not found:
        return ""
    host = found[2].decode("utf-8", "replace")
    return f" (process {int(found[1])}{'' if host == socket.gethostname() else f' on {host}'})"


def _is_ours(file: int) -> bool:
    """Return whether a file says that it is: what somebody else made stays as it is, be it empty."""
    os.lseek(file, 0, os.SEEK_SET)
    content = os.read(file, _LONGEST)
    return content == _MADE or bool(_OURS.fullmatch(content))


def _sign(file: int) -> None:
    """Write who holds a lock, for those that come second; where that cannot be, they are not told."""
    with suppress(OSError):
        if _is_ours(file):
            os.ftruncate(file, 0)
            os.lseek(file, 0, os.SEEK_SET)
            told = f"logged by nvscope: process {os.getpid()} on {socket.gethostname()}\n"
            os.write(file, told.encode(errors="replace"))


if sys.platform == "win32":
    _AT = 1 << 30  # what is locked cannot be read by others, and they are to read who holds it

    def _lock(file: int, *, shared: bool) -> bool | None:
        """Lock a file, and return whether nobody else has, None where nobody knows; locks are not shared here."""
        os.lseek(file, _AT, os.SEEK_SET)
        with suppress(OSError):
            msvcrt.locking(file, msvcrt.LK_UNLCK, 1)
        os.lseek(file, _AT, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            if error.errno in _IS_HELD:
                return False
            if error.errno not in _NO_LOCKS:
                raise
            return None
        return True

    def _remove(lock: str, file: int) -> None:
        # A file that is open has to stay; of one that somebody else has opened since, so it does.
        os.close(file)
        os.unlink(lock)

else:

    def _lock(file: int, *, shared: bool) -> bool | None:
        """Lock a file, and return whether nobody else has, None where nobody knows: there are no locks."""
        try:
            # By flock: other locks are lost when any file of this process is closed that is the same.
            fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in _IS_HELD:
                return False
            if error.errno not in _NO_LOCKS:
                raise
            return None
        return True

    def _remove(lock: str, file: int) -> None:
        os.unlink(lock)

    def _forget_in_copy() -> None:
        for file in _HELD:
            with suppress(OSError):
                os.close(file)
        _HELD.clear()

    os.register_at_fork(after_in_child=_forget_in_copy)
