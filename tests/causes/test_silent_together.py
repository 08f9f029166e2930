"""Nodes that fall silent together: one event, at what they share."""

from __future__ import annotations

from pathlib import Path

from nvscope.causes.cause import Cause
from tests.causes.plants import causes_in, from_hardware
from tests.causes.test_at_the_edges import sent, titles
from tests.oracle.builders import data_frame, other_frame, telegram
from tests.oracle.frame import Frame

SECOND_NS = 1_000_000_000
WITNESS = [from_hardware(other_frame(second * SECOND_NS), "02:00:00:00:00:99") for second in range(40)]
"""Somebody who sends no lists: the capture goes on."""


def node(number: int, until_s: float, *, every_ms: int = 100) -> list[Frame]:
    """Return two lists of a node, which sends them until then."""
    at_ms, rounds = 7 * number, int(until_s * 1000) // every_ms
    return [
        *sent(f"10.0.0.{number}", number, list(range(rounds)), every_ms, since_ms=at_ms),
        *sent(f"10.0.0.{number}", 50 + number, list(range(rounds // 2)), 2 * every_ms, since_ms=at_ms + 3),
    ]


def told(tmp_path: Path, *parts: list[Frame]) -> list[Cause]:
    return causes_in([frame for part in [WITNESS, *parts] for frame in part], tmp_path)


def test_all_that_send_are_silent_from_one_moment_on(tmp_path: Path) -> None:
    (cause,) = told(tmp_path, node(1, 20), node(2, 20), node(3, 20), node(4, 20))
    assert (cause.kind.name, cause.severity.word, cause.until_ns) == ("node-silent", "error", None)
    assert cause.title == "All 4 nodes that send lists are silent since 19.9 s (8 lists)"
    assert cause.checked == (
        "they fell silent within 21.0 ms of each other: what they share is out, or the way to this capture",
        "nothing of them came afterwards, ARP included",
        "no other node is seen to go on",
    )
    assert cause.next.startswith("The link light, cable and mirror port of this capture; a ping to one of them")
    assert len(cause.nodes) == 4
    assert {finding.code for finding in cause.findings} == {"NV504"}


def test_two_that_are_all_are_told_as_one(tmp_path: Path) -> None:
    (cause,) = told(tmp_path, node(1, 20), node(2, 20))
    assert cause.title == "Both nodes that send lists are silent since 19.9 s (lists 1, 2, 51 and 52)"


def test_two_beside_a_third_are_told_one_by_one(tmp_path: Path) -> None:
    causes = told(tmp_path, node(1, 20), node(2, 20), node(3, 40))
    assert sorted(titles(causes)) == [
        ("node-silent", "Node 10.0.0.1 is silent since 19.9 s (lists 1 and 51)"),
        ("node-silent", "Node 10.0.0.2 is silent since 19.9 s (lists 2 and 52)"),
    ]


def test_three_beside_a_fourth_share_a_switch(tmp_path: Path) -> None:
    (cause,) = told(tmp_path, node(1, 20), node(2, 20), node(3, 20), node(4, 40))
    assert cause.title == "Nodes 10.0.0.1, 10.0.0.2 and 10.0.0.3 are silent since 19.9 s (6 lists)"
    assert cause.checked[0] == "they fell silent within 14.0 ms of each other: what they share is out"
    assert cause.checked[-1] == "1 other node goes on"
    assert cause.next.startswith("What they share: a switch")


def test_one_that_had_ended_before_is_another_event(tmp_path: Path) -> None:
    causes = told(tmp_path, node(1, 10), node(2, 20), node(3, 20), node(4, 20))
    assert sorted(titles(causes)) == [
        ("node-silent", "All 3 nodes that send lists are silent since 19.9 s (6 lists)"),
        ("node-silent", "Node 10.0.0.1 is silent since 9.9 s (lists 1 and 51)"),
    ]


def test_a_slow_one_may_have_ended_at_the_same_moment(tmp_path: Path) -> None:
    (cause,) = told(tmp_path, node(1, 20), node(2, 20, every_ms=1000), node(3, 20))
    assert cause.title.startswith("All 3 nodes that send lists are silent since 19.9 s")


def test_one_after_another_is_no_one_event(tmp_path: Path) -> None:
    causes = told(tmp_path, *(node(number, 10 + number) for number in range(1, 6)))
    assert len(causes) == 5


def test_a_single_node_is_told_by_its_name(tmp_path: Path) -> None:
    (cause,) = told(tmp_path, node(1, 20))
    assert cause.title == "Node 10.0.0.1 is silent since 19.9 s (lists 1 and 51)"


def away(number: int, since_s: float, until_s: float, *, every_ms: int = 100, end_s: float = 40) -> list[Frame]:
    """Return two lists of a node, of which nothing came for a while; it counted on."""

    def counters(step_ms: int) -> list[int]:
        silent = range(int(since_s * 1000), int(until_s * 1000))
        return [-1 if at * step_ms in silent else at for at in range(int(end_s * 1000) // step_ms)]

    at_ms = 7 * number
    return [
        *sent(f"10.0.0.{number}", number, counters(every_ms), every_ms, since_ms=at_ms),
        *sent(f"10.0.0.{number}", 50 + number, counters(2 * every_ms), 2 * every_ms, since_ms=at_ms + 3),
    ]


def test_all_that_were_silent_and_came_back_together_are_one_event(tmp_path: Path) -> None:
    (cause,) = told(tmp_path, *(away(number, 20, 26) for number in range(1, 5)))
    assert cause.title == "All 4 nodes that send lists were silent from 19.9 s to 26.0 s (8 lists)"
    assert cause.checked[0].startswith("they fell silent within 21.0 ms of each other, and came back so")
    assert "their counters went on meanwhile: their programs ran" in cause.checked
    assert {finding.code for finding in cause.findings} >= {"NV201"}


def test_who_came_back_later_was_away_for_another_reason(tmp_path: Path) -> None:
    causes = told(tmp_path, away(1, 20, 26), away(2, 20, 26), away(3, 20, 26), away(4, 20, 32))
    assert sorted(len(cause.nodes) for cause in causes) == [1, 3]


def test_what_is_not_due_yet_is_not_told_to_have_stopped(tmp_path: Path) -> None:
    """The capture ends when the fast lists are back, and the slow ones have not been due."""
    frames = [*away(1, 20, 26, every_ms=500, end_s=26.4), *away(2, 20, 26, end_s=26.4), *away(3, 20, 26, end_s=26.4)]
    causes = [one for one in causes_in(frames, tmp_path) if one.severity.word == "error"]
    assert [(one.kind.name, len(one.nodes)) for one in causes] == [("node-silent", 3)]


def test_a_node_that_sends_other_frames_again_is_there_however_late(tmp_path: Path) -> None:
    arp = [
        from_hardware(other_frame(at * SECOND_NS // 20), "02:00:00:00:00:02") for at in (*range(400), *range(450, 800))
    ]
    (cause,) = told(tmp_path, node(1, 20), arp)
    assert cause.kind.name == "program-stopped"
    assert not [fact for fact in cause.checked if "nothing of it came" in fact]


def test_a_node_of_which_nothing_else_was_due_may_be_gone_as_a_whole(tmp_path: Path) -> None:
    """The slow list of the node is not due yet at the end."""
    fast = sent("10.0.0.1", 1, list(range(380)), 100)
    slow = sent("10.0.0.1", 2, list(range(8)), 5000)
    (cause,) = told(tmp_path, fast, slow, node(3, 40))
    assert cause.title == "Node 10.0.0.1 sends list 1 no more since 37.9 s"
    assert cause.checked == (
        "nothing else of it has come since then, and nothing else was due: perhaps all of it is gone",
    )
    assert cause.next.startswith("Its power and LEDs")


def test_a_list_that_comes_on_another_port_now_has_been_moved(tmp_path: Path) -> None:
    before = sent("10.0.0.1", 1, list(range(200)))
    after = [
        data_frame(20 * SECOND_NS + at * SECOND_NS // 10, "10.0.0.1", "255.255.255.255",
                   telegram(list_id=1, counter=200 + at, data=b"\1\2\3\4"), port=1203)
        for at in range(200)
    ]  # fmt: skip
    (cause,) = told(tmp_path, before, after, sent("10.0.0.1", 2, list(range(400))), node(3, 40))
    assert cause.kind.name == "list-stopped"
    assert cause.next == (
        "The port of the list in the network settings of its sender: it comes on UDP 1203 now, and not on 1202."
    )
