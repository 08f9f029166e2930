"""Who asks for whom by ARP, against a look at one question after the other."""

from __future__ import annotations

from collections import defaultdict
from ipaddress import ip_address

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.addresses import addresses_of
from dissectors.batch import LinkType, PacketBatch
from dissectors.headers import IPV4_LOW
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.evidence.presence import Presence
from nvscope.tracker.evidence.questions import CLOSE_NS, LASTING_NS, Questions
from tests.causes.drawn.packets import Port, arp
from tests.laws import examples
from tests.packets import Batches, cut

START_NS = 1_700_000_000_000_000_000
MS_NS = 1_000_000
PORTS = [Port(bytes([2, 0, 0, 0, 0, number]), f"10.0.0.{number}", vlan=number % 2 * 42) for number in range(1, 4)]
QUESTIONS = st.lists(st.tuples(st.sampled_from([100, 1000, 1450, 1550]), st.integers(0, 2), st.integers(0, 2)))
Span = tuple[int, int]


def asked(questions: list[tuple[int, int, int]]) -> PacketBatch:
    times_ns = START_NS + np.cumsum([wait_ms * MS_NS for wait_ms, _, _ in questions], dtype=np.int64)
    frames = [arp(PORTS[asker], PORTS[sought].ip) for _, asker, sought in questions]
    return PacketBatch.of(frames, LinkType.ETHERNET, times_ns)


def unanswered(batches: list[PacketBatch], **limits: int) -> tuple[list[tuple[str, str, int, int]], Questions]:
    presence = Presence(**limits)
    for _ in run(Batches(batches), Reading(), [presence]):
        presence.settle()
    asker, sought, *span = (one.tolist() for one in presence.questions.unanswered())
    names = [[str(ip_address(one - int(IPV4_LOW))) for one in who] for who in (asker, sought)]
    return list(zip(*names, *span, strict=True)), presence.questions


@given(QUESTIONS, st.integers(1, 5))
@examples(60)
def test_spans_are_those_of_one_question_after_the_other(questions: list[tuple[int, int, int]], packets: int) -> None:
    whole = asked(questions)
    expected: dict[tuple[str, str], list[list[int]]] = defaultdict(list)
    for time_ns, (_, asker, sought) in zip(whole.ts_ns.tolist(), questions, strict=True):
        if asker != sought:  # who asks for itself tells where it is
            spans = expected[PORTS[asker].ip, PORTS[sought].ip]
            if spans and time_ns - spans[-1][1] <= CLOSE_NS:
                spans[-1][1] = time_ns
            else:
                spans.append([time_ns, time_ns])
    lasting = [(*pair, *span) for pair, spans in expected.items() for span in spans if span[1] - span[0] >= LASTING_NS]
    told, table = unanswered(cut(whole, packets))
    assert sorted(told) == sorted(lasting)
    assert table.left_out == 0


@pytest.mark.parametrize(("pairs", "told"), [(1, 1), (2, 2)])
def test_of_too_many_pairs_the_first_are_kept_and_the_others_counted(pairs: int, told: int) -> None:
    table = Questions(pairs, 100)

    whole = asked([(1000, 0, 1), (0, 0, 2)] * 3)
    table.observe(addresses_of(whole), whole.ts_ns)
    assert len(table.unanswered()[0]) == told
    assert table.left_out == 6 - 3 * told


def test_while_nobody_listens_no_span_goes_on() -> None:
    table = Questions(10, 100)

    for part in cut(asked([(900, 0, 1)] * 4), 2):
        table.observe(addresses_of(part), part.ts_ns)
        table.begin_anew()
    assert len(table.unanswered()[0]) == 0
