"""A message of the Parameter Manager: a telegram whose Index and SubIndex are those of a parameter."""

from __future__ import annotations

from enum import Enum

import numpy as np
from msgspec import Struct

from dissectors.netvar import (
    HEADER,
    IDENTITY,
    IDENTITY_ASCII,
    IS_PARAMETER,
    PARAMETER_ERRORS,
    PARAMETER_REQUESTS,
    Service,
)

MOST_DATA_BYTES = 4_096
"""As large a value as is sent; no parameter is known that comes near it."""

REPLY_OF = {Service.ODReadRequest: Service.ODReadRequestReply, Service.ODWriteRequest: Service.ODWriteRequestReply}
_SERVICES = {service.value: service for service in Service}


class Flaw(Enum):
    """Why a payload is no message of the Parameter Manager."""

    NO_TELEGRAM = "no telegram"
    MALFORMED = "malformed"
    OF_A_LIST = "about a list"


class Message(Struct, frozen=True):
    """A request or a reply; ``data`` is the value where it carries one, ``items`` how many elements that has."""

    service: Service
    index: int
    subindex: int
    counter: int
    items: int = 1
    data: bytes = b""

    def packed(self) -> bytes:
        """Return the bytes of the telegram."""
        header = HEADER.pack(
            id=self.service, index=self.index, subindex=self.subindex, items=self.items,
            length=HEADER.size_bytes + len(self.data), counter=self.counter,
        )  # fmt: skip
        return header.tobytes() + self.data

    @property
    def is_request(self) -> bool:
        return self.service in PARAMETER_REQUESTS

    @property
    def is_error(self) -> bool:
        return self.service in PARAMETER_ERRORS


def read_message(payload: bytes) -> Message | Flaw:
    """Return the message that the payload of a datagram is, or why it is none. No bytes raise."""
    if len(payload) < HEADER.size_bytes:
        is_cut = payload[:4] in (_bytes_of(IDENTITY), _bytes_of(IDENTITY_ASCII))
        return Flaw.MALFORMED if is_cut else Flaw.NO_TELEGRAM
    header = np.frombuffer(payload, HEADER.dtype, 1)[0]
    if header["identity"] not in (IDENTITY, IDENTITY_ASCII):
        return Flaw.NO_TELEGRAM
    service = _SERVICES.get(int(header["id"]))
    if header["length"] != len(payload) or service is None:
        return Flaw.MALFORMED
    if not IS_PARAMETER[service]:
        return Flaw.OF_A_LIST
    index, subindex, counter, items = (int(header[name]) for name in ("index", "subindex", "counter", "items"))
    return Message(service, index, subindex, counter, items, payload[HEADER.size_bytes :])


def _bytes_of(identity: int) -> bytes:
    return identity.to_bytes(4, "little")
