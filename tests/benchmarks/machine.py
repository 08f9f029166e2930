"""The machine that is measured on: what it is, and the core that is kept free."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import subprocess
from pathlib import Path


def version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def machine() -> str:
    processor = platform.processor() or platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            processor = line.split(":", 1)[1].strip()
            break
    tshark = "missing"
    if shutil.which("tshark"):
        tshark = subprocess.run(["tshark", "--version"], capture_output=True, text=True, check=False).stdout.split(
            "\n"
        )[0]
    packages = ", ".join(f"{name} {version(name)}" for name in ("nvscope", "numpy", "dpkt", "scapy"))
    return f"{processor}, {os.cpu_count()} cores; Python {platform.python_version()}; {packages}; {tshark}"


def reserve_core() -> int:
    """Choose the core for the measured processes and leave it, where there is another one."""
    available = sorted(os.sched_getaffinity(0))
    if len(available) > 1:
        os.sched_setaffinity(0, set(available[:-1]))
    return available[-1]
