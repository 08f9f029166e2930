"""The program from start to end: exit codes, and what a person sees when something goes wrong."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import signal
import sys
from typing import Any, NoReturn, cast

import typer

from nvscope.capture.bus_error import end_in_words
from nvscope.cli.encodings import adapt
from nvscope.cli.memory import leave_the_rest_at_exit, look_for_cycles_seldom
from nvscope.cli.program import VERBS, program
from nvscope.cli.threads import start_no_threads
from nvscope.cli.words import in_order
from nvscope.errors import CaptureError, ExitCode, NvscopeError, UnreadableInput

# Typer brings a click of its own, or uses the installed one, depending on its version.
_CommandLineError = cast(
    "type[Exception]", next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
)


_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f]")
_SIGNALLED = 128
_KEPT: list[Any] = []
_OUTPUT_FAILS = (errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EDQUOT)


def main() -> NoReturn:
    """Run the program and exit with what its exit codes promise (``nvscope.errors.ExitCode``)."""
    _end_in_order()
    end_in_words(_tidied)
    start_no_threads()
    look_for_cycles_seldom()
    leave_the_rest_at_exit()
    for name in ("stdout", "stderr"):
        _let_wait(name)
        if getattr(sys, name) is None:  # the shell closed it
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115  # to the end of the program
    sys.stderr = _stderr_that_never_fails()
    for stream in (sys.stdout, sys.stderr):
        adapt(stream)
    try:
        if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        words = in_order(sys.argv[1:], VERBS)
        status = program(next(iter(words), None))(words, prog_name="nvscope", standalone_mode=False)
        sys.stdout.flush()
    except NvscopeError as error:
        _show(error)
        sys.exit(error.exit_code)
    except _CommandLineError as error:
        _show_usage(error)
        sys.exit(ExitCode.USAGE)
    except (typer.Abort, KeyboardInterrupt):
        sys.exit(ExitCode.INTERRUPTED)
    except _Ended as end:
        sys.exit(_SIGNALLED + end.number)
    except (BrokenPipeError, SystemExit) as left:
        # Whoever read this has read enough; typer turns a broken pipe into an exit of its own.
        reason = left.__context__ if isinstance(left, SystemExit) else left
        if not isinstance(reason, BrokenPipeError):
            raise
        _drop_output()
        sys.exit(ExitCode.GOOD)
    except OSError as error:
        if error.errno not in _OUTPUT_FAILS:
            # Something of the system that nobody expected at this place; it says itself what it is.
            failure = UnreadableInput(
                error.strerror or str(error), where=str(error.filename or ""), next_step="check paths and permissions"
            )
            _show(failure)
            sys.exit(failure.exit_code)
        _drop_output()
        _show(
            CaptureError(f"the output cannot be written: {error.strerror}", next_step="make room, or write elsewhere")
        )
        sys.exit(ExitCode.CAPTURE)
    except MemoryError:
        _show(CaptureError("there is not enough memory", next_step="read a part with --from-time and --to-time"))
        sys.exit(ExitCode.CAPTURE)
    except Exception:
        import traceback

        traceback.print_exc()
        print("nvscope: this is a bug of nvscope; please report it with the lines above.", file=sys.stderr)
        sys.exit(ExitCode.BUG)
    sys.exit(status if isinstance(status, int) else ExitCode.GOOD)


def _tidied() -> int:
    from nvscope.whole_files import discard_all

    discard_all()
    return ExitCode.DATA_LOSS


def _let_wait(name: str) -> None:
    """Let a stream wait for its reader: where whoever started the program made it not to, output would be cut."""
    with contextlib.suppress(AttributeError, OSError, ValueError):
        descriptor = getattr(sys, name).fileno()
        if not os.get_blocking(descriptor):
            os.set_blocking(descriptor, True)


class _Forgiving(io.FileIO):
    """A file to which nothing is written where it cannot be: what is said on stderr decides no exit code."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


def _stderr_that_never_fails() -> io.TextIOWrapper:
    stream: Any = sys.stderr
    try:
        raw = _Forgiving(stream.fileno(), "w", closefd=False)
    except (OSError, ValueError):
        return cast("io.TextIOWrapper", stream)
    # Forgotten, it would close the descriptor, which the next file that is opened would get.
    _KEPT.append(stream)
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding=stream.encoding, errors="backslashreplace", line_buffering=True
    )


class _Ended(BaseException):
    """The process was asked to end; what is half written is removed on the way."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def _end_in_order() -> None:
    """Let SIGTERM and SIGHUP end the program as Ctrl-C does: with its files whole, or not there."""

    def end(number: int, _: object) -> None:
        for name in _ENDING:
            signal.signal(name, signal.SIG_IGN)  # once is enough
        raise _Ended(number)

    for name in _ENDING:
        # Who started the program with nohup wants it to go on.
        if signal.getsignal(name) is signal.SIG_DFL:
            with contextlib.suppress(ValueError):  # not in the main thread
                signal.signal(name, end)


def _drop_output() -> None:
    """Let what is left of the output go nowhere; Python would complain once more when it flushes at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _show_usage(error: Exception) -> None:
    """Show what the command line lacks; Typer escapes some of what a terminal would obey, and not all."""
    from nvscope.view.escape import visible

    told = io.StringIO()
    error.show(file=told)  # type: ignore[attr-defined]
    parts = {part for word in sys.argv[1:] for part in (word, *word.split("=", 1))}
    # As Typer writes them, which leaves backslashes alone: what is typed as one would look like an escape.
    escapes = {_CONTROLS.sub(lambda one: f"\\x{ord(one[0]):02x}", part): visible(part) for part in parts}
    known = "|".join(re.escape(part) for part in sorted(filter(None, escapes), key=len, reverse=True))
    text = re.sub(rf"(?<!\\)(?:{known})(?!\\)", lambda one: escapes[one[0]], told.getvalue())
    print("".join(one if one.isprintable() or one == "\n" else visible(one) for one in text), end="", file=sys.stderr)


def _show(error: NvscopeError) -> None:
    from nvscope.view.escape import visible

    where = f"{visible(error.where)}: " if error.where else ""
    print(f"nvscope: {where}{visible(error.what)}", file=sys.stderr)
    for line in error.excerpt:
        print(f"  {line}", file=sys.stderr)
    if error.next_step:
        print(f"  {visible(error.next_step)}", file=sys.stderr)
