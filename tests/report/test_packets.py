from __future__ import annotations

import csv
import io
import json
import random
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.netvar import HEADER
from nvscope.capture.open import open_source
from nvscope.capture.source import Source
from nvscope.errors import UsageError
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.report.ansi import paint
from nvscope.report.packets.records import Csv, Face, JsonArray, JsonLines, SeparatedFields, separation
from nvscope.report.packets.text import Text
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import DEFAULT_FIELDS, FIELDS
from nvscope.view.lines import moments
from nvscope.view.lines.hexdump import dump
from nvscope.view.lines.layers import layers
from nvscope.view.lines.netvar_line import LineWriter, Moment
from nvscope.view.lines.table import Tone, display_width
from nvscope.view.rows.frames import FrameRows
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.oracle.traffic import LINKS, data_frame, generate, mutate, telegram
from tests.packets import Batches, Shown, batch_of

ROOT = Path(__file__).parents[2]
CAPTURES = ROOT / "captures"
PEERS, INTERFACES, PUBLIC = (
    CAPTURES / "peers" / "peers.pcap",
    CAPTURES / "interfaces.pcapng",
    CAPTURES / "telegrams.pcap",
)
DISSECTOR = ROOT / "tests" / "benchmarks" / "dissector.lua"
MOMENTS: tuple[Moment, ...] = ("a", "ad", "d", "e", "r", "u", "ud")

needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")


def written(face: Face, source: Source) -> str:
    text = face.begin()
    for rows in Shown(source):
        text += "".join(face.render(rows))
    return text + face.end()


def written_of(face: Face, path: Path) -> str:
    return written(face, open_source([str(path)]))


def rows_of(frames: list[Frame]) -> list[FrameRows]:
    return list(Shown(Batches([batch_of(frames)])))


def fields(*names: str) -> list[TelegramField]:
    return [FIELDS[name] for name in names]


def traffic(seed: int) -> list[Frame]:
    choice = random.Random(seed)
    frames = generate(seed, frames=150, link=choice.choice([*LINKS, None]))
    return mutate(seed, frames) if choice.random() < 0.5 else frames


def faces(width: int | None = None) -> list[Face]:
    return [
        SeparatedFields(list(FIELDS.values()), separation(["header=y"])),
        Csv(list(FIELDS.values())),
        JsonArray(list(FIELDS.values())),
        JsonLines(DEFAULT_FIELDS),
        *(Text(moment=moment, width=width) for moment in MOMENTS),
        Text(trees=True, width=width),
        Text(dumps=True, width=width),
        Text(trees=True, dumps=True, width=width, colour=True),
    ]


# --- against tshark ---------------------------------------------------------------------------------------------------


def tshark(path: Path, *options: str) -> str:
    command = ["tshark", "-n", "-o", "ip.defragment:FALSE", "-X", f"lua_script:{DISSECTOR}", "-r", str(path), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@needs_tshark
@pytest.mark.parametrize("path", [PEERS, INTERFACES, PUBLIC], ids=lambda path: path.name)
def test_generic_fields_are_those_of_tshark(path: Path) -> None:
    names = [
        "frame.number", "frame.time_epoch", "frame.time_relative", "frame.time_delta", "frame.len", "frame.cap_len",
        "ip.src", "ip.dst", "udp.srcport", "udp.dstport", "udp.length", "udp.payload",
    ]  # fmt: skip
    asked = [*names, "ipv6.src", "ipv6.dst"]
    # Without the second dissector, udp.payload is there for all datagrams.
    theirs = {}
    for line in tshark(path, "-T", "fields", *(part for name in asked for part in ("-e", name))).splitlines():
        cells = line.split("\t")
        cells[6], cells[7] = cells[6] or cells[12], cells[7] or cells[13]
        theirs[cells[0]] = cells[:12]
    ours = [line.split("\t") for line in written_of(SeparatedFields(fields(*names), separation([])), path).splitlines()]
    assert len(ours) > 10
    assert ours == [theirs[line[0]] for line in ours]


@needs_tshark
@pytest.mark.parametrize("path", [PEERS, INTERFACES, PUBLIC], ids=lambda path: path.name)
def test_header_fields_are_those_of_the_lua_dissector(path: Path) -> None:
    names = ["frame.number", *(f"nv.{entry.name}" for entry in HEADER), "nv.data"]
    theirs = [
        line.split("\t")
        for line in tshark(
            path,
            "-Y",
            "nv and not (ip.flags.mf == 1 or ip.frag_offset > 0)",
            "-T",
            "fields",
            *(part for name in names for part in ("-e", name)),
        ).splitlines()
    ]
    ours = [line.split("\t") for line in written_of(SeparatedFields(fields(*names), separation([])), path).splitlines()]
    complete = [line for line in ours if line[names.index("nv.checksum")]]
    assert complete == theirs
    assert len(theirs) > 10


@needs_tshark
def test_a_dump_is_that_of_tshark() -> None:
    def dumps(text: str) -> list[str]:
        return [line for line in text.splitlines() if re.match(r"[0-9a-f]{4}  ", line)]

    theirs = dumps(tshark(PUBLIC, "-x"))
    assert dumps(written_of(Text(dumps=True), PUBLIC)) == theirs
    assert dumps(written_of(Text(trees=True, dumps=True), PUBLIC)) == theirs
    assert len(theirs) > 50


@needs_tshark
@pytest.mark.parametrize("moment", MOMENTS)
def test_times_are_told_as_by_tshark(moment: Moment, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "America/St_Johns")
    time.tzset()
    try:
        # What is d here, since the telegram shown before, is dd there.
        theirs = tshark(
            PEERS, "-Y", "udp", "-t", "dd" if moment == "d" else moment, "-T", "fields", "-e", "_ws.col.Time"
        )
        ours = written_of(Text(moment=moment), PEERS)
    finally:
        monkeypatch.undo()
        time.tzset()
    pattern = re.compile(r" *\d+ +((?:[\d-]{10} )?-?[\d:.]+)  ")
    told = [match[1] for match in map(pattern.match, ours.splitlines()) if match]
    assert told == [line[: len(line) - 3] for line in theirs.splitlines()]
    assert len(told) == 862


# --- laws -------------------------------------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.lists(st.integers(0, 150), max_size=8))
@examples(25)
def test_any_cut_into_batches_gives_the_same_records(seed: int, cuts: list[int]) -> None:
    whole = batch_of(traffic(seed))
    edges = sorted({0, len(whole), *(min(cut, len(whole)) for cut in cuts)})
    pieces = [whole[start:stop] for start, stop in pairwise(edges)]
    every = list(FIELDS.values())
    for make in (lambda: SeparatedFields(every, separation([])), lambda: JsonArray(every), lambda: Csv(every)):
        assert written(make(), Batches(pieces)) == written(make(), Batches([whole]))
    assert written(Text(trees=True), Batches(pieces)) == written(Text(trees=True), Batches([whole]))


def any_frame(content: bytes, link: int, cut: int, ts_ns: int) -> Frame:
    return Frame(ts_ns, link, content, len(content) + cut)


HEADS = [
    bytes.fromhex("ffffffffffff020000000001080045000040000000004011000001020304ffffffff04b204b2002c0000002d5333"),
    bytes.fromhex("45000040000000004011000001020304ffffffff04b204b2002c0000302d5333"),
    bytes.fromhex("ffffffffffff02000000000181000007080046000044000000004011000001020304ffffffff9404000004b204b2"),
]
FRAMES = st.builds(
    any_frame,
    st.builds(lambda head, rest: head + rest, st.sampled_from([b"", *HEADS]), st.binary(max_size=60)),
    st.sampled_from([*LINKS, 227, 65535]),
    st.integers(0, 5),
    st.integers(-(2**62) + 1, 2**62 - 1),
)


@given(st.lists(FRAMES, max_size=30), st.sampled_from([None, 40, 80]))
@examples(60)
def test_any_bytes_can_be_shown(frames: list[Frame], width: int | None) -> None:
    for face in faces(width):
        text = written(face, Batches([batch_of(frames)] if frames else []))
        assert re.sub(r"\x1b\[[0-9;]+m|\n|\t", "", text).isprintable()


@given(st.integers(0, 10_000), st.integers(40, 130))
@examples(40)
def test_no_line_is_wider_than_the_terminal_and_colour_changes_no_character(seed: int, width: int) -> None:
    source = Batches([batch_of(traffic(seed))])
    for options in ({}, {"moment": "ud"}, {"trees": True}):
        plain = written(Text(width=width, **options), source)  # type: ignore[arg-type]  # keywords of several types
        assert max(map(display_width, plain.splitlines()), default=0) <= width
        assert "trees" in options or all(line == line.rstrip() for line in plain.splitlines())
        coloured = written(Text(width=width, colour=True, **options), source)  # type: ignore[arg-type]  # the same
        assert re.sub(r"\x1b\[[0-9;]+m", "", coloured) == plain


@given(st.integers(0, 10_000), st.sampled_from([*LINKS, None]))
@examples(30)
def test_layers_lie_one_behind_the_other_up_to_the_payload(seed: int, link: int | None) -> None:
    for rows in rows_of(generate(seed, frames=100, link=link)):
        for packet_row, payload in zip(rows.telegrams.datagram.row, rows.telegrams.datagram.payload, strict=True):
            packet = rows.packets.packet(int(packet_row))
            payload_at = int(payload - rows.packets.offset[packet_row])
            found = layers(packet, int(rows.packets.link[packet_row]), payload_at)
            assert found[0].start == 0
            assert found[-1].stop == payload_at
            assert all(before.stop == after.start for before, after in pairwise(found))
            names = [layer.layout.name for layer in found if layer.layout]
            assert names[-1] == "udp"
            assert names[-2] in ("ip", "ipv6")
            assert set(names[:-2]) <= {"eth", "vlan", "sll", "sll2", "null"}


@given(st.lists(st.integers(-(2**62) + 1, 2**62 - 1), max_size=20), st.integers(1, 9))
def test_times_are_exact(times: list[int], digits: int) -> None:
    column = np.array(times, np.int64)
    assert [int(text.replace(".", "")) for text in moments.seconds(column)] == times
    epoch = datetime(1970, 1, 1, tzinfo=UTC)
    stamps = [
        (epoch + timedelta(seconds=value // 10**9)).strftime("%Y-%m-%d %H:%M:%S") + f".{value % 10**9:09}"
        for value in times
    ]
    assert moments.iso(column) == [stamp.replace(" ", "T") + "Z" for stamp in stamps]
    assert moments.clock(column, digits, utc=True, date=True) == [stamp[: 20 + digits] for stamp in stamps]
    assert moments.clock(column, digits, utc=True, date=False) == [stamp[11 : 20 + digits] for stamp in stamps]


# --- records ----------------------------------------------------------------------------------------------------------


def test_json_values_have_the_types_of_their_fields() -> None:
    frames = mutate(4, generate(4, frames=300))
    every = [entry for entry in FIELDS.values() if not entry.name.startswith("can")]
    records = json.loads(written(JsonArray(every), Batches([batch_of(frames)])))
    types = {
        FieldType.UNSIGNED: int,
        FieldType.TIME: str,
        FieldType.DURATION: int,
        FieldType.ADDRESS: str,
        FieldType.BYTES: str,
        FieldType.BOOL: bool,
        FieldType.TEXT: str,
    }
    assert len(records) > 100
    assert all(list(record) == [entry.name for entry in every] for record in records)
    for entry in every:
        there = [record[entry.name] for record in records if record[entry.name] is not None]
        assert there
        assert {type(value) for value in there} == {types[entry.type]}
    lines = written(JsonLines(every), Batches([batch_of(frames)])).splitlines()
    assert [json.loads(line) for line in lines] == records


def test_records_say_the_same_in_every_form() -> None:
    frames = mutate(9, generate(9, frames=300, link=None))
    every = list(FIELDS.values())
    tabbed = [
        line.split("\t")
        for line in written(SeparatedFields(every, separation(["header=y"])), Batches([batch_of(frames)])).splitlines()
    ]
    separated = list(csv.reader(io.StringIO(written(Csv(every), Batches([batch_of(frames)])), newline="")))
    assert separated == tabbed
    records = json.loads(written(JsonArray(every), Batches([batch_of(frames)])))
    assert len(records) == len(tabbed) - 1
    for line, record in zip(tabbed[1:], records, strict=True):
        for entry, cell in zip(every, line, strict=True):
            value = record[entry.name]
            if value is None:
                assert cell == ""
            elif entry.type in (FieldType.UNSIGNED, FieldType.BOOL):
                assert int(cell, 0) == value
            elif entry.type is FieldType.DURATION or entry.name == "frame.time_epoch":
                assert int(cell.replace(".", "")) == int(value)
            else:
                assert cell == value


def test_settings_of_separated_fields() -> None:
    chosen = fields("frame.number", "nv.index", "nv.fault")
    text = written_of(SeparatedFields(chosen, separation(["header=y", "separator=;", "quote=d"])), PUBLIC).splitlines()
    assert text[0] == "frame.number;nv.index;nv.fault"
    assert text[1] == '"1";"1";""'
    assert written_of(SeparatedFields(chosen, separation(["separator=/s", "quote=s"])), PUBLIC).startswith(
        "'1' '1' ''\n"
    )
    for wrong in ("header", "header=x", "separator=", "separator=ab", "separator=\x1b", "quote=x", "bom=y", "=", ""):
        with pytest.raises(UsageError):
            separation([wrong])


def test_no_telegrams_are_still_a_document() -> None:
    nothing = Batches([])
    assert written(JsonArray(DEFAULT_FIELDS), nothing) == "[]\n"
    assert written(JsonLines(DEFAULT_FIELDS), nothing) == ""
    assert written(Csv(DEFAULT_FIELDS), nothing).count("\n") == 1
    assert written(Text(), nothing) == ""


@given(st.text(st.sampled_from("=+-@',\"\r\n\t ab\x1b\u202e"), max_size=8))
def test_text_in_csv_is_quoted_and_no_formula(text: str) -> None:
    entry = TelegramField(
        "a.text", FieldType.TEXT, "", "", lambda rows: TextColumn(np.zeros(len(rows), np.int64), (text,))
    )
    out = written(
        Csv([entry, FIELDS["nv.index"]]), Batches([batch_of([data_frame(0, SENDER, READER, telegram(list_id=7))])])
    )
    heading, record = csv.reader(io.StringIO(out, newline=""))
    assert heading == ["a.text", "nv.index"]
    assert record[1] == "7"
    assert record[0].isprintable()
    assert not record[0].lstrip(" ").startswith(("=", "+", "-", "@"))


# --- text -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "width"), [(PUBLIC, 80), (PUBLIC, 120), (INTERFACES, 80)], ids=["public-80", "public-120", "interfaces-80"]
)
def test_golden_lines(path: Path, width: int, golden: Callable[[str, str], None]) -> None:
    golden(f"packets-{path.stem}.{width}.txt", written_of(Text(width=width, moment="u"), path))


@pytest.mark.parametrize("width", [80, 120])
def test_golden_tree(width: int, golden: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    try:
        golden(f"packets-telegrams.{width}.tree.txt", written_of(Text(width=width, trees=True), PUBLIC))
        golden(f"packets-interfaces.{width}.tree.txt", written_of(Text(width=width, trees=True), INTERFACES))
    finally:
        monkeypatch.undo()
        time.tzset()


SENDER, READER = "192.168.1.10", "192.168.1.20"


def line_of(
    payload: bytes,
    *,
    source: str = SENDER,
    destination: str = "255.255.255.255",
    port: int = 1202,
    width: int | None = None,
) -> str:
    frame = data_frame(1_700_000_000_123_456_789, source, destination, payload, port=port)
    return written(Text(width=width), Batches([batch_of([frame])])).rstrip("\n")


def test_a_line_tells_the_telegram() -> None:
    payload = telegram(list_id=7, subindex=2, items=11, counter=513, data=bytes(40))
    assert line_of(payload) == "1  0.000000  192.168.1.10 → broadcast  list 7 sub 2  data  11 items  60 B  #513"


@pytest.mark.parametrize(
    ("destination", "port", "told"),
    [
        ("255.255.255.255", 1202, "→ broadcast "),
        ("255.255.255.255", 1300, "→ broadcast:1300 "),
        ("192.168.1.255", 1202, "→ 192.168.1.255:1202 "),
        ("225.10.10.11", 1300, "→ 225.10.10.11:1300 "),
    ],
)
def test_where_a_telegram_goes(destination: str, port: int, told: str) -> None:
    assert told in line_of(telegram(), destination=destination, port=port)


def test_where_a_telegram_goes_in_ipv6() -> None:
    line = line_of(telegram(), source="fd00::10", destination="ff02::1", port=1300)
    assert "fd00::10 → [ff02::1]:1300  " in line


@pytest.mark.parametrize(
    ("payload", "told"),
    [
        (telegram(0, flags=1), "data  1 item   22 B  #1  ack-wanted"),
        (telegram(0, flags=3, checksum=0x3C), "  ack-wanted cks=3c"),
        (telegram(0, flags=0, checksum=0x3C), "  #1"),
        (telegram(0, flags=0x80), "  flags=0x80"),
        (telegram(0, flags=4), "  cks-invalid"),
        (telegram(5, data=b""), "  ack  1 item   20 B  #1"),
        (telegram(5, flags=4, data=b""), "  ack!  1 item   20 B  #1  negative"),
        (telegram(6, data=b""), "  boot-up  "),
        (telegram(1), "  param 1 sub 0  read  "),
        (telegram(4), "  param 1 sub 0  write-reply  "),
        (telegram(28), "  param 1 sub 0  error-stopped  "),
        (telegram(100), "  param 1 sub 0  busy  "),
        (telegram(77), "  list 1 sub 0  unknown  1 item   22 B  #1  unknown service 77"),
        (telegram(identity=b"0-S3"), "  identity 30 2d 53 33"),
        (telegram(length=13), "  Length 13, payload 22"),
        (telegram(length=0x1600), "  Length 5632, swapped 22"),
        (telegram()[:16], "  data  ?  ?  ?  short: 16 of 20 bytes"),
    ],
)
def test_services_flags_and_faults_in_words(payload: bytes, told: str) -> None:
    assert told in line_of(payload)


def test_what_the_capture_cut_is_told() -> None:
    frame = data_frame(0, SENDER, READER, telegram(data=bytes(40)))
    for kept, told in ((12, "  ?  ?  ?  cut: 12 of 60 bytes"), (30, "  60 B  #1  cut: 30 of 60 bytes")):
        cut = frame._replace(data=frame.data[: 42 + kept])
        assert told in written(Text(), Batches([batch_of([cut])]))
        tree = written(Text(trees=True), Batches([batch_of([cut])]))
        assert ("Counter                 not captured" in tree) == (kept == 12)
        assert ("Data  10 bytes, 30 more not captured" in tree) == (kept == 30)


def test_on_a_narrow_terminal_the_least_important_goes_first() -> None:
    payload = telegram(list_id=7, items=11, counter=513, flags=3, checksum=0x3C, data=bytes(40))
    wide = line_of(payload, destination=READER)
    told = {width: line_of(payload, destination=READER, width=width) for width in range(40, len(wide) + 1)}
    assert told[len(wide)] == wide
    parts = ("sub 0", ":1202", "0.000000", "11 items", "60 B", READER, "#513")
    first_seen = [min(width for width in told if part in told[width]) for part in parts]
    assert first_seen == sorted(first_seen, reverse=True)
    assert all("list 7/0  data  #513  ack-wanted cks=3c" in line for width, line in told.items() if 76 < width < 80)
    assert all("list 7" in line for line in told.values())


def test_a_rare_fault_takes_the_place_of_figures_where_there_is_no_room_for_both() -> None:
    good, bad = telegram(list_id=7, data=bytes(40)), telegram(list_id=7, data=bytes(40), length=13)
    frames = [data_frame(at, SENDER, "255.255.255.255", bad if at == 5 else good) for at in range(20)]
    lines = written(Text(width=80), Batches([batch_of(frames)])).splitlines()
    assert all("60 B" in line and "1 item" in line for at, line in enumerate(lines) if at != 5)
    assert "Length 13, payload 60" in lines[5]
    every = [data_frame(at, SENDER, "255.255.255.255", bad) for at in range(20)]
    lines = written(Text(width=80), Batches([batch_of(every)])).splitlines()
    assert all("#1" in line and "Length 13, payload 60" in line for line in lines)


def test_lines_stay_aligned_from_piece_to_piece() -> None:
    writer = LineWriter()
    frames = [data_frame(at, SENDER, "255.255.255.255", telegram(counter=count)) for at, count in ((0, 60000), (1, 1))]
    (rows,) = rows_of(frames)
    long, short = ("".join(writer.texts(rows.take(np.array([at])))) for at in (0, 1))
    assert long.index("#60000") + 6 == short.index("#1") + 2


def test_colours_mean_something() -> None:
    def painted(payload: bytes) -> str:
        frame = data_frame(0, SENDER, READER, payload)
        return written(Text(colour=True), Batches([batch_of([frame])]))

    assert "\x1b[1;31mLength 13, payload 22\x1b[0m" in painted(telegram(length=13))
    assert "\x1b[1;31m  ack!\x1b[0m" in painted(telegram(5, flags=4, data=b""))
    acknowledged = painted(telegram(5, data=b""))
    assert set(re.findall(r"\x1b\[([0-9;]+)m", acknowledged)) == {"2", "0"}
    assert "\x1b[1;31m" not in painted(telegram())


def test_a_dump_can_be_toned() -> None:
    lines = list(dump(bytes(range(40)), ((10, Tone.FAINT), (20, Tone.STRONG))))
    plain = list(dump(bytes(range(40))))
    assert paint(lines, colour=False) == paint(plain, colour=False)
    strong = "".join(cell.text for line in lines for cell in line if cell.tone is Tone.STRONG)
    assert bytes.fromhex("".join(re.findall(r"\b[0-9a-f]{2}\b", strong))) == bytes(range(10, 20))


def test_a_tree_shows_every_field_at_its_place() -> None:
    payload = telegram(5, list_id=7, subindex=2, items=3, counter=4660, flags=0x8D, checksum=0x5A, length=99)
    frame = data_frame(0, SENDER, READER, payload)
    tree = written(Text(trees=True), Batches([batch_of([frame])])).splitlines()
    for entry in HEADER:
        at = 42 + HEADER.offset_of(entry.name)
        content = payload[at - 42 : at - 42 + entry.size_bytes]
        (line,) = [line for line in tree if line.startswith(f"  {at:04x}  ") and entry.label in line]
        assert line.startswith(f"  {at:04x}  {content.hex(' ')}  ")
        value = int.from_bytes(content, "little")
        shown = f"0x{value:0{2 * entry.size_bytes}x}" if entry.base == "hex" else str(value)
        assert f"{entry.label} " in line
        assert f" {shown}" in line
    text = "\n".join(tree)
    assert "ODAcknowledgement" in text
    assert "99  ✗ the UDP payload has 22" in text
    assert ".... ...1 = acknowledgement wanted (set)" in text
    assert ".... ..0. = checksum present (not set)" in text
    assert ".... .1.. = invalid checksum: negative acknowledgement (set)" in text
    assert "1000 1... = bits 3 to 7 are undocumented" in text
    assert "Length                  20  ✓ as the UDP payload" in written(
        Text(trees=True), Batches([batch_of([data_frame(0, SENDER, READER, telegram(data=b""))])])
    )
