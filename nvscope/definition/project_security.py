"""Security in the project file: who may write, when, and from which networks telegrams come."""

from __future__ import annotations

import ipaddress
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from msgspec import Struct

from nvscope.definition.project_nodes import canonical_address, of_unknown_node
from nvscope.toml_table import FLAG, TEXT, Place, ValueKind, array, key

Network = ipaddress.IPv4Network | ipaddress.IPv6Network

_DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
_DAY = "|".join(_DAYS)
_SPAN = re.compile(
    rf"(?:(?P<first>{_DAY})(?:-(?P<last>{_DAY}))? +)?(?P<from>\d\d?:\d\d) *- *(?P<to>\d\d?:\d\d)",
    re.ASCII | re.IGNORECASE,
)
_DAY_MINUTES = 24 * 60
_S_NS = 1_000_000_000
_LONGEST_NAME = 60


class Hours(Struct, frozen=True):
    """A span of time of some days: minutes since midnight, local time, the last one excluded; days from 0, Monday.

    One that ends before it begins ends on the next day.
    """

    text: str
    first_minute: int
    end_minute: int
    days: frozenset[int] = frozenset(range(7))

    def holds(self, day: int, minute: int) -> bool:
        """Tell whether a minute of a day lies in it."""
        if self.first_minute < self.end_minute:
            return day in self.days and self.first_minute <= minute < self.end_minute
        # What is behind midnight belongs to the day on which it began.
        return (day in self.days and minute >= self.first_minute) or (
            (day - 1) % 7 in self.days and minute < self.end_minute
        )


def _network(value: Any, place: Place) -> Network:
    text = str(TEXT.read(value, place)).strip()
    try:
        found = ipaddress.ip_network(text)
    except ValueError as error:
        what = f"'{text[:_LONGEST_NAME]}' is no network"
        if "host bits" in str(error):
            loose = ipaddress.ip_network(text, strict=False)
            raise place.error(f"{what}: the address has bits behind its mask", f"Write {loose}.") from None
        raise place.error(what, 'Write one such as "192.168.1.0/24".') from None
    return found


def _writer(value: Any, place: Place) -> Network | str:
    """Return the network of a writer, and the text of what can only be the name of a node."""
    text = str(TEXT.read(value, place)).strip()
    if (address := canonical_address(text)) is not None:
        return ipaddress.ip_network(address)
    if "/" in text:
        return _network(text, place)
    if not 0 < len(text) <= _LONGEST_NAME:
        raise place.error(
            "a writer is an address, a network, or the name of a node",
            'Write one such as "192.168.1.20", or [] where nobody may write.',
        )
    return text


def _hours(value: Any, place: Place) -> Hours:
    text = str(TEXT.read(value, place)).strip()
    match = _SPAN.fullmatch(text)
    minutes = [_minute(match[name]) for name in ("from", "to")] if match else []
    if match is None or None in minutes or minutes[0] == minutes[1] or minutes[0] == _DAY_MINUTES:
        what = f"'{text[:_LONGEST_NAME]}' is no span of hours"
        raise place.error(what, 'Write from when to when, local time: "06:00-18:00", "mon-fri 22:00-06:00".')
    first, end = (one or 0 for one in minutes)
    days = frozenset(range(7))
    if match["first"]:
        begin = _DAYS.index(match["first"].lower())
        last = _DAYS.index((match["last"] or match["first"]).lower())
        days = frozenset((begin + number) % 7 for number in range((last - begin) % 7 + 1))
    return Hours(text, first, end, days)


def _minute(text: str) -> int | None:
    """Return the minute of the day that a time is, None for none: 24:00 is the end of the day."""
    hour, minute = map(int, text.split(":"))
    found = 60 * hour + minute
    return found if minute < 60 and found <= _DAY_MINUTES else None


@dataclass(frozen=True, slots=True)
class Security:
    """What is allowed in the plant. What is not said here is not judged: without this table, nothing is forbidden."""

    writers: tuple[Network | str, ...] | None = key(
        array(ValueKind("address, network or name of a node", _writer, schema={"type": "string"}), single=True),
        "who may write parameters (SDO) and variables (WebVisu); a write of others is NV962, with [] all of them",
        default=None,
    )
    hours: tuple[Hours, ...] = key(
        array(ValueKind("span of hours", _hours, schema={"type": "string"}), single=True),
        'when these may be written, local time, with days where they matter: "06:00-18:00", "mon-fri 06:00-18:00"; a '
        "write at another time is NV962",
        default=(),
    )
    subnets: tuple[Network, ...] = key(
        array(ValueKind("network", _network, schema={"type": "string"}), single=True),
        "where network variables come from; a telegram from elsewhere is NV965. Of IPv4 and IPv6, only what is named "
        "here is judged, and link-local IPv6 never",
        default=(),
    )
    only_nodes: bool = key(
        FLAG, "[nodes] names all nodes that send lists: one that is not there and sends any is NV961", default=False
    )

    @property
    def judges_writes(self) -> bool:
        """Whether anything is said of who may write, or when."""
        return self.writers is not None or bool(self.hours)

    def lets_write(self, address: str) -> bool:
        """Tell whether a host may write, whenever."""
        return self.writers is None or _is_in(address, self.writers)

    def lets_write_at(self, time_ns: int) -> bool:
        """Tell whether anybody may write at a time."""
        if not self.hours:
            return True
        local = time.localtime(time_ns // _S_NS)
        return any(one.holds(local.tm_wday, 60 * local.tm_hour + local.tm_min) for one in self.hours)

    def is_outside(self, address: str) -> bool:
        """Tell whether an address is in none of the subnets, of which some are of its kind.

        A link-local one of IPv6, which every host has beside others, is of this network: no router lets it through.
        """
        own = ipaddress.ip_address(address)
        if own.version == 6 and own.is_link_local:
            return False
        alike = [one for one in self.subnets if one.version == own.version]
        return bool(alike) and not any(own in one for one in alike)


def _is_in(address: str, networks: Sequence[Network | str]) -> bool:
    own = ipaddress.ip_address(address)
    return any(not isinstance(one, str) and own in one for one in networks)


def security_of(told: Security, addresses: Mapping[str, str], place: Place) -> Security:
    """Return what a project says of security, with the addresses of nodes in place of their names.

    ``addresses`` are those of nodes by name. ConfigurationError where a writer is neither an address nor a name.
    """
    if told.writers is None:
        return told
    writers: list[Network | str] = []
    for number, one in enumerate(told.writers):
        if isinstance(one, str):
            if one not in addresses:
                here = place.below("security").below("writers").below(number)
                raise here.error(f"no node is called '{one[:60]}'", of_unknown_node(one, addresses))
            writers.append(ipaddress.ip_network(addresses[one]))
        else:
            writers.append(one)
    return Security(tuple(writers), told.hours, told.subnets, told.only_nodes)
