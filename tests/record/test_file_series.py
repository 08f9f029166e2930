"""A recording as one file after the other: nothing is lost or twice between them, and each is as the rule says."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.open import open_source
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.record.file_series import FileRule
from nvscope.record.recorder import Recorder, Recording
from tests.laws import examples
from tests.packets import Batches, cut
from tests.record.test_recorder import PLANT, packets_of

SECOND_NS = 1_000_000_000
FRAMES = 300


def recorded(
    folder: Path, rule: FileRule, *, size: int = 50, frames: int = FRAMES, suffix: str = "pcapng"
) -> Recording:
    """Record the first frames of the plant by a rule, and return what the recorder says of it."""
    (whole,) = open_source([str(PLANT)])
    recorder = Recorder(rule=rule)
    recorder.start(str(folder / f"run.{suffix}"))
    for _ in run(Batches(cut(whole[:frames], size)), Reading(), [recorder]):  # type: ignore[arg-type]
        pass
    state = recorder.stop()
    assert state is not None
    return state


def files_in(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


RULES = st.builds(
    FileRule,
    st.none() | st.integers(1, 8).map(lambda seconds: seconds * SECOND_NS),
    st.none() | st.integers(1, 120),
    st.none() | st.integers(200, 20_000),
)


@examples(30)
@given(RULES, st.integers(1, FRAMES), st.sampled_from(["pcapng", "pcap"]))
def test_the_files_together_are_what_was_told(rule: FileRule, size: int, suffix: str) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        state = recorded(folder, rule, size=size, suffix=suffix)
        parts = [packets_of(path) for path in files_in(folder)]
        assert [packet for part in parts for packet in part] == packets_of(PLANT)[:FRAMES]
        assert (state.frames, state.files, state.failure) == (FRAMES, len(parts), "")
        assert state.bytes >= sum(path.stat().st_size for path in files_in(folder)) - 200 * len(parts)
        for part in parts:
            assert part
            assert rule.packets is None or len(part) <= rule.packets
            assert rule.duration_ns is None or part[-1][1] - part[0][1] < rule.duration_ns
        for path in files_in(folder)[:-1]:
            one_packet = 1600
            assert rule.size_bytes is None or path.stat().st_size <= rule.size_bytes + one_packet


@pytest.mark.parametrize("size", [1, 7, 300])
def test_where_a_file_ends_hangs_on_packets_and_not_on_batches(size: int, tmp_path: Path) -> None:
    recorded(tmp_path, FileRule(packets=40, duration_ns=SECOND_NS), size=size)
    walked: list[list[int]] = [[]]
    for _, ts_ns in packets_of(PLANT)[:FRAMES]:
        if len(walked[-1]) == 40 or (walked[-1] and ts_ns - walked[-1][0] >= SECOND_NS):
            walked.append([])
        walked[-1].append(ts_ns)
    assert [[ts_ns for _, ts_ns in packets_of(path)] for path in files_in(tmp_path)] == walked
    assert len({len(part) for part in walked}) > 2


def test_files_are_named_as_those_of_tshark(tmp_path: Path) -> None:
    state = recorded(tmp_path, FileRule(packets=100))
    names = [path.name for path in files_in(tmp_path)]
    assert all(re.fullmatch(rf"run_0000{number}_20\d{{12}}\.pcapng", name) for number, name in enumerate(names, 1))
    assert len(names) == 3
    assert state.path == str(tmp_path / names[-1])


def test_of_too_many_files_the_oldest_ones_go_and_nobody_elses(tmp_path: Path) -> None:
    mine = tmp_path / "run_00001_20200101000000.pcapng"
    mine.write_text("mine")
    state = recorded(tmp_path, FileRule(packets=50, files=2))
    assert (state.frames, state.files) == (FRAMES, 6)
    assert mine.read_text() == "mine"
    mine.unlink()
    left = [packet for path in files_in(tmp_path) for packet in packets_of(path)]
    assert left == packets_of(PLANT)[FRAMES - 100 : FRAMES]


def test_without_a_rule_it_is_one_file_of_the_name_that_was_given(tmp_path: Path) -> None:
    assert recorded(tmp_path, FileRule()).path == str(tmp_path / "run.pcapng")


def test_a_full_disk_leaves_whole_files(small_disk: Path) -> None:
    state = recorded(small_disk, FileRule(size_bytes=10_000), frames=1212)
    assert "No space left" in state.failure
    whole = [packet for path in files_in(small_disk) for packet in packets_of(path)]
    assert whole == packets_of(PLANT)[: state.frames]
    assert state.frames > 100
