"""CAN frames against a reading frame by frame, and against python-can, Scapy and tshark."""

from __future__ import annotations

import csv
import io
import random
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import can
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.can import CAN

from dissectors.batch import LinkType, PacketBatch
from dissectors.can.frame import DLC_OF_LENGTH, FD_LENGTHS, CanBatch, Fault, dissect_can
from dissectors.link import peel
from tests.capture.build import pcap
from tests.capture.reference import Packet
from tests.oracle.frame import Frame
from tests.packets import batch_of

CAN_LINK, SLL, SLL2 = LinkType.CAN_SOCKETCAN, LinkType.LINUX_SLL, LinkType.LINUX_SLL2
HEADS: dict[int, tuple[int, int]] = {SLL: (16, 14), SLL2: (20, 0)}
"""Bytes of a cooked frame's header, and where in it the protocol is."""
PROTOCOLS = {"CAN": 0x000C, "CAN FD": 0x000D, "CAN XL": 0x000E}


class Row(NamedTuple):
    """What one frame is, read plainly."""

    identifier: int
    extended: bool
    remote: bool
    error: bool
    fd: bool
    brs: bool
    esi: bool
    length: int
    data: bytes
    fault: Fault


SHORT = Row(0, False, False, False, False, False, False, 0, b"", Fault.SHORT)


def row_of(raw: bytes, protocol: int = 0) -> Row:
    """Read one frame, by hand; ``protocol`` is that of a cooked frame."""
    if len(raw) < 8:
        return SHORT
    word, length, flags, reserved, last = struct.unpack_from("<IBBBB" if protocol else ">IBBBB", raw)
    fd = flags in (4, 5, 6, 7) and reserved == last == 0 if not protocol else protocol == PROTOCOLS["CAN FD"]
    error = not fd and bool(word & 0x2000_0000)
    remote = not fd and not error and bool(word & 0x4000_0000)
    extended = not error and bool(word & 0x8000_0000)
    identifier = word & 0x1FFF_FFFF
    data = b"" if remote else raw[8 : 8 + length]
    if length & 0x80 or protocol == PROTOCOLS["CAN XL"]:
        fault = Fault.XL
    elif length > 64:
        fault = Fault.TOO_LONG
    elif length > 8 and not fd:
        fault = Fault.CLASSIC_TOO_LONG
    elif len(data) < length and not remote:
        fault = Fault.TRUNCATED
    elif identifier > 0x7FF and not extended and not error:
        fault = Fault.IDENTIFIER
    else:
        fault = Fault.NONE
    if not extended and not error:
        identifier &= 0x7FF
    return Row(
        identifier, extended, remote, error, fd, fd and bool(flags & 1), fd and bool(flags & 2), length, data, fault
    )


def rows_of(frames: CanBatch) -> list[Row]:
    """Return the columns of a batch as rows, and see that their types are as promised."""
    types = {"row": "int64", "ts_ns": "int64", "at": "int64", "channel": "uint16", "identifier": "uint32"}
    types |= dict.fromkeys(("length", "captured", "fault"), "uint8")
    types |= dict.fromkeys(("extended", "remote", "error", "fd", "brs", "esi"), "bool")
    for name, dtype in types.items():
        column = getattr(frames, name)
        assert column.shape == (len(frames),), name
        assert column.dtype == dtype, name
    names = ("identifier", "extended", "remote", "error", "fd", "brs", "esi", "length")
    columns = [getattr(frames, name).tolist() for name in names]
    return [
        Row(*values, frames.payload(position), Fault(frames.fault[position]))
        for position, values in enumerate(zip(*columns, strict=True))
    ]


def captured(raws: Iterable[bytes], link: int = CAN_LINK) -> PacketBatch:
    return batch_of([Frame(1000 * number, link, raw, len(raw)) for number, raw in enumerate(raws)])


def cooked(raw: bytes, protocol: int, link: int, interface: int = 3) -> bytes:
    """Return a frame behind the header of a cooked capture."""
    if link == SLL:
        return struct.pack(">HHHQH", 1, 280, 0, 0, protocol) + raw
    return struct.pack(">HHIHBBQ", protocol, 0, interface, 280, 1, 0, 0) + raw


@st.composite
def plausible_frames(draw: st.DrawFn) -> bytes:
    """Frames as buses have them, and nearly so."""
    word = draw(st.integers(0, 0x7FF) | st.integers(0, 0xFFFF_FFFF))
    length = draw(st.integers(0, 9) | st.sampled_from(FD_LENGTHS) | st.integers(0, 255))
    flags = draw(st.integers(0, 8) | st.integers(0, 255))
    reserved, last = draw(st.sampled_from([(0, 0), (0, 0), (0, 15), (1, 0), (0xCC, 0xCC)]))
    data = draw(st.binary(min_size=min(length, 64), max_size=64) | st.binary(max_size=16))
    return struct.pack(">IBBBB", word, length, flags, reserved, last) + data


raw_frames = plausible_frames() | st.binary(max_size=80)


@given(st.lists(raw_frames, max_size=20))
def test_any_bytes_are_frames_or_faults(raws: list[bytes]) -> None:
    frames = dissect_can(captured(raws))
    assert rows_of(frames) == [row_of(raw) for raw in raws]
    assert frames.row.tolist() == list(range(len(raws)))
    assert frames.ts_ns.tolist() == [1000 * number for number in range(len(raws))]
    assert not frames.channel.any()


others = st.tuples(st.sampled_from([LinkType.ETHERNET, LinkType.RAW, 65535]), st.binary(max_size=60))


@st.composite
def cooked_frames(draw: st.DrawFn) -> tuple[int, bytes]:
    link = draw(st.sampled_from([SLL, SLL2]))
    protocol = draw(st.sampled_from([*PROTOCOLS.values(), 0x0800, 0x86DD, 0, 0xFFFF]))
    whole = cooked(draw(raw_frames), protocol, link, draw(st.integers(0, 9)))
    return link, whole[: draw(st.just(len(whole)) | st.integers(0, len(whole)))]


@given(
    st.lists(others | cooked_frames() | st.tuples(st.just(CAN_LINK), raw_frames), max_size=20), st.booleans(), st.data()
)
def test_mixed_links_give_their_can_frames(packets: list[tuple[int, bytes]], some: bool, draws: st.DataObject) -> None:
    expected, places, interfaces = [], [], []
    for place, (link, raw) in enumerate(packets):
        head, at = HEADS.get(link, (0, 0))
        protocol = int.from_bytes(raw[at : at + 2], "big") if head and len(raw) >= head else 0
        if link == CAN_LINK or protocol in PROTOCOLS.values():
            expected.append(row_of(raw[head:], protocol))
            places.append(place)
            interfaces.append(int.from_bytes(raw[4:8], "big") if link == SLL2 else 0)
    batch = batch_of([Frame(7 * place, link, raw, len(raw)) for place, (link, raw) in enumerate(packets)])
    chosen = list(range(len(packets)))
    if some:
        chosen = [place for place in chosen if draws.draw(st.booleans())]
    frames = dissect_can(batch, np.array(chosen, np.int64) if some else None)
    kept = [number for number, place in enumerate(places) if place in chosen]
    assert rows_of(frames) == [expected[number] for number in kept]
    assert frames.row.tolist() == [places[number] for number in kept]
    assert frames.ts_ns.tolist() == [7 * places[number] for number in kept]
    assert frames.channel.tolist() == [interfaces[number] for number in kept]


def test_channels_of_the_capture_go_before_interfaces_of_cooked_frames() -> None:
    raws = [cooked(bytes(16), PROTOCOLS["CAN"], SLL2, interface=70_000 + n) for n in range(3)]
    batch = captured(raws, SLL2)
    assert dissect_can(batch).channel.tolist() == [0xFFFF] * 3
    told = PacketBatch(
        batch.data, batch.offset, batch.captured, batch.original, batch.ts_ns, batch.link,
        np.array([4, 5, 6], np.uint16),
    )  # fmt: skip
    assert dissect_can(told).channel.tolist() == [4, 5, 6]
    assert dissect_can(told, np.array([2])).channel.tolist() == [6]


def test_a_cooked_frame_that_libpcap_shows() -> None:
    """The bytes of libpcap issue 1247: ``cansend can0 123#0102030405060708`` captured on "any", and on can0."""
    raw = bytes.fromhex("23010000080000000102030405060708")
    cooked_row = rows_of(dissect_can(captured([cooked(raw, PROTOCOLS["CAN"], SLL2)], SLL2)))[0]
    plain_row = rows_of(dissect_can(captured([bytes.fromhex("00000123") + raw[4:]])))[0]
    assert cooked_row == plain_row
    assert (cooked_row.identifier, cooked_row.data, cooked_row.fault) == (0x123, bytes(range(1, 9)), Fault.NONE)


def test_frames_can_be_chosen() -> None:
    frames = dissect_can(captured([struct.pack(">IBBBB", n, 2, 0, 0, 0) + bytes([n, n]) for n in range(5)]))
    assert [row.identifier for row in rows_of(frames.take(np.array([4, 1])))] == [4, 1]
    assert [row.data for row in rows_of(frames.take(frames.identifier > 3))] == [b"\4\4"]
    assert len(frames.take(slice(1, 3))) == 2


def test_can_is_a_known_link_type_without_datagrams() -> None:
    peeled = peel(captured([bytes(16)] * 3).with_margin())
    assert peeled.unsupported is None
    assert len(peeled.udp) == 0


def test_dlc() -> None:
    lengths = {length: dlc for dlc, length in enumerate(can.util.CAN_FD_DLC)}
    assert {length: int(DLC_OF_LENGTH[length]) for length in lengths} == lengths
    assert [int(DLC_OF_LENGTH[n]) for n in (9, 13, 33, 63)] == [9, 10, 14, 15]

    def dlc(length: int, flags: int = 0, reserved: int = 0, last: int = 0, word: int = 1) -> int:
        return int(
            dissect_can(captured([struct.pack(">IBBBB", word, length, flags, reserved, last) + bytes(64)])).dlc[0]
        )

    assert [dlc(length) for length in (0, 5, 8, 9, 200)] == [0, 5, 8, 8, 8]
    assert [dlc(length, flags=4) for length in (0, 8, 12, 64, 127)] == [0, 8, 9, 15, 15]
    assert [dlc(8, last=last) for last in (7, 9, 15, 16, 255)] == [8, 9, 15, 8, 8]
    assert dlc(7, last=12) == 7
    assert dlc(8, reserved=1, last=12) == 8, "noise of an old capture"
    assert dlc(8, last=12, word=0x4000_0001) == 12, "a remote frame"
    assert dissect_can(captured([b"\0" * 7])).dlc.tolist() == [0]


messages = st.builds(
    dict,
    extended=st.booleans(),
    identifier=st.integers(0, 0x1FFF_FFFF),
    remote=st.booleans(),
    error=st.booleans(),
    fd=st.booleans(),
    brs=st.booleans(),
    esi=st.booleans(),
    data=st.sampled_from(FD_LENGTHS).flatmap(lambda n: st.binary(min_size=n, max_size=n)),
)


def message_of(values: dict[str, Any]) -> can.Message:
    fd, extended = values["fd"], values["extended"]
    error = not fd and values["error"]
    remote = not fd and not error and values["remote"]
    data = values["data"] if fd else values["data"][:8]
    return can.Message(
        arbitration_id=values["identifier"] & (0x1FFF_FFFF if extended or error else 0x7FF),
        is_extended_id=extended and not error,
        is_remote_frame=remote,
        is_error_frame=error,
        is_fd=fd,
        bitrate_switch=fd and values["brs"],
        error_state_indicator=fd and values["esi"],
        data=None if remote else data,
        dlc=len(data),
        check=not error,
    )


@pytest.mark.skipif(sys.platform != "linux", reason="python-can knows SocketCAN frames on Linux only")
@given(st.lists(messages, max_size=8))
def test_frames_of_python_can(drawn: list[dict[str, Any]]) -> None:
    from can.interfaces.socketcan.socketcan import build_can_frame  # noqa: PLC0415

    sent = [message_of(values) for values in drawn]
    raws = []
    for message in sent:
        raw = build_can_frame(message)
        word = int.from_bytes(raw[:4], sys.byteorder)
        # python-can leaves the DLC in the last byte of the head also where the frame has no such field
        raws.append(struct.pack(">I", word) + raw[4:7] + b"\0" + raw[8:])
    expected = [
        Row(
            message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.is_error_frame,
            message.is_fd, message.bitrate_switch, message.error_state_indicator, message.dlc, bytes(message.data),
            Fault.NONE,
        )
        for message in sent
    ]  # fmt: skip
    assert rows_of(dissect_can(captured(raws))) == expected


@given(st.lists(raw_frames.filter(lambda raw: len(raw) >= 8), max_size=8))
def test_scapy_reads_the_same_head(raws: list[bytes]) -> None:
    for row, raw in zip(rows_of(dissect_can(captured(raws))), raws, strict=True):
        packet = CAN(raw)
        flags = str(packet.flags).split("+")
        assert packet.length == row.length
        if not row.fd:
            assert ("error" in flags) == row.error
            assert ("remote_transmission_request" in flags and not row.error) == row.remote
        assert ("extended" in flags and not row.error) == row.extended
        assert packet.identifier & (0x1FFF_FFFF if row.extended or row.error else 0x7FF) == row.identifier
        if not row.remote:
            assert bytes(packet.data) == row.data


TSHARK_FIELDS = (
    "frame.number", "can.id", "can.flags.xtd", "can.flags.rtr", "can.flags.err", "can.len", "canfd.flags.brs",
    "canfd.flags.esi", "_ws.col.Protocol",
)  # fmt: skip


def tshark_rows(capture: Path) -> list[dict[str, str]]:
    fields = [argument for name in TSHARK_FIELDS for argument in ("-e", name)]
    done = subprocess.run(
        ["tshark", "-r", str(capture), "-T", "fields", "-E", "separator=,", *fields],
        check=True, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    return [dict(zip(TSHARK_FIELDS, row, strict=True)) for row in csv.reader(io.StringIO(done.stdout))]


def sound_frames(count: int) -> Sequence[bytes]:
    """Frames without fault, of every kind."""
    rng = random.Random(20)
    raws = []
    while len(raws) < count:
        fd = rng.random() < 0.3
        extended = rng.random() < 0.5
        word = rng.getrandbits(29) | 0x8000_0000 if extended else rng.getrandbits(11)
        length = rng.choice(FD_LENGTHS) if fd else rng.randint(0, 8)
        flags = 4 | rng.randrange(4) if fd else 0
        if not fd and rng.random() < 0.2:
            word |= 0x4000_0000
        if not fd and rng.random() < 0.2:
            word, length = 0x2000_0000 | rng.getrandbits(9), 8
        raws.append(struct.pack(">IBBBB", word, length, flags, 0, 0) + rng.randbytes(64 if fd else 8))
    return raws


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
@pytest.mark.parametrize("link", [CAN_LINK, SLL, SLL2])
@pytest.mark.skipif(sys.byteorder != "little", reason="Wireshark reads cooked frames in the order of its own host")
def test_tshark_reads_the_same(tmp_path: Path, link: LinkType) -> None:
    raws = []
    for raw in sound_frames(400):
        if link == CAN_LINK:
            raws.append(raw)
        else:
            protocol = PROTOCOLS["CAN FD" if raw[5] & 4 else "CAN"]
            raws.append(cooked(raw[3::-1] + raw[4:], protocol, link))
    capture = tmp_path / "can.pcap"
    capture.write_bytes(pcap([Packet(n * 1000, len(raw), link, raw) for n, raw in enumerate(raws)], link=link))
    rows = rows_of(dissect_can(captured(raws, link)))
    assert all(row.fault is Fault.NONE for row in rows)
    shown = tshark_rows(capture)
    assert len(shown) == len(rows)
    for row, told in zip(rows, shown, strict=True):
        assert told["_ws.col.Protocol"] == ("CANFD" if row.fd else "CAN")
        assert int(told["can.len"]) == row.length
        if row.error:
            assert told["can.flags.err"] == "1"
            continue
        assert int(told["can.id"]) == row.identifier
        assert told["can.flags.xtd"] == str(int(row.extended))
        if row.fd:
            assert (told["canfd.flags.brs"], told["canfd.flags.esi"]) == (str(int(row.brs)), str(int(row.esi)))
        else:
            assert told["can.flags.rtr"] == str(int(row.remote))
