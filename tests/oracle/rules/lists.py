"""A list as its senders, readers and receivers count it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from tests.oracle.frame import Address
from tests.oracle.rules.errors import ErrorEvent
from tests.oracle.rules.telegram import Telegram


class Delivery(NamedTuple):
    """A telegram of a list, as its receivers count it; ``written`` where a reader would take its values."""

    telegram: Telegram
    written: bool


@dataclass
class List:
    """Everything that is known of one list apart from its streams."""

    deliveries: list[Delivery] = field(default_factory=list)
    sent: list[Telegram] = field(default_factory=list)
    acknowledgements: list[Telegram] = field(default_factory=list)
    senders: set[Address] = field(default_factory=set)
    readers: set[Address] = field(default_factory=set)
    errors: list[ErrorEvent] = field(default_factory=list)
    malformed: int = 0
    truncated: int = 0
    boot_up_requests: int = 0
    wanted: dict[int, list[Telegram]] = field(default_factory=dict)
    last_data: dict[int, Telegram] = field(default_factory=dict)
    reference_checksum: dict[int, int] = field(default_factory=dict)

    def count(self, *names: str) -> int:
        return sum(error.name in names for error in self.errors)

    def received_by(self, node: Address) -> list[Delivery]:
        return [
            delivery
            for delivery in self.deliveries
            if delivery.telegram.source != node
            and (node in self.readers if delivery.telegram.broadcast else delivery.telegram.destination == node)
        ]


def text(time: int | None) -> str | None:
    return None if time is None else str(time)


def last_time(telegrams: Sequence[Telegram]) -> str | None:
    return text(telegrams[-1].time) if telegrams else None


def diag(sent: list[Telegram], received: list[Delivery], acks: int, errors: list[ErrorEvent]) -> dict[str, Any]:
    last = max(errors, key=lambda error: error.order, default=None)
    return {
        "nSendCount": len(sent),
        "tLastSend": last_time(sent),
        "nReceiveCount": len(received),
        "tLastReceive": last_time([delivery.telegram for delivery in received]),
        "nWriteCount": sum(delivery.written for delivery in received),
        "sLastError": last.name if last else "NOERROR",
        "tLastError": text(last.time) if last else None,
        "nErrorCount": len(errors),
        "nAcknowledges": acks,
    }


def is_empty(components: dict[str, Any]) -> bool:
    return all(value in (0, None, "NOERROR") for value in components.values())
