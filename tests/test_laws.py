"""The laws that hold for any traffic."""

from __future__ import annotations

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.findings.catalogue import CATALOGUE
from nvscope.tracker.diagnosis import DiagError
from nvscope.tracker.figures import LIST_COUNTERS
from tests.laws import examples
from tests.oracle.builders import LINKS
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of, document_of, tracked


def traffic(seed: int) -> list[Frame]:
    choice = random.Random(seed)
    frames = generate(seed, frames=choice.choice([20, 200, 500]), link=choice.choice([1, None]))
    return mutate(seed, frames) if choice.random() < 0.3 else frames


@given(st.integers(0, 10_000), st.randoms(use_true_random=False))
@examples(40)
def test_any_cut_into_batches_gives_the_same_report(seed: int, choice: random.Random) -> None:
    whole = batch_of(traffic(seed))
    cuts = sorted(choice.sample(range(len(whole) + 1), min(len(whole), choice.choice([1, 3, 30]))))
    pieces = [whole[start:stop] for start, stop in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    assert document_of(tracked(pieces)) == document_of(tracked([whole]))


@given(st.integers(0, 10_000))
@examples(8)
def test_packets_one_by_one_give_the_same_report(seed: int) -> None:
    whole = batch_of(traffic(seed)[:150])
    pieces = [whole[row : row + 1] for row in range(len(whole))]
    assert document_of(tracked(pieces)) == document_of(tracked([whole]))


def any_packet(content: bytes, link: int, cut: int, ts_ns: int) -> Frame:
    return Frame(ts_ns, link, content, len(content) + cut)


PACKETS = st.builds(
    any_packet,
    st.one_of(
        st.binary(max_size=120),
        st.binary(max_size=60).map(lambda rest: bytes.fromhex("ffffffffffff0200000000010800450000") + rest),
        st.binary(max_size=60).map(lambda rest: bytes.fromhex("002d533300000000") + rest),
    ),
    st.sampled_from([*LINKS, 0, 1, 227, 65535]),
    st.integers(0, 5),
    st.integers(-(2**62), 2**62),
)


@given(st.lists(PACKETS, min_size=1, max_size=40))
@settings(deadline=None)
def test_any_bytes_are_accounted_for(frames: list[Frame]) -> None:
    capture = document_of(tracked([batch_of(frames)]))["capture"]
    assert capture["telegrams"] + capture["other_frames"] == capture["frames"] == len(frames)


@given(st.integers(0, 10_000), st.integers(0, 10_000))
@examples(40)
def test_mutated_traffic_is_accounted_for(seed: int, mutation: int) -> None:
    frames = mutate(mutation, generate(seed, frames=150, link=None))
    capture = document_of(tracked([batch_of(frames)]))["capture"]
    assert capture["telegrams"] + capture["other_frames"] == capture["frames"] == len(frames)


def test_traffic_shows_every_counter_and_error() -> None:
    """The laws above are worth something only if the traffic has everything in it."""
    counted: set[str] = set()
    errors: set[str] = set()
    codes: set[str] = set()
    for seed in range(120):
        document = document_of(tracked([batch_of(traffic(seed))]))
        codes |= {finding["code"] for finding in document["findings"]}
        for entry in document["lists"]:
            counted |= {name for name, number in entry["counters"].items() if number}
            errors |= {node["diag"]["sLastError"] for node in entry["nodes"]} | {entry["diag"]["sLastError"]}
    assert counted == {counter.name for counter in LIST_COUNTERS}
    observable = {error.name for error in DiagError if error < DiagError.UDPNETWORKMANAGER_NOT_READY}
    assert errors == observable
    assert {code for code in CATALOGUE if code < "NV305"} <= codes


def test_empty_batches_change_nothing() -> None:
    whole = batch_of(traffic(1))
    nothing: PacketBatch = whole[0:0]
    assert document_of(tracked([nothing, whole, nothing])) == document_of(tracked([whole]))
