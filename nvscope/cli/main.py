"""The program from start to end: exit codes, and what a person sees when something goes wrong."""

from __future__ import annotations

import contextlib
import errno
import io
import re
import signal
import sys
from typing import NoReturn, cast

import typer

from nvscope.capture.bus_error import end_in_words
from nvscope.cli.interrupts import comes_of_an_interrupt, lose_no_interrupt
from nvscope.cli.memory import leave_the_rest_at_exit, look_for_cycles_seldom
from nvscope.cli.program import VERBS, program
from nvscope.cli.streams import drop_output, prepare, spare_inputs
from nvscope.cli.terminal import notice
from nvscope.cli.threads import start_no_threads
from nvscope.cli.words import in_order
from nvscope.errors import CaptureError, ExitCode, NvscopeError, UnreadableInput

# Imported at once: nothing can be read any more when it is needed where memory or descriptors are at their end.
from nvscope.resources import allow_all_descriptors, shortage
from nvscope.view.escape import visible

# Typer brings a click of its own, or uses the installed one, depending on its version.
_CommandLineError = cast(
    "type[Exception]", next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
)


_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
_CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f]")
_SIGNALLED = 128
_OUTPUT_FAILS = (errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EDQUOT, errno.EBADF)


def main() -> NoReturn:
    """Run the program and exit with what its exit codes promise (``nvscope.errors.ExitCode``)."""
    _end_in_order()
    lose_no_interrupt()
    end_in_words(_tidied)
    start_no_threads()
    look_for_cycles_seldom()
    allow_all_descriptors()
    leave_the_rest_at_exit()
    prepare()
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
        drop_output()
        sys.exit(ExitCode.GOOD)
    except OSError as error:
        if short := shortage(error):
            _show(short)
            sys.exit(short.exit_code)
        if error.errno not in _OUTPUT_FAILS:
            # Something of the system that nobody expected at this place; it says itself what it is.
            failure = UnreadableInput(
                error.strerror or str(error), where=str(error.filename or ""), next_step="check paths and permissions"
            )
            _show(failure)
            sys.exit(failure.exit_code)
        drop_output()
        why = "stdout is closed" if error.errno == errno.EBADF else error.strerror
        _show(CaptureError(f"the output cannot be written: {why}", next_step="make room, or write elsewhere"))
        sys.exit(ExitCode.CAPTURE)
    except Exception as error:
        if comes_of_an_interrupt(error):
            sys.exit(ExitCode.INTERRUPTED)
        if short := shortage(error):
            _show(short)
            sys.exit(short.exit_code)
        import traceback

        spare_inputs(_named())
        traceback.print_exc()
        print("nvscope: this is a bug of nvscope; please report it with the lines above.", file=sys.stderr)
        sys.exit(ExitCode.BUG)
    sys.exit(status if isinstance(status, int) else ExitCode.GOOD)


def _tidied() -> int:
    from nvscope.whole_files import discard_all

    discard_all()
    return ExitCode.DATA_LOSS


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


def _show_usage(error: Exception) -> None:
    """Show what the command line lacks; Typer escapes some of what a terminal would obey, and not all."""
    spare_inputs(_named())
    told = io.StringIO()
    error.show(file=told)  # type: ignore[attr-defined]
    parts = {part for word in sys.argv[1:] for part in (word, *word.split("=", 1))}
    # As Typer writes them, which leaves backslashes alone: what is typed as one would look like an escape.
    escapes = {_CONTROLS.sub(lambda one: f"\\x{ord(one[0]):02x}", part): visible(part) for part in parts}
    text = told.getvalue()
    # Without a word there is nothing to look for, and a pattern of nothing is found everywhere.
    if known := "|".join(re.escape(part) for part in sorted(filter(None, escapes), key=len, reverse=True)):
        text = re.sub(rf"(?<!\\)(?:{known})(?!\\)", lambda one: escapes[one[0]], text)
    print("".join(one if one.isprintable() or one == "\n" else visible(one) for one in text), end="", file=sys.stderr)


def _named() -> set[str]:
    """Return what may be a file on the command line: as a word, behind = or behind the letter of an option."""
    return {part for word in sys.argv[1:] for part in (word, word.partition("=")[2], word[2:])}


def _show(error: NvscopeError) -> None:
    spare_inputs(_named())
    where = f"{visible(error.where)}: " if error.where else ""
    print(notice(f"nvscope: {where}{visible(error.what)}"), file=sys.stderr)
    for line in error.excerpt:
        print(f"  {line}", file=sys.stderr)
    if error.next_step:
        print(notice(f"  {visible(error.next_step)}"), file=sys.stderr)
    for other in error.others:
        _show(other)
