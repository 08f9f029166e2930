"""A plain socket: payloads become packets again, and what it cannot see is not judged."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import IP, UDP
from scapy.layers.inet6 import IPv6

from dissectors.netvar import dissect
from nvscope.capture.live.internet_headers import packet_of
from nvscope.capture.live.live_source import Autostop, LiveSource
from nvscope.capture.live.udp_socket import UdpAddress, UdpSocket
from nvscope.capture.live.wait import Wait
from nvscope.errors import CaptureError, UsageError
from tests.capture.live.network import cable, needs_namespaces, send
from tests.laws import examples
from tests.oracle.builders import internet_checksum, telegram


def _free_port(kind: int = socket.AF_INET) -> int:
    with socket.socket(kind, socket.SOCK_DGRAM) as own:
        own.bind(("::1" if kind == socket.AF_INET6 else "127.0.0.1", 0))
        port: int = own.getsockname()[1]
        return port


@contextmanager
def _reporting(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run a report on a socket; it is open when this begins."""
    with subprocess.Popen(
        [sys.executable, "-m", "nvscope", "report", "--json", *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as done:  # fmt: skip
        assert done.stderr is not None
        assert "a plain socket" in done.stderr.readline()
        yield done


def _report(done: subprocess.Popen[str]) -> Any:
    done.send_signal(signal.SIGINT)
    out, said = done.communicate(timeout=20)
    assert done.returncode == 0, said
    return json.loads(out)


@pytest.mark.parametrize(
    ("word", "address", "port", "groups"),
    [
        ("udp://0.0.0.0:1202", "0.0.0.0", 1202, ()),
        ("udp://:1300", "0.0.0.0", 1300, ()),
        ("udp://127.0.0.1", "127.0.0.1", 1202, ()),
        ("udp://0.0.0.0:1202,239.0.0.1,239.0.0.2", "0.0.0.0", 1202, ("239.0.0.1", "239.0.0.2")),
        ("udp://[::]:1202,ff02::5", "::", 1202, ("ff02::5",)),
    ],
)
def test_what_a_word_says(word: str, address: str, port: int, groups: tuple[str, ...]) -> None:
    assert UdpAddress.of(word) == UdpAddress(address, port, groups)


@pytest.mark.parametrize(
    "word",
    ["udp://host:1202", "udp://0.0.0.0:0", "udp://0.0.0.0:70000", "udp://0.0.0.0:1202,10.0.0.1", "udp://[::]:1,239.0.0.1",
     "udp://0.0.0.0:12x", "udp://1:2:3"],
)  # fmt: skip
def test_words_that_say_nothing(word: str) -> None:
    with pytest.raises(UsageError, match=re.escape(word)):
        UdpAddress.of(word)


@examples(300)
@given(st.binary(max_size=2000), st.integers(1, 65535), st.integers(1, 65535), st.integers(0, 255), st.booleans())
def test_headers_are_those_that_a_datagram_had(payload: bytes, source: int, port: int, hops: int, six: bool) -> None:
    addresses = ("fd00::1", "ff02::2") if six else ("10.1.2.3", "255.255.255.255")
    packet = packet_of(*addresses, source, port, hops, payload)
    seen = IPv6(packet) if six else IP(packet)
    assert (seen.src, seen.dst, seen.hlim if six else seen.ttl) == (*addresses, hops)
    assert (seen[UDP].sport, seen[UDP].dport, bytes(seen[UDP].payload)) == (source, port, payload)
    if not six:
        assert internet_checksum(packet[:20]) == 0


@pytest.mark.parametrize(("kind", "address"), [(socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")])
def test_datagrams_come_with_addresses_and_times(kind: int, address: str) -> None:
    port = _free_port(kind)
    place = f"[{address}]" if kind == socket.AF_INET6 else address
    source = LiveSource(UdpSocket(f"udp://{place}:{port}"), Wait(), Autostop(packets=3))
    with socket.socket(kind, socket.SOCK_DGRAM) as out:
        out.bind((address, 0))
        before_ns = time.time_ns()
        for number in range(3):
            out.sendto(telegram(counter=number + 1), (address, port))
        found = [(batch, dissect(batch)) for batch in source if len(batch)]
    packets, telegrams = found[0]
    assert [int(one) for one in telegrams.telegrams.header["counter"]] == [1, 2, 3]
    assert before_ns <= int(packets.ts_ns[0]) <= time.time_ns()
    (info,) = source.infos
    assert (info.frames, info.drops, info.is_live, info.hears_answers) == (3, 0, True, False)


def test_what_came_before_it_was_stopped_is_there() -> None:
    port = _free_port()
    source = LiveSource(UdpSocket(f"udp://127.0.0.1:{port}"), Wait())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for _ in range(50):
            out.sendto(telegram(), ("127.0.0.1", port))
    source.stop()
    assert sum(map(len, source)) == 50
    assert list(source) == []


def test_what_is_lost_in_its_queue_is_counted() -> None:
    port = _free_port()
    inlet = UdpSocket(f"udp://127.0.0.1:{port}")
    sent = 40_000
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for _ in range(sent):
            out.sendto(bytes(1400), ("127.0.0.1", port))
    source = LiveSource(inlet, Wait(), Autostop(duration_ns=1_500_000_000))
    frames = sum(map(len, source))
    (info,) = source.infos
    assert info.drops
    assert frames + info.drops == sent
    assert dict(info.drops_by) == {"kernel": info.drops}


def test_answers_that_are_not_to_be_seen_are_not_missed() -> None:
    port = _free_port()
    with _reporting(f"udp://127.0.0.1:{port}", "-d", f"udp.port=={port},nvl") as done:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for number in range(150):
                out.sendto(telegram(flags=1, counter=number + 1), ("127.0.0.1", port))
                time.sleep(0.01)
        report = _report(done)
    (entry,) = report["lists"]
    assert entry["streams"][0]["telegrams"] == 150
    counters = entry["counters"]
    unknown = {"missing_acknowledgements", "negative_acknowledgements", "send_rejected"}
    assert {name for name, value in counters.items() if value is None} == unknown
    assert "NV301" not in {finding["code"] for finding in report["findings"]}


def test_a_port_that_somebody_keeps_for_himself() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        port = own.getsockname()[1]
        with pytest.raises(CaptureError, match=f"port {port} is in use"):
            UdpSocket(f"udp://127.0.0.1:{port}")


def test_an_address_of_another_machine() -> None:
    with pytest.raises(CaptureError, match="does not have this address"):
        UdpSocket("udp://192.0.2.77:1202")


@needs_namespaces
@pytest.mark.parametrize("target", ["10.77.0.255", "255.255.255.255", "239.1.2.3"])
def test_broadcasts_and_groups_are_heard(target: str) -> None:
    with cable() as (press, engineer):
        for host in (press, engineer):
            host.ip("route", "add", "default", "dev", host.device)
        word = "udp://0.0.0.0:1202,239.1.2.3"
        watching = engineer.nvscope("report", "--json", word, "--for", "2500ms")
        assert watching.stderr is not None
        watching.stderr.readline()
        press.start(*send(target, 20)).wait(10)
        out, said = watching.communicate(timeout=20)
    assert json.loads(out)["capture"]["telegrams"] == 20, said
