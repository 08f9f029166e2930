"""The limit of streams and identifiers: the first ones go on being counted, what is left out is told, however cut."""

from __future__ import annotations

import json
import random
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType, PacketBatch
from dissectors.carried import Carrier
from dissectors.keys import KeyTable
from nvscope.engine.keys import NOBODY, FrameKind
from nvscope.engine.limit import ELSEWHERE, MAX_STREAMS, LeftOut, Missing
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.engine.told import Told
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from tests import program
from tests.engine.test_dealing import at_once_and_joined, shown
from tests.engine.traffic import CHANNELS, batches_of, can_batches, reading_of
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate
from tests.packets import Batches, batch_of, cut, document_of, observed, tracked
from tests.records import replace
from tests.tracker.can.test_state import batch

DATA = (FrameKind.DATA, FrameKind.PDO)
CAPTURE = Path(__file__).parents[2] / "captures" / "plant.pcapng.gz"
LIMITS = st.sampled_from([1, 2, 5, 9, 17, 40])


ANYBODY, OTHERS = "anybody", "others"


def flows_of(state: TrackerState) -> dict[Any, tuple[int, int]]:
    """Return the first frame of each flow, and how many telegrams it has; its receiver is the last part of its key."""
    keys, flows = state.keys, state.lists.flows
    nodes = list(zip(keys.nodes.high.tolist(), keys.nodes.low.tolist(), strict=True))
    found = {}
    for flow in range(len(keys.flows)):
        kind, place, source, destination = (
            int(flows.column(name)[flow]) for name in ("kind", "place", "source", "destination")
        )
        key = (
            kind, keys.list_key(int(keys.places.high[place])), int(keys.places.low[place]),
            None if source < 0 else nodes[source],
            {NOBODY: ANYBODY, ELSEWHERE: OTHERS}.get(destination) or nodes[destination],
        )  # fmt: skip
        found[key] = int(flows.column("first_frame")[flow]), int(flows.column("count")[flow])
    return found


def kept(flows: dict[Any, tuple[int, int]], most: int) -> dict[Any, tuple[int, int]]:
    """Return what is told apart of all flows of a capture."""
    in_order = sorted(flows.items(), key=lambda entry: entry[1])
    others = [entry for entry in in_order if entry[0][0] not in DATA][:most]
    told: dict[Any, tuple[int, int]] = dict(others)
    streams: set[Any] = set()
    further = 0
    for key, (frame, count) in in_order:
        stream = key[:-1]
        begins = stream not in streams
        if key[0] not in DATA or (begins and len(streams) == most):
            continue
        streams.add(stream)
        further += not begins
        known = key if begins or further <= most else (*stream, OTHERS)
        begun, before = told.get(known, (frame, 0))
        told[known] = begun, before + count
    return told


class Asked:
    """Counts the telegrams of the Parameter Manager."""

    by_stream: ClassVar = True
    telegrams = 0

    def observe(self, told: Told) -> None:
        self.telegrams += len(told.laid.parameters)


def counted_with(batches: Sequence[PacketBatch], most: int) -> tuple[TrackerState, int]:
    """Return the state with a limit, and how many telegrams of the Parameter Manager were told apart."""
    state, asked = TrackerState(), Asked()
    for _ in run(Batches(batches, CHANNELS), replace(reading_of(None), max_streams=most), [state, asked]):
        pass
    return state, asked.telegrams


def left_out(state: TrackerState) -> dict[int, int]:
    log = state.capture.left_out
    return dict(zip(log.keys.high.tolist(), log.rows.column("count").tolist(), strict=True))


@given(st.integers(0, 10_000), LIMITS)
@examples(40)
def test_the_first_flows_are_counted_as_without_a_limit_and_the_rest_is_told(seed: int, most: int) -> None:
    batches = batches_of(seed, random.Random(seed))
    (every, asked), (some, asked_some) = (counted_with(batches, number) for number in (1 << 20, most))
    assert flows_of(some) == kept(flows_of(every), most)
    assert not left_out(every)
    elsewhere = sum(count for key, (_, count) in flows_of(some).items() if key[-1] == OTHERS)
    assert int(some.capture.elsewhere.rows.column("count").sum()) == elsewhere
    counted, beyond = (sum(count for _, count in flows_of(state).values()) for state in (every, some))
    told = left_out(some)
    assert counted - beyond + asked - asked_some == told.get(Carrier.UDP, 0) + told.get(Carrier.CAN, 0)
    for name in ("frames", "telegrams", "start_ns", "end_ns"):
        assert getattr(some.capture, name) == getattr(every.capture, name)
    findings = [finding for finding in judge(some) if finding.code == "NV906"]
    asked_for = some.parameters.known
    of_parameters = 0 if asked_for is None else int(asked_for.left_out.rows.column("count").sum())
    beyond = sum(told.values()) + elsewhere + of_parameters
    assert [finding.count for finding in findings] == ([beyond] if beyond else [])


@given(st.integers(0, 10_000), LIMITS, st.randoms(use_true_random=False))
@examples(40)
def test_any_cut_into_batches_gives_the_same_with_a_limit(seed: int, most: int, choice: random.Random) -> None:
    whole = batch_of(generate(seed, frames=choice.choice([20, 200, 500]), link=1))
    cuts = sorted(choice.sample(range(len(whole) + 1), min(len(whole), choice.choice([1, 3, 30]))))
    pieces = [whole[start:stop] for start, stop in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    reading = Reading(max_streams=most)
    assert document_of(tracked(pieces, reading)) == document_of(tracked([whole], reading))


@given(st.integers(0, 10_000), st.integers(2, 5), LIMITS)
@examples(30)
def test_parts_joined_are_the_state_folded_at_once_with_a_limit(seed: int, parts: int, most: int) -> None:
    reading = replace(reading_of(None), max_streams=most)
    whole, joined = at_once_and_joined(batches_of(seed, random.Random(seed)), parts, reading)
    assert shown(joined) == shown(whole)


@given(st.integers(0, 10_000), st.integers(1, 4), LIMITS, st.integers(1, 40))
@examples(30)
def test_of_each_channel_the_first_identifiers_are_told_apart(seed: int, channels: int, most: int, size: int) -> None:
    batches = can_batches(random.Random(seed), channels)
    reading = Reading(max_streams=most)
    every = observed(TrackerState(), batches, Reading(), CHANNELS).buses.load.identifiers
    for pieces in (batches, [piece for whole in batches for piece in cut(whole, size)]):
        some = observed(TrackerState(), pieces, reading, CHANNELS).buses.load.identifiers
        expected: dict[int, list[tuple[int, int, int]]] = defaultdict(list)
        for channel, word, first, frames in zip(
            every.keys.high.tolist(), every.keys.low.tolist(), every.columns.column("first_frame").tolist(),
            every.columns.column("frames").tolist(), strict=True,
        ):  # fmt: skip
            expected[channel].append((first, word, frames))
        kept = {
            (channel, word): frames for channel, own in expected.items() for _, word, frames in sorted(own)[:most]
        }  # fmt: skip
        found = zip(some.keys.high.tolist(), some.keys.low.tolist(), strict=True)
        assert dict(zip(found, some.columns.column("frames").tolist(), strict=True)) == kept
        beyond = {
            channel: sum(frames for *_, frames in sorted(own)[most:]) for channel, own in expected.items()
        }  # fmt: skip
        log = some.left_out
        told = dict(zip(log.keys.high.tolist(), log.rows.column("count").tolist(), strict=True))
        assert told == {channel: frames for channel, frames in beyond.items() if frames}


def test_a_state_that_is_full_keeps_no_further_nodes_lists_or_streams() -> None:
    full = 0
    for seed in range(8):
        keys = tracked([batch_of(generate(seed, frames=400, link=LinkType.ETHERNET))], Reading(max_streams=4)).keys
        is_data = keys.columns.column("stream") >= 0
        data, others = int(is_data.sum()), int((~is_data).sum())
        full += len(keys.streams) == 4 or others == 4
        assert data <= 3 * 4  # the first receiver of each stream, 4 further ones, and all others of each stream
        assert max(others, len(keys.streams), len(keys._partners), len(keys._rejections)) <= 4
        assert len(keys.lists) <= 2 * 4 + 4
        assert len(keys.nodes) <= 2 * 4 + 4 + 2 * 4 + 2 * 4 + 3 * 4
    assert full


def test_the_option_the_project_and_what_is_said(tmp_path: Any) -> None:
    log = tmp_path / "many.log"
    log.write_text("".join(f"({time}.000000) can0 {word:03X}#0102\n" for time in range(3) for word in range(1, 9)))
    shown = program.run("report", log, "--max-streams", "5", "--all").stdout.decode()
    assert "NV906 limit-reached, 9 times" in shown
    assert "The first 5 streams" in shown
    assert "9 data frames of further identifiers" in " ".join(shown.split())
    assert "9 frames are left out of figures or findings: the limit was reached (NV906)" in shown
    assert "NV906" not in program.run("report", log).stdout.decode()
    (tmp_path / "nvscope.toml").write_text("[limits]\nmax_streams = 7\n")
    shown = program.run("report", log, "--project", tmp_path / "nvscope.toml", "--all").stdout.decode()
    assert "NV906 limit-reached, 3 times" in shown


def test_remote_frames_of_further_identifiers_are_told_too() -> None:
    words = [0x4000_0000 | number for number in range(1, 6)]
    frames = [(second, 0, word, b"") for second, word in enumerate(words)]
    state = tracked([batch(frames)], Reading(max_streams=3))
    (finding,) = [finding for finding in judge(state) if finding.code == "NV906"]
    assert finding.count == 2
    assert finding.frames == (4, 5)
    assert len(state.buses.remotes.rows) == 3


def test_a_known_stream_keeps_its_telegrams_whoever_receives_them() -> None:
    known = bytes.fromhex(
        "ffffffffffff02000000000108004500003200000000401100000a0000010a0000ff04b204b2001e0000"
        "002d53330000000007000000010016002a0000001027"
    )
    alone = [bytes([2, 0, 0, 0, 0, last]) + known[6:30] + bytes([10, 0, 0, last]) + known[34:] for last in range(2, 11)]
    sent = [
        datagram[:58] + bytes([counter]) + datagram[59:]
        for counter, datagram in enumerate([known, *alone, known, *alone, alone[0]])
    ]
    frames = [Frame(second, LinkType.ETHERNET, data, len(data)) for second, data in enumerate(sent)]
    for size in (1, 7, len(frames)):
        state = tracked(cut(batch_of(frames), size), Reading(max_streams=1))
        # Broadcasts, those to the first node alone, and those to all others.
        assert [count for _, count in flows_of(state).values()] == [2, 3, 16]
        assert not left_out(state)
        findings = judge(state)
        assert [(finding.code, finding.count) for finding in findings] == [("NV906", 16)]
        assert "16 telegrams to further receivers" in findings[0].message
        (entry,) = summarize(state).lists
        (stream,) = entry.streams
        assert (stream.telegrams, stream.counters["lost"], entry.diagnosis.nSendCount) == (21, 0, 21)
        assert [diagnosis.nReceiveCount for _, diagnosis in entry.nodes] == [0, 3]


def test_nothing_is_called_missing_that_may_be_left_out() -> None:
    """Acknowledgements and boot-up requests of a capture: what is said of them with a limit holds without one, too."""

    def told(most: int) -> set[tuple[Any, ...]]:
        report = json.loads(program.run("report", CAPTURE, "--json", "--max-streams", str(most)).stdout)
        answers = [one for one in report["findings"] if one["code"] in ("NV301", "NV303", "NV304")]
        return {(one["code"], one["list"], one["node"], one["subindex"], one["count"]) for one in answers}

    every = told(200_000)
    some = [told(most) for most in range(1, 12)]
    assert all(part <= every for part in some)
    assert any(some)


def test_lists_that_may_be_left_out_are_not_called_silent_or_incomplete() -> None:
    can = CAPTURE.parent / "can"
    words = ("report", can / "press.log", can / "press.gvl", can / "level.gvl", "--json")

    def told(*more: str) -> set[str]:
        report = json.loads(program.run(*words, *more).stdout)
        return {one["code"] for one in report["findings"]}

    assert "NV604" in told()
    for most in range(1, 6):
        found = told("--max-streams", str(most))
        assert "NV906" in found
        assert not {"NV407", "NV604"} & found


def test_where_too_many_lists_are_left_out_none_is_known_to_be_whole() -> None:
    first, last = (np.arange(MAX_STREAMS, MAX_STREAMS + number, dtype=np.uint64) for number in (1, 2))
    lists = KeyTable(3)
    lists.numbers(
        np.zeros(3, np.uint64), np.zeros(3, np.uint64), np.array([1, MAX_STREAMS, 7 * MAX_STREAMS], np.uint64)
    )
    left_out = LeftOut()
    for identifier, expected in (
        (np.arange(MAX_STREAMS, dtype=np.uint64), [1, 0, 0]),
        (first, [7, 7, 7]),
        (last, [7, 7, 7]),
    ):
        nothing = np.zeros(len(identifier), np.uint64)
        left_out.add(np.full(len(identifier), Missing.DATA, np.uint8), nothing, nothing, identifier)
        assert left_out.of_lists(lists).tolist() == expected
        assert left_out.copied().of_lists(lists).tolist() == expected
