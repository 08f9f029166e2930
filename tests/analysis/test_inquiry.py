"""Filters over whole captures: what they leave of a report are rows of it, none of them changed."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_source
from nvscope.capture.source import Source
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_project
from nvscope.errors import UsageError
from nvscope.view.asked_time import parse_range
from tests.packets import Shown

CAPTURES = Path(__file__).parents[2] / "captures"
PLANT, PEERS = str(CAPTURES / "plant.pcapng.gz"), str(CAPTURES / "peers" / "peers.pcap")
AXIS = [str(CAPTURES / "peers" / name) for name in ("axis.gvl", "axis_types.st")]
CAN = CAPTURES / "can"
PRESS, BENCH, HMI = "192.168.1.10", "192.168.1.99", "192.168.1.20"
PROJECT = f"""
[nodes]
"{PRESS}" = {{ name = "press" }}
[lists.7]
name = "axis"
"""


def report(path: str, expression: str | None = None, project: Project | None = None) -> dict[str, Any]:
    inquiry = Inquiry([path], project or Project())
    return inquiry.report(inquiry.analyze(expression))


def frames(path: str, expression: str, project: Project | None = None) -> list[int]:
    chosen = Inquiry([path], project or Project()).filter(expression)
    return [number for rows in Shown(open_source([path]), chosen=chosen) for number in rows.frame_number.tolist()]


def place(finding: dict[str, Any]) -> tuple[Any, ...]:
    return finding["code"], finding["list"], finding["node"], finding["subindex"]


EXPRESSIONS = [
    "nv.index == 7",
    f"ip.src == {BENCH}",
    f"ip.src == {HMI}",
    f"ip.addr == {PRESS} && nv.subindex == 1",
    "nv.flags.ack",
    "frame.time_relative < 1",
    "nv.counter == 3",
    "nv.id == 6",
    "list.lost > 0",
    "node.nErrorCount > 0",
    'finding.severity == "warning"',
    'cause.kind == "second-sender"',
    'cause.severity == "warning" && finding.count == 1',
    "!cause.kind",
    "nv.index == 77",
]


@pytest.mark.parametrize("expression", EXPRESSIONS)
@pytest.mark.parametrize("path", [PLANT, PEERS])
def test_what_a_filter_leaves_are_rows_of_the_whole_report(path: str, expression: str) -> None:
    whole, part = report(path), report(path, expression)
    chosen = frames(path, expression)
    assert part["filter"] == {"expression": expression, "telegrams": len(chosen)}
    assert part["capture"] == whole["capture"]
    assert all(finding in whole["findings"] for finding in part["findings"])
    lists = {entry["key"]: entry for entry in whole["lists"]}
    for entry in part["lists"]:
        full = lists[entry["key"]]
        assert {**entry, "streams": [], "nodes": []} == {**full, "streams": [], "nodes": []}
        assert all(stream in full["streams"] for stream in entry["streams"])
        assert all(node in full["nodes"] for node in entry["nodes"])
    assert bool(part["lists"]) == bool(chosen)


def test_all_that_everything_chooses_is_everything() -> None:
    whole, part = report(PLANT), report(PLANT, "frame.number")
    assert {**part, "filter": None} == {**whole, "filter": None}


def test_a_sender_alone_is_not_blamed_for_answers_that_the_filter_hides() -> None:
    shown = report(PLANT, f"ip.src == {PRESS} && nv.index == 3")
    (entry,) = shown["lists"]
    assert [stream["node"] for stream in entry["streams"]] == [PRESS]
    # Of the recipe's telegrams only those of the three seconds were not acknowledged, seen with the filter or without.
    (finding,) = (one for one in shown["findings"] if one["code"] == "NV301")
    assert finding["count"] == entry["counters"]["missing_acknowledgements"] == 6


def test_streams_and_nodes_are_those_of_the_telegrams_chosen() -> None:
    (entry,) = report(PLANT, f"nv.index == 7 && ip.src == {BENCH}")["lists"]
    assert {(stream["node"], stream["subindex"]) for stream in entry["streams"]} == {(BENCH, 0), (BENCH, 1)}
    assert [node["address"] for node in entry["nodes"]] == [BENCH]
    codes = {place(finding) for finding in report(PLANT, f"nv.index == 7 && ip.src == {BENCH}")["findings"]}
    assert ("NV402", "udp/1202/7", BENCH, 1) in codes
    assert not [one for one in codes if one[2] == PRESS]


def test_findings_are_chosen_one_by_one() -> None:
    assert [place(one) for one in report(PLANT, 'finding.code == "NV402"')["findings"]] == [
        ("NV402", "udp/1202/7", PRESS, 1),
        ("NV402", "udp/1202/7", BENCH, 1),
    ]
    both = report(PLANT, f'finding.name == "shape-changed" && ip.src == {BENCH}')["findings"]
    assert [place(one) for one in both] == [("NV402", "udp/1202/7", BENCH, 1)]
    # This one is about a sender, and of no list.
    assert [one["code"] for one in report(PEERS, 'finding.code == "NV206"')["findings"]] == ["NV206"]
    assert [one["code"] for one in report(PEERS, "finding.count > 100")["findings"]] == ["NV207"]
    assert report(PLANT, 'finding.code == "NV206"')["findings"] == []


def test_the_telegrams_that_show_a_finding_are_those_of_its_frames() -> None:
    findings = {place(one): one for one in report(PLANT)["findings"]}
    gap = findings["NV201", "udp/1202/7", PRESS, 1]
    assert frames(PLANT, f'finding.code == "NV201" && node.address == {PRESS}') == gap["frames"]


def happened(path: str, expression: str | None = None, project: Project | None = None) -> dict[str, Any]:
    """Return a report with causes."""
    inquiry = Inquiry([path], project or Project())
    return inquiry.report(inquiry.analyze(expression, causes=True))


def kinds(document: dict[str, Any]) -> list[str]:
    return [cause["kind"] for cause in document["causes"]]


@pytest.mark.parametrize(
    "expression",
    [
        'cause.kind == "second-sender"', 'cause.kind == "loss-of-list"', 'cause.kind == "reader-silent"',
        'cause.severity == "warning"', 'cause.title contains "silent"', "cause.kind",
    ],
)  # fmt: skip
def test_causes_are_chosen_with_what_they_explain_and_concern(expression: str) -> None:
    field, _, text = expression.partition(" ")
    text = text.partition('"')[2].strip('"')
    whole, part = happened(PLANT), happened(PLANT, expression)
    wanted = [cause for cause in whole["causes"] if text in cause[field.removeprefix("cause.")]]
    assert wanted
    assert part["causes"] == wanted
    explained = {tuple(one.values()) for cause in wanted for one in cause["findings"]}
    assert part["findings"] == [finding for finding in whole["findings"] if place(finding) in explained]
    # A cause at one node may explain what is found of another one's list: answers to what it asked for.
    concerned = {key for cause in wanted for key in (*cause["lists"], *(one["list"] for one in cause["findings"]))}
    assert [entry["key"] for entry in part["lists"]] == sorted(
        concerned - {None}, key=[entry["key"] for entry in whole["lists"]].index
    )
    # Each of these has not more than ten events, or names the first ten of them.
    assert frames(PLANT, expression) == sorted(number for cause in wanted for number in cause["frames"])


def test_a_cause_that_no_telegram_shows_is_asked_alone() -> None:
    path = str(CAPTURES / "interfaces.pcapng")
    incomplete = 'cause.kind == "capture-incomplete"'
    part = happened(path, incomplete)
    assert (kinds(part), part["filter"]["telegrams"], part["lists"]) == (["capture-incomplete"], 0, [])
    assert [finding["code"] for finding in part["findings"]] == ["NV901"]
    assert kinds(happened(path, f"{incomplete} && ip.src == 192.0.2.1")) == []
    assert kinds(happened(path, f"!({incomplete})")) == ["second-sender"]


def test_a_telegram_condition_chooses_among_the_telegrams_that_show_a_cause() -> None:
    part = happened(PLANT, f'cause.kind == "second-sender" && ip.src == {BENCH}')
    assert kinds(part) == ["second-sender"]
    (entry,) = part["lists"]
    assert [node["address"] for node in entry["nodes"]] == [BENCH]
    assert kinds(happened(PLANT, f'cause.kind == "second-sender" && ip.src == {HMI}')) == []


def test_of_findings_and_causes_asked_for_together_one_explains_the_other() -> None:
    part = happened(PLANT, 'cause.kind == "second-sender" && finding.code == "NV403"')
    assert kinds(part) == ["second-sender"]
    assert {finding["code"] for finding in part["findings"]} == {"NV403"}
    unrelated = happened(PLANT, 'cause.kind == "second-sender" && finding.code == "NV201"')
    assert (unrelated["causes"], unrelated["findings"], unrelated["filter"]["telegrams"]) == ([], [], 0)
    either = happened(PLANT, 'cause.kind == "node-silent" || finding.code == "NV204"')
    assert sorted(kinds(either)) == ["node-restart", "node-silent"]
    assert {finding["code"] for finding in either["findings"]} == {"NV204", "NV504"}
    # A counter that is byte-swapped is explained by a cause; what a note tells, by none.
    unexplained = happened(PEERS, "finding.code && !cause.kind")
    assert unexplained["causes"] == []
    assert "NV206" in {finding["code"] for finding in unexplained["findings"]}


def test_findings_are_shown_with_the_causes_that_explain_them() -> None:
    assert kinds(happened(PLANT, 'finding.code == "NV504"')) == ["node-silent"]


def test_who_asks_for_no_causes_can_choose_by_them() -> None:
    chosen = 'cause.kind == "counter-foreign"'
    inquiry = Inquiry([PEERS], read_project(None, AXIS))
    part = inquiry.analyze(chosen, values=True)
    assert part.values is not None
    assert part.state.capture.chosen == len(frames(PEERS, chosen)) == 1
    assert inquiry.report(part)["findings"] == happened(PEERS, chosen)["findings"]


def test_titles_of_causes_are_those_that_are_shown(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(PROJECT)
    inquiry = Inquiry([PLANT], read_project(tmp_path / "nvscope.toml"))
    for names, shown, hidden in (True, "press", PRESS), (False, PRESS, "press"):
        for text, count in (shown, 1), (hidden, 0):
            found = inquiry.analyze(f'cause.title contains "{text}"', causes=True, names=names)
            assert len(inquiry.report(found, names=names)["causes"]) == count


def test_names_come_from_the_project(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(PROJECT)
    project = read_project(tmp_path / "nvscope.toml")
    assert frames(PLANT, 'node.name == "press" && list.name == "axis"', project) == frames(
        PLANT, f"ip.src == {PRESS} && nv.index == 7"
    )
    assert frames(PLANT, "!node.name", project) == frames(PLANT, f"ip.src != {PRESS}")


def test_variables_are_fields() -> None:
    inquiry = Inquiry([PEERS], read_project(None, AXIS))
    whole = inquiry.analyze(values=True)
    part = inquiry.analyze("var.stAxis.pos > 500 && var.bStart", values=True)
    assert part.values
    assert whole.values
    (some,), (all_of,) = part.values.streams.values(), whole.values.streams.values()
    sent = [entry["v"] for entry in json.loads((CAPTURES / "peers" / "sent-node-red.json").read_text())]
    wanted = [values for values in sent if values["stAxis"]["pos"] > 500 and values["bStart"]]
    assert some.telegrams == part.state.capture.chosen == len(wanted)
    assert all_of.telegrams == len(sent)
    assert some.least[3] is not None
    assert some.least[3][0] > 500


def test_stdin_is_not_read_twice() -> None:
    with pytest.raises(UsageError, match="stdin cannot be read twice"):
        Inquiry(["-"]).analyze("list.lost > 0")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_that_has_a_name_is_not_read_twice(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UsageError, match="a pipe cannot be read twice"):
        Inquiry([str(tmp_path / "pipe")]).analyze("list.lost > 0")


def with_another_axis(folder: Path) -> Project:
    """Return definitions of which one does not fit what is sent."""
    axis = (CAPTURES / "peers" / "axis.gvl").read_text()
    assert "nSpeed : INT" in axis
    (folder / "axis.gvl").write_text(axis.replace("nSpeed : INT", "nSpeed : LREAL"))
    return read_project(None, [str(folder / "axis.gvl"), str(CAPTURES / "peers" / "axis_types.st")])


@pytest.mark.parametrize(
    ("capture", "project", "codes"),
    [
        (PLANT, lambda _: Project(), {"NV201"}),
        (PEERS, with_another_axis, {"NV207", "NV405"}),
        (str(CAN / "press.log"), lambda _: read_project(None, [str(CAN / "press.gvl")]), set()),
    ],
)
def test_a_session_over_captures_ends_with_their_report(
    capture: str, project: Callable[[Path], Project], codes: set[str], tmp_path: Path
) -> None:
    inquiry = Inquiry([capture], project(tmp_path))
    session = inquiry.session()
    session.start()
    assert session.wait(30)
    last, found = session.stop(), inquiry.analyze()
    assert (last.summary, last.findings) == (found.summary, found.findings)
    assert codes <= {finding.code for finding in last.findings}
    assert last.figures is not None
    if inquiry.project == Project():
        assert last.figures.summary() == found.summary


class Interface:
    """A source that is no file: what is captured can be read once."""

    def __init__(self, path: str) -> None:
        self._source: Source = open_source([path])
        self.infos, self.channels, self.attachments = (), (), ()

    def __iter__(self) -> Iterator[PacketBatch]:
        return iter(self._source)

    def between(self, start_ns: int | None, end_ns: int | None) -> Interface:
        self._source = self._source.between(start_ns, end_ns)
        return self

    def stop(self) -> None:
        self._source.stop()


def test_a_source_that_is_no_file_is_asked_as_files_are() -> None:
    in_files, captured = Inquiry([PLANT]).analyze(), Inquiry(Interface(PLANT)).analyze()
    assert captured.summary == in_files.summary
    assert captured.findings == in_files.findings
    session = Inquiry(Interface(PLANT)).session()
    session.start()
    assert session.wait(30)
    assert session.stop().summary == in_files.summary


def test_a_source_that_is_no_file_begins_and_ends_when_it_does() -> None:
    start_ns = Inquiry([PLANT]).analyze().summary.start_ns
    assert start_ns is not None
    text = f"{datetime.fromtimestamp(start_ns // 1_000_000_000 + 5, UTC):%Y-%m-%d %H:%M:%S}Z"
    absolute = parse_range(text, None)
    expected = Inquiry([PLANT], asked=absolute).analyze().summary
    assert Inquiry(Interface(PLANT), asked=absolute).analyze().summary == expected
    assert expected.start_ns is not None
    assert expected.start_ns >= start_ns + 4_000_000_000
    for start, end in (("5s", None), (None, "-2s"), ("08:00:00", None)):
        with pytest.raises(UsageError, match="needs files"):
            Inquiry(Interface(PLANT), asked=parse_range(start, end)).open()
    with pytest.raises(UsageError, match="what is no file cannot be read twice"):
        Inquiry(Interface(PLANT)).analyze("list.lost > 0")
    with pytest.raises(UsageError, match="--at: what is no file has no end"):
        Inquiry(Interface(PLANT)).latest_ns("--at")
