"""Where the program begins: an interrupt while it is still being imported ends it without a word."""

# Not by ``signal``: that imports what takes longer than all that stands here.
import _signal  # type: ignore[import-not-found]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import NoReturn

_NO_MEMORY = b"nvscope: there is not enough memory to start, or to say what there is too little of\n"
_CAPTURE = 5  # ExitCode.CAPTURE, which may be what could not be imported


def main() -> "NoReturn":
    """Run the program (``nvscope.cli.main``)."""
    # A shell that runs a command in the background lets it ignore interrupts: that stays so.
    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
    try:
        from nvscope.cli.main import main as run
    except (MemoryError, OSError) as error:
        import errno
        import os

        if isinstance(error, OSError) and error.errno != errno.ENOMEM:
            raise
        os.write(2, _NO_MEMORY)
        os._exit(_CAPTURE)
    try:
        run()
    except (MemoryError, SystemError):  # the interpreter raises the second where it has no memory for the first
        import os
        import sys

        os.write(2, _NO_MEMORY)
        sys.exit(_CAPTURE)
