"""Scapy's reading of a telegram against numpy's and tshark's: three readers of one table."""

from __future__ import annotations

import csv
import io
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import IP, UDP
from scapy.layers.l2 import Ether
from scapy.packet import Packet, Raw
from scapy.utils import rdpcap

from dissectors.layout import Field, Layout
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, PORT, Service
from dissectors.scapy_layers import NetVar, scapy_fields

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "captures" / "peers" / "peers.pcap"
LUA_DISSECTOR = ROOT / "tests" / "benchmarks" / "dissector.lua"

NAMES = [field.name for field in HEADER]


def numpy_values(payload: bytes) -> dict[str, int]:
    row = HEADER.gather(np.frombuffer(payload, np.uint8), np.array([0], np.int64))[0]
    return {name: int(row[name]) for name in NAMES}


def scapy_values(telegram: Packet) -> dict[str, int]:
    return {name: int(telegram.getfieldval(name)) for name in NAMES}


def rebuilt(telegram: Packet) -> bytes:
    """Return the bytes that Scapy builds from the fields, not the ones it remembers."""
    fields: dict[str, Any] = dict(scapy_values(telegram))
    return bytes(NetVar(**fields) / Raw(bytes(telegram.payload)))


numbers = {
    field.name: st.integers(0, 2 ** (8 * field.size_bytes) - 1) for field in HEADER if field.name != "identity"
} | {"identity": st.sampled_from([IDENTITY, IDENTITY_ASCII])}
headers: st.SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(numbers)
data = st.binary(max_size=300)


@given(headers, data)
def test_both_pack_and_unpack_the_same_bytes(header: dict[str, Any], content: bytes) -> None:
    built = HEADER.pack(**header).tobytes() + content
    assert bytes(NetVar(**header) / Raw(content)) == built
    assert scapy_values(NetVar(built)) == numpy_values(built) == header
    assert bytes(NetVar(built).payload) == content


@given(headers, data, st.data())
def test_both_read_mutated_bytes_alike(header: dict[str, Any], content: bytes, draws: st.DataObject) -> None:
    mutated = bytearray(HEADER.pack(**header).tobytes() + content)
    for position, value in draws.draw(
        st.lists(st.tuples(st.integers(4, len(mutated) - 1), st.integers(0, 255)), max_size=8)
    ):
        mutated[position] = value
    cut = bytes(mutated[: draws.draw(st.integers(0, len(mutated)))])
    telegram: Packet = NetVar(cut)
    assert bytes(telegram) == cut
    if len(cut) < HEADER.size_bytes:
        assert telegram.__class__ is Raw
    else:
        assert scapy_values(telegram) == numpy_values(cut)
        assert rebuilt(telegram) == cut


@given(st.binary(max_size=64))
def test_any_bytes_to_the_port_survive_dissection(content: bytes) -> None:
    frame = bytes(IP(src="192.0.2.1", dst="192.0.2.255") / UDP(sport=40000, dport=PORT) / Raw(content))
    packet = IP(frame)
    assert bytes(packet) == frame
    is_telegram = len(content) >= 20 and content[:4] in (b"\x00-S3", b"0-S3")
    assert (NetVar in packet) == is_telegram


def test_prompt_session() -> None:
    packet = IP(dst="255.255.255.255") / UDP() / NetVar(index=7, items=1, flags="ack+checksum") / b"\x2a\x00"
    received = IP(bytes(packet))
    assert (received[UDP].sport, received[UDP].dport) == (PORT, PORT)
    telegram = received[NetVar]
    assert (
        bytes(telegram).hex() == "002d533300000000" + "0700" + "0000" + "0100" + "1600" + "0000" + "03" + "00" + "2a00"
    )
    assert telegram.flags.ack
    assert telegram.flags.checksum
    assert not telegram.flags.invalid
    shown = str(received.show(dump=True))
    assert all(line in shown for line in ("id        = ODStateFree", "flags     = ack+checksum", "length    = 22"))
    assert "list 7/0" in received.summary()


def test_services_are_known_by_name() -> None:
    for service in Service:
        named = bytes(NetVar(id=service.name))
        assert numpy_values(named)["id"] == service
        assert f"id        = {service.name}\n" in str(NetVar(named).show(dump=True))


def test_length_is_filled_in_only_where_it_is_not_given() -> None:
    assert numpy_values(bytes(NetVar()))["length"] == 20
    assert numpy_values(bytes(NetVar() / (b"x" * 256)))["length"] == 276
    assert numpy_values(bytes(NetVar(length=5) / b"xyz"))["length"] == 5
    with pytest.raises(OverflowError):
        bytes(NetVar() / (b"x" * 65516))


@pytest.mark.parametrize(
    ("ports", "is_telegram"),
    [
        ({"sport": 1202, "dport": 1202}, True),
        ({"sport": 51000, "dport": 1202}, True),
        ({"sport": 53, "dport": 1202}, True),
        ({"sport": 48879, "dport": 1202}, True),
        ({"sport": 1202, "dport": 51000}, True),
        ({"sport": 51000, "dport": 51001}, False),
    ],
)
def test_either_port_makes_a_telegram(ports: dict[str, Any], is_telegram: bool) -> None:
    packet = Ether(bytes(Ether() / IP(dst="192.0.2.255") / UDP(**ports) / NetVar(index=3)))
    assert (NetVar in packet) == is_telegram


def test_every_kind_of_field_has_a_scapy_field() -> None:
    layout = Layout(
        "sample",
        (
            Field("small", "u1", "small", "one byte"),
            Field("word", "<u2", "word", "two bytes", base="hex"),
            Field("double", "<u4", "double", "four bytes", values={1: "one"}),
            Field("long", "<u8", "long", "eight bytes"),
        ),
    )
    sample: type[Packet] = type("Sample", (Packet,), {"name": "Sample", "fields_desc": scapy_fields(layout)})
    values: dict[str, Any] = {"small": 0x01, "word": 0x0302, "double": 0x07060504, "long": 0x0F0E0D0C0B0A0908}
    assert bytes(sample(**values)) == layout.pack(**values).tobytes() == bytes(range(1, 16))
    with pytest.raises(TypeError, match="field odd"):
        scapy_fields(Layout("odd", (Field("odd", ">u2", "odd", "other byte order"),)))


def tshark_rows(capture: Path) -> list[dict[str, str]]:
    columns = [*(f"nv.{name}" for name in NAMES), "nv.data"]
    command = [
        "tshark",
        "-n",
        "-X",
        f"lua_script:{LUA_DISSECTOR}",
        "-r",
        str(capture),
        "-T",
        "fields",
        "-E",
        "header=y",
    ]
    for column in columns:
        command += ["-e", column]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return list(csv.DictReader(io.StringIO(printed), delimiter="\t"))


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_scapy_and_tshark_read_recorded_traffic_alike() -> None:
    rows = tshark_rows(PEERS)
    packets: Any = rdpcap(str(PEERS))
    assert len(rows) == len(packets) == 864
    telegrams = 0
    for row, packet in zip(rows, packets, strict=True):
        assert (NetVar in packet) == bool(row["nv.identity"])
        if NetVar in packet:
            telegrams += 1
            telegram = packet[NetVar]
            assert {name: int(row[f"nv.{name}"], 0) for name in NAMES} == scapy_values(telegram)
            assert row["nv.data"] == bytes(telegram.payload).hex()
    assert telegrams == 862
