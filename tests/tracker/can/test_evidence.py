"""CANopen only with evidence, what many identifiers have alike as one finding, and COB-IDs as people read them."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.definition.buses import Buses, BusSettings
from nvscope.definition.model import Definition
from nvscope.findings.judge import judge
from nvscope.report import markdown, text
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.units import list_key
from nvscope.view.documents.report import report_document
from tests.packets import observed
from tests.tracker.can.test_state import START_NS, Frame, batch, report

MS = 1_000_000
HEARTBEAT, ALL_START, START_5 = (0x705, b"\5"), (0, b"\1\0"), (0, b"\1\5")
ASKED, ANSWERED = (0x605, b"\x40\0\x10\0" + bytes(4)), (0x585, b"\x43\0\x10\0" + bytes(4))
OF_NODES = [(0x185, bytes(8)), (0x186, bytes(8)), (0x85, b"\x20\x31\5" + bytes(5)), (0x80, b"")]


def frames_of(*words: tuple[int, bytes]) -> list[Frame]:
    return [(START_NS + number * MS, 0, word, data) for number, (word, data) in enumerate(words * 3)]


def names(found: dict[str, Any]) -> dict[int, str]:
    return {entry["id"]: entry["canopen"] for entry in found["lists"] if entry["canopen"]}


@pytest.mark.parametrize(
    ("evidence", "named", "nodes"),
    [
        ((), set(), []),
        ((ASKED,), set(), []),
        ((ANSWERED,), set(), []),
        (((0x705, b"\1"),), set(), []),  # no state
        (((0x705, b"\5\5"),), set(), []),
        (((0, b"\7\0"),), set(), []),  # no command
        ((HEARTBEAT,), {0x705, 0x185, 0x85, 0x80}, [5]),
        (((0x705, b"\0"),), {0x705, 0x185, 0x85, 0x80}, [5]),
        ((START_5,), {0, 0x185, 0x85, 0x80}, [5]),
        ((ASKED, ANSWERED), {0x605, 0x585, 0x185, 0x85, 0x80}, [5]),
        ((ALL_START,), {0, 0x185, 0x186, 0x85, 0x80}, [5]),
        (((0x706, b"\5"),), {0x706, 0x186, 0x80}, [6]),
    ],
)
def test_names_and_nodes_are_those_of_which_there_is_evidence(
    evidence: tuple[tuple[int, bytes], ...], named: set[int], nodes: list[int]
) -> None:
    for cut in (1000, 1):
        found = report(frames_of(*OF_NODES, *evidence), cut)
        assert set(names(found)) == named
        assert [node["node"] for node in found["buses"][0]["canopen_nodes"]] == nodes
        told = {entry["cob_id"] for entry in found["buses"][0]["identifiers"] if entry["canopen"]}
        assert told == named
        assert not [one for one in found["findings"] if one["code"] == "NV602"]


def test_what_canopen_would_have_is_shown_on_demand_as_its_plan() -> None:
    found = report(frames_of(*OF_NODES), 1000)
    assert "TPDO1" not in text.render(found, width=160, utc=True, everything=True)
    details = text.render(found, width=160, utc=True, details=True)
    assert "CANopen's plan" in details
    assert "TPDO1 node 5" in details
    known = text.render(report(frames_of(*OF_NODES, HEARTBEAT), 1000), width=160, utc=True, everything=True)
    assert "TPDO1 node 5" in known


def jittery(identifiers: range, channel: int = 0, late_ms: int = 9) -> list[Frame]:
    """Return frames that are sent every 10 ms, one in forty late."""
    frames = [
        (START_NS + MS * (10 * number + (late_ms if number % 40 == 39 else 0)) + word, channel, word, bytes(8))
        for number in range(200)
        for word in identifiers
    ]
    return sorted(frames)


def test_what_many_identifiers_have_alike_is_one_finding() -> None:
    found = report(jittery(range(0x300, 0x320)), 10_000)
    (one,) = [finding for finding in found["findings"] if finding["code"] == "NV502"]
    assert (one["list"], one["subindex"], one["channel"], one["count"]) == (None, None, "can0", 32)
    assert one["lists"] == [entry["key"] for entry in found["lists"]]
    assert [(part["list"], part["count"], part["extent"]) for part in one["parts"]] == [
        (key, 1, one["extent"]) for key in one["lists"]
    ]
    assert one["message"].startswith(
        "32 identifiers of can0 show this: 0x300, 0x301, 0x302, 0x303 and 28 more. 0x300: "
    )
    shown = text.render(found, width=100, utc=True, everything=True)
    assert "channel can0" in shown
    assert "Findings: 1 warning" in shown
    assert "-v shows each." in shown
    details = text.render(found, width=100, utc=True, details=True)
    assert [f"COB-ID 0x{0x300 + place:03X}: Jitter" in details for place in range(32)] == [True] * 32
    assert [f"COB-ID 0x{0x300 + place:03X}: Jitter" in markdown.render(found, details=True) for place in (0, 31)] == [
        True
    ] * 2


def test_what_is_said_of_many_identifiers_is_that_of_the_worst() -> None:
    frames = sorted(
        jittery(range(0x300, 0x310), late_ms=7) + jittery(range(0x310, 0x311)) + jittery(range(0x311, 0x320))
    )
    (one,) = [finding for finding in report(frames, 10_000)["findings"] if finding["code"] == "NV502"]
    assert " and 28 more. 0x310: Jitter 90 %" in one["message"]


def test_frames_that_are_missing_are_called_neither_late_nor_irregular() -> None:
    missing = {40, 41, 42, 80, 120}
    frames = [(START_NS + 10 * MS * number, 0, 0x300, bytes(8)) for number in range(200) if number not in missing]
    found = {finding["code"]: finding for finding in report(frames, 10_000)["findings"]}
    assert set(found) == {"NV501", "NV502"}
    assert "without a loss" not in found["NV501"]["message"]
    assert "No Counter tells whether" in found["NV501"]["message"]
    assert "as where telegrams are missing; without these, jitter is 0" in found["NV502"]["message"]
    assert "NV604" in found["NV502"]["hint"]


def test_few_identifiers_and_other_channels_have_their_own_findings() -> None:
    frames = sorted(jittery(range(0x300, 0x304)) + jittery(range(0x300, 0x306), channel=1))
    told = [one for one in report(frames, 10_000)["findings"] if one["code"] == "NV502"]
    assert sorted((one["list"] or "", one["channel"]) for one in told) == [
        ("", "vcan1"), *((f"can/can0/{word}", "can0") for word in range(0x300, 0x304)),
    ]  # fmt: skip


def test_a_length_that_changes_is_told_with_both() -> None:
    frames = frames_of((0x300, bytes(8)), (0x300, bytes(6)))
    (one,) = [finding for finding in report(frames, 1000)["findings"] if finding["code"] == "NV603"]
    assert one["message"] == "The length of the frames changed 5 times: they have 6 or 8 bytes, the last one 6."


def test_lengths_are_those_of_the_whole_capture_however_many_identifiers_come_between(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Kinds of frames are forgotten when there are too many of them; what was seen of an identifier is not."""
    frames = frames_of((0x300, bytes(8)), (0x301, bytes(2)), (0x300, bytes(6)), (0x301, bytes(2)))[:3]
    frames += [(frames[-1][0] + place * MS, 0, 0x8000_0000 | place, b"") for place in range(1, 40)]
    whole = report(frames, 1)["findings"]
    monkeypatch.setattr("dissectors.sorter.MOST_VARIETIES", 5)
    assert report(frames, 1)["findings"] == whole
    (one,) = [finding for finding in whole if finding["code"] == "NV603"]
    assert one["message"] == "The length of the frames changed 1 time: they have 6 or 8 bytes, the last one 6."


def loaded(bit_rate: int) -> dict[str, Any]:
    frames = [(START_NS + number * MS, 0, 0x300, bytes(8)) for number in range(3000)]
    state = TrackerState()
    observed(state, [batch(frames)])
    summary = summarize(state, buses=Buses((("can0", BusSettings(bit_rate)),)))
    document = report_document(summary, judge(state, summary=summary), [], Definition())
    (one,) = [finding for finding in document["findings"] if finding["code"] == "NV605"]
    return dict(one)


def test_more_load_than_time_is_a_wrong_bit_rate() -> None:
    wrong = loaded(50_000)
    assert "the bit rate that is given, 50 kbit/s, is wrong" in wrong["message"]
    assert "in the mean" not in wrong["message"]
    assert (wrong["channel"], wrong["list"], wrong["count"]) == ("can0", None, 3)
    assert "in the mean" in loaded(150_000)["message"]


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("can/can0/272", "can/can0/0x110"),
        ("can/can0/0", "can/can0/0x000"),
        ("can/*/2047", "can/*/0x7FF"),
        ("can/can0/419369524x", "can/can0/0x18FF1234"),
        ("can/a/b/16", "can/a/b/0x010"),
        ("udp/1202/7", "udp/1202/7"),
        ("can/can0/axis", "can/can0/axis"),
        ("can/can0/²", "can/can0/²"),
    ],
)
def test_people_read_cob_ids_in_hexadecimal(key: str, shown: str) -> None:
    assert list_key(key) == shown


def test_a_finding_on_can_names_a_cob_id_and_no_subindex() -> None:
    extended = 0x8000_0000 | 0x18FF1234
    frames = frames_of((0x300, bytes(8)), (0x300, bytes(6)), (extended, bytes(8)), (extended, bytes(6)))
    found = report(frames, 1000)
    shown = text.render(found, width=100, utc=True, details=True)
    assert "can/can0/0x300, COB-ID 0x300\n" in shown
    assert "can/can0/0x18FF1234\n" in shown
    assert "SubIndex" not in shown
    assert [(entry["key"], entry["id"], entry["cob_id"]) for entry in found["lists"]] == [
        ("can/can0/768", 768, "0x300"), ("can/can0/419369524x", 0x18FF1234, "0x18FF1234"),
    ]  # fmt: skip
