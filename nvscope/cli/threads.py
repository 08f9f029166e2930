"""What numpy's linear algebra does when it is loaded, which nothing here needs."""

from __future__ import annotations

import os


def start_no_threads() -> None:
    """Let OpenBLAS start no threads, unless the environment says how many; to be called before numpy is imported.

    It starts one for each further core, and each of them waits for work in a loop before it sleeps: at the start of a
    short run, that is a fifth of the processor time.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
