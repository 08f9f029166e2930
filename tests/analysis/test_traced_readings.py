"""Traces of variables of databases and of pages: the values of their history, and a gap is not a line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.read_values import last_values, meant, value_history
from nvscope.analysis.traced_readings import TracedReadings
from nvscope.analysis.tracing import Trace, Tracing
from nvscope.analysis.watching import Scene, Watching, scene_at, scenes_by_second
from nvscope.definition.project import Project
from nvscope.view.documents.read_rows import last_rows, row_of_reading
from nvscope.view.lines.read_rows import ReadRow
from nvscope.view.lines.variable_rows import VariableRows
from tests.analysis.transactions.talk import PANEL as PANEL_AT
from tests.analysis.transactions.talk import PRESS, post, reply
from tests.laws import examples
from tests.oracle.builders import START
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of
from tests.records import replace
from tests.tracker.datalogger.logs import Row, write_log
from tests.tracker.visu.test_names import listed, loads

CAPTURES = Path(__file__).parents[2] / "captures"
GENUINE = str(CAPTURES / "datalogger" / "genuine-5min.db")
PANEL = str(CAPTURES / "visu" / "panel.pcap")


def row_of(scene: Scene, name: str) -> ReadRow:
    rows = VariableRows(scene.variables, read_ones=scene.read_ones)
    found = [row for row in map(rows.row, range(len(rows))) if row.name == name]
    assert isinstance(found[0], ReadRow)
    return found[0]


def traced(row: ReadRow) -> TracedReadings:
    return TracedReadings(row.group.key.source, row.variable, row.has_numbers, row.hidden_frame)


def read(tracing: Tracing, scene: Scene) -> Trace:
    return list(tracing.read(scene))[-1]


def whole(*paths: str) -> Scene:
    scene = scene_at(Inquiry(list(paths), Project()), None)
    assert scene is not None
    return scene


def trace_of(path: str, name: str) -> Trace:
    scene = whole(path)
    return read(Tracing(traced(row_of(scene, name))), scene)


def gaps(trace: Trace) -> list[int]:
    """Return the frames of the values in front of which there is a gap."""
    return trace.frame[1:][np.diff(trace.run) > 0].tolist()


def history_of(path: str, name: str) -> list[tuple[int, float]]:
    """Return the frames and values that ``vars --history --all`` has."""
    history = value_history(meant(name), every=True)
    rows = []
    inquiry = Inquiry([path], Project())
    for _ in inquiry.run(inquiry.open(), [history]):
        for known in history.known.values():
            rows += [row_of_reading(entry) for entry in known.entries()]
    return [(row["frame"], row["new"]) for row in rows]


@pytest.mark.parametrize(
    ("path", "name"),
    [(GENUINE, "Arp.Plc.Eclr/I_2_IN01"), (PANEL, "PLC_PRG.iCount"), (PANEL, "PLC_PRG.rActual"), (PANEL, ".OUT0")],
)
def test_a_trace_has_the_values_of_the_history(path: str, name: str) -> None:
    trace, told = trace_of(path, name), history_of(path, name)
    assert len(told) > 10
    # A database says in its rows what has not changed, too.
    of_frame = dict(zip(trace.frame.tolist(), trace.value.tolist(), strict=True))
    assert [(frame, of_frame[frame]) for frame, _ in told] == told


def test_scene_by_scene_it_is_the_same_as_at_once() -> None:
    for path, name in ((GENUINE, "Arp.Plc.Eclr/I_2_IN01"), (PANEL, "PLC_PRG.iCount")):
        scenes = list(scenes_by_second(Inquiry([path], Project())))
        of = traced(row_of(scenes[-1], name))
        at_once, bit_by_bit = read(Tracing(of), scenes[-1]), Tracing(of)
        for scene in scenes:
            trace = read(bit_by_bit, scene)
        for column in ("time_ns", "frame", "value", "run"):
            assert getattr(trace, column).tolist() == getattr(at_once, column).tolist()
        past = read(bit_by_bit, scenes[len(scenes) // 2])
        assert int(past.time_ns[-1]) <= (scenes[len(scenes) // 2].at_ns or 0)


def test_what_the_ring_let_go_is_no_more_in_the_trace() -> None:
    scenes = list(scenes_by_second(Inquiry([GENUINE], Project()), Watching(ring_bytes=30_000)))
    last, tracing = scenes[-1], Tracing(traced(row_of(scenes[-1], "Arp.Plc.Eclr/I_2_IN01")))
    for scene in scenes:
        trace = read(tracing, scene)
    assert last.recent.passed > 0
    assert len(trace.frame) > 10
    assert (trace.frame >= last.recent.first_frame).all()
    assert trace.value.tolist() == read(Tracing(tracing.traced), last).value.tolist()


@examples(60)
@given(st.lists(st.tuples(st.integers(0, 2), st.sampled_from([1, 1, 1, 0])), min_size=1, max_size=40))
def test_where_only_changes_are_stored_a_value_lasts_until_data_was_lost(samples: list[tuple[int, int]]) -> None:
    rows = [Row(100 * place, (value, place), consistent) for place, (value, consistent) in enumerate(samples)]
    with TemporaryDirectory() as directory:
        path = write_log(Path(directory) / "x.db", [("v", "INT"), ("n", "INT")], rows, only_changes=True)
        trace = trace_of(path, "v")
    expected: list[tuple[int, int]] = []
    parted: list[int] = []
    before, known, lost = None, False, False
    for frame, (value, consistent) in enumerate(samples, 1):
        if not consistent and frame > 1:
            known, lost = False, True
        if value != before:
            known = True
        before = value
        if known:
            expected.append((frame, value))
            if lost:
                parted.append(frame)
            lost = False
    assert list(zip(trace.frame.tolist(), trace.value.tolist(), strict=True)) == expected
    assert gaps(trace) == parted


def every_100_ms(places: Sequence[int], lost: Sequence[int] = ()) -> list[Row]:
    return [Row(100 * place, (place,), 0 if place in lost else 1) for place in places]


def test_where_each_row_is_stored_missing_ones_part_a_trace(tmp_path: Path) -> None:
    there = [place for place in range(60) if place not in (20, 40, 41)]
    path = write_log(tmp_path / "x.db", [("v", "INT")], every_100_ms(there, lost=[50]))
    trace = trace_of(path, "v")
    assert trace.value.tolist() == there
    assert [there[frame - 1] for frame in gaps(trace)] == [21, 42, 50]


def test_rows_at_no_regular_interval_are_not_missing(tmp_path: Path) -> None:
    # Each comes after twice as long as the one before, up to a minute, again and again.
    times = np.cumsum([1 << place % 16 for place in range(100)]).tolist()
    path = write_log(tmp_path / "x.db", [("v", "INT")], [Row(at, (at,), 1) for at in times])
    assert gaps(trace_of(path, "v")) == []


def test_null_and_texts_are_no_points(tmp_path: Path) -> None:
    values = [1, None, 2.5, "x", 3, 4]
    path = write_log(tmp_path / "x.db", [("v", "INT")], [Row(100 * at, (one,)) for at, one in enumerate(values)])
    trace = trace_of(path, "v")
    assert trace.value.tolist() == [1.0, 2.5, 3.0, 4.0]
    assert gaps(trace) == [3, 5], "nobody knows a number while it was a text, or unknown"
    path = write_log(tmp_path / "y.db", [("v", "INT")], [Row(100 * at, (one,)) for at, one in enumerate([1, 2, None])])
    row = row_of(whole(path), "v")
    assert (row.text, row.readings, row.bounds, row.last_frame) == ("unknown", 2, ("1", "2"), 3)


def test_databases_of_one_name_are_told_apart(tmp_path: Path) -> None:
    paths = []
    for number in range(2):
        (tmp_path / str(number)).mkdir()
        rows = [Row(100 * at + number, (number,)) for at in range(5)]
        paths.append(write_log(tmp_path / str(number) / "x.db", [("v", "INT")], rows))
    scene = whole(*paths)
    rows_seen = VariableRows((), read_ones=scene.read_ones)
    assert len(rows_seen) == 2
    for place in range(2):
        row = rows_seen.row(place)
        assert isinstance(row, ReadRow)
        assert set(read(Tracing(traced(row)), scene).value.tolist()) == {int(row.text)}
        # Where the ring begins with a row of the second one, that is the first one there.
        chunks = [*scene.recent.pieces(2, 3), *scene.recent.pieces(3)]
        later = replace(scene, recent=replace(scene.recent, chunks=chunks))
        assert set(read(Tracing(traced(row)), later).value.tolist()) == {int(row.text)}


def test_what_is_a_password_or_was_one_is_not_traced() -> None:
    scene = whole(PANEL)
    secret, other = row_of(scene, ".CurrentPassword"), row_of(scene, "PLC_PRG.iCount")
    assert (secret.text, secret.bounds, secret.has_numbers) == ("(hidden)", None, False)
    assert (other.hidden_frame, other.is_hidden) == (0, False)
    every = read(Tracing(traced(other)), scene)
    frame = int(every.frame[5])
    hidden = TracedReadings("visu", other.variable, True, frame)
    assert read(Tracing(hidden), scene).frame.tolist() == every.frame[6:].tolist()


def test_where_a_password_was_before_another_download_its_values_are_told_nowhere() -> None:
    line = Line((PANEL_AT, 50_000), (PRESS, 80), now=START).open()
    loads(line, listed({".CurrentPassword": "4,8,4,4", "PLC_PRG.n": "4,100,4,4"}))
    for value in (4711, 4712):
        line.ask(post("|0|1|0|4|8|4|4|")).answer(reply(f"|{value}|"))
    loads(line, listed({"PLC_PRG.nPieces": "4,8,4,4", "PLC_PRG.n": "4,104,4,4"}))
    for value in (5, 6, 7):
        line.ask(post("|0|1|0|4|8|4|4|")).answer(reply(f"|{value}|"))
    scene = scene_at(Inquiry(Batches([batch_of(line.frames)]), Project()), None)
    assert scene is not None
    row = row_of(scene, "PLC_PRG.nPieces")
    assert (row.text, row.is_hidden, row.bounds) == ("7", False, None)
    # Without the frames in front of them, nobody knows of what list the first values were.
    later = replace(scene, recent=replace(scene.recent, chunks=list(scene.recent.pieces(_frame_of(line, b"|4711|")))))
    for one in (scene, later):
        assert read(Tracing(traced(row)), one).value.tolist() == [5, 6, 7]
    # Whoever has read all of it knows by the values themselves.
    assert read(Tracing(replace(traced(row), hidden_frame=0)), scene).value.tolist() == [5, 6, 7]
    observer = last_values(meant(None))
    inquiry = Inquiry(Batches([batch_of(line.frames)]), Project())
    for _ in inquiry.run(inquiry.open(), [observer]):
        pass
    shown, all_of_it = (last_rows(observer.known, secrets=secrets)["page_variables"][0] for secrets in (False, True))
    assert (shown["value"], shown["min"], all_of_it["max"]) == (7, None, 4712)


def _frame_of(line: Line, content: bytes) -> int:
    """Return the number of the frame before the one that holds some bytes: the request that this answers."""
    return next(number for number, frame in enumerate(line.frames) if content in bytes(frame.data))
