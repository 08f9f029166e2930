"""What is told of plants in which one thing happens close to another, or from the beginning to the end."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_project
from tests.causes.drawn.bus import ERROR, OFF, Bus, Device, PdoList
from tests.causes.drawn.by_hand import told_of_bus
from tests.causes.drawn.plant import START_NS
from tests.causes.drawn.truth import MILLISECOND, SECOND
from tests.causes.plants import causes_in
from tests.causes.told import causes_of
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap

PRESS, SAW, ALL = "10.0.0.1", "10.0.0.2", "255.255.255.255"
RESTARTED = 0x100


def sent(
    source: str, number: int, counters: list[int], every_ms: int = 100, *, since_ms: int = 0, subindexes: int = 1,
    payload: bytes = b"\1\2\3\4",
) -> list[Frame]:  # fmt: skip
    """Return telegrams of a list, a cycle for each counter; one that is below 0 is left out."""
    return [
        data_frame(
            (since_ms + at * every_ms) * MILLISECOND + subindex * 100_000, source, ALL,
            telegram(list_id=number, counter=counter, subindex=subindex, data=payload),
        )
        for at, counter in enumerate(counters) if counter >= 0 for subindex in range(subindexes)
    ]  # fmt: skip


def titles(causes: list[Cause]) -> list[tuple[str, str]]:
    return [(cause.kind.name, cause.title) for cause in causes]


GOES_ON = sent(SAW, 7, list(range(500, 900)))


def test_a_node_that_starts_anew_twice_within_ten_seconds_did_so_twice(tmp_path: Path) -> None:
    crashing = [*range(100, 200), *range(1, 51), *range(1, 251)]
    causes = causes_in([*sent(PRESS, 1, crashing), *sent(PRESS, 2, crashing, since_ms=20), *GOES_ON], tmp_path)
    assert sorted(titles(causes)) == [
        ("node-restart", "Node 10.0.0.1 started anew at 10.0 s"),
        ("node-restart", "Node 10.0.0.1 started anew at 15.0 s"),
    ]  # fmt: skip


def test_it_is_not_said_that_a_node_sent_nothing_while_one_of_its_lists_went_on(tmp_path: Path) -> None:
    anew = [*range(100, 200), *[-1] * 40, *range(1, 261)]
    lists = [*sent(PRESS, 1, anew), *sent(PRESS, 2, anew, since_ms=20), *sent(PRESS, 3, list(range(400)), since_ms=40)]
    (cause,) = (one for one in causes_in([*lists, *GOES_ON], tmp_path) if one.kind.name == "node-restart")
    assert not [fact for fact in cause.checked if "nothing" in fact or "pause" in fact]


@pytest.mark.parametrize("subindexes", [1, 3])
def test_foreign_headers_go_on_to_the_end(subindexes: int, tmp_path: Path) -> None:
    foreign = [
        frame._replace(data=frame.data[:42] + frame.data[42:].replace(b"\x18\0", b"\x16\0", 1))
        for frame in sent(PRESS, 9, list(range(40)), 1000, subindexes=subindexes)
    ]
    (cause,) = (one for one in causes_in([*foreign, *GOES_ON], tmp_path) if one.kind.name == "header-foreign")
    assert cause.until_ns is None


def test_a_clock_that_goes_back_behind_the_beginning_silences_nobody(tmp_path: Path) -> None:
    frames = sorted([*sent(PRESS, 1, list(range(200))), *sent(SAW, 7, list(range(200)))], key=lambda one: one.ts_ns)
    step = next(place for place, one in enumerate(frames) if one.ts_ns >= 10 * SECOND)
    late = [one._replace(ts_ns=one.ts_ns + 30 * SECOND) for one in frames[:step]] + frames[step:]
    path = tmp_path / "frames.pcap"
    write_pcap(late, path)
    assert [one.kind.name for one in causes_of(Inquiry([str(path)], Project()))[1]] == ["clock"]


def test_copies_are_counted_beside_a_node_that_starts_anew_meanwhile(tmp_path: Path) -> None:
    anew = [*range(100, 150), *[-1] * 60, *range(1, 291)]
    frames = [*sent(PRESS, 1, anew), *sent(PRESS, 2, anew, since_ms=20), *GOES_ON]
    copies = [
        one._replace(ts_ns=one.ts_ns + 50_000) for one in frames if 6 * SECOND <= one.ts_ns < 12 * SECOND
    ]  # fmt: skip
    kinds = sorted(one.kind.name for one in causes_in([*frames, *copies], tmp_path))
    assert kinds == ["mirrored-twice", "node-restart"]


def test_copies_are_counted_beside_a_sender_that_does_not_count(tmp_path: Path) -> None:
    swapped = [(number & 0xFF) << 8 | number >> 8 for number in range(200, 600)]
    frames = [*sent(PRESS, 1, swapped), *GOES_ON]
    copies = [one._replace(ts_ns=one.ts_ns + 50_000) for one in frames if 6 * SECOND <= one.ts_ns < 12 * SECOND]
    kinds = sorted(one.kind.name for one in causes_in([*frames, *copies], tmp_path))
    assert kinds == ["counter-foreign", "mirrored-twice"]


@pytest.mark.parametrize("first", [PRESS, "10.0.0.95"])
def test_of_two_senders_from_the_beginning_on_the_one_by_the_definition_is_right(first: str, tmp_path: Path) -> None:
    (tmp_path / "axis.gvl").write_text(
        "<GVL><Declarations><![CDATA[VAR_GLOBAL\na : UDINT;\nEND_VAR]]></Declarations><NetvarSettings Protocol='UDP'>"
        "<ListIdentifier>1</ListIdentifier><Pack>True</Pack><CyclicTransmission>True</CyclicTransmission>"
        "<Interval>T#100ms</Interval></NetvarSettings></GVL>"
    )
    project = read_project(None, definitions=[str(tmp_path / "axis.gvl")])
    own = sent(PRESS, 1, list(range(400)), since_ms=0 if first == PRESS else 40)
    other = sent("10.0.0.95", 1, list(range(400)), since_ms=40 if first == PRESS else 0, payload=bytes(8))
    causes = causes_in([*own, *other, *GOES_ON], tmp_path, project)
    assert titles(causes) == [("second-sender", "A further node sends list axis since 0.0 s: 10.0.0.95")]


def test_what_a_list_of_several_telegrams_loses_is_known_to_the_end(tmp_path: Path) -> None:
    chance = random.Random(5)
    every = sent(PRESS, 1, list(range(3000)), 20, subindexes=4)
    lossy = [frame for frame in every if frame.ts_ns < 6 * SECOND or chance.random() > 0.12]
    slow = sent(PRESS, 2, list(range(30)), 2000, since_ms=5)
    causes = causes_in([*lossy, *slow, *sent(SAW, 7, list(range(600)))], tmp_path)
    (cause,) = causes
    assert (cause.kind.name, cause.until_ns) == ("loss-of-list", None)
    assert f"lost {(len(every) - len(lossy)) // 1000} {(len(every) - len(lossy)) % 1000:03} telegrams" in cause.title


def test_a_controller_that_says_it_is_back_was_off_till_then(tmp_path: Path) -> None:
    bus = Bus(random.Random(1), "can0", 250_000, 40)
    for cob_id, interval_ms in ((0x140, 100), (0x150, 500)):
        interval_ns = interval_ms * MILLISECOND
        bus.devices.append(Device([PdoList(cob_id, interval_ns, [8], 0.01, START_NS)], None, SECOND))
    bus.rows.append((START_NS + 20 * SECOND, ERROR | OFF, bytes(8)))
    bus.rows.append((START_NS + 23 * SECOND, ERROR | RESTARTED, bytes(8)))
    ((kind, since_s, until_s),) = told_of_bus(bus, tmp_path)
    assert (kind, since_s, until_s) == ("bus-off", 20, 23)


def test_two_senders_of_malformed_telegrams_alone_are_told_as_two(tmp_path: Path) -> None:
    """There is no stream of such a list, and nobody sends it at any time."""
    frames = [
        data_frame(at * 50 * MILLISECOND, (PRESS, SAW)[at % 2], ALL, telegram(list_id=3, counter=at, length=3))
        for at in range(40)
    ]
    assert titles(causes_in([*frames, *GOES_ON], tmp_path)) != []
