"""Watching: a source that is looked at while it is read; each look is a scene, a value that stays as it is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from msgspec import Struct, field
from msgspec.structs import replace

from nvscope.analysis.inquiry import Analysis, Inquiry
from nvscope.analysis.read_values import last_values, meant
from nvscope.analysis.snapshot import Snapshot, snapshot
from nvscope.analysis.transactions.recent_transactions import NO_TRANSACTIONS, RecentTransactions, TransactionsSeen
from nvscope.capture.by_second import BySecond
from nvscope.capture.source import Source, any_live
from nvscope.engine.events import Listeners
from nvscope.engine.ring import RING_BYTES, FrameRing, Recent, RecentSource
from nvscope.engine.run import Observer
from nvscope.engine.session import Session
from nvscope.tracker.can.canopen_since import CanOpenSeen
from nvscope.tracker.counted import Counted
from nvscope.tracker.evidence.contacts import Contacts, contacts_of
from nvscope.tracker.evidence.witness import Witness
from nvscope.tracker.pace import Pace, PaceSeen
from nvscope.tracker.state import TrackerState
from nvscope.view.documents.report import report_document

if TYPE_CHECKING:
    from nvscope.causes.chronicle import Chronicle
    from nvscope.tracker.readings.values_seen import LastSeen, ValuesSeen
    from nvscope.tracker.variables.values import StreamValues
    from nvscope.view.display_filter import DisplayFilter
    from nvscope.view.documents.variables import VariableStream


class Scene(Struct, frozen=True, dict=True):
    """What is known at a moment: figures and causes, how fast lists come, the last frames, the values of variables.

    ``contacts`` are who sends to whom. ``variables`` are empty without definitions. ``node_names`` are those that
    causes tell nodes by. ``at_ns`` is what the clock showed, up to which the source was watched. ``took_ns``
    is how long the look took that made it, which was done at ``made_ns`` of ``time.monotonic_ns``. ``canopen``
    tells which CAN frames are CANopen's, ``transactions`` are the last ones of the Parameter Manager and of web
    visualization pages. ``read_ones`` are the variables whose values come one by one, by who tells them
    (``nvscope.analysis.read_values.SOURCES``), as far as anybody does.
    """

    snapshot: Snapshot
    pace: PaceSeen
    recent: Recent
    inquiry: Inquiry
    contacts: Contacts
    channels: Sequence[str] = ()
    variables: Sequence[VariableStream] = ()
    node_names: Mapping[str, str] | None = None
    took_ns: int = 0
    made_ns: int = 0
    canopen: CanOpenSeen = field(default_factory=CanOpenSeen)
    transactions: TransactionsSeen = NO_TRANSACTIONS
    read_ones: Mapping[str, ValuesSeen] = field(default_factory=dict)

    @property
    def at_ns(self) -> int | None:
        return self.snapshot.summary.capture.now_ns

    @cached_property
    def chronicle(self) -> Chronicle | None:
        """What each list did when, up to this moment; None where nobody asked why findings are there."""
        happened, at_ns = self.snapshot.happened, self.at_ns
        return happened.chronicle.up_to(at_ns) if happened and at_ns is not None else None

    @cached_property
    def list_keys(self) -> Mapping[int, str]:
        """The keys of the lists by number, as documents have them."""
        summary = self.snapshot.summary
        keys = {entry.number: str(entry.key) for entry in summary.lists}
        return keys | {entry.number: str(entry.key) for entry in summary.can.lists}

    @cached_property
    def document(self) -> Mapping[str, Any]:
        """The report (schema ``nvscope.report/2``) at that moment; its lists and findings are made when asked for."""
        known, happened = self.snapshot, self.snapshot.happened
        project = self.inquiry.project
        names = project.node_names if self.node_names is None else self.node_names
        causes, left_out = (happened.causes, happened.left_out) if happened else ((), 0)
        return report_document(
            known.summary, known.findings, known.infos, project.definition, node_names=names, causes=causes,
            left_out=left_out, drawn=True,
        )  # fmt: skip

    def filter(self, expression: str) -> DisplayFilter:
        """Return a display filter that goes by what was known at that moment; UsageError as ``Inquiry.filter``."""
        return self.inquiry.filter_by(expression, analysis_of(self))

    def frames(self, first_frame: int = 0, stop_frame: int | None = None) -> RecentSource:
        """Return the last frames, from one number to before another, as a source."""
        return RecentSource(self.recent, self.snapshot.infos, self.channels, first_frame, stop_frame)


class Watching(Struct, frozen=True):
    """How a source is watched: ``ring_bytes`` are kept of the last frames, 0 for none, ``others`` observe too.

    ``node_names`` are those that are shown, None for those of the project. ``clock`` tells the moments of causes, None
    for the time since the beginning. ``listeners`` hear of the events of the state.
    """

    ring_bytes: int = RING_BYTES
    node_names: Mapping[str, str] | None = None
    others: Sequence[Observer] = ()
    clock: Callable[[int], str] | None = None
    listeners: Listeners = ()


USUAL = Watching()

_LOOKS = 100


class Watched:
    """The observers of a source that is watched, and what they know together.

    ``overdue``: what nobody answered in time counts, frame or not.
    """

    def __init__(self, inquiry: Inquiry, source: Source, how: Watching = USUAL, *, overdue: bool = True) -> None:
        self.source = source
        self.inquiry, self._overdue, self._names = inquiry, overdue, how.node_names
        self._clock = how.clock
        self._witness = Witness(live=any_live(source.infos))
        self._state = inquiry.state(values=True, listeners=(self._witness, *how.listeners))
        self._ring, self._pace = FrameRing(how.ring_bytes), Pace()
        self._transactions = RecentTransactions(inquiry.project.definition.parameters)
        self._read_ones = last_values(meant(None))
        self._read_looks: dict[str, LastSeen] = {}
        self._reset = False
        self._base: Counted | None = None
        ring = [self._ring] if how.ring_bytes else []
        self.observers: list[Observer] = [
            self._state,
            self._witness,
            *ring,
            self._pace,
            self._transactions,
            self._read_ones,
            *how.others,
        ]

    @property
    def state(self) -> TrackerState:
        """What was counted so far."""
        return self._state

    def reset(self) -> None:
        """Count from the next look on, and leave out what is over by then; for any thread."""
        self._reset = True

    def look(self, *, causes: bool = True) -> Scene:
        """Return what is known at this moment, with ``causes`` or without; nothing that is observed changes by it."""
        inquiry, began_ns = self.inquiry, time.monotonic_ns()
        found = snapshot(
            self._state, self.source, inquiry.project, inquiry.pdos, overdue=self._overdue,
            protocols=inquiry.protocols, witness=self._witness, causes=causes, node_names=self._names,
            clock=self._clock, figures=self._reset or self._base is not None,
        )  # fmt: skip
        if self._reset:
            self._reset, self._base = False, found.figures
        if self._base is not None:
            found = _since(found, self._base, inquiry)
        contacts = contacts_of(self._state, self._witness)
        pace, recent, variables = self._pace.seen(), self._ring.recent(), _kept_variables(self._state)
        made_ns = time.monotonic_ns()
        return Scene(
            found, pace, recent, inquiry, contacts, tuple(self.source.channels), variables, self._names,
            made_ns - began_ns, made_ns,
            CanOpenSeen.of(self._state.buses.canopen, inquiry.pdos.cob_ids if inquiry.pdos else ()),
            self._transactions.seen(), self._read_seen(),
        )  # fmt: skip

    def _read_seen(self) -> Mapping[str, ValuesSeen]:
        for name, values in self._read_ones.known.items():
            if name not in self._read_looks:
                from nvscope.tracker.readings.values_seen import LastSeen  # noqa: PLC0415  not without any

                self._read_looks[name] = LastSeen(values)
        # In the order in which reports have them, whoever told something first.
        return {name: self._read_looks[name].look() for name in self._read_ones.makes if name in self._read_looks}


def _since(found: Snapshot, base: Counted, inquiry: Inquiry) -> Snapshot:
    """Return what was counted since a moment, and of what happened what was not over then."""
    assert found.figures is not None
    project, start_ns = inquiry.project, base.end_ns
    summary = (found.figures - base).summary(
        intervals_ns=project.definition.nominal_intervals_ns(), readers=project.readers, buses=project.buses,
        cob_ids=inquiry.pdos.cob_ids if inquiry.pdos else frozenset(),
    )  # fmt: skip
    happened = found.happened
    if start_ns is None or happened is None:
        return replace(found, summary=summary)
    causes = [one for one in happened.causes if one.until_ns is None or one.until_ns > start_ns]
    findings = [one for one in found.findings if one.last_ns is None or one.last_ns > start_ns]
    chronicle = happened.chronicle.last(max(happened.chronicle.end_ns - start_ns, 1))
    return replace(
        found, summary=summary, findings=tuple(findings), happened=replace(happened, causes=causes, chronicle=chronicle)
    )


def watching(inquiry: Inquiry, how: Watching = USUAL, source: Source | None = None) -> Session[Scene]:
    """Return the captures of an inquiry, or the ``source`` that it opened, to be read in a thread of its own."""
    return session_of(Watched(inquiry, source or inquiry.open(), how))


def session_of(watched: Watched) -> Session[Scene]:
    """Return what is watched to be read in a thread of its own."""
    return Session(watched.source, watched.inquiry.reading(), watched.observers, watched.look)


def scene_at(
    inquiry: Inquiry, time_ns: int | None, how: Watching = USUAL, progress: Callable[[], bool] = lambda: True
) -> Scene | None:
    """Return what was known of captures at a time, None for their end; they are read up to there.

    ``progress`` is called after each batch; None where it returns False.
    """
    source = inquiry.open() if time_ns is None else inquiry.open().between(None, time_ns)
    watched = Watched(inquiry, source, how, overdue=False)
    for _ in inquiry.run(source, watched.observers):
        if not progress():
            source.stop()
            return None
    return watched.look()


def scenes_by_second(
    inquiry: Inquiry, how: Watching = USUAL, source: Source | None = None, *, sparingly: bool = False,
    causes: bool = True,
) -> Iterator[Scene]:  # fmt: skip
    """Yield what was known of captures behind each second of their time, and at their end.

    ``source`` are they where they are open already. Without ``causes``, none has them. ``sparingly``:
    behind ``_LOOKS`` seconds behind every second one, behind as many looks more behind every fourth, and so on: hours
    would take minutes to look at.
    """
    by_second = BySecond(source or inquiry.open())
    watched = Watched(inquiry, by_second, how, overdue=False)
    looks = 0
    for told in inquiry.run(by_second, watched.observers):
        if len(told) or told.until_ns is None:
            continue
        yield watched.look(causes=causes)
        looks += 1
        if sparingly and looks % _LOOKS == 0:
            by_second.every *= 2
    yield watched.look(causes=causes)


def analysis_of(scene: Scene) -> Analysis:
    """Return a scene as what one reading of captures showed, to be asked for what filters need."""
    known = scene.snapshot
    return Analysis(known.infos, TrackerState(), known.summary, known.findings, happened=known.happened)


def _kept_variables(state: TrackerState) -> Sequence[VariableStream]:
    """Return copies of the values of all streams, in the order in which they are shown."""
    values = state.values
    if values is None or not values.streams:
        return ()
    from nvscope.view.documents.variables import streams_of  # noqa: PLC0415  not without definitions

    return tuple(
        replace(stream, sequence=[_kept(one) for one in stream.sequence]) for stream in streams_of(state, values)
    )


def _kept(known: StreamValues) -> StreamValues:
    return replace(
        known, data=known.data.copy(), changes=known.changes.copy(), changed_ns=known.changed_ns.copy(),
        least=[None if one is None else one.copy() for one in known.least],
        most=[None if one is None else one.copy() for one in known.most],
    )  # fmt: skip
