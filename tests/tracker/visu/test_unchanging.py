"""Variables that pages ask for and that never change, against the rules, and whole columns against single values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.tracker.visu.on_demand import VisuState
from tests.analysis.transactions.talk import PANEL, PRESS, post, reply
from tests.laws import examples, some
from tests.oracle.builders import START
from tests.oracle.frame import Frame
from tests.oracle.rules.visu_values import VisuValues, never_changed
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import followed

Told = list[tuple[str, int, list[str], list[str]]]


def told(batches: Iterable[PacketBatch]) -> Told:
    state = followed(batches).others["visu"]
    assert isinstance(state, VisuState)
    found = state.known.unchanging.summary() if state.known else ()
    return sorted((one.server, one.variables, list(one.unchanged), list(one.unreadable)) for one in found)


def by_the_rules(frames: Sequence[Frame]) -> Told:
    rules = VisuValues()
    for frame in frames:
        rules.observe(frame)
    return never_changed(rules)


@pytest.mark.parametrize("seed", some(range(80)))
def test_it_is_what_the_rules_say(seed: int) -> None:
    frames = visu_traffic(seed)
    assert told([batch_of(frames)]) == by_the_rules(frames)


@examples(30)
@given(seed=st.integers(0, 20_000), packets=st.integers(1, 90))
def test_any_cut_gives_the_same(seed: int, packets: int) -> None:
    frames = visu_traffic(seed)
    assert told(cut(batch_of(frames), packets)) == told([batch_of(frames)])


TEXTS = st.sampled_from(("1", "01", "1.0", "???", "22222222", "123456789", "12345678901234567", "x" * 70, "x" * 71, ""))


@examples(60)
@given(
    st.lists(st.tuples(TEXTS, TEXTS), min_size=1, max_size=4),
    st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=6, max_size=24),
)
def test_columns_of_many_replies_are_compared_as_single_values(
    values: list[tuple[str, str]], choices: list[list[bool]]
) -> None:
    # Of each variable two texts; which of them a reply has, now and then another one than before.
    kinds = ("4|0|2|1", "4|4|4|6", "4|8|90|8", "4|99|4|11")
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    body = f"|0|{len(values)}|" + "".join(f"{place}|{kinds[place]}|" for place in range(len(values)))
    for chosen in choices:
        texts = [pair[which] for pair, which in zip(values, chosen, strict=False)]
        line.ask(post(body)).answer(reply(f"|{'|'.join(texts)}|"))
    assert told([batch_of(line.frames)]) == by_the_rules(line.frames)


@pytest.mark.parametrize(
    ("replies", "unchanged", "unreadable"),
    [
        (["|1.5|"] * 4, ["4,4,4,6"], []),  # the second one is in no reply: nobody knows whether it can be read
        (["|1.5|"] * 40, ["4,4,4,6"], []),
        (["|1.5|???|"] * 4, ["4,4,4,6"], ["4,8,2,1"]),
        (["|1.5|???|"] * 40, ["4,4,4,6"], ["4,8,2,1"]),
        (["|1.5|", "|???|???|"], [], ["4,8,2,1"]),  # told once: that it never changed says nothing
        (["|1.5|7|", *["|???|???|"] * 40], [], []),
        (["|"] * 3, [], []),
        (["|???|"] * 9, [], ["4,4,4,6"]),
    ],
)
def test_what_is_in_no_reply_is_neither_unreadable_nor_unchanged(
    replies: list[str], unchanged: list[str], unreadable: list[str]
) -> None:
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    for body in replies:
        line.ask(post("|0|2|0|4|4|4|6|1|4|8|2|1|")).answer(reply(body))
    found = told([batch_of(line.frames)])
    assert found == by_the_rules(line.frames)
    assert found == ([(PRESS, 2, unchanged, unreadable)] if unchanged or unreadable else [])
