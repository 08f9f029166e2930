"""The display filter over captures: what tshark chooses is chosen, and what is known of the telegrams is true."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.open import open_source
from nvscope.errors import UsageError
from nvscope.expression.typed_columns import FieldType
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields.frame import EITHER_OF, FIELDS, PROTOCOL_TESTS, expression_names
from tests.laws import examples, some
from tests.oracle.builders import LINKS
from tests.oracle.traffic import generate, mutate
from tests.packets import Shown
from tests.tshark_choices import choices_of_tshark
from tests.view.fields.test_frame import rows_of, values

ROOT = Path(__file__).parents[2]
CAPTURES = ROOT / "captures"
PEERS, PLANT = CAPTURES / "peers" / "peers.pcap", CAPTURES / "plant.pcapng.gz"
INTERFACES = CAPTURES / "interfaces.pcapng"
DISSECTOR = ROOT / "tests" / "benchmarks" / "dissector.lua"


def numbers(path: Path, expression: str | None = None, limit: int | None = None) -> list[int]:
    chosen = DisplayFilter(expression) if expression is not None else None
    shown = Shown(open_source([str(path)]), chosen=chosen, limit=limit)
    return [number for rows in shown for number in rows.frame_number.tolist()]


# --- against tshark

GENERIC = [
    "ip.src == 10.77.0.1",
    "ip.src != 10.77.0.1",
    "ip.src == 10.77.0.0/31 || ip.dst == 10.77.0.0/30",
    "ip.dst == 255.255.255.255",
    "ip.src in {10.77.0.2, 192.168.10.11..192.168.10.30}",
    "ip.src > 10.77.0.1",
    "ip.addr == 10.77.0.2",
    "ip.addr != 10.77.0.2",
    "!(ip.addr == 10.77.0.2)",
    "udp.dstport in {1202, 1300..1400}",
    "udp.dstport not in {1202}",
    "vlan.id not in {7, 100..200}",
    "udp.srcport == 1202 && udp.dstport == 1202",
    "udp.port == 1202",
    "udp.port != 1202",
    "udp.port > 40000",
    "udp.length > 60",
    "frame.len > 100 && frame.len <= 0x80",
    "frame.cap_len < 90 or frame.number <= 20",
    "frame.number & 1 == 1",
    "frame.number & 6",
    "frame.number + 1 == 5",
    "frame.number % 10 == 0",
    "frame.number in {3, 5..9, 860..862}",
    "frame.number not in {1..20}",
    "!frame.number == 6",
    "frame.number == 3 or frame.number == 4 and frame.len > 60",
    "not frame.number == 3 and not frame.len > 90 || frame.number == 8",
    "frame.time_relative < 0.05",
    "frame.time_relative >= 1 && frame.time_relative <= 2.5",
    "frame.time_delta > 0.01",
    'frame.time < "2026-01-31 12:00:00"',
    "udp.payload[0:4] == 00:2d:53:33",
    "udp.payload[8] == 2a",
    "udp.payload[8] == 0x2a",
    "udp.payload[1-3] == 2d:53:33",
    "udp.payload[-2:] == 00:00",
    "udp.payload[-2:2] == 00:00",
    "udp.payload[:5] == 00:2d:53:33:05",
    "udp.payload[40:4] == 00:00:00:00",
    "udp.payload[16:2] > 40:00",
    "udp.payload[16:] < 10:00:00",
    "udp.payload[8:] contains 00:07",
    "udp.payload[40:]",
    "udp.payload contains 00:00:00:01",
    'udp.payload contains "S3"',
    'udp.payload contains "\\x2d\\x53"',
    "udp.payload",
    'udp.payload matches "S3"',
    'udp.payload matches "^.-s3.{4}\\x07"',
    'udp.payload matches r"\\x00\\x14[\\x00-\\x0f]"',
    'udp.payload matches "\\xff"',
    'udp.payload matches "^[^\\xf0-\\xff]*$"',
    'udp.payload[16:] matches "^\\x14|\\x10"',
    'udp.payload ~ "\\x00{12}"',
    'udp.payload contains "\\xff"',
    "udp.payload[8] == 7",
    "udp.payload[8] != 7",
    "udp.payload[8] > 7",
    "udp.payload contains 7",
    "udp.payload[16] == a or udp.payload[16] == b",
    "udp.payload[0,2] == 00:53",
    "udp.payload[0-3,8] == 00:2d:53:33:07",
    "udp.payload[-1:,8:1] == 00:07",
    "udp.payload[0:4] == 00-2d-53-33",
    "udp.payload[0:4] == 00.2d.53.33",
    "udp.payload[0:4] == 00.2d.5333",
    "udp.payload[8:2] == 10-00 or udp.payload[8:2] == 07-00",
    "any ip.addr == 10.77.0.2",
    "all ip.addr != 10.77.0.2",
    "any ip.addr != 10.77.0.2",
    "all udp.port == 1202",
    "any udp.port == 1202 && udp.length > 60",
    "!all udp.port == 1202",
    "all udp.port in {1202}",
    'all udp.payload matches "\\x07"',
    "len(udp.payload) > 40",
    "len(udp.payload) + 8 == udp.length",
    "count(ip.addr) == 2",
    "udp.length == 0b100111",
    "udp.length == 047",
    "frame.time_relative < 010",
    "udp",
    "ip and udp.length > 60",
    "!ipv6 && frame.number < 100",
    "frame && udp.payload[8] == 7",
]
NETWORK_VARIABLES = [
    "nv.index == 7 && nv.subindex > 0",
    "nv.flags & 0x01",
    "nv.counter in {10..20, 30}",
    "nv.id == 5 || nv.flags & 1 == 1",
    "nv.items * 2 + 20 > nv.length",
    "nv.data[0:2] == 01:00",
    "nv.data contains 00:01",
    "nv.length != 20 and nv.checksum == 0",
    "nv.identity == 0x33532d00",
    "nv && nv.index == 07",
    "len(nv.data) > 20",
    'nv.data matches "^\\x01"',
    "nv.data[0,-1] == 01:00",
]


@cache
def choices(path: Path) -> dict[str, list[int]]:
    """Return what tshark chooses by each generic filter."""
    return choices_of_tshark(path, GENERIC, "-o", "ip.defragment:FALSE")


def by_tshark(path: Path, expression: str, *options: str) -> list[int]:
    command = ["tshark", "-n", "-o", "ip.defragment:FALSE", *options, "-r", str(path)]
    command += ["-Y", expression, "-T", "fields", "-e", "frame.number"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [int(line) for line in done.stdout.split()]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
@pytest.mark.parametrize("path", [PEERS, PLANT], ids=lambda path: path.name)
@pytest.mark.parametrize("expression", GENERIC)
def test_what_tshark_chooses_is_chosen(path: Path, expression: str) -> None:
    telegrams = set(numbers(path))
    theirs = choices(path)[expression]
    assert numbers(path, expression) == [number for number in theirs if number in telegrams]


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
@pytest.mark.parametrize("expression", ["any ip.addr != 10.77.0.2", "frame.time_relative < 010"])
def test_tshark_chooses_the_same_for_all_filters_at_once(expression: str) -> None:
    assert choices(PEERS)[expression] == by_tshark(PEERS, expression)


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
@pytest.mark.parametrize(("path", "expression"), some([*product([PEERS, PLANT], NETWORK_VARIABLES)]))
def test_what_tshark_with_a_dissector_chooses_is_chosen(path: Path, expression: str) -> None:
    telegrams = set(numbers(path))
    theirs = by_tshark(path, expression, "-X", f"lua_script:{DISSECTOR}")
    assert numbers(path, expression) == [number for number in theirs if number in telegrams]


def test_the_filters_compared_with_tshark_choose_something_and_not_everything() -> None:
    sizes = {expression: {len(numbers(path, expression)) for path in (PEERS, PLANT)} for expression in GENERIC}
    idle = [expression for expression, found in sizes.items() if found <= {0}]
    whole = [expression for expression, found in sizes.items() if found <= {862, 1206}]
    assert len(idle) <= 3, idle
    assert len(whole) <= 20, whole


# --- of our own


@pytest.mark.parametrize(
    ("expression", "same"),
    [
        ("nv.flags.ack", "nv.flags & 1"),
        ('nv.service == "ODAcknowledgement"', "nv.id == 5"),
        ('nv.service matches "ack.*ment$"', "nv.id == 5"),
        ('nv.service contains "Ack"', "nv.id == 5"),
        ("frame.time_relative < 50ms", "frame.time_relative < 0.05"),
        ("frame.time_relative < T#1s500ms", "frame.time_relative < 1.5"),
        ("frame.time_relative < 1m30s - 88.5s", "frame.time_relative < 1.5"),
        ("nv.data == udp.payload[20:]", "nv.length > 20"),
        ("frame.time - frame.time_relative == frame.time_epoch - frame.time_relative", "frame.number"),
        ("nv.fault", 'nv.fault matches "."'),
        ("nv.broadcast && !nv.truncated", "nv.broadcast == true"),
        ("NV.Index EQ 7", "nv.index == 7"),
    ],
)  # fmt: skip
def test_two_ways_to_say_the_same(expression: str, same: str) -> None:
    assert numbers(PLANT, expression) == numbers(PLANT, same)


def test_the_limit_counts_what_is_read() -> None:
    shown = Shown(open_source([str(PEERS)]), chosen=DisplayFilter("nv.index == 7"), limit=20)
    assert [len(rows) for rows in shown] == [3]
    assert shown.counts[1:] == (20, 3)


def test_the_time_since_the_telegram_shown_before_is_that_since_the_one_chosen_before() -> None:
    (rows,) = Shown(open_source([str(PEERS)]), chosen=DisplayFilter("nv.index == 42"))
    times = rows.telegrams.ts_ns.tolist()
    assert rows.since_shown_ns.tolist() == [0, *(b - a for a, b in pairwise(times))]


def test_ipv6_addresses_and_networks() -> None:
    version_6 = numbers(INTERFACES, "ip.version == 6")
    assert version_6
    assert numbers(INTERFACES, "ip.src == ::/0") == numbers(INTERFACES, "ipv6") == version_6
    assert numbers(INTERFACES, "ip") == numbers(INTERFACES, "!ipv6") == numbers(INTERFACES, "ip.version == 4")
    assert numbers(INTERFACES, "ip.src != ::/0") == numbers(INTERFACES, "ip.version == 4")


@given(st.integers(0, 10_000), st.sampled_from([*LINKS, None]))
@examples(20)
def test_a_field_alone_is_there_or_true_in_broken_telegrams_too(seed: int, link: int | None) -> None:
    for rows in rows_of(mutate(seed, generate(seed, frames=100, link=link))):
        for name in FIELDS:
            if name == "frame.time_delta_displayed":
                continue
            found = values(name, rows)
            is_bool = FIELDS[name].type is FieldType.BOOL
            assert DisplayFilter(name)(rows).tolist() == [bool(v) if is_bool else v is not None for v in found]
        for name, wanted in (("nv.data", b"\0\1"), ("udp.payload", b"S3")):
            mask = DisplayFilter(f"{name} contains {wanted.hex(':')}")(rows)
            data = [v if isinstance(v, bytes) else b"" for v in values(name, rows)]
            assert mask.tolist() == [wanted in part for part in data]
            assert DisplayFilter(f"{name}[2:3] == 33:00:00")(rows).tolist() == [part[2:5] == b"3\0\0" for part in data]


def test_every_field_can_be_named_but_the_one_that_the_filter_decides() -> None:
    names = expression_names(FIELDS)
    assert set(names) == {*FIELDS, *EITHER_OF, *PROTOCOL_TESTS}
    for name in names:
        if name != "frame.time_delta_displayed":
            numbers(INTERFACES, name)
    with pytest.raises(UsageError, match="still to be decided"):
        DisplayFilter("frame.time_delta_displayed > 1")
