"""HTTP over a line that loses packets: what two hosts said, and what tshark and the product make of it."""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import pytest

from dissectors.claims import Claims
from dissectors.link import peel
from nvscope.capture.open import open_source
from nvscope.tracker.streams import Streams
from nvscope.tracker.visu.http_forms import What
from nvscope.tracker.visu.http_messages import HttpStreams
from nvscope.tracker.visu.waiting_requests import Waiting
from tests.capture.live.network import Host, cable, needs_namespaces
from tests.capture.live.test_ring import wait_for_ring
from tests.cli.test_visu_between_hosts import captured

pytestmark = [
    needs_namespaces, pytest.mark.long,
    pytest.mark.skipif(not all(map(shutil.which, ("tcpdump", "tshark", "nft"))), reason="needs tcpdump, tshark, nft"),
]  # fmt: skip

PORT, CONNECTIONS, EXCHANGES, LOST_PERCENT = 8080, 8, 10, 6
_HEX = re.compile("(?:[0-9a-f]{2})+")

SPEAK = """
import json, random, socket, sys, threading
side, address, port, connections, exchanges = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:])
start = {"client": b"POST /plc/webvisu.htm HTTP/1.1", "server": b"HTTP/1.1 200 OK"}[side]
sent = []

def hear(link, held):
    while b"\\r\\n\\r\\n" not in held:
        held += link.recv(9999) or sys.exit("ended")
    head, _, held = held.partition(b"\\r\\n\\r\\n")
    length = int(head.rpartition(b": ")[2])
    while len(held) < length:
        held += link.recv(9999) or sys.exit("ended")
    return held[length:]

def say(link, number, turn, chance):
    values = "|".join(str(chance.randrange(10**6)) for _ in range(chance.choice([1, 4, 90, 700])))
    body = f"|0|{number}|{turn}|{side}|{values}|"
    sent.append(body)
    data = start + b"\\r\\nContent-Length: %d\\r\\n\\r\\n" % len(body) + body.encode()
    at = 0
    while at < len(data):
        size = chance.choice([1, 3, chance.randint(1, 60), chance.randint(1, 3000)])
        link.sendall(data[at:at + size])
        at += size

def speak(link, number):
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    chance, held = random.Random(f"{side} {number}"), b""
    for turn in range(exchanges):
        if side == "client":
            say(link, number, turn, chance)
        held = hear(link, held)
        if side == "server":
            say(link, number, turn, chance)
    link.close()

if side == "server":
    listening = socket.create_server((address, port))
    print("ready", flush=True)
    links = [listening.accept()[0] for _ in range(connections)]
else:
    links = [socket.create_connection((address, port)) for _ in range(connections)]
threads = [threading.Thread(target=speak, args=(link, number)) for number, link in enumerate(links)]
for one in threads:
    one.start()
for one in threads:
    one.join()
print(json.dumps(sent))
"""
"""Speaks HTTP on some connections at once, and prints what it has said: side, address, port, connections, exchanges."""


def lose(host: Host) -> None:
    """Have a host lose packets of the conversation that reach it, behind where tcpdump sees them."""
    rules = "; ".join(
        f"tcp {port} {PORT} numgen random mod 100 < {LOST_PERCENT} drop" for port in ("dport", "sport")
    )  # fmt: skip
    table = f"table inet line {{ chain input {{ type filter hook input priority 0; {rules};}};}}"
    subprocess.run(["ip", "netns", "exec", host.namespace, "nft", table], check=True, timeout=10)


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Counter[bytes]]:
    """Return a capture of a conversation, and the bodies that were sent."""
    path = tmp_path_factory.mktemp("line") / "line.pcap"
    with ExitStack() as stack:
        client, server = stack.enter_context(cable())
        stack.enter_context(captured(server, path))
        for host in (client, server):
            lose(host)
        words = server.address, str(PORT), str(CONNECTIONS), str(EXCHANGES)
        serving = server.python_program(SPEAK, "server", *words)
        assert serving.stdout is not None
        assert serving.stdout.readline() == "ready\n"
        asking = client.python_program(SPEAK, "client", *words)
        outputs = [process.communicate(timeout=100) for process in (asking, serving)]
    assert [err for _, err in outputs] == ["", ""]
    bodies = [body for out, _ in outputs for body in json.loads(out.splitlines()[-1])]
    assert len(bodies) == 2 * CONNECTIONS * EXCHANGES
    return path, Counter(body.encode() for body in bodies)


def bodies_read(path: Path) -> tuple[Counter[bytes], int]:
    """Return the bodies that the product finds in a capture, and how many bytes are missing in its streams."""
    streams, http, first_frame = Streams((PORT,)), HttpStreams(), 1
    found: Counter[bytes] = Counter()
    missing = 0
    for packets in open_source([path]):
        brought = streams.observe(packets, peel(packets, claims=Claims(tcp=(PORT,))).tcp, first_frame)
        messages = http.read(packets.data, brought, lambda _: Waiting())
        for row, number in enumerate(messages.form.tolist()):
            form, content = messages.forms[number], messages.content(row)
            missing += form.missing_bytes
            if form.what is What.WHOLE and content is not None:
                found[content] += 1
        first_frame += len(packets)
    return found, missing


def bodies_by_tshark(path: Path, *, with_late: bool = True) -> Counter[bytes]:
    """Return the bodies that tshark puts together, as soon as they are whole.

    Without the late ones: while they came, something was sent once more that had been acknowledged. Who acknowledges
    what the capture lacks has got it: that it is missing is told then, and stays so where it is sent once more, since
    the acknowledgement was lost.
    """
    fields = "tcp.stream", "tcp.srcport", "tcp.seq", "tcp.ack", "http.file_data"
    words = (
        "tshark", "-r", str(path), "-o", "tcp.reassemble_out_of_order:TRUE", "-Y", "tcp", "-T", "fields",
        "-E", "occurrence=a", "-E", "aggregator=/s", *(word for field in fields for word in ("-e", field)),
    )  # fmt: skip
    lines = subprocess.run(words, capture_output=True, text=True, check=True, timeout=100).stdout.splitlines()
    bodies: Counter[bytes] = Counter()
    acknowledged: dict[tuple[str, bool], int] = {}
    late: set[tuple[str, bool]] = set()
    for stream, port, sequence, acknowledges, data in (line.split("\t") for line in lines):
        own, other = (stream, port == str(PORT)), (stream, port != str(PORT))
        if int(sequence) < acknowledged.get(other, 0):
            late.add(own)
        if data and (with_late or own not in late):
            # Which of both it is depends on the version; and what tshark makes up is any part of a body.
            bodies += Counter(bytes.fromhex(one) if _HEX.fullmatch(one) else one.encode() for one in data.split())
        if data:
            late.discard(own)
        acknowledged[own] = max(acknowledged.get(own, 0), int(acknowledges or 0))
    return bodies


def without(path: Path, chance: random.Random, to: Path) -> Path:
    """Write a capture without some of its packets, as if nobody had captured them."""
    count = int(
        subprocess.run(["capinfos", "-Mc", path], capture_output=True, text=True, check=True).stdout.split()[-1]
    )
    lost = [str(number) for number in range(1, count + 1) if chance.random() < 0.01]
    subprocess.run(["editcap", path, to, *lost], check=True, capture_output=True, timeout=30)
    return to


def test_what_came_late_or_twice_is_put_together_body_by_body(said: tuple[Path, Counter[bytes]]) -> None:
    path, bodies = said
    assert bodies_read(path) == (bodies, 0)
    assert bodies_by_tshark(path) == bodies


def test_it_is_heard_live_as_it_is_captured(tmp_path: Path) -> None:
    with cable() as (client, server):
        watching = server.nvscope("report", "--json", server.device, "--for", "2500ms")
        wait_for_ring(server)
        words = server.address, str(PORT), "2", "5"
        serving = server.python_program(SPEAK, "server", *words)
        assert serving.stdout is not None
        assert serving.stdout.readline() == "ready\n"
        client.python_program(SPEAK, "client", *words).communicate(timeout=30)
        serving.communicate(timeout=30)
        out, err = watching.communicate(timeout=30)
    (row,) = json.loads(out)["visu"]
    assert (row["client"], row["connections"], row["reads"], row["replies"]) == ("10.77.0.1", 2, 10, 10), err


@pytest.mark.parametrize("seed", range(4))
def test_what_was_not_captured_is_made_up_by_nobody(
    said: tuple[Path, Counter[bytes]], seed: int, tmp_path: Path
) -> None:
    path, bodies = said
    partial = without(path, random.Random(seed), tmp_path / "partial.pcap")
    found, missing = bodies_read(partial)
    assert found <= bodies
    assert missing > 0
    # What tshark finds of what was said; it makes up bodies where something is missing.
    assert bodies_by_tshark(partial, with_late=False) & bodies <= found
    assert sum(found.values()) >= sum(bodies.values()) // 2
