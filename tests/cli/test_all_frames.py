"""Frames of all kinds: `packets --all-frames`, and filters and fields that ask for frames which are no telegrams."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType
from nvscope.expression.typed_columns import FieldType
from nvscope.view.fields.other_frames import OTHER_FIELDS
from tests.cli.test_widths import on_terminal
from tests.laws import examples
from tests.oracle.frame import ETHERNET, Frame
from tests.oracle.pcap import write_pcap
from tests.other_frames import NAMES, START_S, kinds, write_kinds
from tests.program_here import run_text
from tests.tshark_choices import choices_of_tshark

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")

SCENARIOS = Path(__file__).parents[1] / "scenarios"
FIELDS = (
    "frame.number", "eth.src", "eth.dst", "vlan.id", "arp.hw.type", "arp.proto.type", "arp.hw.size", "arp.proto.size",
    "arp.opcode", "arp.src.hw_mac", "arp.src.proto_ipv4", "arp.dst.hw_mac", "arp.dst.proto_ipv4", "icmp.type",
    "icmp.code", "icmpv6.type", "icmpv6.code", "tcp.srcport", "tcp.dstport", "udp.srcport", "udp.dstport",
)  # fmt: skip
"""Those that are called the same there and here, and tell the same of frames that are whole."""

CHOICES = (
    "arp", "icmp", "icmpv6", "tcp", "!arp", "icmp.type == 3", "icmp.type == 3 && icmp.code == 4", "icmp.type >= 5",
    "icmpv6.type == 135 || arp.opcode == 1", "arp.opcode == 2", "arp.src.hw_mac == 02:00:00:00:00:02",
    "arp.src.proto_ipv4 == 10.0.0.1", "arp.dst.proto_ipv4 == 10.0.0.0/24", "tcp.port == 80", "tcp.dstport == 80",
    "arp.dst.hw_mac == ff:ff:ff:ff:ff:ff", "icmp.code", "arp.proto.type == 0x800", "vlan.id == 5 && arp",
)  # fmt: skip


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kinds") / "kinds.pcap"
    write_kinds(path)
    return path


def shown(*words: str | Path) -> list[list[str]]:
    done = run_text("packets", "-q", *words)
    assert done.returncode == 0, done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


def asked(names: tuple[str, ...]) -> list[str]:
    return [word for name in names for word in ("-e", name)]


def tshark(path: Path, *words: str) -> list[list[str]]:
    command = [
        "tshark", "-n", "-r", str(path), "-o", "ip.defragment:FALSE", "-o", "ipv6.defragment:FALSE", "-T", "fields",
        "-E", "occurrence=f", *words,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [line.split("\t") for line in done.stdout.splitlines()]


def numbers(lines: list[list[str]]) -> list[str]:
    return [line[0] for line in lines]


def test_every_frame_has_a_line_in_its_order(capture: Path) -> None:
    done = run_text("packets", capture, "--all-frames")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert [int(line.split()[0]) for line in lines] == list(range(1, len(NAMES) + 1))
    told = dict(zip(NAMES, lines, strict=True))
    for name, words in {
        "arp request": "ARP who has 10.0.0.9? tell 10.0.0.1",
        "gratuitous": "ARP 10.0.0.1 is at 02:00:00:00:00:01 (gratuitous)",
        "probe": "ARP who has 10.0.0.1? (probe)",
        "telegram": "list 7 sub 0 data 1 item",
        "port unreachable": "ICMP destination unreachable: port unreachable (UDP 10.0.0.1:1202 → 10.0.0.9:1202)",
        "too long": "fragmentation needed, at most 1400 bytes",
        "unknown icmp": "ICMP type 77: code 9",
        "advertisement": "ICMPv6 neighbour advertisement: fe80::9 is at 02:00:00:00:00:02",
        "tcp": "TCP 49152 → 80 [SYN], 0 bytes",
        "lldp": "LLDP EtherType 0x88cc, 43 bytes",
        "802.3": "IEEE 802.3 38 bytes",
        "fragment 0": "ICMP, a fragment, not put together",
    }.items():
        assert words in " ".join(told[name].split()), name
    assert not [name for name, line in told.items() if "cut short" in line]


def test_what_is_cut_says_so(tmp_path: Path) -> None:
    """In front of the end of a header: of Ethernet, ARP, IP, ICMP, UDP and TCP."""
    for name, size in (("arp reply", 13), ("arp reply", 40), ("echo", 30), ("echo", 34), ("udp", 40), ("tcp", 50)):
        data = bytes(dict(kinds())[name])
        write_pcap([Frame(START_S * 10**9, ETHERNET, data[:size], len(data))], tmp_path / "a.pcap")
        assert "cut short" in run_text("packets", tmp_path / "a.pcap", "--all-frames").stdout, (name, size)


def test_without_being_asked_telegrams_only(capture: Path) -> None:
    (line,) = run_text("packets", capture).stdout.splitlines()
    assert "list 7 sub 0" in line


@pytest.mark.parametrize("more", [(), ("--color", "always"), ("-t", "ad")])
def test_ends_stand_in_columns_whatever_a_frame_is_of(capture: Path, more: tuple[str, ...]) -> None:
    done = run_text("packets", "-q", capture, "--all-frames", *more)
    plain = re.sub("\x1b\\[[0-9;]*m", "", done.stdout)
    lines = plain.splitlines()
    assert len({line.index(" → ") for line in lines}) == 1
    behind = [re.split(r"(?<= → )(\S+ +)", line, maxsplit=1) for line in lines]
    assert {"ARP", "list", "ICMP", "UDP"} <= {rest.split()[0] for _, _, rest in behind}
    assert len({len(destination) for _, destination, _ in behind}) == 1


def test_pieces_that_follow_keep_the_columns(tmp_path: Path) -> None:
    """A piece of telegrams alone behind one of several kinds: pieces are of some thousand frames."""
    known = {name: bytes(frame) for name, frame in kinds()}
    frames = [known["arp request"], *[known["telegram"]] * 9000, known["echo v6"]]
    write_pcap([Frame(START_S * 10**9, ETHERNET, data, len(data)) for data in frames], tmp_path / "a.pcap")
    done = run_text("packets", "-q", tmp_path / "a.pcap", "--all-frames")
    assert len({line.index(" → ") for line in done.stdout.splitlines()}) == 1


@pytest.mark.skipif(os.name != "posix", reason="needs a terminal of POSIX")
@pytest.mark.parametrize("columns", [60, 80, 100])
def test_telegrams_lose_nothing_for_it_on_narrow_terminals(capture: Path, columns: int) -> None:
    told = on_terminal(["packets", str(capture), "--all-frames"], columns).splitlines()
    (alone,) = on_terminal(["packets", str(capture)], columns).splitlines()
    assert [line.split() for line in told if " list 7" in line] == [alone.split()]
    assert max(map(len, told)) <= columns


@pytest.mark.skipif(os.name != "posix", reason="needs a terminal of POSIX")
@pytest.mark.parametrize("columns", [40, 60, 80])
def test_other_frames_share_columns_with_telegrams_and_keep_their_protocol(columns: int, tmp_path: Path) -> None:
    known = {name: bytes(frame) for name, frame in kinds()}
    names = {"arp request": "ARP", "telegram": "list", "lldp": "LLDP", "port unreachable": "ICMP"}
    frames = [Frame(START_S * 10**9, ETHERNET, known[name], len(known[name])) for name in names]
    write_pcap(frames, tmp_path / "a.pcap")
    lines = on_terminal(["packets", str(tmp_path / "a.pcap"), "--all-frames"], columns).splitlines()[: len(frames)]
    assert max(map(len, lines)) <= columns
    assert len({line.index(" → ") for line in lines}) == 1
    starts = {line.index(f"  {protocol}") for line, protocol in zip(lines, names.values(), strict=True)}
    assert len(starts) == 1
    assert len({len(line.split()[1]) for line in lines}) == 1


@pytest.mark.parametrize(
    ("link", "data", "told"),
    [
        (LinkType.NULL, struct.pack("<I", 16) + bytes(40), "AppleTalk address family 16, 44 bytes"),
        (LinkType.NULL, struct.pack(">I", 23) + bytes(40), "IPX address family 23, 44 bytes"),
        (LinkType.NULL, struct.pack("<I", 10) + bytes(40), "IPv6 of Linux address family 10, 44 bytes"),
        (LinkType.NULL, struct.pack("<I", 99) + bytes(40), "NULL address family 99, 44 bytes"),
        (LinkType.NULL, b"\7\0", "link cut short: 2 bytes"),
        (LinkType.LOOP, struct.pack(">I", 7) + bytes(40), "OSI address family 7, 44 bytes"),
        (LinkType.LOOP, struct.pack(">I", 0x10000) + bytes(4), "LOOP address family 65536, 8 bytes"),
        (LinkType.RAW, b"\x50" + bytes(20), "RAW neither IPv4 nor IPv6: version 5, 21 bytes"),
        (LinkType.RAW, b"", "link cut short: 0 bytes"),
        (147, bytes(10), "link type 147 10 bytes, not read here"),
    ],
)
def test_what_is_not_ip_is_named(link: int, data: bytes, told: str, tmp_path: Path) -> None:
    write_pcap([Frame(START_S * 10**9, link, data, len(data))], tmp_path / "a.pcap")
    done = run_text("packets", tmp_path / "a.pcap", "--all-frames")
    assert done.stdout.split("→ ?")[1].split() == told.split()


@needs_tshark
def test_fields_are_those_of_tshark(capture: Path) -> None:
    ours = shown(capture, "-T", "fields", "--all-frames", *asked(FIELDS))
    theirs = tshark(capture, *asked(FIELDS))
    assert len(ours) == len(theirs) == len(NAMES)
    quoted = NAMES.index("port unreachable"), NAMES.index("unreachable v6")
    for row, (own, other) in enumerate(zip(ours, theirs, strict=True)):
        told = dict(zip(FIELDS, other, strict=True))
        for name, value in zip(FIELDS, own, strict=True):
            if told[name].startswith("0x"):
                assert int(value, 16) == int(told[name], 16), (NAMES[row], name)
            elif name.startswith("udp.") and not value and (row in quoted or NAMES[row] in _QUOTING):
                continue  # they show what an ICMP error quotes as if it had been sent
            elif name.startswith("icmp") and NAMES[row].startswith("fragment"):
                assert value == "", "a fragment is not put together, so nothing is read in it"
            else:
                assert value == told[name], (NAMES[row], name)


_QUOTING = {"too long", "time exceeded", "redirect"}


@pytest.fixture(scope="module")
def choices(capture: Path) -> dict[str, list[int]]:
    return choices_of_tshark(capture, CHOICES, "-o", "ip.defragment:FALSE", "-o", "ipv6.defragment:FALSE")


@needs_tshark
@pytest.mark.parametrize("choice", CHOICES)
def test_filters_choose_what_those_of_tshark_choose(
    capture: Path, choices: dict[str, list[int]], choice: str
) -> None:  # fmt: skip
    """And without --all-frames: who names what only such frames have, wants to see them."""
    theirs = list(map(str, choices[choice]))
    fragments = {str(NAMES.index(f"fragment {number}") + 1) for number in range(2)}
    ours = numbers(shown(capture, "-Y", choice, "-e", "frame.number"))
    assert set(ours) - fragments == set(theirs) - fragments
    assert ours
    assert ours == numbers(shown(capture, "-Y", choice, "-e", "frame.number", "--all-frames"))


@pytest.mark.parametrize("name", [field.name for field in OTHER_FIELDS] + ["tcp.srcport", "tcp.dstport"])
def test_naming_a_field_of_such_frames_shows_them(capture: Path, name: str) -> None:
    for form in ("fields", "csv", "json", "ndjson"):
        done = run_text("packets", capture, "-q", "-T", form, "-e", "frame.number", "-e", name)
        assert done.returncode == 0, done.stderr
        rows = json.loads(done.stdout) if form == "json" else done.stdout.splitlines()
        assert len(rows) - (form == "csv") == len(NAMES)
    chosen = numbers(shown(capture, "-Y", name, "-e", "frame.number"))
    assert 0 < len(chosen) < len(NAMES)
    upper = name.upper()
    assert numbers(shown(capture, "-Y", upper, "-e", "frame.number")) == chosen
    assert f"\n{name} " in f"\n{run_text('keys', '--fields').stdout}"


def test_json_values_have_the_types_of_their_fields(capture: Path) -> None:
    done = run_text("packets", capture, "-T", "json", *asked(tuple(field.name for field in OTHER_FIELDS)))
    rows = json.loads(done.stdout)
    types = {FieldType.UNSIGNED: int, FieldType.ADDRESS: str, FieldType.BYTES: str, FieldType.BOOL: bool}
    for field in OTHER_FIELDS:
        there = [row[field.name] for row in rows if row[field.name] is not None]
        assert there
        assert {type(value) for value in there} == {types[field.type]}, field.name


def test_a_field_of_all_frames_alone_does_not_show_them(capture: Path) -> None:
    assert len(shown(capture, "-e", "frame.number", "-e", "eth.src")) == 1
    assert len(shown(capture, "-e", "frame.number", "-e", "eth.src", "--all-frames")) == len(NAMES)


def test_where_only_telegrams_count_the_way_to_frames_is_told(capture: Path) -> None:
    for words in (
        ("report", capture, "-Y", "icmp.type == 3"),
        ("export", capture, "-Y", "arp", "-w", "out.csv"),
        ("export", capture, "--what", "telegrams", "-e", "icmp.type", "-w", "out.csv"),
    ):
        done = run_text(*words, cwd=capture.parent)
        assert done.returncode == 2
        assert "no telegram has it `nvscope packets` shows frames of all kinds" in " ".join(done.stderr.split())
    assert not (capture.parent / "out.csv").exists()


_NOTHING = "1 telegram read, the filter does not choose it."


@pytest.mark.parametrize(
    ("choice", "more"),
    [
        ("udp.port == 5353", f"{_NOTHING} --all-frames looks at 24 other frames too."),
        ("nv.index == 99", _NOTHING),
        ("icmp.type == 99", f"{len(NAMES)} frames read, the filter chooses none of them."),
    ],
)  # fmt: skip
def test_where_frames_could_be_meant_it_is_told(capture: Path, choice: str, more: str) -> None:
    done = run_text("packets", capture, "-Y", choice)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.splitlines()[0] == f"nvscope: {more}"
    if "--all-frames" in more:
        assert len(shown(capture, "-Y", choice, "--all-frames")) == 1


def test_a_finding_that_no_telegram_shows_leads_to_its_frames(tmp_path: Path) -> None:
    done = run_text("simulate", SCENARIOS / "unreachable.toml", "-w", tmp_path / "a.pcap")
    assert done.returncode == 0
    words = ("packets", tmp_path / "a.pcap", "-Y", 'finding.code == "NV305"')
    done = run_text(*words)
    assert (done.stdout, "--all-frames looks at 5 other frames too." in done.stderr) == ("", True)
    told = run_text(*words, "--all-frames").stdout.splitlines()
    assert told
    assert all("ICMP" in line and "unreachable" in line for line in told)


def test_a_count_counts_frames(capture: Path) -> None:
    for many in (1, 6, 10):
        assert numbers(shown(capture, "--all-frames", "-c", str(many), "-e", "frame.number")) == [
            str(number) for number in range(1, many + 1)
        ]
    assert numbers(shown(capture, "-Y", "icmp", "-c", "8", "-e", "frame.number")) == ["7", "8"]


def test_figures_of_telegrams_are_the_same(capture: Path) -> None:
    """Who looks at all frames sees the telegrams among them as before."""
    names = ("frame.number", "frame.time", "ip.src", "nv.index", "nv.counter", "udp.payload")
    telegrams = shown(capture, *asked(names))
    among = [line for line in shown(capture, *asked(names), "--all-frames") if line[0] == telegrams[0][0]]
    assert among == telegrams


WHOLE = [(name, bytes(frame)) for name, frame in kinds()]


@st.composite
def damaged(draw: st.DrawFn) -> list[Frame]:
    """Draw frames that were cut, changed, or captured as another link layer than they are of."""
    chance = random.Random(draw(st.integers(0, 1 << 32)))
    link = draw(st.sampled_from([ETHERNET, ETHERNET, ETHERNET, 113, 276, 101, 0, 228, 147]))
    frames = []
    for number in range(draw(st.integers(1, 40))):
        data = bytearray(chance.choice(WHOLE)[1])
        for _ in range(chance.choice((0, 0, 1, 1, 3, 9))):
            data[chance.randrange(len(data))] = chance.choice((0, 1, 6, 0x45, 0x81, 0xFF, chance.randrange(256)))
        length = len(data)
        if chance.random() < 0.6:
            del data[chance.randrange(len(data) + 1) :]
        frames.append(Frame((START_S * 1000 + number) * 1_000_000, link, bytes(data), length))
    return frames


@examples(30)
@given(frames=damaged())
def test_damaged_frames_are_shown_like_others(frames: list[Frame], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("damaged") / "a.pcap"
    write_pcap(frames, path)
    every = [str(number) for number in range(1, len(frames) + 1)]
    for form in ((), ("-V", "-x"), ("-T", "json")):
        done = run_text("packets", path, "-q", "--all-frames", *form)
        assert done.returncode == 0, done.stderr
        if not form:
            assert [line.split()[0] for line in done.stdout.splitlines()] == every
        elif "-V" in form:
            assert re.findall(r"^Frame (\d+)$", done.stdout, re.MULTILINE) == every
        else:
            assert [str(row["frame.number"]) for row in json.loads(done.stdout)] == every
    for choice in ("arp || icmp || icmpv6", "arp.src.proto_ipv4 == 10.0.0.1 || icmp.code == 3"):
        assert run_text("packets", path, "-q", "-Y", choice).returncode == 0


@needs_tshark
@examples(25)
@given(frames=damaged())
def test_damaged_frames_have_the_fields_that_tshark_finds(
    frames: list[Frame], tmp_path_factory: pytest.TempPathFactory
) -> None:  # fmt: skip
    """Of cut or changed frames of Ethernet, what both of them tell is the same."""
    frames = [Frame(frame.ts_ns, ETHERNET, frame.data, frame.original) for frame in frames]
    path = tmp_path_factory.mktemp("damaged") / "a.pcap"
    write_pcap(frames, path)
    names = ("frame.number", "arp.opcode", "arp.src.hw_mac", "arp.src.proto_ipv4", "icmp.type", "icmpv6.type")
    ours = shown(path, "--all-frames", *asked(names))
    theirs = tshark(path, *asked(names))
    assert len(ours) == len(theirs)
    for own, other in zip(ours, theirs, strict=True):
        for name, value, told in zip(names, own, other, strict=True):
            if value and told:
                assert value == told, (own[0], name)
