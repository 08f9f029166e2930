"""Claims: datagrams and segments of the ports that somebody asks for, and no frame is passed over that is wanted."""

from __future__ import annotations

import random
from ipaddress import ip_address

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import IP, TCP
from scapy.layers.inet6 import IPv6
from scapy.layers.l2 import Ether

from dissectors import address
from dissectors.batch import PacketBatch
from dissectors.claims import NO_CLAIMS, Claims
from dissectors.link import peel
from dissectors.sorter import Sorter
from dissectors.transport import SegmentBatch
from dissectors.varieties import NO_TELEGRAM
from tests.laws import examples
from tests.oracle.builders import internet_packet, link_frame, udp
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of, cut

WEB = Claims(tcp=(80, 8080))
V4, V6 = ("10.0.0.1", "10.0.0.2"), ("2001:db8::1", "2001:db8::2")


def segment(chance: random.Random, port: int, *, v6: bool = False) -> bytes:
    """Return a frame made by Scapy: a segment to or from a port, with options or without, padded or not."""
    source, destination = V6 if v6 else V4
    ip = IPv6(src=source, dst=destination) if v6 else IP(src=source, dst=destination)
    ports = [port, chance.randrange(1024, 65536)]
    chance.shuffle(ports)
    tcp = TCP(
        sport=ports[0], dport=ports[1], seq=chance.getrandbits(32), ack=chance.getrandbits(32),
        flags=chance.choice(("S", "A", "PA", "FA", "R")),
        options=chance.choice(([], [("MSS", 1460)], [("NOP", None), ("NOP", None), ("Timestamp", (1, 2))])),
    )  # fmt: skip
    data = chance.randbytes(chance.choice((0, 0, 1, 7, 200)))
    frame = bytes(Ether(src="02:00:00:00:00:01", dst="02:00:00:00:00:02") / ip / tcp / data)
    return frame + bytes(max(0, 60 - len(frame)))


@examples(60)
@given(st.integers(0, 10_000))
def test_segments_are_what_scapy_reads(seed: int) -> None:
    chance = random.Random(seed)
    frames, expected = [], []
    for row in range(30):
        port = chance.choice((80, 8080, 443))
        data = segment(chance, port, v6=chance.random() < 0.3)
        kept = data if chance.random() < 0.8 else data[: chance.randrange(14, len(data) + 1)]
        frames.append(Frame(row, ETHERNET, kept, len(data)))
        whole = Ether(data)
        ip, tcp = whole.payload, whole[TCP]
        header_bytes = 14 + len(bytes(ip)) - len(bytes(ip.payload)) if ip.version == 6 else 14 + 20
        if port == 443 or len(kept) < header_bytes + 20:
            continue
        at = header_bytes + tcp.dataofs * 4
        size = (ip.plen - tcp.dataofs * 4) if ip.version == 6 else ip.len - 20 - tcp.dataofs * 4
        expected.append(
            (row, ip.src, ip.dst, tcp.sport, tcp.dport, tcp.seq, tcp.ack, int(tcp.flags), size,
             header_bytes, min(max(len(kept) - at, 0), size), data[at : at + min(max(len(kept) - at, 0), size)])
        )  # fmt: skip
    batch = batch_of(frames).with_margin()
    found = peel(batch, None, WEB).tcp
    told = []
    for place in range(len(found)):
        begin, size = int(found.payload[place]), int(found.captured_bytes[place])
        told.append(
            (
                int(found.row[place]), address.text(int(found.source_hi[place]), int(found.source_lo[place])),
                address.text(int(found.destination_hi[place]), int(found.destination_lo[place])),
                *(int(column[place]) for column in (
                    found.source_port, found.destination_port, found.sequence, found.acknowledgement, found.flags,
                    found.payload_bytes, found.header - batch.offset[found.row], found.captured_bytes,
                )),
                batch.data[begin : begin + size].tobytes(),
            )
        )  # fmt: skip
    assert told == expected
    assert len(peel(batch, None, NO_CLAIMS).tcp) == 0


def claimed_traffic(seed: int) -> list[Frame]:
    """Return telegrams, other datagrams and segments, on plain Ethernet or not, broken or not."""
    chance = random.Random(seed)
    frames = generate(seed, frames=120, link=[ETHERNET, ETHERNET, None][seed % 3])
    for _ in range(60):
        ts_ns = frames[0].ts_ns if frames else 0
        if chance.random() < 0.5:
            data = segment(chance, chance.choice((80, 443)), v6=chance.random() < 0.3)
        else:
            content = chance.choice((b"hello", b"\x00-S3", b"\x00-S3" + bytes(8), b""))
            port = chance.choice((53, 4711))
            datagram = udp(content, port=port)
            if chance.random() < 0.2:
                # Begins as a telegram does, and is too short for one: what follows is none of the datagram's.
                datagram = udp(b"\x00-S3" + bytes(30), port=port, udp_length=8 + 4)
            packet = internet_packet(ip_address(V4[0]), ip_address(V4[1]), 17, datagram)
            data = link_frame(packet, tags=chance.choice(((), (), (0x8100,))))
        frames.append(Frame(ts_ns, ETHERNET, data, len(data)))
    chance.shuffle(frames)
    return mutate(seed, frames) if seed % 2 else frames


@examples(60)
@given(st.integers(0, 10_000))
def test_sorting_gives_what_was_asked_for_and_changes_nothing_else(seed: int) -> None:
    """The fast path finds the claimed frames that peeling all frames finds, whatever it has learned before."""
    claims = Claims(udp=(53, 4711, 1202), tcp=(80,))
    whole = batch_of(claimed_traffic(seed))
    sorter, plain = Sorter(claims=claims), Sorter()
    for batch in (whole, whole, *cut(whole, 17)):
        told, without = sorter.sort(batch), plain.sort(batch)
        assert (told.variety != NO_TELEGRAM).tolist() == (without.variety != NO_TELEGRAM).tolist()
        telegrams = told.variety != NO_TELEGRAM
        assert told.counter[telegrams].tolist() == without.counter[telegrams].tolist()
        assert told.fragments == without.fragments
        assert not len(without.datagrams)
        assert not len(without.segments)
        margin = batch.with_margin()
        peeled = peel(margin, None, claims)
        asked = claims.claim_udp(peeled.udp.source_port, peeled.udp.destination_port)
        wanted = peeled.udp.take(asked & (told.variety[peeled.udp.row] == NO_TELEGRAM))
        assert told.datagrams.row.tolist() == wanted.row.tolist()
        assert told.datagrams.payload_bytes.tolist() == wanted.payload_bytes.tolist()
        assert columns(told.segments, told.packets) == columns(peeled.tcp, margin)


def columns(segments: SegmentBatch, packets: PacketBatch) -> dict[str, tuple[str, list[int]]]:
    """Return the type and the numbers of each column, by name; places as they are in their packets."""
    found = {name: getattr(segments, name) for name in SegmentBatch.__match_args__}
    for name in ("header", "payload"):
        found[name] = found[name] - packets.offset[segments.row]
    return {name: (str(column.dtype), column.tolist()) for name, column in found.items()}


@examples(60)
@given(st.integers(0, 10_000))
def test_segments_told_by_their_headers_alone_are_those_that_are_peeled(seed: int) -> None:
    """Whatever the headers say: lengths, options, fragments, versions; and wherever the capture was cut."""
    chance = random.Random(seed)
    frames = []
    for row in range(60):
        data = bytearray(segment(chance, chance.choice((80, 8080, 443))))
        for _ in range(chance.choice((0, 0, 1, 1, 2))):
            data[chance.randrange(12, 54)] = chance.choice((0, 0x45, 0x46, 0x50, 0x60, 6, 17, chance.randrange(256)))
        kept = data if chance.random() < 0.7 else data[: chance.randrange(14, len(data) + 1)]
        frames.append(Frame(row, ETHERNET, bytes(kept), len(data)))
    batch = batch_of(frames)
    told, margin = Sorter(claims=WEB).sort(batch), batch.with_margin()
    assert columns(told.segments, told.packets) == columns(peel(margin, None, WEB).tcp, margin)


def test_either_side_may_have_the_port() -> None:
    source, destination = np.array([80, 5, 5], np.uint16), np.array([5, 80, 5], np.uint16)
    assert WEB.claim_tcp(source, destination).tolist() == [True, True, False]
    assert WEB.claim_udp(source, destination).tolist() == [False, False, False]
    assert Claims.of([WEB, Claims(udp=(7,), tcp=(80,))]) == Claims((7,), (80, 8080))
