"""CAN buses in the report for people: readable at any width, and as Markdown, with nothing raw from the wire."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.report import markdown, text
from tests.report.examples import START_NS, S, at, report


def identifier(cob_id: int, share: float, frames: int, **more: Any) -> dict[str, Any]:
    return {
        "cob_id": cob_id, "extended": False, "name": None, "canopen": None, "frames": frames, "bits": 115 * frames,
        "fast_bits": 0, "share": share, **more,
    }  # fmt: skip


def bus(**parts: Any) -> dict[str, Any]:
    return {
        "channel": "can0", "frames": 12_345, "seconds": 60, "bits": 3_465_000, "fast_bits": 0, "peak_bits": 102_500,
        "worst_bits": 120_500, "bit_rate": {"nominal": 250_000, "data": None, "source": "found"},
        "load": {
            "mean": 23.1, "peak": 41.0, "peak_ns": str(START_NS // S * S + 5 * S), "worst": 48.2, "partial": False,
        },
        "identifiers": [], "errors": None, "canopen_nodes": [], **parts,
    }  # fmt: skip


ERRORS = {
    "frames": 7, "first_ns": at(0), "last_ns": at(S), "classes": [
        {"name": "controller", "label": "controller problem", "frames": 3},
        {"name": "bus-off", "label": "bus off", "frames": 4},
    ],
    "states": [{"name": "tx-passive", "label": "error passive by transmit errors", "frames": 3}],
    "bus_off": {
        "count": 3, "restarted": 1, "returned": 1, "total_ns": 5 * S // 2, "longest_ns": 2 * S, "since_ns": at(50 * S),
    },
    "tx_errors": 128, "rx_errors": 96,
}  # fmt: skip
NODE = {
    "node": 5, "state": "operational", "since_ns": at(S), "told_by": "heartbeat", "last_ns": at(9 * S),
    "heartbeats": 60, "changes": 2, "boot_ups": 1, "emergencies": 1,
    "last_emergency": {
        "code": 0x8130, "text": "life guard or heartbeat error", "register": ["generic"], "time_ns": at(S),
    },
}  # fmt: skip
SILENT = {
    **NODE, "node": 17, "state": "stopped", "told_by": "command", "heartbeats": 0, "emergencies": 0,
    "last_emergency": None, "boot_ups": 0, "changes": 0,
}  # fmt: skip
IDENTIFIERS = [
    identifier(0x190, 60.0, 7000, name="press"),
    identifier(0x705, 30.0, 3000, canopen="heartbeat node 5"),
    *(identifier(0x300 + number, 1.0, 100) for number in range(10)),
]
WHOLE = bus(identifiers=IDENTIFIERS, errors=ERRORS, canopen_nodes=[NODE, SILENT])


def document(*buses: dict[str, Any]) -> dict[str, Any]:
    capture = {"frames": 12_345, "other_frames": 12_345, "can_frames": 12_345, "start_ns": at(0), "end_ns": at(60 * S)}
    return report(capture, [], []) | {"buses": list(buses)}


def section(shown: str) -> str:
    return shown[shown.index("Bus ") :]


def test_a_bus_at_a_terminal() -> None:
    assert (
        section(text.render(document(WHOLE), width=80, utc=True, everything=True))
        == """\
Bus can0: 250 kbit/s (found) · 12 345 frames · load: 23.1 % in the mean, at its
  peak 41.0 % at 12:03:12 (48.2 % with all possible stuff bits)
  7 error frames: controller problem (3), bus off (4)
  off the bus 3 times, for 2.5 s in all, 2.0 s at the longest, and since
    12:03:57.123 to the end
  controller: error passive by transmit errors (3)
  error counters up to 128 (transmit) and 96 (receive)

  identifier  name              frames     bits   share    load
  0x190       press              7 000  805 000  60.0 %  13.9 %
  0x705       heartbeat node 5   3 000  345 000  30.0 %   6.9 %
  0x300       -                    100   11 500   1.0 %   0.2 %
  0x301       -                    100   11 500   1.0 %   0.2 %
  0x302       -                    100   11 500   1.0 %   0.2 %
  0x303       -                    100   11 500   1.0 %   0.2 %
  0x304       -                    100   11 500   1.0 %   0.2 %
  0x305       -                    100   11 500   1.0 %   0.2 %
  4 more      -                    400   46 000   4.0 %   0.9 %

  CANopen  state                last heard    EMCY  last EMCY
  node 5   operational          12:03:16.123     1  0x8130 life gu…artbeat error
  node 17  stopped (commanded)  12:03:16.123     0  -
  Hidden: since, heartbeats, changes, boot-ups, register, at (--wide shows them)
"""
    )


def test_a_bus_whose_bit_rate_nobody_knows() -> None:
    shown = section(text.render(document(bus(bit_rate=None, load=None)), width=100, utc=True))
    assert shown == "Bus can0: bit rate unknown: --bitrate gives it, and the load · 12 345 frames · 3 465 000 bits\n"


def test_can_fd_without_the_bit_rate_of_its_data_phase_has_at_least_a_load() -> None:
    partial = bus(load={"mean": 1.0, "peak": 2.0, "peak_ns": at(0), "worst": 3.0, "partial": True})
    assert "load: at least 1.0 %" in text.render(document(partial), width=100)
    rate = {"nominal": 500_000, "data": 2_000_000, "source": "given"}
    assert "Bus can0: 500 kbit/s and 2 Mbit/s (given)" in text.render(document(bus(bit_rate=rate)), width=100)


@pytest.mark.parametrize("width", [40, 60, 80, 140])
@pytest.mark.parametrize("details", [False, True])
def test_no_line_is_wider_than_the_terminal(width: int, details: bool) -> None:
    shown = text.render(document(WHOLE, bus(channel="c" * 60)), width=width, details=details)
    assert max(map(len, shown.splitlines())) <= width
    assert ("0x309" in shown) == details


def test_of_many_buses_the_first_are_shown() -> None:
    many = document(*(bus(channel=f"can{number}") for number in range(20)))
    shown = text.render(many, width=100)
    assert (shown.count("Bus can"), shown.splitlines()[-1]) == (
        16, "4 buses more: -v shows all, --json and --md too.",
    )  # fmt: skip
    assert text.render(many, width=100, details=True).count("Bus can") == markdown.render(many).count("### Bus") == 20


def test_identifiers_and_nodes_are_shown_where_all_is_asked_for() -> None:
    for shown in (text.render(document(WHOLE), width=80), markdown.render(document(WHOLE))):
        assert "7 error frames: controller problem (3), bus off (4)" in shown
        assert "0x190" not in shown


def test_a_bus_in_markdown() -> None:
    shown = markdown.render(document(WHOLE), utc=True, everything=True)
    assert "\n### Bus `can0`\n\n- 250 kbit/s (found) · 12 345 frames · load: 23.1 % in the mean" in shown
    assert (
        "\n| identifier | name | frames | bits | share | load |\n| --- | --- | ---: | ---: | ---: | ---: |\n" in shown
    )
    assert "\n| 0x705 | `heartbeat node 5` | 3 000 | 345 000 | 30.0 % | 6.9 % |\n" in shown
    assert "\n| node 17 | stopped (commanded) | 12:03:08.123 |" in shown
    assert "\u00a0" not in shown


def test_names_from_the_wire_are_shown_visibly() -> None:
    hostile = bus(channel="can\x1b[31m|`<b>\u202e", identifiers=[identifier(1, 100.0, 1, name="a\x07|`b")])
    shown = text.render(document(hostile), width=100, everything=True)
    assert "\x1b" not in shown
    assert "\x07" not in shown
    assert "\u202e" not in shown
    in_markdown = markdown.render(document(hostile), everything=True)
    assert not {"\x1b", "\x07", "\u202e"} & set(in_markdown)
    assert "<b>" not in in_markdown.replace("`", "").partition("### Bus")[0]
