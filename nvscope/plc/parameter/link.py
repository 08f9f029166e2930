"""A socket to one partner, over which requests of the Parameter Manager go one after the other."""

from __future__ import annotations

import errno
import os
import select
import socket
import struct
import sys
import time
from types import TracebackType
from typing import Self

from dissectors.netvar import HEADER
from nvscope.errors import CaptureError, UsageError
from nvscope.plc.parameter.conversation import Conversation, Outcome, Patience
from nvscope.plc.parameter.message import Message
from nvscope.plc.permission import is_loopback, is_near, plain_address, refuse_far
from nvscope.units import endpoint

_DATAGRAM_BYTES = 65_535
_LONGEST_WAIT_NS = 100_000_000
_MOST_AT_ONCE = 64
_LINUX = sys.platform.startswith("linux")
_RECVERR = {socket.AF_INET: (socket.IPPROTO_IP, 11), socket.AF_INET6: (socket.IPPROTO_IPV6, 25)}
_MSG_ERRQUEUE = 0x2000
_EXTENDED_ERROR = struct.Struct("@IBBBBII")
_ANCILLARY_BYTES = 512
_WHY = {
    errno.ECONNREFUSED: "port unreachable",
    errno.EHOSTUNREACH: "host unreachable",
    errno.ENETUNREACH: "network unreachable",
    errno.EACCES: "prohibited",
    errno.EMSGSIZE: "too large for the way",
}


class ParameterLink:
    """Asks one partner, by its address and port; UsageError where it may not be sent there, before anything is opened.

    What is sent to another machine comes from the same port, since a controller may answer to that; not where another
    program has it here (``is_port_taken``). CaptureError where a socket cannot be opened, or nothing be sent.
    """

    def __init__(self, address: str, port: int, *, allow_network: bool = False) -> None:
        partner = plain_address(address)
        if partner.is_multicast or partner.is_unspecified or str(partner) == "255.255.255.255":
            raise UsageError(
                f"{address} is no node, and requests of the Parameter Manager go to one",
                next_step="name the address of the controller",
            )
        if not allow_network and not is_near(address):
            raise refuse_far(address)
        self._partner, self._where = str(partner), endpoint(address, port)
        self._family, _, _, _, self._target = self._resolved(address, port)
        self.is_port_taken = False
        self._socket = self._opened(address, port)

    def _resolved(self, address: str, port: int) -> tuple[int, int, int, str, tuple[object, ...]]:
        try:
            found = socket.getaddrinfo(address, port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST)[0]
        except OSError as error:
            raise self._failure(error) from error
        return found

    def _opened(self, address: str, port: int) -> socket.socket:
        try:
            with socket.socket(self._family, socket.SOCK_DGRAM) as looking:
                looking.connect(self._target)  # sends nothing, and tells which address of this machine leads there
                own = looking.getsockname()
            opened = socket.socket(self._family, socket.SOCK_DGRAM)
        except OSError as error:
            raise self._failure(error) from error
        if not is_loopback(address) and str(plain_address(own[0])) != self._partner:
            try:
                opened.bind((own[0], port, *own[2:]))
            except OSError:
                self.is_port_taken = True
        opened.setblocking(False)
        if _LINUX:
            opened.setsockopt(*_RECVERR[socket.AddressFamily(self._family)], 1)
        return opened

    def ask(self, request: Message, patience: Patience) -> Outcome:
        """Send a request, and return what came of it."""
        conversation = Conversation(request, self._partner, patience)
        while conversation.outcome is None:
            datagram = conversation.due(time.monotonic_ns())
            if datagram is not None:
                self._send(datagram, conversation)
            if conversation.outcome is not None:
                break
            wait_ns = min(max(conversation.wait_until_ns - time.monotonic_ns(), 0), _LONGEST_WAIT_NS)
            if select.select([self._socket], [], [], wait_ns / 1e9)[0]:
                self._take(conversation)
        return conversation.outcome

    def _send(self, datagram: bytes, conversation: Conversation) -> None:
        for again in (True, False):
            try:
                self._socket.sendto(datagram, self._target)
                return
            except BlockingIOError:
                return  # as lost as on the way
            except OSError as error:
                # What is told here may be of a datagram before.
                self._take_errors(conversation)
                if not again or error.errno not in _WHY:
                    if error.errno not in (errno.ECONNREFUSED, errno.EHOSTUNREACH):
                        raise self._failure(error) from error
                    conversation.undelivered(_WHY[error.errno])
                    return

    def _take(self, conversation: Conversation) -> None:
        for _ in range(_MOST_AT_ONCE):
            try:
                payload, source = self._socket.recvfrom(_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except OSError as error:
                if not self._take_errors(conversation) and (why := _WHY.get(error.errno or 0)):
                    conversation.undelivered(why)
                continue
            conversation.received(str(plain_address(source[0])), payload, time.monotonic_ns())
        self._take_errors(conversation)

    def _take_errors(self, conversation: Conversation) -> bool:
        """Take what the system keeps of datagrams that came back; return whether there was any."""
        if not _LINUX:
            return False
        found = False
        while True:
            try:
                quoted, told, _, _ = self._socket.recvmsg(HEADER.size_bytes, _ANCILLARY_BYTES, _MSG_ERRQUEUE)
            except OSError:
                return found
            for _, kind, value in told:
                if kind in (11, 25) and len(value) >= _EXTENDED_ERROR.size:
                    number = _EXTENDED_ERROR.unpack_from(value)[0]
                    conversation.undelivered(_WHY.get(number, os.strerror(number)), quoted)
                    found = True

    def _failure(self, error: OSError) -> CaptureError:
        return CaptureError(
            f"cannot be sent: {error.strerror or error}", where=self._where,
            next_step="check the address, and that an interface leads there",
        )  # fmt: skip

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
