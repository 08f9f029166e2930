"""Random traffic of WebVisus: everything happens in it; and tshark, where nothing is missing, reads the same bodies."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from functools import cache
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.oracle.frame import ETHERNET, RAW, SLL, Frame
from tests.oracle.pcap import write_pcap
from tests.oracle.rules.visu import Visu
from tests.oracle.tcp import ACK, FIN, PSH, RST, SYN, peel_tcp
from tests.oracle.visu_traffic import conversations, visu_traffic

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
SEEDS = (*range(96), 485)
PORTS = (80, 8080, 8888)

HAPPENINGS = {
    # TCP
    "began before the capture", "began with SYN", "behind its acknowledgement", "both ports claimed",
    "cut by the snap length", "elsewhere",
    "hole final by acknowledgement", "hole final by reset", "hole final by time", "hole final by what is kept",
    "in part late", "kept behind a hole", "late", "missing behind all that is there",
    "new connection in place of another", "new connection whose SYN is missing", "other bytes",
    "taken in another order", "wrapped",
    # HTTP
    "1xx", "body decoded", "body not known", "body to the end", "chunked", "foreign", "found by searching",
    "hole between messages", "hole in a body chunked", "hole in a body of known length", "hole in a body to the end",
    "hole in a head", "hole over the end of a body", "hole while searching", "malformed chunks",
    "open request answered within a chunk", "open request answered", "open request broken off",
    "response not whole at the end", "response to HEAD that was not captured",
    # WebVisu
    "ambiguous write", "answered by what is missing", "begin of a client that is missing", "client lost step",
    "cut reply", "cut request", "early response",
    "given up", "list that is not whole, or not read", "may answer what was not captured", "names", "no value",
    "nobody knows what answers it", "other names", "other request", "password read", "password written",
    "read with an HTTP error", "reply of a server that nobody heard", "request of a client that nobody heard",
    "request that was not seen",
    "response to a forgotten request", "response to nobody", "response to what was not captured", "server lost step",
    "response to what is missing in front",
    "several wait", "slow", "two controllers of one address", "waiting forgotten", "encoding",
    "encoding that cannot be used",
}  # fmt: skip
FIGURES = {
    "connections", "reads", "writes", "entries", "variables", "replies", "refused", "unanswered", "cut", "gap_bytes",
    "miscounted", "ambiguous", "other_bytes", "latency_ns.count", "latency_ns.p50", "latency_ns.p99", "latency_ns.max",
    "polling_ns.p50", "polling_ns.p99",
}  # fmt: skip


frames_of = cache(conversations)


def observed(frames: list[Frame], ports: tuple[int, ...] = (80, 8080)) -> Visu:
    visu = Visu(ports)
    for frame in frames:
        visu.observe(frame)
    return visu


SAID = (
    b" HTTP/1.0\r\n", b" HTTP/1.1\n", b"HTTP/1.0 200 OK", b"HTTP/1.1 100 Continue", b" 204 ", b" 404 ", b" 500",
    b" 403 ", b"/plc/webvisu.htm", b"/PLC/webvisu.htm", b"WebVisuV3.bin", b"TcAdsWebService.dll", b"READPI?",
    b"writepi?", b"HEAD /", b"OPTIONS *", b"PUT /x", b"content-length:", b"CONTENT-LENGTH:", b"cONTENT-lENGTH:",
    b"gzip, Chunked", b";a=b", b"X-After", b"X-GZIP", b"deflate", b"identity", b":br", b"|???", b"|\n", b"\r\n|",
    b"a|b", b"|100|", b"\xe4\xf6", b"<variablelist>", b"\x16\x03\x01", b"SSH-2.0", b"stray",
)  # fmt: skip


def test_the_traffic_says_everything() -> None:
    said: Counter[bytes] = Counter()
    sizes: set[int] = set()
    flags: set[int] = set()
    links: set[int] = set()
    one_sided = hasty = 0
    for seed in SEEDS:
        speakers: dict[frozenset[object], set[object]] = {}
        for frame in frames_of(seed):
            segment = peel_tcp(frame)
            assert segment is not None
            said.update(words for words in SAID if words in segment.payload)
            sizes.add(segment.length)
            flags.add(segment.flags)
            links.add(int.from_bytes(frame.data[12:14], "big") if frame.link == ETHERNET else frame.link)
            ends = (segment.source, segment.source_port), (segment.destination, segment.destination_port)
            speakers.setdefault(frozenset(ends), set()).add(ends[0])
            hasty += bool(segment.flags & SYN) and segment.length > 0
        one_sided += sum(len(heard) == 1 for heard in speakers.values())
    assert set(said) == set(SAID)
    assert {1, 1460, 60_000} <= sizes
    assert flags == {SYN, SYN | ACK, ACK, PSH | ACK, FIN | ACK, RST, RST | ACK}
    assert links == {0x0800, 0x86DD, 0x8100, 0x88A8, SLL, RAW}
    assert one_sided
    assert hasty


def test_a_seed_gives_the_same_frames() -> None:
    assert conversations(5) == conversations(5)
    assert conversations(5) != conversations(6)


def test_the_traffic_shows_everything() -> None:
    happened: Counter[str] = Counter()
    figures: Counter[str] = Counter()
    codes: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    versions: set[int] = set()
    for seed in SEEDS:
        frames = frames_of(seed)
        visu = observed(frames)
        happened += visu.happened
        for row in visu.rows():
            nested = {f"{name}.{part}": row[name][part] for name in ("latency_ns", "polling_ns") for part in row[name]}
            figures.update(name for name, value in (row | nested).items() if value and isinstance(value, int))
            versions.add(6 if ":" in row["client"] else 4)
        codes.update(one["code"] for one in visu.findings())
        kinds.update(told.kind for told in visu.messages)
    assert {name for name, count in happened.items() if count} == HAPPENINGS
    assert {name for name in figures if name != "port"} == FIGURES
    assert min(figures.values()) >= 10
    assert {code for code, count in codes.items() if count >= 3} == {f"NV8{number:02}" for number in range(1, 11)}
    assert set(kinds) == {"request", "query", "reply"}
    assert versions == {4, 6}


@pytest.mark.parametrize("seed", range(1, 40, 3))
def test_what_is_broken_is_read_all_the_same(seed: int) -> None:
    frames = visu_traffic(seed)
    visu = observed(frames)
    assert visu.number == len(frames)
    assert all(1 <= number <= len(frames) for one in visu.findings() for number in one["frames"])


@pytest.mark.parametrize("seed", range(0, 96, 4))
def test_mild_traffic_has_no_holes(seed: int) -> None:
    visu = observed(frames_of(seed), PORTS)
    assert not any(
        name.startswith("hole") or "lost" in name or name == "foreign" for name, count in visu.happened.items() if count
    )
    rows = visu.rows()
    assert sum(row["gap_bytes"] for row in rows) == 0
    assert sum(row["cut"] for row in rows) <= visu.happened["response not whole at the end"]


def test_the_clock_steps_and_frames_are_cut_in_some() -> None:
    steps = short = 0
    for seed in SEEDS:
        frames = frames_of(seed)
        steps += any(after.ts_ns < before.ts_ns for before, after in pairwise(frames))
        short += any(len(frame.data) < frame.original for frame in frames)
        assert all(peel_tcp(frame) is not None for frame in frames)
    assert steps
    assert short


@needs_tshark
def test_tshark_reads_the_same_bodies(tmp_path: Path) -> None:
    """Plain traffic: each body, and the frame with which it is whole, as tshark's own reassembly has them."""
    together = 0
    for seed in range(16):
        frames = conversations(seed, link=ETHERNET, plain=True)
        path = tmp_path / f"{seed}.pcap"
        write_pcap(frames, path)
        ours = Counter((told.frame, spaced(told.body)) for told in observed(frames, PORTS).messages)
        theirs = Counter(bodies_by_tshark(path))
        assert ours - theirs == Counter()
        assert not [one for one in (theirs - ours) if one[1].startswith(b"|")]
        together += ours.total()
    assert together > 200


def bodies_by_tshark(path: Path) -> list[tuple[int, bytes]]:
    """Return frame and body of every message that tshark sees, those without a body too."""
    claimed = [part for port in PORTS for part in ("-d", f"tcp.port=={port},http")]
    command = ["tshark", "-n", "-r", str(path), "-o", "tcp.desegment_tcp_streams:TRUE", *claimed, "-Y", "http"]
    done = subprocess.run([*command, "-T", "pdml"], capture_output=True, check=True)
    found = []
    for packet in ElementTree.fromstring(done.stdout).iter("packet"):
        (number,) = [int(one.get("show", "")) for one in packet.iter("field") if one.get("name") == "frame.number"]
        for proto in packet.iter("proto"):
            if proto.get("name") == "http":
                bodies = [one for one in proto.iter("field") if one.get("name") == "http.file_data"]
                found.append((number, spaced(body_of(bodies[0])) if bodies else b""))
    return found


def body_of(field: ElementTree.Element) -> bytes:
    """Return the bytes of a field; of what was compressed, tshark 4.0 tells the text alone."""
    return bytes.fromhex(field.get("value", "")) or field.get("show", "").encode("latin-1", "replace")


def spaced(body: bytes) -> bytes:
    """Return a body with its line ends as XML passes them on."""
    return re.sub(rb"\s+", b" ", body)
