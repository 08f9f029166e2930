"""The default filter lets in what nvscope looks at, and no other traffic."""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Sequence
from ipaddress import ip_address
from shutil import which

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.live.bpf import compiled, default_program, packed
from nvscope.errors import UsageError
from tests.capture.live.bpf_machine import answer
from tests.laws import examples
from tests.oracle.builders import internet_packet, link_frame, telegram, udp, unreachable
from tests.oracle.frame import ETHERNET, IPV4, PROTOCOL_ICMP, PROTOCOL_UDP, RAW

_ADDRESSES = {4: ("10.0.0.1", "10.0.0.255"), 6: ("fd00::1", "ff02::1")}
_TCP = 6
_EXTENSIONS = (0, 43, 51, 60)
_TAGS = st.lists(st.sampled_from([0x8100, 0x88A8]), max_size=2)
_PORTS = st.sets(st.integers(1, 65535), max_size=300)


def _packet(version: int, protocol: int, content: bytes, **more: object) -> bytes:
    source, destination = (ip_address(text) for text in _ADDRESSES[version])
    return internet_packet(source, destination, protocol, content, **more)  # type: ignore[arg-type]


def _lets_in(
    packet: bytes, ports: Sequence[int] = (1202,), *, tcp: Sequence[int] = (), tags: Sequence[int] = (),
    link: int = ETHERNET,
) -> bool:  # fmt: skip
    program = default_program(link, ports, tcp)
    assert program is not None
    return answer(program, link_frame(packet, link, tags=tags)) > 0


@examples(2000)
@given(st.sampled_from([4, 6]), _TAGS, _PORTS, st.integers(1, 65535), st.booleans(), st.integers(0, 10), st.data())
def test_udp_is_let_in_by_port_or_identity(
    version: int, tags: list[int], ports: set[int], port: int, is_telegram: bool, options: int, data: st.DataObject
) -> None:
    source_port = data.draw(st.sampled_from([port, 40000]))
    payload = telegram() if is_telegram else b"something else"
    more = {"options": bytes(4 * options)} if version == 4 else {}
    packet = _packet(version, PROTOCOL_UDP, udp(payload, source_port=source_port, port=port), **more)
    every_port = len(ports) > 256
    expected = is_telegram or every_port or bool({port, source_port} & ports)
    assert _lets_in(packet, sorted(ports), tags=tags) == expected


@examples(500)
@given(st.sampled_from([4, 6]), _TAGS, _PORTS, _PORTS, st.integers(0, 10), st.data())
def test_tcp_is_let_in_by_its_ports(
    version: int, tags: list[int], ports: set[int], tcp: set[int], options: int, data: st.DataObject
) -> None:
    ends = [data.draw(st.sampled_from([1, 80, 50000, *tcp])) for _ in range(2)]
    more = {"options": bytes(4 * options)} if version == 4 else {}
    packet = _packet(version, _TCP, struct.pack(">HH", *ends) + bytes(16), **more)
    expected = len(tcp) > 256 or not tcp.isdisjoint(ends)
    assert _lets_in(packet, sorted(ports), tcp=sorted(tcp), tags=tags) == expected


@pytest.mark.parametrize("tags", [(), (0x8100,), (0x88A8, 0x8100)])
@pytest.mark.parametrize("version", [4, 6])
class TestOtherTraffic:
    def test_tcp_that_nobody_wants_stays_out(self, version: int, tags: tuple[int, ...]) -> None:
        for tcp in ((), (80, 8080)):
            assert not _lets_in(_packet(version, _TCP, udp(telegram())), tcp=tcp, tags=tags)

    def test_fragments_come_in(self, version: int, tags: tuple[int, ...]) -> None:
        for place in ((0, True), (100, True), (185, False)):
            assert _lets_in(_packet(version, PROTOCOL_UDP, bytes(200), fragment=place), tags=tags)

    def test_what_was_not_delivered_comes_in(self, version: int, tags: tuple[int, ...]) -> None:
        source = ip_address(_ADDRESSES[version][0])
        quoted = _packet(version, PROTOCOL_UDP, udp(telegram()))
        assert _lets_in(unreachable(source, quoted), tags=tags)

    def test_a_cut_packet_stays_out(self, version: int, tags: tuple[int, ...]) -> None:
        program = default_program(ETHERNET, [1202])
        assert program
        frame = link_frame(_packet(version, PROTOCOL_UDP, udp(b"", source_port=9, port=9)), tags=tags)
        for length in range(len(frame)):
            assert not answer(program, frame[:length])


@pytest.mark.parametrize("extension", _EXTENSIONS)
def test_what_hides_behind_an_extension_header_comes_in(extension: int) -> None:
    assert _lets_in(_packet(6, _TCP, b"", extensions=[extension]))


def test_arp_comes_in_and_other_protocols_stay_out() -> None:
    program = default_program(ETHERNET, [1202])
    assert program
    for kind, expected in ((0x0806, True), (0x88CC, False), (0x8892, False), (0x0021, False)):
        assert (answer(program, link_frame(bytes(40), ethertype=kind)) > 0) == expected


@pytest.mark.parametrize("link", [RAW, IPV4])
def test_links_without_a_header(link: int) -> None:
    assert _lets_in(_packet(4, PROTOCOL_UDP, udp(telegram(), port=9)), link=link)
    assert _lets_in(_packet(4, PROTOCOL_ICMP, bytes(8)), link=link)
    assert not _lets_in(_packet(4, _TCP, bytes(20)), link=link)
    assert _lets_in(_packet(6, PROTOCOL_UDP, udp(b"", port=1202)), link=RAW)
    assert not _lets_in(_packet(6, _TCP, bytes(20)), link=RAW)


def test_a_bus_has_no_default_filter() -> None:
    assert default_program(227, [1202]) is None


@pytest.mark.skipif(which("tcpdump") is None, reason="needs tcpdump")
@pytest.mark.parametrize("expression", ["udp port 1202", "arp or icmp", "vlan and udp", "ether host 2:0:0:0:0:1"])
def test_filters_are_compiled_as_tcpdump_does(expression: str) -> None:
    told = subprocess.run(["tcpdump", "-y", "EN10MB", "-ddd", expression], capture_output=True, text=True, check=True)
    expected = [tuple(map(int, line.split())) for line in told.stdout.splitlines()[1:]]
    assert [tuple(one) for one in compiled(expression, ETHERNET)] == expected
    assert len(packed(compiled(expression, ETHERNET))) == 8 * len(expected)


def test_a_filter_that_is_none_is_told_with_the_reason() -> None:
    with pytest.raises(UsageError, match="-f udp prot 1202"):
        compiled("udp prot 1202", ETHERNET)
