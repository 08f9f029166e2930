"""What people call a bus: ``can:INTERFACE:CHANNEL[,key=value...]``, as in ``can:slcan:COM3,bitrate=250000``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from nvscope.errors import UsageError

PREFIX = "can:"

Value = str | int | float | bool

_KEY = re.compile(r"[A-Za-z_]\w*")
_WHOLE = re.compile(r"-?(?:0[xX][0-9a-fA-F]{1,16}|[0-9]{1,18})")
_DECIMAL = re.compile(r"-?[0-9]{1,18}\.[0-9]{0,18}")
_TRUTH = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
_RESERVED = ("interface", "channel", "bustype", "ignore_config", "config_context", "receive_own_messages")


@dataclass(frozen=True, slots=True)
class CanWord:
    """A bus: an interface of python-can, a channel of it, and what else its driver is told."""

    interface: str
    channel: str
    options: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}), hash=False)

    @classmethod
    def of(cls, word: str) -> CanWord:
        """Return what a word says; UsageError where it cannot be understood.

        A channel may have colons, and commas too, as long as nothing between them looks like ``key=value``.
        """
        interface, sign, rest = word.removeprefix(PREFIX).partition(":")
        channel, *others = rest.split(",")
        options: dict[str, Value] = {}
        for part in others:
            key, equals, value = part.partition("=")
            if not equals and not options:
                channel += f",{part}"
                continue
            if not equals or not _KEY.fullmatch(key) or key in _RESERVED or key in options:
                raise _not_understood(word, f"'{part[:40]}' is no key=value that a driver may be told")
            options[key] = _value(value)
        if not interface or not sign or not channel:
            raise _not_understood(word, "expected can:INTERFACE:CHANNEL, with key=value behind commas")
        return cls(interface, channel, MappingProxyType(options))

    @property
    def name(self) -> str:
        """What the bus is called: the channel; one that is a number as logs of python-can call it, ``can0``."""
        return f"can{self.channel}" if self.channel.isdigit() else self.channel

    @property
    def driver_channel(self) -> str | int:
        """The channel as drivers want it: numbers as such."""
        return int(self.channel) if self.channel.isdecimal() and len(self.channel) < 10 else self.channel


def _value(text: str) -> Value:
    if _WHOLE.fullmatch(text):
        return int(text, 0) if "x" in text.lower() else int(text)
    if _DECIMAL.fullmatch(text):
        return float(text)
    return _TRUTH.get(text.lower(), text)


def _not_understood(word: str, what: str) -> UsageError:
    return UsageError(
        f"{word[:80]}: {what}", next_step="for example can:socketcan:can0, or can:slcan:/dev/ttyUSB0,bitrate=250000"
    )
