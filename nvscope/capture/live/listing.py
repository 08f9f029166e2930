"""What can be captured on: the interfaces of this machine, then the CAN channels that drivers find, as words."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from msgspec import Struct

from nvscope.capture.live.addresses import Address, addresses_of
from nvscope.capture.live.device import device_of, names, state_of
from nvscope.errors import CaptureError


class Listed(Struct, frozen=True):
    """A source by the ``word`` that names it, what it is, whether it works, and its addresses; '' for what is unknown.

    ``title`` is what the system calls it where its name says nothing.
    """

    word: str
    kind: str = ""
    state: str = ""
    addresses: tuple[Address, ...] = ()
    title: str = ""


def interfaces() -> list[Listed]:
    """Return the interfaces of this machine, in the order of the system."""
    if not sys.platform.startswith("linux"):
        from nvscope.capture.live.layer2_devices import devices  # noqa: PLC0415

        return [
            Listed(one.name, one.kind, "up" if one.is_up else "down", one.addresses, one.title) for one in devices()
        ]  # fmt: skip
    return [_listed(name) for name in names()]


def _listed(name: str) -> Listed:
    device, state = device_of(name), state_of(name)
    told = ""
    if state is not None:
        told = "down" if not state.is_up else "up" if state.has_carrier else "up, no carrier"
    return Listed(name, device.kind_name if device else "", told, tuple(addresses_of(name)))


def can_channels() -> list[Listed]:
    """Return the channels that drivers of python-can find; it takes a second or two."""
    from nvscope.capture.live.can.library import channels  # noqa: PLC0415

    return [Listed(word) for word in channels()]


def word_of(number: int) -> str:
    """Return the source that has a number in the list, counted from 1; CaptureError where there is none."""
    found: Sequence[Listed] = interfaces()
    if number > len(found):
        found = [*found, *can_channels()]
    if not 0 < number <= len(found):
        raise CaptureError(f"no interface has the number {number}", next_step="`nvscope -D` lists them")
    return found[number - 1].word
