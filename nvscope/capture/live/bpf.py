"""Classic BPF: the filter that the kernel asks of each packet before it is captured.

The default one is made here, without libpcap: whatever nvscope looks at, and what shows that a node is there at all.
Filters of tcpdump's language are compiled by libpcap, through Scapy.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from dissectors.batch import LinkType
from dissectors.netvar import IDENTITY, IDENTITY_ASCII
from nvscope.errors import UsageError

MAX_SNAP_BYTES = 262_144
_IDENTITIES = [int.from_bytes(one.to_bytes(4, "little"), "big") for one in (IDENTITY, IDENTITY_ASCII)]
"""The first four bytes of a telegram as one number in network order, in both ways that they are written."""

_MOST_PORTS = 256
_LOAD_WORD, _LOAD_HALF, _LOAD_BYTE = 0x20, 0x28, 0x30
_LOAD_WORD_AT_X, _LOAD_HALF_AT_X, _LOAD_BYTE_AT_X = 0x40, 0x48, 0x50
_LOAD_X_IP_HEADER = 0xB1
_LOAD_X = 0x01
_EQUAL, _GREATER_OR_EQUAL, _ANY_BIT = 0x15, 0x35, 0x45
_JUMP, _RETURN = 0x05, 0x06
_INSTRUCTION = struct.Struct("=HBBI")
_MAX_INSTRUCTIONS = 4096

_IPV4, _IPV6, _ARP, _DOT1Q, _DOT1AD = 0x0800, 0x86DD, 0x0806, 0x8100, 0x88A8
_ICMP, _TCP, _UDP, _ICMPV6 = 1, 6, 17, 58
_EXTENSIONS = (0, 43, 44, 51, 60)
_MOST_TAGS = 2


class Instruction(NamedTuple):
    """One instruction: what it does, how many are left out if a test holds and if not, and its number."""

    code: int
    if_true: int
    if_false: int
    number: int


def packed(program: Iterable[Instruction]) -> bytes:
    """Return a program as the kernel takes it (``struct sock_filter``)."""
    return b"".join(_INSTRUCTION.pack(*one) for one in program)


NOTHING = (Instruction(_RETURN, 0, 0, 0),)
"""Lets no packet in."""


def default_program(link: int, ports: Collection[int], tcp: Collection[int] = ()) -> Sequence[Instruction] | None:
    """Return what lets in all that says something of network variables on a link; None where everything does.

    That is UDP on one of the ``ports`` or with the identity of a telegram at its begin, TCP on one of the ``tcp``
    ports, fragments, ICMP, and ARP, which shows that a node is there; behind up to two VLAN tags.
    """
    if link == LinkType.ETHERNET:
        return _Assembler(ports, tcp).ethernet()
    if link in (LinkType.RAW, LinkType.IPV4, LinkType.IPV6):
        return _Assembler(ports, tcp).raw()
    return None


@dataclass
class _Assembler:
    """Puts a program together; jumps name labels, and are counted at the end."""

    ports: Collection[int]
    tcp: Collection[int]
    _lines: list[tuple[int, str, str, int]] = field(default_factory=list)
    _labels: dict[str, int] = field(default_factory=dict)

    def ethernet(self) -> Sequence[Instruction]:
        for tags in range(_MOST_TAGS + 1):
            at = 14 + 4 * tags
            self._label(f"type {tags}")
            self._do(_LOAD_HALF, at - 2)
            self._test(_EQUAL, _IPV4, f"IPv4 {at}")
            self._test(_EQUAL, _IPV6, f"IPv6 {at}")
            self._test(_EQUAL, _ARP, "in")
            if tags < _MOST_TAGS:
                self._test(_EQUAL, _DOT1Q, f"type {tags + 1}")
                self._test(_EQUAL, _DOT1AD, f"type {tags + 1}")
            self._do(_RETURN, 0)
        for tags in range(_MOST_TAGS + 1):
            self._internet(14 + 4 * tags)
        return self._done()

    def raw(self) -> Sequence[Instruction]:
        self._do(_LOAD_BYTE, 0)
        self._test(_GREATER_OR_EQUAL, 0x60, "IPv6 0")
        self._internet(0)
        return self._done()

    def _internet(self, at: int) -> None:
        """Look at what begins with an IPv4 or IPv6 header at a place."""
        self._label(f"IPv4 {at}")
        self._do(_LOAD_HALF, at + 6)
        self._test(_ANY_BIT, 0x3FFF, "in")
        self._do(_LOAD_BYTE, at + 9)
        self._test(_EQUAL, _ICMP, "in")
        self._ports(f"UDP {at}", f"TCP {at}", (_LOAD_X_IP_HEADER, at), at)
        self._label(f"IPv6 {at}")
        self._do(_LOAD_BYTE, at + 6)
        self._test(_EQUAL, _ICMPV6, "in")
        for extension in _EXTENSIONS:
            self._test(_EQUAL, extension, "in")
        self._ports(f"UDP6 {at}", f"TCP6 {at}", (_LOAD_X, 40), at)

    def _ports(self, udp: str, tcp: str, load_x: tuple[int, int], at: int) -> None:
        """Look at ports by the protocol that was loaded; ``load_x`` finds how long the IP header is."""
        if self.tcp:
            self._test(_EQUAL, _TCP, tcp)
        self._test(_EQUAL, _UDP, udp, "out")
        self._label(udp)
        self._do(*load_x)
        self._udp(at)
        if self.tcp:
            self._label(tcp)
            self._do(*load_x)
            self._tcp(at)

    def _tcp(self, at: int) -> None:
        """Look at a TCP header that begins X behind a place."""
        if len(self.tcp) > _MOST_PORTS:
            self._do(_RETURN, MAX_SNAP_BYTES)
            return
        self._port_of(self.tcp, at)
        self._do(_RETURN, 0)

    def _port_of(self, ports: Collection[int], at: int) -> None:
        """Let in what goes to one of some ports, or comes from it."""
        for port_at in (at + 2, at):
            self._do(_LOAD_HALF_AT_X, port_at)
            for port in sorted(ports):
                self._test(_EQUAL, port, "in")

    def _udp(self, at: int) -> None:
        """Look at a UDP header that begins X behind a place."""
        if len(self.ports) > _MOST_PORTS:
            self._do(_RETURN, MAX_SNAP_BYTES)
            return
        self._port_of(self.ports, at)
        self._do(_LOAD_WORD_AT_X, at + 8)
        for identity in _IDENTITIES:
            self._test(_EQUAL, identity, "in")
        self._do(_RETURN, 0)

    def _label(self, name: str) -> None:
        self._labels[name] = len(self._lines)

    def _do(self, code: int, number: int) -> None:
        self._lines.append((code, "", "", number))

    def _test(self, code: int, number: int, if_true: str, if_false: str = "") -> None:
        """Go to a label if a test holds; tests reach 255 instructions far, plain jumps everywhere."""
        self._lines.append((code, if_true, if_false, number))

    def _done(self) -> Sequence[Instruction]:
        """Return the program; a jump that is too far for a test goes by way of a plain one behind it."""
        self._label("in")
        self._do(_RETURN, MAX_SNAP_BYTES)
        self._label("out")
        self._do(_RETURN, 0)
        # Each test becomes up to three instructions: the test, and a plain jump for each way that it can take.
        far = len(self._lines) * 3 > 255
        place, at = [], 0
        for _, yes, no, _ in self._lines:
            place.append(at)
            at += 1 + (far and bool(yes)) + (far and bool(no))
        program: list[Instruction] = []
        for number, (code, yes, no, value) in enumerate(self._lines):
            if not yes:
                program.append(Instruction(code, 0, 0, value))
                continue
            goals = [place[self._labels[goal]] for goal in (yes, no) if goal]
            if not far:
                steps = [goal - place[number] - 1 for goal in goals]
                program.append(Instruction(code, steps[0], steps[1] if no else 0, value))
                continue
            program.append(Instruction(code, 0, 1, value))
            # The way of a test without a second label goes on behind the jump of the first.
            for goal in goals:
                program.append(Instruction(_JUMP, 0, 0, goal - len(program) - 1))
        return program


def compiled(expression: str, link: int) -> Sequence[Instruction]:
    """Return a filter of tcpdump's language as a program for a link; UsageError where libpcap cannot compile it."""
    try:
        from scapy.arch.common import compile_filter  # noqa: PLC0415
        from scapy.error import Scapy_Exception  # noqa: PLC0415

        found = compile_filter(expression, linktype=link)
    except (ImportError, OSError) as error:
        next_step = "install libpcap, or choose with -Y what is shown"
        raise UsageError(f"-f {expression}: {error}", next_step=next_step) from error
    except (Scapy_Exception, ValueError) as error:
        raise UsageError(f"-f {expression}: {error}", next_step="see the manual page pcap-filter") from error
    if found.bf_len > _MAX_INSTRUCTIONS:
        raise UsageError(f"-f: a filter of {found.bf_len} instructions; the kernel takes {_MAX_INSTRUCTIONS}")
    lines = (found.bf_insns[number] for number in range(found.bf_len))
    program = [Instruction(one.code, one.jt, one.jf, one.k) for one in lines]
    # How much of a packet it lets in is Scapy's choice, and less than a packet may have.
    return [one._replace(number=MAX_SNAP_BYTES) if one.code == _RETURN and one.number else one for one in program]
