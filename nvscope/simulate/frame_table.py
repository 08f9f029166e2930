"""FrameTable: every frame of a scenario in the order of the capture, as columns and patterns.

Bytes come into being only when a batch is rendered; until then a frame takes about 130 bytes of memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I32, I64, U8, U16, Bool
from nvscope.simulate.absence import captured_rows, present_rows
from nvscope.simulate.answers import Answers
from nvscope.simulate.draft import Draft
from nvscope.simulate.faults import Label, Struck, make_journey, struck_by_faults
from nvscope.simulate.incidents import Mirrored
from nvscope.simulate.parameters import add_parameters
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.schedule import FRAME_GAP_NS, Stream, Writer, make_schedule
from nvscope.simulate.strangers import add_malformed, add_scans, add_searches, add_short_headers, add_traffic
from nvscope.simulate.telegram_faults import Malformed, UnexpectedAcknowledgement, Unreachable
from nvscope.simulate.template import Role, Template
from nvscope.simulate.visu.frames import add_pages


class FrameTable(Struct, frozen=True):
    """The frames of a scenario, shape (n,), in the order of the capture.

    ``ordinal``, ``counter``, ``flags`` and ``checksum`` fill the template. ``label``, ``number`` and ``epoch`` are what
    is true of data telegrams (``faults.Label``, ``Schedule``). ``captured`` bytes of a frame are kept. By stream,
    ``sequence_of`` tells what its counter runs through, ``sent_of`` how many telegrams are sent. ``struck`` are the
    telegrams that faults struck, by their places in the scenario.
    """

    writers: tuple[Writer, ...]
    streams: tuple[Stream, ...]
    sequence_of: I64
    sent_of: I64
    struck: dict[str, Struck]
    templates: tuple[Template, ...]
    ts_ns: I64
    template: I32
    ordinal: I32
    counter: U16
    flags: U8
    checksum: U8
    label: U8
    number: I32
    epoch: I32
    captured: I32

    def __len__(self) -> int:
        return len(self.ts_ns)


def make_frame_table(scenario: Scenario) -> FrameTable:
    """Return all frames of a scenario; ConfigurationError where its faults contradict each other."""
    schedule = make_schedule(scenario)
    journey = make_journey(scenario, schedule)
    struck = struck_by_faults(scenario, schedule, journey)
    draft = Draft(scenario, schedule, journey)
    draft.add_telegrams()
    answers = Answers(draft)
    for position, reader in enumerate(scenario.reader):
        answers.add_acknowledgements(position, reader)
        answers.add_boot_up_requests(reader)
    for place, fault in scenario.selections():
        if isinstance(fault, Malformed):
            add_malformed(draft, fault, place)
        elif isinstance(fault, UnexpectedAcknowledgement):
            answers.add_unexpected(fault, place)
        elif isinstance(fault, Unreachable):
            answers.add_unreachable(fault, place)
    add_short_headers(draft)
    del answers  # what they remember takes memory
    add_traffic(draft)
    add_searches(draft)
    add_scans(draft)
    add_parameters(draft)
    add_pages(draft)
    del schedule, journey
    return _finished(draft, struck)


def _finished(draft: Draft, struck: dict[str, Struck]) -> FrameTable:
    """Return everything in the order of the capture, with its clock. The draft is of no use afterwards."""
    scenario, writers, streams = draft.scenario, draft.schedule.writers, draft.schedule.streams
    sequence_of = np.zeros(max(len(streams), 1), np.int64)
    sequence_of[draft.schedule.stream] = draft.schedule.sequence
    sent_of = np.bincount(draft.schedule.stream, minlength=len(streams))
    del draft.schedule, draft.journey, draft.row_template
    columns = {name: np.concatenate(draft.pieces.pop(name)) for name in list(draft.pieces)}
    if scenario.power_off or scenario.unplugged:
        columns = _chosen(columns, present_rows(draft, columns["ts_ns"], columns["template"]))
    for position, mirrored in enumerate(scenario.mirrored):
        if not scenario.wild and mirrored.delay_ns >= _shortest_interval(columns, draft.templates):
            raise scenario.error(
                f"mirrored[{position}].delay",
                "a copy must come before the next telegram of its stream, list and SubIndex of a sender",
            )
        columns = _doubled(columns, mirrored, draft.templates)
    if scenario.capture_loss:
        columns = _chosen(columns, captured_rows(scenario, columns["ts_ns"]))
    order = np.argsort(columns["ts_ns"], kind="stable")
    for name in columns:
        columns[name] = columns[name][order]
    del order
    true_ns = columns.pop("ts_ns")
    ts_ns = true_ns + scenario.start_ns
    for step in scenario.clock_step:
        ts_ns[true_ns >= step.at_ns] += step.by_ns
    if len(ts_ns) and ts_ns.min() < 0:
        raise scenario.error("clock_step", "the clock would show a time before 1970")
    captured = _captured(columns, draft)
    return FrameTable(
        writers, streams, sequence_of, sent_of, struck, tuple(draft.templates), ts_ns, captured=captured, **columns
    )


def _chosen(columns: dict[str, npt.NDArray[Any]], rows: Bool) -> dict[str, npt.NDArray[Any]]:
    return {name: column[rows] for name, column in columns.items()}


def _shortest_interval(columns: dict[str, npt.NDArray[Any]], templates: list[Template]) -> int:
    """Return how close to each other the data telegrams of one stream come at most, and a frame's gap where none do."""
    stream_of = np.array([entry.stream if entry.role == Role.DATA else -1 for entry in templates] or [-1], np.int64)
    stream = stream_of[columns["template"]]
    rows = np.flatnonzero(stream >= 0)
    rows = rows[np.lexsort((columns["ts_ns"][rows], stream[rows]))]
    again = np.diff(stream[rows]) == 0
    shortest: int = np.diff(columns["ts_ns"][rows])[again].min(initial=np.iinfo(np.int64).max)
    return int(shortest) if again.any() else FRAME_GAP_NS


def _doubled(
    columns: dict[str, npt.NDArray[Any]], mirrored: Mirrored, templates: list[Template]
) -> dict[str, npt.NDArray[Any]]:
    """Return the frames and behind them those that the mirror port shows again."""
    data = np.array([template.role == Role.DATA for template in templates] or [False], np.bool_)
    inside = columns["ts_ns"] >= mirrored.from_ns
    if mirrored.until_ns is not None:
        inside &= columns["ts_ns"] < mirrored.until_ns
    copies = {name: column[inside] for name, column in columns.items()}
    copies["ts_ns"] += mirrored.delay_ns
    copies["label"][data[copies["template"]]] = Label.COPY
    return {name: np.concatenate([column, copies[name]]) for name, column in columns.items()}


def _captured(columns: dict[str, npt.NDArray[Any]], draft: Draft) -> I32:
    """Return how many bytes of each frame are captured."""
    template, kept = columns["template"], columns.pop("kept_bytes").astype(np.int32)
    size = np.array([len(entry.frame.data) for entry in draft.templates] or [0], np.int32)[template]
    payload = np.array([max(entry.frame.payload, 0) for entry in draft.templates] or [0], np.int32)[template]
    captured = np.where(kept >= 0, np.minimum(size, payload + kept), size)
    if draft.scenario.snap_length:
        captured = np.minimum(captured, draft.scenario.snap_length)
    result: I32 = captured.astype(np.int32)
    return result
