"""Permissions: may this user capture, and what can be seen without?"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator

from nvscope.doctor.case import Case
from nvscope.doctor.result import Result, State

NAME = "permissions"


def judge_permissions(case: Case) -> Iterator[Result]:
    """Judge whether a packet socket could be opened; without, plain sockets may be enough."""
    may = case.machine.may_capture if case.machine else None
    if may is None:
        yield Result(NAME, State.UNKNOWN, "whether this user may capture is not known on this system")
    elif may:
        yield Result(NAME, State.OK, "this user may capture")
    else:
        ports = case.expected.ports
        seen = "this user may not capture (CAP_NET_RAW is missing): only broadcasts, and what is sent to this machine, "
        heard = bool(case.heard)
        yield Result(
            NAME, State.NOTE if heard else State.PROBLEM, seen + "can be seen",
            f"run it with sudo, or allow it once: sudo setcap cap_net_raw+ep {os.path.realpath(sys.executable)}; "
            f"without, udp://0.0.0.0:{ports[0]} shows what comes to this machine{_by_dumpcap()}",
            brief="this user may not capture, and nothing came to a plain socket",
        )  # fmt: skip


def _by_dumpcap() -> str:
    """Return that dumpcap can be used, where it is there and this user may start it with its own privileges."""
    path = shutil.which("dumpcap")
    if path is None or not os.access(path, os.X_OK):
        return ""
    try:
        os.getxattr(path, "security.capability")
    except (OSError, AttributeError):
        return ""
    return f"; {path} may capture for this user, and its files can be read"
