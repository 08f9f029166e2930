"""Two senders of a list that count on in one Counter: what the one lacks, the other has sent, and nothing is lost."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.findings.security_plants import analysed
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import SECOND, A, B, C

EVERYBODY = "255.255.255.255"


def sent(number: float, counter: int, source: str, list_id: int = 1) -> Frame:
    """Return a telegram, so many tenths of a second behind the beginning."""
    data = telegram(list_id=list_id, counter=counter, data=bytes([counter & 0xFF]))
    return data_frame(int(number * SECOND / 10), source, EVERYBODY, data)


def in_turns(who: Callable[[int], str], lost: Callable[[int], bool] = lambda _: False) -> list[Frame]:
    """Return telegrams of one program, each from the address that is its turn."""
    return [sent(number, number, who(number)) for number in range(1, 401) if not lost(number)]


def by_chance(number: int) -> str:
    return random.Random(number).choice((A, B))


def told(frames: list[Frame], directory: Path) -> list[tuple[str, list[str]]]:
    """Return causes, each with what was checked of Counters."""
    happened = analysed(frames, directory).happened
    assert happened is not None
    return [(one.kind.name, [text for text in one.checked if "Counter" in text]) for one in happened.causes]


@pytest.mark.parametrize(
    "who", [lambda number: (A, B)[number % 2], lambda number: B if number % 20 == 0 else A, by_chance],
    ids=["in turn", "now and then", "by chance"],
)  # fmt: skip
def test_what_the_other_one_sent_is_not_lost(who: Callable[[int], str], tmp_path: Path) -> None:
    ((kind, (checked,)),) = told(in_turns(who), tmp_path)
    assert kind == "second-sender"
    gaps = checked.partition(": ")[2].split()
    assert gaps[0] == gaps[2]
    assert checked.endswith("gaps of either are what the other one sent")


def test_so_it_is_where_some_were_lost(tmp_path: Path) -> None:
    lost = random.Random(1)
    ((kind, (checked,)),) = told(in_turns(by_chance, lambda _: lost.random() < 0.03), tmp_path)
    assert kind == "second-sender"
    filled, gaps = (int(checked.partition(": ")[2].split()[place]) for place in (0, 2))
    assert 0.8 * gaps < filled < gaps


def test_what_a_third_one_loses_has_its_own_cause(tmp_path: Path) -> None:
    other = [sent(number + 0.3, number + 900, C, 2) for number in range(1, 401) if number not in (50, 51, 200)]
    kinds = [kind for kind, _ in told([*in_turns(by_chance), *other], tmp_path)]
    assert sorted(kinds) == ["loss-of-list", "second-sender"]


def test_who_counts_for_itself_has_lost_what_is_missing(tmp_path: Path) -> None:
    own = [sent(number, number, A) for number in range(1, 401) if number not in (50, 51, 90)]
    other = [sent(number + 0.5, number + 3000, B) for number in range(1, 401)]
    assert sorted(told([*own, *other], tmp_path)) == [("loss-of-list", []), ("second-sender", [])]
