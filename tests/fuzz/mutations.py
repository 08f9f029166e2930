"""Mutations of capture files, each drawn from a random generator: the same seed makes the same file.

Blind ones change any bytes, so also those of a compressed file. Aimed ones know where records, their numbers and
their packets are, and those on packets keep the records right around them, so that what is broken is what is inside.
"""

from __future__ import annotations

import gzip
import random
import struct
from collections.abc import Callable, Sequence

from tests.fuzz.anatomy import PCAP_ORDERS, PCAP_RECORD, PCAPNG_ORDERS, Anatomy, Number, anatomy_of, packet_numbers

Blind = Callable[[random.Random, bytes, Sequence[bytes]], bytes]
Aimed = Callable[[random.Random, Anatomy], Anatomy]

MAX_BYTES = 1 << 20
"""A mutated file is cut here: what grows with the size alone is not what is looked for."""

_MAGICS = [
    *PCAP_ORDERS,
    *PCAPNG_ORDERS,
    b"\x0a\x0d\x0d\x0a",
    b"\x1f\x8b\x08\x00",
    b"\x28\xb5\x2f\xfd",
    b"\x04\x22\x4d\x18",
]


def mutated(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    """Return a file after one or a few mutations; ``others`` are the files that it may be mixed with."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        anatomy = anatomy_of(raw) if rng.random() < 0.75 else None
        if anatomy is not None and anatomy.records:
            raw = rng.choice(AIMED)(rng, anatomy).assembled()
        else:
            raw = rng.choice(BLIND)(rng, raw, others)
        raw = raw[:MAX_BYTES]
    return raw


def shortened(rng: random.Random, raw: bytes, records: int) -> bytes:
    """Return a file with the records of some place in it only, and what stands before all packets."""
    anatomy = anatomy_of(raw)
    if anatomy is None or len(anatomy.records) <= records:
        return raw
    first = next(iter(anatomy.packets()), 0)
    begin = rng.randrange(first, max(len(anatomy.records) - records, first) + 1)
    return anatomy.with_records(anatomy.records[:first] + anatomy.records[begin : begin + records]).assembled()


# --- compression ----------------------------------------------------------------------------------------------------


def gzipped(raw: bytes) -> bytes:
    return gzip.compress(raw, 1, mtime=0)


def zstd_compressed(raw: bytes) -> bytes:
    import zstandard  # noqa: PLC0415

    return zstandard.ZstdCompressor(level=1).compress(raw)


def lz4_compressed(raw: bytes) -> bytes:
    import lz4.frame  # noqa: PLC0415

    return bytes(lz4.frame.compress(raw))


COMPRESSIONS: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzipped,
    ".zst": zstd_compressed,
    ".lz4": lz4_compressed,
}


# --- any bytes ------------------------------------------------------------------------------------------------------


def _place(rng: random.Random, raw: bytes) -> int:
    """Draw a place in the bytes, one in four times close to the begin."""
    return rng.randrange(min(len(raw), 64) if rng.random() < 0.25 else len(raw)) if raw else 0


def _span(rng: random.Random, raw: bytes, longest: int = 300) -> tuple[int, int]:
    begin = _place(rng, raw)
    return begin, min(begin + rng.randint(1, longest), len(raw))


def flip_bits(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    data = bytearray(raw)
    for _ in range(rng.choice((1, 1, 4, 60)) if data else 0):
        data[_place(rng, raw)] ^= 1 << rng.randrange(8)
    return bytes(data)


def change_bytes(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    data = bytearray(raw)
    for _ in range(rng.choice((1, 1, 4, 60)) if data else 0):
        data[_place(rng, raw)] = rng.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, rng.randrange(256)))
    return bytes(data)


def change_any_number(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    size = rng.choice((2, 4, 8))
    if len(raw) < size:
        return raw
    number = Number(min(_place(rng, raw), len(raw) - size), size, rng.choice("<>"))
    return number.written(raw, _other_value(rng, number, raw))


def truncate(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    return raw[: _place(rng, raw)]


def cut_begin(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    return raw[_place(rng, raw) :]


def delete_region(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    begin, end = _span(rng, raw)
    return raw[:begin] + raw[end:]


def repeat_region(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    begin, end = _span(rng, raw)
    return raw[:end] + raw[begin:end] * rng.choice((1, 1, 2, 30)) + raw[end:]


def swap_regions(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    a, b, c, d = sorted(_place(rng, raw) for _ in range(4))
    return raw[:a] + raw[c:d] + raw[b:c] + raw[a:b] + raw[d:]


def insert_garbage(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    at, size = _place(rng, raw), rng.choice((1, 2, 3, 4, 16, 60, 500, 5000))
    garbage = rng.choice((rng.randbytes(size), bytes(size), b"\xff" * size, rng.choice(_MAGICS)))
    return raw[:at] + garbage + raw[at:]


def append_garbage(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    size = rng.choice((1, 3, 4, 8, 11, 12, 15, 16, 28, 200))
    return raw + rng.choice((rng.randbytes(size), bytes(size), b"\xff" * size))


def splice(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others)
    return raw[: _place(rng, raw)] + other[_place(rng, other) :]


def concatenate(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    return raw + rng.choice(others)


def change_magic(rng: random.Random, raw: bytes, others: Sequence[bytes]) -> bytes:
    """Put another magic over the first bytes, or over those of a section's byte order."""
    at = 8 if raw[:4] == b"\x0a\x0d\x0d\x0a" and rng.random() < 0.7 else 0
    return raw[:at] + rng.choice(_MAGICS if at == 0 else list(PCAPNG_ORDERS)) + raw[at + 4 :]


BLIND: tuple[Blind, ...] = (
    flip_bits, change_bytes, change_any_number, truncate, cut_begin, delete_region, repeat_region, swap_regions,
    insert_garbage, append_garbage, splice, concatenate, change_magic,
)  # fmt: skip


# --- numbers and records --------------------------------------------------------------------------------------------


def _other_value(rng: random.Random, number: Number, data: bytes) -> int:
    """Draw a value that means trouble: the ends of the range, beside the old one, the old one in the other order."""
    old = number.read(data)
    swapped = Number(number.at, number.size, "<>"[number.order == "<"]).read(data)
    most = (1 << 8 * number.size) - 1
    half = 1 << (8 * number.size - 1)
    return rng.choice(
        (0, 1, most, most - 1, most - 3, half, half - 1, old + 1, old - 1, old + 4, old - 4, old + 8, old * 2, old // 2,
         old ^ half, old ^ 1 << rng.randrange(8 * number.size), swapped, rng.randint(0, most), rng.randint(0, 300))
    )  # fmt: skip


def change_file_header(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Change a number of the file header of pcap; of pcapng, one of the first blocks."""
    if not anatomy.head:
        return _on_record(rng, anatomy, rng.randrange(min(len(anatomy.records), 3)))
    order = PCAP_ORDERS[anatomy.head[:4]]
    number = rng.choice([Number(at, size, order) for at, size in ((4, 2), (6, 2), (8, 4), (16, 4), (20, 4), (20, 2))])
    value = rng.choice((0, 1, 101, 108, 113, 228, 229, 276)) if number.at == 20 and rng.random() < 0.8 else None
    head = number.written(anatomy.head, _other_value(rng, number, anatomy.head) if value is None else value)
    return Anatomy(head, anatomy.records, anatomy.rest)


def change_record_number(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    for _ in range(rng.choice((1, 1, 2, 10))):
        anatomy = _on_record(rng, anatomy, rng.randrange(len(anatomy.records)))
    return anatomy


def _on_record(rng: random.Random, anatomy: Anatomy, place: int) -> Anatomy:
    record = anatomy.records[place]
    numbers = record.numbers()
    number = rng.choice(numbers)
    value = _other_value(rng, number, record.data)
    data = number.written(record.data, value)
    if record.kind != PCAP_RECORD and number.at == 4 and rng.random() < 0.5:
        # Both lengths of a block alike: what is inside them is what does not fit.
        data = Number(len(data) - 4, 4, record.order).written(data, value)
    records = list(anatomy.records)
    records[place] = record._replace(data=data)
    return anatomy.with_records(records)


def rearrange_records(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Drop, double, move or exchange records."""
    records = list(anatomy.records)
    for _ in range(rng.choice((1, 2, 10))):
        at, to = rng.randrange(len(records)), rng.randrange(len(records))
        match rng.randrange(5):
            case 0 if len(records) > 1:
                del records[at]
            case 1:
                records[at:at] = [records[at]] * rng.choice((1, 1, 3, 70))
            case 2:
                records.insert(to, records.pop(at))
            case 3:
                records[at], records[to] = records[to], records[at]
            case _:
                begin, end = min(at, to), max(at, to)
                records[begin:end] = records[begin:end][::-1]
    return anatomy.with_records(records[:20_000])


def change_times(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Let the clock step, for one packet or for all that follow, by anything between a tick and the whole range."""
    packets = [place for place in anatomy.packets() if anatomy.records[place].time()]
    if not packets:
        return anatomy
    records = list(anatomy.records)
    first = rng.randrange(len(packets))
    affected = packets[first : first + rng.choice((1, 1, 5, len(packets)))]
    part = rng.randrange(2)
    step = rng.choice(
        (1, -1, 1000, -1000, 60_000_000, -60_000_000, rng.getrandbits(32), 0x80000000, -rng.getrandbits(20))
    )
    fixed = rng.choice((None, None, None, 0, 0xFFFFFFFF, rng.getrandbits(32)))
    for place in affected:
        record = records[place]
        number = record.time()[part]
        value = number.read(record.data) + step if fixed is None else fixed
        records[place] = record._replace(data=number.written(record.data, value))
    return anatomy.with_records(records)


# --- packets within right records -----------------------------------------------------------------------------------


def _on_packets(
    rng: random.Random, anatomy: Anatomy, change: Callable[[bytes], bytes], shares: Sequence[float] = (0.02, 0.1, 0.5)
) -> Anatomy:
    """Change a share of the packets, but at least one."""
    places = anatomy.packets()
    if not places:
        return anatomy
    share = rng.choice(shares)
    chosen = {place for place in places if rng.random() < share} | {rng.choice(places)}
    records = [
        record.with_packet(change(record.content())) if place in chosen else record
        for place, record in enumerate(anatomy.records)
    ]
    return anatomy.with_records(records)


def flip_packet_bits(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    return _on_packets(rng, anatomy, lambda packet: flip_bits(rng, packet, ()))


def change_packet_bytes(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    return _on_packets(rng, anatomy, lambda packet: change_bytes(rng, packet, ()))


def change_packet_numbers(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Change numbers of the headers, of each packet others."""

    def change(packet: bytes) -> bytes:
        for _ in range(rng.choice((1, 1, 2, 4))):
            numbers = packet_numbers(packet)
            if numbers:
                number = rng.choice(numbers)
                packet = number.written(packet, _other_value(rng, number, packet))
        return packet

    return _on_packets(rng, anatomy, change)


def change_one_number_of_packets(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Change the same number of many packets, to one value or to values out of a few."""
    places = anatomy.packets()
    numbers = packet_numbers(anatomy.records[rng.choice(places)].content()) if places else []
    if not numbers:
        return anatomy
    number = rng.choice(numbers)
    values = [rng.choice((0, 1, 5, 6, 0xFFFF, rng.getrandbits(8 * number.size))) for _ in range(rng.choice((1, 2, 8)))]

    def change(packet: bytes) -> bytes:
        return number.written(packet, rng.choice(values)) if number.at + number.size <= len(packet) else packet

    return _on_packets(rng, anatomy, change, (0.1, 0.5, 1.0))


def number_from_other_packet(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Give packets a number that another packet has in the same place."""
    places = anatomy.packets()
    if not places:
        return anatomy

    def change(packet: bytes) -> bytes:
        other = anatomy.records[rng.choice(places)].content()
        numbers = [number for number in packet_numbers(packet) if number.at + number.size <= len(other)]
        if not numbers:
            return packet
        number = rng.choice(numbers)
        return number.written(packet, number.read(other))

    return _on_packets(rng, anatomy, change)


def cut_packets(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    return _on_packets(rng, anatomy, lambda packet: packet[: rng.randrange(len(packet) + 1)])


def cut_all_packets_alike(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    snap_bytes = rng.randrange(120)
    return _on_packets(rng, anatomy, lambda packet: packet[:snap_bytes], (1.0,))


def lengthen_packets(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    more = rng.choice((rng.randbytes(rng.choice((1, 3, 40, 2000))), bytes(100)))
    return _on_packets(rng, anatomy, lambda packet: packet + more)


def splice_packets(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Put the tail of one packet to the head of another, at the same place or at any."""
    places = anatomy.packets()
    if not places:
        return anatomy

    def change(packet: bytes) -> bytes:
        other = anatomy.records[rng.choice(places)].content()
        at = rng.randrange(len(packet) + 1)
        return packet[:at] + other[at if rng.random() < 0.6 else rng.randrange(len(other) + 1) :]

    return _on_packets(rng, anatomy, change)


def insert_into_packets(rng: random.Random, anatomy: Anatomy) -> Anatomy:
    """Put something between the bytes: VLAN tags, IP options, garbage."""
    tag = struct.pack(">HH", rng.choice((0x8100, 0x88A8, 0x9100)), rng.getrandbits(16))

    def change(packet: bytes) -> bytes:
        match rng.randrange(3):
            case 0:
                return packet[:12] + tag * rng.choice((1, 2, 8, 9, 30)) + packet[12:]
            case 1:
                at = rng.randrange(len(packet) + 1)
                return packet[:at] + rng.randbytes(rng.randint(1, 8)) + packet[at:]
            case _:
                begin, end = _span(rng, packet, 20)
                return packet[:begin] + packet[end:]

    return _on_packets(rng, anatomy, change)


AIMED: tuple[Aimed, ...] = (
    change_file_header, change_record_number, rearrange_records, change_times, flip_packet_bits, change_packet_bytes,
    change_packet_numbers, change_packet_numbers, change_one_number_of_packets, change_one_number_of_packets,
    number_from_other_packet, cut_packets, cut_all_packets_alike, lengthen_packets, splice_packets, insert_into_packets,
)  # fmt: skip
