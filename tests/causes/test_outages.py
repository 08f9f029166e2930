"""Outages and losses that come again: what is one cause, where it is, since when, and whether it is over."""

from __future__ import annotations

from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from tests.causes.drawn.by_hand import list_of, lost, node_of, plant_of, told_of
from tests.causes.drawn.packets import write_pcap
from tests.causes.drawn.plant import Plant
from tests.causes.drawn.traffic import play
from tests.causes.drawn.truth import SECOND
from tests.causes.told import causes_of


def press_and_saw(seconds: int = 60, *intervals_ms: int, scope: str = "stream") -> Plant:
    """Return a plant of two controllers; the lists of the first have these intervals."""
    plant = plant_of(seconds)
    press, saw = node_of(plant, 1, scope=scope), node_of(plant, 2)
    for number, interval_ms in enumerate(intervals_ms):
        list_of(press, number + 1, interval_ms)
    list_of(saw, 90, 100)
    return plant


def test_a_link_that_was_down_is_one_outage_of_fast_and_slow_lists(tmp_path: Path) -> None:
    plant = press_and_saw(60, 10, 200)
    lost(plant, lambda sent, at_s: sent.list.node.ip == "10.0.0.1" and 20 <= at_s < 20.7)
    ((kind, since_s, until_s),) = told_of(plant, tmp_path)
    assert (kind, since_s) == ("loss-at-sender", 20.0)
    assert until_s is not None
    assert 20.7 <= until_s <= 21


def test_lists_whose_missing_telegrams_were_due_at_other_times_were_out_together(tmp_path: Path) -> None:
    plant = press_and_saw(120, 640, 1000, 1300)
    lost(plant, lambda sent, at_s: sent.list.node.ip == "10.0.0.1" and 60 <= at_s < 64)
    (cause,) = told_of(plant, tmp_path)
    assert cause[0] == "loss-at-sender"


def test_many_that_one_counter_of_a_node_misses_are_not_all_of_one_list(tmp_path: Path) -> None:
    plant = press_and_saw(60, 50, 100, scope="telegram")
    lost(plant, lambda sent, at_s: sent.list.node.ip == "10.0.0.1" and 20 <= at_s < 20.6)
    (cause,) = told_of(plant, tmp_path)
    assert cause[0] == "loss-at-sender"


def test_an_outage_is_over_when_telegrams_come_again_however_near_the_end(tmp_path: Path) -> None:
    plant = press_and_saw(60, 100, 1000)
    lost(plant, lambda sent, at_s: sent.list.id == 1 and 58 <= at_s < 58.7)
    ((kind, since_s, until_s),) = told_of(plant, tmp_path)
    assert (kind, until_s is None) == ("loss-of-list", False)
    assert 57.9 <= since_s <= 58.1


def test_what_comes_again_every_few_seconds_in_bursts_is_not_over_between_two(tmp_path: Path) -> None:
    plant = press_and_saw(60, 20, 30)
    lost(plant, lambda sent, at_s: sent.list.node.ip == "10.0.0.1" and at_s > 10 and at_s % 6 < 0.07)
    ((kind, since_s, until_s),) = told_of(plant, tmp_path)
    assert (kind, round(since_s), until_s) == ("loss-at-sender", 12, None)


def causes_of_cut(directory: Path, until_s: float, *, talks: bool = False, all_of_it: bool = True) -> Cause:
    """Return the one cause where a cable was out from 20 s on.

    Without ``all_of_it`` one of three lists came; ``talks`` says whether ARP did.
    """
    plant = press_and_saw(60, 100, 200, 500)
    plant.nodes[0].chatter_ns = SECOND if talks else None
    lost(
        plant, lambda sent, at_s: sent.list.node.ip == "10.0.0.1" and 20 <= at_s < until_s
        and (all_of_it or sent.list.id < 3),
    )  # fmt: skip
    path = directory / "plant.pcap"
    write_pcap(play(plant), path)
    (cause,) = causes_of(Inquiry([str(path)]))[1]
    assert cause.kind.name == "loss-at-sender"
    return cause


def says_that_nothing_came(cause: Cause) -> bool:
    return any("no other frame" in fact for fact in cause.checked)


def test_of_a_cable_that_was_out_it_is_said_that_nothing_came(tmp_path: Path) -> None:
    cause = causes_of_cut(tmp_path, 24)
    assert cause.checked[0] == "no cyclic list and no other frame of it came for 4.0 s"
    assert cause.next == "Its cable and switch port, and what lies between: its program ran meanwhile."


def test_of_a_blink_it_is_not(tmp_path: Path) -> None:
    cause = causes_of_cut(tmp_path, 20.6)
    assert not says_that_nothing_came(cause)
    assert "error counters" in cause.next


def test_nor_where_a_list_came_meanwhile(tmp_path: Path) -> None:
    cause = causes_of_cut(tmp_path, 24, all_of_it=False)
    assert not says_that_nothing_came(cause)


def test_nor_where_arp_came(tmp_path: Path) -> None:
    assert not says_that_nothing_came(causes_of_cut(tmp_path, 24, talks=True))
