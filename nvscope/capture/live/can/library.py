"""Where python-can is asked: to open a bus, and which channels there are. It is imported when that is wanted."""

from __future__ import annotations

import errno
import importlib
import logging
import re
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from dissectors.can.frame import CanBatch
from nvscope.capture.live.can.drivers import PASSIVE, Driver, driver_of
from nvscope.capture.live.can.word import PREFIX, CanWord
from nvscope.errors import CaptureError, UsageError

DETECT_S = 2.0
"""How long drivers may look for channels."""

_LOGGERS = ("can", "seeedbus")
_MOST_NEAR = 3
_MOST_CHANNELS = 200
_MISSING = re.compile(
    r"not installed|no module named|librar(?:y|ies)\b.*\bnot\b|\bnot\b.*\blibrar(?:y|ies)\b", re.IGNORECASE
)
_LISTS = "`nvscope -D` lists the channels that drivers find"


class UnknownInterface(Exception):
    """An interface that python-can does not know; ``known`` are those that it does."""

    def __init__(self, known: Sequence[str]) -> None:
        super().__init__()
        self.known = known


def _library() -> Any:
    # What drivers complain of would go to stderr; what matters of it is told in words.
    for name in _LOGGERS:
        logging.getLogger(name).addHandler(logging.NullHandler())
    import can  # noqa: PLC0415  it takes a tenth of a second
    import can.interfaces  # noqa: PLC0415

    return can


def opened(where: CanWord, driver: Driver) -> Any:
    """Return an open bus, which listens only where its driver can.

    Configuration files of python-can are not asked: what is captured is what the word says. Raises whatever a driver
    raises, for ``reason``.
    """
    return _opened(where, driver.options)


def opened_to_send(where: CanWord) -> Any:
    """Return an open bus that may be sent on; raises as ``opened``."""
    driver = driver_of(where.interface)
    return _opened(where, {} if driver.listens else driver.options)


def message_of(frames: CanBatch, place: int) -> Any:
    """Return a frame as python-can sends it; it is no error frame, and whole."""
    at, length, is_fd = int(frames.at[place]), int(frames.length[place]), bool(frames.fd[place])
    remote = bool(frames.remote[place])
    return _library().Message(
        arbitration_id=int(frames.identifier[place]), is_extended_id=bool(frames.extended[place]),
        is_remote_frame=remote, is_fd=is_fd, bitrate_switch=bool(frames.brs[place]),
        error_state_indicator=bool(frames.esi[place]), dlc=length,
        data=None if remote else frames.data[at : at + length].tobytes(),
    )  # fmt: skip


def _opened(where: CanWord, options: Mapping[str, Any]) -> Any:
    can = _library()
    if where.interface not in can.interfaces.BACKENDS:
        raise UnknownInterface(sorted(can.interfaces.BACKENDS))
    asked = {key: can.BusState.PASSIVE if value == PASSIVE else value for key, value in options.items()}
    told: Mapping[str, Any] = where.options
    if isinstance(state := told.get("state"), str):
        told = {**told, "state": can.BusState[state.upper()]}
    return can.Bus(
        interface=where.interface, channel=where.driver_channel, ignore_config=True, **{**asked, **told}
    )  # fmt: skip


def reason(where: CanWord, word: str, error: BaseException) -> CaptureError:
    """Return why a bus could not be opened, with what to do about it."""
    told = str(error).strip().splitlines()[0][:300] if str(error).strip() else type(error).__name__
    if isinstance(error, UnknownInterface):
        return _unknown(where, word, error.known)
    if isinstance(error, ModuleNotFoundError) and error.name == "can":
        return CaptureError(
            "CAN buses need python-can, which is not installed",
            where=word,
            next_step="install it: pip install python-can",
        )
    # What a library lacks that was not found, some drivers notice by a name that is not defined.
    if isinstance(error, ImportError | NotImplementedError | NameError) or _MISSING.search(told):
        needs = driver_of(where.interface).needs
        next_step = (
            f'install what it needs: pip install "{needs}"' if needs
            else "install the driver of the manufacturer of the adapter, and what python-can says of it in its manual"
        )  # fmt: skip
        return CaptureError(f"the driver of {where.interface} is missing: {told}", where=word, next_step=next_step)
    system = _system_error(error)
    if system is not None:
        what, next_step = _SYSTEM.get(system.errno or 0, (system.strerror or told, _LISTS))
        return CaptureError(what, where=word, next_step=next_step)
    if isinstance(error, TypeError | ValueError | KeyError):
        return CaptureError(
            f"its driver cannot be told this: {told}", where=word,
            next_step=f"what {where.interface} takes behind commas stands in the manual of python-can; {_LISTS}",
        )  # fmt: skip
    return CaptureError(f"it cannot be opened: {told}", where=word, next_step=f"look at adapter and channel; {_LISTS}")


_SYSTEM = {
    errno.ENODEV: ("there is no such channel", _LISTS),
    errno.ENOENT: ("there is no such channel", _LISTS),
    errno.ENXIO: ("there is no such channel", _LISTS),
    errno.EINVAL: ("this is no channel of this interface", _LISTS),
    errno.ENETDOWN: ("the interface is down", "set it up: sudo ip link set NAME up type can bitrate 250000"),
    errno.EACCES: ("no permission", "run it with sudo, or join the group that the device belongs to (dialout)"),
    errno.EPERM: ("no permission", "run it with sudo"),
    errno.EBUSY: ("another program has it", "end that program"),
    errno.EAFNOSUPPORT: ("the kernel knows no CAN", "load its modules: sudo modprobe can_raw"),
    errno.EPROTONOSUPPORT: ("the kernel knows no CAN", "load its modules: sudo modprobe can_raw"),
}


def _system_error(error: BaseException | None) -> OSError | None:
    """Return the error of the system that an error comes of, None where there is none."""
    for _ in range(8):
        if error is None or isinstance(error, OSError):
            return error
        error = error.__cause__ or error.__context__
    return None


def _unknown(where: CanWord, word: str, known: Sequence[str]) -> CaptureError:
    from difflib import get_close_matches  # noqa: PLC0415  only where something is wrong

    near = get_close_matches(where.interface.lower(), known, _MOST_NEAR, 0.6)
    perhaps = f"perhaps {', '.join(f'{PREFIX}{one}:{where.channel}' for one in near)}; " if near else ""
    return CaptureError(
        f"python-can has no interface '{where.interface}'", where=word, next_step=f"{perhaps}it has {', '.join(known)}"
    )


def channels() -> list[str]:
    """Return what the drivers that are there find, as words; of those that take longer than ``DETECT_S``, nothing.

    Not asked are the virtual interface, which makes channels up, and socketcand, which waits for other machines.
    """
    try:
        backends = dict(_library().interfaces.BACKENDS)
    except ImportError:
        return []
    found: dict[str, list[str]] = {}
    threads = [
        threading.Thread(target=_detect, args=(interface, *where, found), daemon=True)
        for interface, where in sorted(backends.items())
        if interface not in ("virtual", "socketcand")
    ]
    for thread in threads:
        thread.start()
    until_s = time.monotonic() + DETECT_S
    for thread in threads:
        thread.join(max(until_s - time.monotonic(), 0))
    return [word for _, words in sorted(found.items()) for word in words][:_MOST_CHANNELS]


def _detect(interface: str, module: str, kind: str, found: dict[str, list[str]]) -> None:
    # Not by python-can's own function: its threads keep the process from ending where a driver hangs.
    with suppress(BaseException):
        told = getattr(importlib.import_module(module), kind)._detect_available_configs()
        found[interface] = sorted({word for one in told if (word := _word(interface, one))})


def _word(interface: str, told: Mapping[str, Any]) -> str:
    """Return what a bus is called that a driver found, with what else it has to be told; '' where nothing says it."""
    channel = told.get("channel")
    if channel is None or isinstance(channel, bytes):
        return ""
    word = f"{PREFIX}{interface}:{channel}"
    others = {key: value for key, value in told.items() if key not in ("interface", "channel")}
    for chosen in (others, {}):
        longer = word + "".join(
            f",{key}={value}" for key, value in chosen.items() if isinstance(value, str | int) and key != "fd"
        )
        with suppress(UsageError):
            if CanWord.of(longer).channel == str(channel):
                return longer
    return ""
