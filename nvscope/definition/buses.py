"""Buses: the bit rates of CAN buses as a project or a command line gives them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from msgspec import Struct

from nvscope.errors import UsageError
from nvscope.toml_table import Place, ValueKind, key, mapping, read_table

ANY_CHANNEL = "*"
MAX_CHANNEL_NAME = 60
"""Characters that the name of a channel may have where a person gives it."""

_MOST_BITS_PER_S = 20_000_000
_LEAST_BITS_PER_S = 1_000
_RATE = re.compile(r"(\d{1,8})(?:\.(\d{1,6}))?\s*([kM]?)(?:bit/s)?", re.IGNORECASE | re.ASCII)
_FACTORS = {"": 1, "k": 1_000, "m": 1_000_000}
_EXAMPLE = 'Write bits per second, such as 250000, or "250k", "1M".'


def parse_bit_rate(text: str) -> int:
    """Return bits per second of ``250000``, ``250k`` or ``1M``; ValueError where the text is no bit rate of CAN."""
    match = _RATE.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"'{text[:40]}' is no bit rate")
    fraction = match[2] or ""
    rate: int = int(match[1] + fraction) * _FACTORS[match[3].lower()] // 10 ** len(fraction)
    if not _LEAST_BITS_PER_S <= rate <= _MOST_BITS_PER_S:
        raise ValueError(f"'{text[:40]}' is no bit rate of CAN: {_LEAST_BITS_PER_S} to {_MOST_BITS_PER_S} bit/s")
    return rate


def _rate(value: Any, place: Place) -> int:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise place.error("a bit rate is expected", _EXAMPLE)
    try:
        return parse_bit_rate(str(value))
    except ValueError as error:
        raise place.error(str(error), _EXAMPLE) from None


BIT_RATE = ValueKind('bit rate, such as 250000 or "250k"', _rate)


def is_channel_name(text: str) -> bool:
    """Return whether a channel can be given this name, which reports and keys of lists show."""
    return 0 < len(text) <= MAX_CHANNEL_NAME and text.isprintable() and not any(map(str.isspace, text))


@dataclass(frozen=True, slots=True)
class BusSettings:
    """A CAN bus, by the name of its channel in the capture: ``[buses.can0]``. ``[buses."*"]`` is for all others.

    Names may have the wildcards ``*`` and ``?``; a name without any goes first, then the order of the file counts.
    """

    bit_rate: int | None = key(
        BIT_RATE, "bits per second; without it, it is found from the frames where they allow it", default=None
    )
    data_bit_rate: int | None = key(BIT_RATE, "bits per second of the data phase of CAN FD", default=None)


def _buses(value: Any, place: Place) -> tuple[tuple[str, BusSettings], ...]:
    found = []
    for name, table in mapping(ValueKind("", lambda entry, _: entry)).read(value, place).items():
        if not 0 < len(name) <= MAX_CHANNEL_NAME:
            raise place.error(f"the name of a channel has 1 to {MAX_CHANNEL_NAME} characters")
        found.append((name, read_table(BusSettings, table, place.below(name))))
    return tuple(found)


BUS_TABLES = ValueKind("[{name}.CHANNEL]", _buses, BusSettings)


class Buses(Struct, frozen=True):
    """What is given of buses, by names of channels or patterns of such: the first entry that fits goes first."""

    given: Sequence[tuple[str, BusSettings]] = ()

    @classmethod
    def of_project(cls, told: Sequence[tuple[str, BusSettings]]) -> Buses:
        """Return the buses of a project file, in which a name goes before a pattern."""
        return cls(tuple(sorted(told, key=_is_pattern)))

    def overridden(self, options: Sequence[str]) -> Buses:
        """Return these buses, those of a command line going first: ``500000``, ``can0@500k``, ``can0@500k,2M``.

        UsageError where one cannot be understood.
        """
        told = sorted((_option(text) for text in options), key=_is_pattern)
        return Buses((*told, *self.given))

    def of(self, channel: str) -> BusSettings:
        """Return what is given of a channel."""
        fitting = [told for name, told in self.given if name == channel or fnmatchcase(channel, name)]
        return BusSettings(
            next((told.bit_rate for told in fitting if told.bit_rate), None),
            next((told.data_bit_rate for told in fitting if told.data_bit_rate), None),
        )


def _is_pattern(entry: tuple[str, BusSettings]) -> bool:
    return any(wildcard in entry[0] for wildcard in "*?[")


def _option(text: str) -> tuple[str, BusSettings]:
    channel, at, rates = text.rpartition("@")
    nominal, comma, data = rates.partition(",")
    try:
        if at and not channel.strip():
            raise ValueError("no channel stands in front of @")
        if not nominal.strip() or (comma and not data.strip()):
            raise ValueError("a bit rate is missing")
        settings = BusSettings(parse_bit_rate(nominal), parse_bit_rate(data) if comma else None)
    except ValueError as error:
        option = f"--bitrate {text[:80]}" if text.strip() else "--bitrate"
        raise UsageError(
            f"{option}: {error}", next_step="for example --bitrate 500000, or --bitrate can0@250k"
        ) from None
    return channel or ANY_CHANNEL, settings
