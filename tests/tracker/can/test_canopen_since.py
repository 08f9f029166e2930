"""From which frame on frames are CANopen's: what the whole capture up to there shows, and no later one."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.can.canopen import NO_EVIDENCE, CanOpen, Evidence
from nvscope.tracker.can.canopen_since import CanOpenSince
from tests.laws import examples
from tests.packets import Batches
from tests.packets import cut as pieces_of
from tests.program_here import run_text
from tests.tracker.can.test_canopen import talk
from tests.tracker.can.test_state import Frame, batch

COB_IDS = (0, 0x80, 0x81, 0x82, 0x181, 0x281, 0x602, 0x701, 0x702, 0x77F, 0x7E5, 0x110)


def shown(frames: list[Frame], cut: int, lists: set[int]) -> list[list[bool]]:
    """Return of each frame, as it comes, which COB-IDs are CANopen's on its channel."""
    since, told_of = CanOpenSince(lists), []
    for told in run(Batches(pieces_of(batch(frames), cut)), Reading(), [since]):
        assert told.can is not None
        for row, channel in zip(told.can.row.tolist(), told.can.channel.tolist(), strict=True):
            told_of.append([since.of_frame(channel, cob_id, row + told.first_frame) for cob_id in COB_IDS])
    return told_of


def evidence(frames: list[Frame], lists: set[int]) -> dict[int, Evidence]:
    seen = CanOpen()
    for told in run(Batches([batch(frames)]), Reading(), []):
        assert told.can is not None
        seen.observe(told, told.can)
    return seen.evidence(lists)


@examples(40)
@given(
    st.integers(0, 10_000), st.integers(1, 40), st.sampled_from([1, 7, 100]),
    st.sets(st.sampled_from([0, 0x701, 0x601, 0x581, 0x702])),
)  # fmt: skip
def test_it_is_the_evidence_of_the_capture_up_to_each_frame(seed: int, count: int, cut: int, lists: set[int]) -> None:
    frames = talk(seed, count)
    told = shown(frames, cut, lists)
    assert len(told) == count
    for place, (_, channel, _, _) in enumerate(frames):
        known = evidence(frames[: place + 1], lists).get(channel, NO_EVIDENCE)
        assert told[place] == [known.of_cob_id(cob_id) for cob_id in COB_IDS]


PDOS = "181#0102\n201#00\n080#\n085#2031050000000000\n605#4000100000000000\n7E4#00"
WORDS = ("TPDO", "RPDO", "SYNC", "EMCY", "SDO", "LSS", "heartbeat", "emergency", "node ")


def lines(folder: Path, text: str, *more: str) -> list[str]:
    log = folder / "a.log"
    log.write_text("".join(f"({1_000_000_000 + at}.0) can0 {frame}\n" for at, frame in enumerate(text.split("\n"))))
    done = run_text("packets", log, *more)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.parametrize("form", [(), ("-V",), ("-x",)])
def test_without_evidence_frames_have_no_names_of_canopen(form: tuple[str, ...], tmp_path: Path) -> None:
    text = "\n".join(lines(tmp_path, PDOS, *form))
    assert "181" in text
    assert not [word for word in WORDS if word in text]


@pytest.mark.parametrize("shown_by", ["000#0100", "701#05", "601#4000100000000000\n581#4300100000000000"])
def test_from_the_evidence_on_they_have(shown_by: str, tmp_path: Path) -> None:
    before, behind = "181#0102\n080#", "080#\n181#0102"
    told = lines(tmp_path, f"{before}\n{shown_by}\n{behind}")
    assert [line.split("]")[1].split("  ")[-1].strip() for line in (told[-2], told[-1])] == ["SYNC", "TPDO1 node 1"]
    assert not [word for word in WORDS if word in "\n".join(told[:2])]
    # A filter leaves out what is shown, not what is known.
    assert lines(tmp_path, f"{before}\n{shown_by}\n{behind}", "-Y", "can.id == 0x181")[1] == told[-1]
    tree = "\n".join(lines(tmp_path, f"{before}\n{shown_by}\n{behind}", "-V", "-Y", "can.id == 0x181"))
    assert tree.count("TPDO1 node 1") == 1


def test_heartbeats_of_one_node_name_no_other(tmp_path: Path) -> None:
    told = lines(tmp_path, "701#05\n181#0102\n182#0102\n081#0000000000000000\n082#0000000000000000")
    assert ["node 1" in line for line in told] == [True, True, False, True, False]
    assert "node 2" not in "\n".join(told)


@pytest.mark.parametrize(
    "shown_by",
    [
        "\n".join(f"000#{value:02X}00" for value in range(16)),
        "581#4300100000000000\n601#4000100000000000",
        "601#4000100000000000\n581#4300110000000000",
        "601#0100000000000000\n581#0100000000000000",
    ],
)
def test_what_looks_like_canopen_now_and_then_names_nothing(shown_by: str, tmp_path: Path) -> None:
    told = lines(tmp_path, f"{shown_by}\n080#\n181#0102\n081#0000000000000000")
    assert not [word for word in WORDS if word in "\n".join(told[-3:])]
    done = run_text("report", tmp_path / "a.log", "--json")
    assert '"canopen_nodes": []' in done.stdout
    assert not [word for word in WORDS if word in done.stdout]
