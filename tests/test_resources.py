"""What an error of a library says of the system: a shortage, or something else."""

from __future__ import annotations

import errno

import pytest

from nvscope.errors import ExitCode
from nvscope.resources import shortage

NO_MEMORY = [
    MemoryError(),
    OSError(errno.ENOMEM, "Cannot allocate memory"),
    ImportError("libx.so: failed to map segment from shared object: Cannot allocate memory"),
    SystemError("error return without exception set"),
    SystemError("<built-in function exec> returned NULL without setting an exception"),
]


@pytest.mark.parametrize("error", NO_MEMORY, ids=str)
def test_too_little_memory_is_said_however_it_shows(error: Exception) -> None:
    behind = ValueError("a part cannot be read")
    behind.__cause__ = error
    for one in (error, behind):
        told = shortage(one)
        assert told is not None
        assert told.exit_code == ExitCode.CAPTURE
        assert "not enough memory" in told.what


@pytest.mark.parametrize("error", [ValueError("x"), OSError(errno.ENOENT, "No such file"), SystemError("bad argument")])
def test_what_is_no_shortage_is_none(error: Exception) -> None:
    assert shortage(error) is None
