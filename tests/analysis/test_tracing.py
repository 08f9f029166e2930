"""Traces: what a variable was, read from the frames that scenes hold, is what a history of the capture tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.history import Changes
from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.traced_telegrams import TracedElement
from nvscope.analysis.tracing import Trace, Tracing
from nvscope.analysis.watching import Scene, Watching, scene_at, scenes_by_second
from nvscope.definition.project_file import read_project
from nvscope.view.lines.variable_rows import VariableRow, VariableRows
from tests.fuzz.definition_floods import gvl
from tests.laws import examples
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "captures" / "peers"
CAN = ROOT / "captures" / "can"
NOMINAL_NS = 50_000_000


def inquiry_into(capture: Path, *definitions: Path) -> Inquiry:
    return Inquiry([str(capture)], read_project(None, [str(path) for path in definitions]))


def peers() -> Inquiry:
    return inquiry_into(PEERS / "peers.pcap", PEERS / "axis.gvl", PEERS / "axis_types.st", PEERS / "batch.gvl")


def traced(scene: Scene, name: str) -> TracedElement:
    rows = VariableRows(scene.variables)
    row = next(row for row in map(rows.row, range(len(rows))) if row.name == name)
    assert isinstance(row, VariableRow)
    key = row.group.key
    return TracedElement(key.list, key.subindex, key.sender, row.known.layout, row.place)


def read(tracing: Tracing, scene: Scene, nominal_ns: int | None = None) -> Trace:
    return list(tracing.read(scene, nominal_ns))[-1]


def whole(inquiry: Inquiry, how: Watching | None = None) -> Scene:
    scene = scene_at(inquiry, None, how or Watching())
    assert scene is not None
    return scene


@pytest.mark.parametrize("name", ["bStart", "nSpeed", "stAxis.pos", "level", "t"])
def test_a_trace_has_the_values_of_the_history(name: str) -> None:
    inquiry = peers()
    trace = read(Tracing(traced(scene := whole(inquiry), name)), scene, NOMINAL_NS)
    told = [(entry.frame, entry.time_ns, entry.now) for entry in Changes(inquiry, name, every=True)]
    values = trace.value.astype(trace.value.dtype.newbyteorder("<"))
    assert len(told) > 100
    assert list(zip(trace.frame.tolist(), trace.time_ns.tolist(), [one.tobytes() for one in values], strict=True)) == [
        (frame, time_ns, bytes([any(now)]) if name == "bStart" else now) for frame, time_ns, now in told
    ]
    assert set(trace.run.tolist()) == {1}, "nothing was lost"


def test_frames_of_can_have_traces_too() -> None:
    inquiry = inquiry_into(CAN / "press.log", CAN / "press.gvl", CAN / "level.gvl")
    trace = read(Tracing(traced(scene := whole(inquiry), "v2")), scene, NOMINAL_NS)
    told = [int.from_bytes(entry.now, "little") for entry in Changes(inquiry, "press:v2", every=True)]
    assert trace.value.tolist() == told
    # Two frames of this COB-ID were lost (captures/can/press.toml).
    assert [int(value) for value in trace.value[1:][np.diff(trace.run) > 0]] == [60, 90]


def test_scene_by_scene_it_is_the_same_as_at_once() -> None:
    inquiry = peers()
    scenes = list(scenes_by_second(inquiry))
    at_once = read(Tracing(traced(scenes[-1], "stAxis.pos")), scenes[-1], NOMINAL_NS)
    bit_by_bit = Tracing(at_first := traced(scenes[-1], "stAxis.pos"))
    assert at_first.has_numbers
    for scene in scenes:
        trace = read(bit_by_bit, scene, NOMINAL_NS)
        assert trace.stop_frame == scene.recent.stop_frame
    for column in ("time_ns", "frame", "value", "run"):
        assert getattr(trace, column).tolist() == getattr(at_once, column).tolist()


def test_a_scene_of_the_past_has_the_past_alone() -> None:
    scenes = list(scenes_by_second(peers()))
    tracing = Tracing(traced(scenes[-1], "nSpeed"))
    read(tracing, scenes[-1])
    past = read(tracing, scenes[3])
    assert past.time_ns.tolist() == read(Tracing(tracing.traced), scenes[3]).time_ns.tolist()
    assert int(past.time_ns[-1]) <= (scenes[3].at_ns or 0)


def test_what_the_ring_let_go_is_no_more_in_the_trace() -> None:
    inquiry = peers()
    tracing = None
    for scene in scenes_by_second(inquiry, Watching(ring_bytes=60_000)):
        if scene.variables and tracing is None:
            tracing = Tracing(traced(scene, "nSpeed"))
        if tracing is not None:
            trace = read(tracing, scene)
            assert (trace.frame >= scene.recent.first_frame).all()
    assert tracing is not None
    assert scene.recent.passed > 0
    assert trace.frame.tolist() == read(Tracing(tracing.traced), scene).frame.tolist()


def test_where_telegrams_were_lost_the_trace_is_parted(tmp_path: Path) -> None:
    capture = simulated(ROOT / "tests" / "scenarios" / "loss.toml").write(tmp_path / "loss.pcapng")
    (tmp_path / "axis.gvl").write_text(gvl("v : ARRAY[0..21] OF UDINT;", 7))
    scene = whole(inquiry_into(capture, tmp_path / "axis.gvl"))
    trace = read(Tracing(traced(scene, "v[0]")), scene, NOMINAL_NS)
    # Telegrams 40 and 100 to 102 (tests/scenarios/loss.toml): in front of frames 40 and 99.
    assert trace.frame[1:][np.diff(trace.run) > 0].tolist() == [40, 99]


@examples(30)
@given(st.integers(4, 100))
def test_few_points_keep_the_extremes(most: int) -> None:
    inquiry = peers()
    scene = _PEERS_AT_END.setdefault("scene", whole(inquiry))
    of = traced(scene, "nSpeed")
    every, few = read(Tracing(of), scene), read(Tracing(of, most_points=most), scene)
    assert few.thinned
    assert len(few.value) <= most
    assert (few.value.min(), few.value.max()) == (every.value.min(), every.value.max())
    known = set(zip(every.time_ns.tolist(), every.value.tolist(), strict=True))
    assert set(zip(few.time_ns.tolist(), few.value.tolist(), strict=True)) <= known
    assert few.time_ns.tolist() == sorted(few.time_ns.tolist())


_PEERS_AT_END: dict[str, Scene] = {}
