"""What is known of the drivers of python-can: how each is told to listen only, whose clock it tells, and its errors.

Source: the packages below ``can.interfaces`` of python-can 4.6. A driver that is no row, such as one of another package
that registers itself, is ``OTHER``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from types import MappingProxyType

from nvscope.capture.live.can.word import CanWord, Value


class Clock(Enum):
    """Whose times a driver tells."""

    SYSTEM = auto()
    """Those of the kernel of this machine."""
    OWN = auto()
    """Of a device, another machine, or nobody knows: they are looked at."""
    NONE = auto()
    """In a unit that nobody knows: the times at which frames arrive take their place."""


PASSIVE = "passive"
"""Stands for ``can.BusState.PASSIVE``, by which some drivers are told to listen only."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """A driver: the ``options`` that let it listen only, and those that let it hear everything.

    ``listens`` says which: by the options, by somebody else (``remark``), or that there is no controller on a bus.
    ``has_classes``: its error frames have SocketCAN's classes. ``state_is_mode``: PASSIVE means that it was told to
    listen only. ``needs`` is what pip has to install for it beside python-can, '' for a library of the manufacturer.
    """

    options: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    listens: bool = False
    is_virtual: bool = False
    clock: Clock = Clock.OWN
    has_classes: bool = False
    needs: str = ""
    remark: str = ""


OTHER = Driver(remark="whether its driver listens only, nvscope cannot say")

_CANNOT = "its driver cannot listen only: nothing is sent, but frames of others are acknowledged"


def _listening(needs: str = "", **options: Value) -> Driver:
    return Driver(options=MappingProxyType(options), listens=True, needs=needs)


def _taking_part(needs: str = "", clock: Clock = Clock.OWN, *, has_classes: bool = False) -> Driver:
    return Driver(needs=needs, clock=clock, has_classes=has_classes, remark=_CANNOT)


DRIVERS: Mapping[str, Driver] = MappingProxyType(
    {
        # FD frames would not be seen otherwise; it asks nothing of the bus.
        "socketcan": Driver(
            options=MappingProxyType({"fd": True}), clock=Clock.SYSTEM, has_classes=True,
            remark="nothing is sent; whether its controller acknowledges frames of others is a setting of the "
            "interface: ip link set NAME type can listen-only on",
        ),
        "virtual": Driver(is_virtual=True, has_classes=True),
        "udp_multicast": Driver(
            is_virtual=True, clock=Clock.SYSTEM, has_classes=True, needs="python-can[multicast]"
        ),
        "socketcand": Driver(
            has_classes=True, remark="nothing is sent; whether the controller of that machine acknowledges frames of "
            "others is a setting there: ip link set NAME type can listen-only on",
        ),
        "slcan": _listening("python-can[serial]", listen_only=True),
        "vector": _listening(listen_only=True),
        "kvaser": _listening(driver_mode=False),
        "pcan": _listening(state=PASSIVE),
        "systec": _listening(state=PASSIVE),
        "cantact": _listening("python-can[cantact]", monitor=True),
        "nixnet": _listening("python-can[nixnet]", listen_only=True),
        "seeedstudio": _listening("python-can[seeedstudio]", operation_mode="silent"),
        "gs_usb": _taking_part("python-can[gs-usb]", has_classes=True),
        "neovi": _taking_part("python-can[neovi]"),
        "canalystii": _taking_part("python-can[canalystii]"),
        "serial": _taking_part("python-can[serial]"),
        "robotell": _taking_part("python-can[serial]"),
        "usb2can": _taking_part(clock=Clock.NONE),
        "ixxat": _taking_part(),
        "nican": _taking_part(),
        "iscan": _taking_part(),
        "neousys": _taking_part(),
        "etas": _taking_part(),
    }
)  # fmt: skip


def driver_of(interface: str) -> Driver:
    """Return what is known of the driver of an interface."""
    return DRIVERS.get(interface, OTHER)


def remark_on(word: str) -> str:
    """Return what a person has to know of a bus that is not listened to only, '' where there is nothing."""
    where = CanWord.of(word)
    driver = driver_of(where.interface)
    if driver.listens and any(where.options.get(key, value) != value for key, value in driver.options.items()):
        return "not listening only, as was asked for: nothing is sent, but frames of others are acknowledged"
    return driver.remark
