"""Senders that count along with another one, and two that only look so."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.counter_takeovers import CounterTakeovers
from tests.findings.security_plants import analysed, found_in, told_in
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import SECOND, A, B

STEP = SECOND // 10
ALL = "255.255.255.255"


def sent(at: float, counter: int, source: str = A, *, list_id: int = 1, value: int = 0) -> Frame:
    """Return a telegram so many steps of 100 ms behind the beginning."""
    data = telegram(list_id=list_id, counter=counter, data=bytes([counter & 0xFF, value]))
    return data_frame(int(at * STEP), source, ALL, data)


def victim(count: int = 200) -> list[Frame]:
    return [sent(number, number) for number in range(1, count + 1)]


def slipped_in(every: int = 7, count: int = 200) -> list[Frame]:
    """Return telegrams of another node, each with the Counter that comes next of the first one."""
    return [sent(number + 0.5, number + 1, B, value=9) for number in range(every, count, every)]


def codes(frames: list[Frame], directory: Path) -> set[str]:
    return {code for code, *_ in told_in(frames, directory)}


def test_who_slips_in_telegrams_with_the_next_counter_counts_along(tmp_path: Path) -> None:
    found = analysed([*victim(), *slipped_in()], tmp_path)
    (finding,) = [one for one in found.findings if one.code == "NV964"]
    assert finding.message == (
        f"{B} counts along with {A}: of 27 telegrams with another Counter than the one before of its own, 27 have the "
        f"next one of {A} instead of its own."
    )
    assert found.summary.addresses[finding.node or 0] == B
    assert (finding.subindex, finding.count, finding.first_ns) == (0, 27, int(14.5 * STEP))
    assert found.happened is not None
    (cause,) = found.happened.causes
    assert cause.kind.name == "second-sender"
    assert finding in cause.findings
    assert cause.checked[0] == finding.message.rstrip(".")


@pytest.mark.parametrize("seed", range(12))
def test_who_slips_in_at_random_in_four_of_ten_cycles_counts_along(seed: int, tmp_path: Path) -> None:
    """Of two cycles that follow each other, its telegrams follow each other, too, as those of one that counts."""
    rng = random.Random(seed)
    along = [sent(at + rng.uniform(0.01, 0.99), at + 1, B, value=9) for at in range(1, 300) if rng.random() < 0.4]
    assert "NV964" in codes([*victim(300), *along], tmp_path)


@examples(300)
@given(seed=st.integers(0, 10**6))
def test_no_good_capture_has_one_that_counts_along(seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Two that send one list, each for itself: they begin when they want, restart, lose telegrams, are doubled."""
    rng = random.Random(seed)
    frames: list[Frame] = []
    together = rng.random() < 0.5
    for source in (A, B):
        lost = rng.choice((0, 0, 0.02, 0.1, 0.3))
        interval, phase = 1 if together else rng.choice((1, 1, 2, 0.5, 1.37)), rng.random()
        counter = 1 if together else rng.choice((1, 100, 65_500, rng.randrange(65_536)))
        restarts = {rng.randrange(300) for _ in range(rng.choice((0, 0, 1, 3)))}
        lists = rng.choice((1, 1, 2))
        for cycle in range(300):
            if cycle in restarts:
                counter = rng.choice((0, 1)) - cycle
            for place in range(lists):
                at = cycle * interval + phase + 0.01 * place + rng.uniform(0, 0.05)
                if rng.random() >= lost:
                    frames.append(sent(at, (counter + cycle) % 65_536, source, list_id=1 + place, value=9))
    if rng.random() < 0.3:
        frames += [one._replace(ts_ns=one.ts_ns + 2000) for one in frames]
    assert "NV964" not in codes(frames, tmp_path_factory.mktemp("good"))


def test_fewer_telegrams_than_ten_may_be_chance(tmp_path: Path) -> None:
    some = slipped_in(every=18)
    assert len(some) == 11  # the first one takes no step
    assert "NV964" in codes([*victim(), *some], tmp_path)
    assert "NV964" not in codes([*victim(), *some[:-1]], tmp_path)


def test_two_that_began_together_count_each_for_itself(tmp_path: Path) -> None:
    """A redundant pair in step, one behind the other: the second always has the next Counter, which is its own."""
    pair = [sent(number + 0.5, number + 1, B, value=9) for number in range(1, 200)]
    assert "NV964" not in codes([*victim(), *pair], tmp_path)
    some_lost = [one for number, one in enumerate(pair) if number % 3]
    assert "NV964" not in codes([*victim(), *some_lost], tmp_path)


@pytest.mark.parametrize("delay", [0.2, -0.2])
def test_the_same_telegrams_with_a_translated_address_count_as_their_sender(delay: float, tmp_path: Path) -> None:
    """A router translates addresses, and both of its sides are captured; it may lose some."""
    copies = [sent(number + delay, number, B) for number in range(1, 200) if number % 4]
    assert "NV964" not in codes([*victim(), *copies], tmp_path)


def test_a_device_that_has_another_address_since_goes_on_once(tmp_path: Path) -> None:
    """As a new lease of DHCP, or a redundant pair that shares what it counts."""
    after = [sent(number, number, B) for number in range(101, 201)]
    assert "NV964" not in codes([*victim(100), *after], tmp_path)


def test_one_device_with_two_addresses_in_turns_counts_for_both(tmp_path: Path) -> None:
    turns = [sent(number, number, (A, B)[number % 2]) for number in range(1, 201)]
    assert "NV964" not in codes(turns, tmp_path)


def test_a_program_that_sends_over_two_network_cards_counts_for_both(tmp_path: Path) -> None:
    """It has a hardware address for each, and one Counter: what the one card lacks, the other has."""
    turns = [sent(number, number, (A, B)[number % 2]) for number in range(1, 201)]
    by_card = [one._replace(data=one.data[:6] + b"\2\0\0\0\0" + one.data[29:30] + one.data[12:]) for one in turns]
    assert "NV964" not in codes(by_card, tmp_path)


def test_who_sends_the_list_by_the_word_of_the_project_is_not_told(tmp_path: Path) -> None:
    nodes = '[nodes]\n"{}" = {{ name = "spare", writes = [{}] }}\n'
    given = [B, "1"], [B, '"udp/1202/1"'], [B, "2"], [A, "1"]
    frames = [*victim(), *slipped_in()]
    told = ["NV964" in {one.code for one in found_in(frames, tmp_path, nodes.format(*one))} for one in given]
    assert told == [False, False, True, True]


@pytest.mark.parametrize("every", [15, 20, 50])
def test_one_device_that_sends_now_and_then_from_another_address_counts_for_both(every: int, tmp_path: Path) -> None:
    device = [sent(number, number, B if number % every == 0 else A) for number in range(1, 1200)]
    assert "NV964" not in codes(device, tmp_path)


def test_who_counts_along_with_a_sender_that_loses_telegrams_is_told_all_the_same(tmp_path: Path) -> None:
    lossy = [one for number, one in enumerate(victim(400)) if number % 29]
    assert "NV964" in codes([*lossy, *slipped_in(count=400)], tmp_path)


def test_of_more_pairs_than_are_kept_it_is_told_how_many_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Senders without number, each of which counts on where another one stands."""
    frames = [sent(number, number, f"10.0.0.{number % 7 * (number % 31) + 1}") for number in range(1, 600)]
    assert "NV906" not in {one.code for one in analysed(frames, tmp_path).findings}
    monkeypatch.setattr(CounterTakeovers.__init__, "__defaults__", (20,))
    (told,) = [one for one in analysed(frames, tmp_path).findings if one.code == "NV906"]
    assert "telegrams of further pairs of senders that count along." in told.message


def test_a_pc_that_counts_over_its_lists_may_stay_one_ahead(tmp_path: Path) -> None:
    """It sends five lists at a time, twice a second, and counts as fast as the other one does."""
    frames = victim()
    for send in range(1, 40):
        counter = 5 * send + 1
        frames += [
            sent(5 * send + 0.5 + 0.01 * place, counter + place, B, list_id=1 + place, value=9) for place in range(5)
        ]
    assert "NV964" not in codes(frames, tmp_path)


def test_a_mirror_that_shows_every_telegram_twice_changes_nothing(tmp_path: Path) -> None:
    frames = [*victim(), *slipped_in()]
    twice = [*frames, *(one._replace(ts_ns=one.ts_ns + 2000) for one in frames)]
    (told,) = [one for one in told_in(twice, tmp_path) if one[0] == "NV964"]
    assert told[2] == 27


def test_of_a_victim_that_does_not_count_for_itself_nobody_can_say(tmp_path: Path) -> None:
    odd = [sent(number, 3 * number) for number in range(1, 201)]
    along = [sent(number + 0.5, 3 * number + 1, B, value=9) for number in range(7, 200, 7)]
    assert "NV964" not in codes([*odd, *along], tmp_path)
