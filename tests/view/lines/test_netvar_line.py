"""The line of a telegram: its words, its faults, and what goes first where there is little room."""

from __future__ import annotations

import re

import numpy as np
import pytest

from nvscope.report.packets.text import Text
from nvscope.view.lines.netvar_line import LineWriter
from tests.oracle.builders import data_frame, telegram
from tests.packets import Batches, Shown, batch_of
from tests.report.packets.written import READER, SENDER, written


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
        (telegram(1), "  param 0x0001 sub 0  read  "),
        (telegram(4), "  param 0x0001 sub 0  write-reply  "),
        (telegram(28), "  param 0x0001 sub 0  error-stopped  "),
        (telegram(100), "  param 0x0001 sub 0  busy  "),
        (telegram(77), "  list 1 sub 0  unknown  1 item   22 B  #1  unknown service 77"),
        (telegram(identity=b"0-S3"), "  identity 30 2d 53 33"),
        (telegram(length=13), "  Length 13, payload 22"),
        (telegram(length=0x1600), "  Length 5632, swapped 22"),
        (telegram()[:16], "  data  ?  ?  ?  short: 16 of 20 bytes"),
    ],
)
def test_services_flags_and_faults_in_words(payload: bytes, told: str) -> None:
    assert told in line_of(payload)


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


def test_names_of_nodes_lose_what_all_of_them_begin_with_in_every_piece_alike() -> None:
    names = {"10.0.0.1": "Plant_Hall3_Press_Controller_Left", "10.0.0.2": "Plant_Hall3_Press_Controller_Right"}
    frames = [data_frame(0, source, "255.255.255.255", telegram()) for source in names]
    for width, shown in ((48, ["…Left", "…Right"]), (60, ["…Left", "…Right"]), (80, [*names.values()])):
        for part in (slice(0, 2), slice(0, 1), slice(1, 2)):
            lines = written(Text(width=width, names=names), Batches([batch_of(frames[part])])).splitlines()
            assert [line.split()[2] for line in lines] == shown[part]
            assert all(len(line) <= width for line in lines)


def test_lines_stay_aligned_from_piece_to_piece() -> None:
    writer = LineWriter()
    frames = [data_frame(at, SENDER, "255.255.255.255", telegram(counter=count)) for at, count in ((0, 60000), (1, 1))]
    (rows,) = Shown(Batches([batch_of(frames)]))
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
