"""Findings that say the same of many places: one entry, and nothing of any of them is lost."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from nvscope.report import folding, markdown, text

from .examples import ALIKE, S, at, finding, report, udp_list

CODES = {"NV201": "telegram-gap", "NV502": "jitter", "NV504": "stopped", "NV601": "cob-id-overlap", "NV901": "drops"}
SILENT, NEXT = "Silent for the last 8.0 s.", "See whether all lists of this node stopped together."


def stopped(index: int, message: str = SILENT, **parts: Any) -> dict[str, Any]:
    return finding("NV504", "stopped", "error", message, NEXT, list=f"udp/1202/{index}", node="10.0.0.1", **parts)


def lost(index: int, telegrams: str, events: int = 1) -> dict[str, Any]:
    message = f"{telegrams} of 90 000 telegrams lost."
    extent = int(telegrams.replace(" ", ""))
    return finding(
        "NV201", "telegram-gap", "error", message, "", list=f"udp/1202/{index}", count=events, extent=extent
    )  # fmt: skip


def shown(findings: list[dict[str, Any]], *, width: int = 100, details: bool = False) -> str:
    lists = [udp_list(1202, index) for index in range(1, 60)]
    document = report({"frames": 1, "telegrams": 1}, lists, findings)
    return text.render(document, width=width, utc=True, everything=True, details=details)


def one(findings: list[dict[str, Any]]) -> folding.Entry:
    (entry,) = folding.entries(findings)
    return entry


def test_equal_findings_of_many_lists_are_one_entry_with_a_range() -> None:
    entry = one([stopped(index) for index in [*range(1, 5), *range(6, 41), 57, 58]])
    assert entry.about({}, {}) == (["udp/1202/1 to 4, 6 to 40, 57, 58 (41 lists)", "10.0.0.1"], [])
    assert entry.title() == ", 41 findings"
    assert entry.message({}, {}) == f"Each: {SILENT}"


def test_two_that_are_equal_are_enough_and_few_lists_are_named() -> None:
    entry = one([stopped(1, subindex=0), stopped(2, subindex=0, count=3)])
    assert entry.about({"udp/1202/1": "axis"}, {"10.0.0.1": "press"}) == (
        ["udp/1202/1 axis", "udp/1202/2", "10.0.0.1 press"], ["SubIndex 0"],
    )  # fmt: skip
    assert entry.title() == ", 2 findings, 4 times"


def test_of_different_figures_four_are_folded_and_three_are_not() -> None:
    findings = [stopped(index, f"Silent for the last {index} s.") for index in range(1, 5)]
    assert len(folding.entries(findings[:3])) == 3
    assert one(findings).message({}, {}) == "For example: udp/1202/1, 10.0.0.1: Silent for the last 1 s."


def test_the_worst_is_told_by_what_was_lost_and_not_by_the_number_of_gaps() -> None:
    findings = [lost(1, "12", 9), lost(2, "1 204"), lost(3, "1204"), lost(4, "999", 40)]
    assert one(findings).message({}, {}) == "Worst: udp/1202/2: 1 204 of 90 000 telegrams lost."
    others = [stopped(index, f"{index} times.", count=index % 4 + 1) for index in range(1, 6)]
    assert one(others).message({}, {}) == "Worst: udp/1202/3, 10.0.0.1: 3 times."


def test_the_worst_burst_is_the_shortest_and_else_what_goes_furthest_is() -> None:
    def found(code: str) -> list[dict[str, Any]]:
        extents = enumerate([5, 2, 9, 3], 1)
        return [
            {**stopped(index, f"{extent} ns.", extent=extent, count=index), "code": code} for index, extent in extents
        ]

    for code in ("NV501", "NV502", "NV504", "NV207"):
        assert one(found(code)).message({}, {}) == "Worst: udp/1202/3, 10.0.0.1: 9 ns."
    assert one(found("NV503")).message({}, {}) == "Worst: udp/1202/2, 10.0.0.1: 2 ns."


def test_times_and_frames_are_those_of_all() -> None:
    findings = [
        stopped(index, first_ns=at(index * S), last_ns=at((index + 5) * S), frames=[20 - index, 30 + index], count=4)
        for index in range(1, 9)
    ]
    row = one(findings).row
    assert (row["first_ns"], row["last_ns"], row["count"]) == (at(S), at(13 * S), 32)
    assert row["frames"] == [*range(12, 20), 31, 32]


def test_other_steps_severities_and_kinds_are_other_entries() -> None:
    findings = [
        *(stopped(index) for index in (1, 2)),
        *({**stopped(index), "hint": "Other."} for index in (3, 4)),
        *({**stopped(index), "severity": "warning"} for index in (5, 6)),
        *({**stopped(index), "code": "NV501"} for index in (7, 8)),
    ]
    assert [len(entry.places) for entry in folding.entries(findings)] == [2, 2, 2, 2]


def test_what_says_something_else_of_each_list_or_is_of_none_stays_alone() -> None:
    overlaps = [
        finding("NV601", "cob-id-overlap", "error", f"Overlaps {index}.", "", list=f"can/can0/{index}", channel="can0")
        for index in range(256, 264)
    ]
    drops = [finding("NV901", "drops", "warning", "Dropped.", "") for _ in range(5)]
    assert len(folding.entries(overlaps + drops)) == 13


def test_lists_on_can_are_told_by_their_cob_ids() -> None:
    findings = [
        finding("NV504", "stopped", "error", SILENT, "", list=f"can/can0/{number}", subindex=0, channel="can0")
        for number in ("272", "273", "274", "288", "419365377x")
    ]
    named, parts = one(findings).about({}, {})
    assert named == ["can/can0/0x110 to 0x112, 0x120, can/can0/0x18FF0201 (5 lists)"]
    assert parts == []  # the lists have told them
    findings[1] |= {"subindex": 1, "list": "can/can0/272"}
    assert one(findings).about({}, {})[1] == ["COB-ID 0x110", "COB-ID 0x111", "COB-ID 0x112", "COB-ID 0x120"]


def test_few_identifiers_are_told_once() -> None:
    findings = [
        finding(
            "NV504", "stopped", "error", f"{number}.", "", list=f"can/can0/{number}", subindex=0, channel="can0",
            extent=number,
        )
        for number in range(272, 276)
    ]  # fmt: skip
    told = shown(findings)
    assert [told.count(f"0x11{place}") for place in range(4)] == [1, 1, 1, 2]
    assert "Worst: can/can0/0x113: 275." in told
    assert "COB-ID" not in told


def test_more_ranges_and_nodes_than_anybody_reads_are_cut_and_counted() -> None:
    findings = [{**stopped(index), "node": f"10.0.0.{index}"} for index in range(1, 59, 3)]
    named, _ = one(findings).about({}, {})
    assert named == [
        "udp/1202/1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, 34, … (20 lists)",
        "10.0.0.1", "10.0.0.4", "10.0.0.7 and 17 more nodes",
    ]  # fmt: skip


def test_details_show_each_and_what_is_folded_is_told() -> None:
    findings = [stopped(index) for index in range(1, 41)]
    assert "40 findings are folded into 1 entry: -v shows each." in shown(findings)
    details = shown(findings, details=True)
    assert details.count("NV504 stopped") == 40
    assert "are folded into 1 entry" not in details
    document = report({"frames": 1, "telegrams": 1}, [udp_list(1202, 1)], findings)
    assert markdown.render(document, everything=True).count("NV504 stopped") == 1
    assert markdown.render(document, details=True).count("NV504 stopped") == 40


def test_a_report_with_equal_findings_is_short_at_any_width() -> None:
    for width in (40, 80, 100, 200):
        told = text.render(ALIKE, width=width, utc=True, everything=True)
        assert told.count("NV201 telegram-gap") == told.count("NV504 stopped") == 1


@given(
    st.lists(
        st.builds(
            lambda code, index, node, part, figure: finding(
                code, CODES[code], "error", f"{figure} of 9 lost.", "", list=f"udp/1202/{index}", node=node,
                subindex=part, count=figure, extent=None if code == "NV504" else figure,
            ),
            st.sampled_from(["NV201", "NV502", "NV504"]), st.integers(1, 9), st.sampled_from([None, "10.0.0.1", "b"]),
            st.none() | st.integers(0, 2), st.integers(1, 5),
        ),
        max_size=30,
    )
)  # fmt: skip
def test_no_finding_is_lost_and_the_worst_of_each_entry_is_shown(findings: list[dict[str, Any]]) -> None:
    entries = folding.entries(findings)
    assert sum(len(entry.places) for entry in entries) == len(findings)
    assert sum(entry.row["count"] for entry in entries) == sum(row["count"] for row in findings)
    assert [entry.order for entry in entries] == sorted(entry.order for entry in entries)
    for entry in entries:
        same = [row for row in findings if row["code"] == entry.row["code"]]
        assert {place[:2] for place in entry.places} <= {(row["list"], row["node"]) for row in same}
        if entry.differ:
            assert len(same) >= 4
            assert entry.shown["count"] == max(row["count"] for row in same)
    assert [entry.row for entry in folding.entries(findings, each=True)] == findings
