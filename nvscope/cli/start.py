"""Where the program begins: an interrupt while it is still being imported ends it without a word."""

from __future__ import annotations

import signal
from typing import NoReturn


def main() -> NoReturn:
    """Run the program (``nvscope.cli.main``)."""
    # A shell that runs a command in the background lets it ignore interrupts: that stays so.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from nvscope.cli.main import main as run

    run()
