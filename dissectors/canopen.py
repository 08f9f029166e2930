"""Identifiers that CANopen has given away: its predefined connection set (CiA 301), and LSS (CiA 305)."""

from __future__ import annotations

from typing import NamedTuple

MAX_COB_ID = 0x7FF
"""The largest identifier of a CAN base frame."""


class Service(NamedTuple):
    """A service and the COB-IDs from ``first`` to ``last`` that it uses."""

    name: str
    first: int
    last: int


PREDEFINED = (
    Service("NMT", 0x000, 0x000),
    Service("SYNC", 0x080, 0x080),
    Service("EMCY", 0x081, 0x0FF),
    Service("TIME", 0x100, 0x100),
    Service("TPDO1", 0x181, 0x1FF),
    Service("RPDO1", 0x201, 0x27F),
    Service("TPDO2", 0x281, 0x2FF),
    Service("RPDO2", 0x301, 0x37F),
    Service("TPDO3", 0x381, 0x3FF),
    Service("RPDO3", 0x401, 0x47F),
    Service("TPDO4", 0x481, 0x4FF),
    Service("RPDO4", 0x501, 0x57F),
    Service("SDO answer", 0x581, 0x5FF),
    Service("SDO request", 0x601, 0x67F),
    Service("heartbeat", 0x701, 0x77F),
    Service("LSS", 0x7E4, 0x7E5),
)
"""The predefined connection set, by COB-ID."""


def services_within(first: int, last: int) -> tuple[Service, ...]:
    """Return the services that use any of the COB-IDs from ``first`` to ``last``."""
    return tuple(service for service in PREDEFINED if service.first <= last and first <= service.last)
