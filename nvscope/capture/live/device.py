"""Network devices of this machine: names, kinds, states and addresses."""

from __future__ import annotations

import socket
import struct
import sys
from contextlib import suppress
from pathlib import Path

from msgspec import Struct

from dissectors.batch import LinkType

_ETHERNET, _LOOPBACK, _CAN, _NONE = 1, 772, 280, 65534
_LINKS = {_ETHERNET: LinkType.ETHERNET, _LOOPBACK: LinkType.ETHERNET, _CAN: LinkType.CAN_SOCKETCAN, _NONE: LinkType.RAW}
_KINDS = {_ETHERNET: "Ethernet", _LOOPBACK: "loopback", _CAN: "CAN", _NONE: "IP"}
_IFNAME_BYTES, _HARDWARE_BYTES = 16, 6
_SIOCGIFFLAGS, _SIOCGIFHWADDR = 0x8913, 0x8927
_IFF_UP, _IFF_RUNNING = 0x1, 0x40


class Device(Struct, frozen=True):
    """A network device by ``name`` and ``index``; ``kind`` is the kernel's number for what it is (ARPHRD)."""

    name: str
    index: int
    kind: int

    @property
    def link(self) -> int:
        """The link type of what is captured on it."""
        return _LINKS[self.kind]

    @property
    def is_known(self) -> bool:
        """Whether what is captured on it can be read."""
        return self.kind in _LINKS

    @property
    def kind_name(self) -> str:
        """What it is, in a word or two."""
        return _KINDS.get(self.kind, f"kind {self.kind}, cannot be read")

    @property
    def is_loopback(self) -> bool:
        return self.kind == _LOOPBACK

    @property
    def is_ethernet(self) -> bool:
        return self.link == LinkType.ETHERNET

    @property
    def is_can(self) -> bool:
        return self.kind == _CAN


class DeviceState(Struct, frozen=True):
    """Whether somebody has set a device up, and whether it has a carrier, which is a cable that works."""

    is_up: bool
    has_carrier: bool


def names() -> list[str]:
    """Return the names of the network devices, in the order of the system."""
    if sys.platform == "win32":  # whose own names say nothing to people
        from nvscope.capture.live.layer2_devices import devices  # noqa: PLC0415

        return [one.name for one in devices()]
    try:
        return [name for _, name in socket.if_nameindex()]
    except OSError:
        return []


def device_of(name: str) -> Device | None:
    """Return a device by its name, None where there is none; elsewhere than on Linux its kind is only guessed."""
    if not sys.platform.startswith("linux"):
        known = names()
        return Device(name, known.index(name), _ETHERNET) if name in known else None
    if not 0 < len(name.encode(errors="replace")) < _IFNAME_BYTES:
        return None
    try:
        index = socket.if_nametoindex(name)
        kind = struct.unpack_from("=H", _ask(name, _SIOCGIFHWADDR), _IFNAME_BYTES)[0]
    except (OSError, ValueError):  # also what cannot be a name at all
        return None
    return Device(name, index, kind)


def hardware_of(name: str) -> str:
    """Return the hardware address of a device, as ``02:00:00:00:00:01``; "" where it has none; on Linux."""
    with suppress(OSError, ValueError):
        told = _ask(name, _SIOCGIFHWADDR)
        if struct.unpack_from("=H", told, _IFNAME_BYTES)[0] == _ETHERNET:
            return told[_IFNAME_BYTES + 2 :][:_HARDWARE_BYTES].hex(":")
    return ""


def state_of(name: str) -> DeviceState | None:
    """Return the state of a device, None where there is none any more; on Linux."""
    try:
        flags = struct.unpack_from("=H", _ask(name, _SIOCGIFFLAGS), _IFNAME_BYTES)[0]
    except (OSError, ValueError):  # also what cannot be a name at all
        return None
    return DeviceState(bool(flags & _IFF_UP), bool(flags & _IFF_RUNNING))


def speed_of(name: str) -> int | None:
    """Return what a device carries at most, in Mbit/s; None where nobody tells, as of wireless ones; on Linux."""
    with suppress(OSError, ValueError):
        told = int(Path("/sys/class/net", name, "speed").read_text("ascii"))
        return told if told > 0 else None
    return None


def _ask(name: str, question: int) -> bytes:
    from fcntl import ioctl  # noqa: PLC0415  not there on Windows

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        return ioctl(any_socket.fileno(), question, name.encode().ljust(40, b"\0"))
