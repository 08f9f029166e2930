"""Telegrams to everybody that their only reader does not answer, and single ones."""

from __future__ import annotations

from pathlib import Path

from tests.causes.drawn.by_hand import list_of, node_of, plant_of, told_of
from tests.causes.drawn.plant import START_NS, Away, List, Node, Plant
from tests.causes.drawn.truth import SECOND


def press_and_reader(*, chatter_s: float | None = None) -> tuple[Plant, List, Node]:
    """Return a plant in which a node reads a broadcast list and acknowledges it, and sends one of its own."""
    plant = plant_of(60)
    press, reader = node_of(plant, 1), node_of(plant, 2, chatter_s=chatter_s)
    read = list_of(press, 1, 100, readers=(reader,))
    list_of(reader, 2, 100)
    return plant, read, reader


def away(since_s: int, until_s: int, mode: str, *, chatter: bool = False) -> Away:
    return Away(START_NS + since_s * SECOND, START_NS + until_s * SECOND, mode, chatter)


def test_who_is_silent_answers_no_broadcast_either(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader()
    reader.away.append(away(30, 70, "cable"))
    ((kind, _, until_s),) = told_of(plant, tmp_path)
    assert (kind, until_s) == ("node-silent", None)


def test_who_starts_anew_does_not_answer_meanwhile(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader()
    reader.away.append(away(30, 34, "off"))
    assert [kind for kind, _, _ in told_of(plant, tmp_path)] == ["node-restart"]


def test_who_was_hardly_heard_before_is_there_if_it_is_heard_afterwards(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader(chatter_s=7)
    reader.away.append(away(8, 70, "frozen", chatter=True))
    assert [kind for kind, _, _ in told_of(plant, tmp_path)] == ["program-stopped"]


def test_single_telegrams_without_an_answer_are_told_as_such_and_go_on(tmp_path: Path) -> None:
    plant, read, _ = press_and_reader()
    for at_ns in range(START_NS + 10 * SECOND, START_NS + 60 * SECOND, 5 * SECOND):
        read.silent_readers.append((at_ns, at_ns + SECOND // 10, "nothing"))
    ((kind, since_s, until_s),) = told_of(plant, tmp_path)
    assert (kind, round(since_s), until_s) == ("reader-silent", 10, None)


def test_a_list_that_nobody_acknowledges_stays_so_while_its_addressee_is_away(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader()
    other = list_of(plant.nodes[0], 7, 200)
    other.acknowledged, other.to = True, reader.ip
    reader.away.append(away(30, 70, "cable"))
    assert told_of(plant, tmp_path)[0] == ("acknowledgement-impossible", 0.0, None)
