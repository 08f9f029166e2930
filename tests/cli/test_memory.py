"""What a long run asks of the C library is what the process gets."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

LARGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage/enabled")

HEAP_AFTER = """
from nvscope.cli.memory import keep_freed_memory
keep_freed_memory()
import numpy
columns = [numpy.ones(1 << 17) for _ in range(8)]
heaps = open("/proc/self/smaps").read().split("VmFlags:")
print(*[part.split()[0] + ":" + after.split("\\n")[0] for part, after in zip(heaps, heaps[1:]) if "[heap]" in part])
"""


@pytest.mark.skipif(not LARGE_PAGES.exists(), reason="this system has no large pages")
def test_the_heap_that_columns_lie_in_is_of_large_pages() -> None:
    done = subprocess.run([sys.executable, "-c", HEAP_AFTER], capture_output=True, text=True, check=True)
    assert " hg" in done.stdout
