"""Inquiry: captures and how to read them, to be asked what was seen, what follows from it, and what is wrong.

Verbs, notebooks and whatever else wants to know something about captures ask an ``Inquiry``; there is one way from
captures, project and filter to an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from typing import TYPE_CHECKING, Any

from msgspec import Struct, field
from msgspec.structs import replace

from dissectors import address
from dissectors.netvar import PortRules
from nvscope.analysis.extent import part_of
from nvscope.analysis.reading import reading_of
from nvscope.capture.content import STDIN
from nvscope.capture.last_time import latest_ns
from nvscope.capture.open import open_source
from nvscope.capture.source import Source, SourceInfo, any_live
from nvscope.capture.streams import is_stream
from nvscope.definition.defined_pdos import pdos_of
from nvscope.definition.project import Project
from nvscope.engine.events import Listeners
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.engine.told import Told
from nvscope.errors import UsageError
from nvscope.protocols.protocol import Protocol
from nvscope.protocols.table import PROTOCOLS, accumulators_of, fields_of

if TYPE_CHECKING:  # what only some questions need is imported when they are asked
    from nvscope.analysis.compared import Comparisons
    from nvscope.analysis.snapshot import Happenings, Snapshot
    from nvscope.causes.cause import Cause
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.pdos import Pdos
    from nvscope.engine.session import Session
    from nvscope.findings.finding import Finding
    from nvscope.tracker.evidence.witness import Witness
    from nvscope.tracker.state import TrackerState
    from nvscope.tracker.summary import Summary
    from nvscope.tracker.variables.values import Values
    from nvscope.view.asked_time import AskedRange
    from nvscope.view.chosen import Chosen
    from nvscope.view.display_filter import DisplayFilter
    from nvscope.view.fields.verdicts import Names, Verdicts
    from nvscope.view.fields.vocabulary import Vocabulary


Watch = Callable[[Source], AbstractContextManager[Callable[[], None]]]
"""Given a source that is about to be read, returns what is called after each batch, as a context."""


def _nobody(_: Source) -> AbstractContextManager[Callable[[], None]]:
    return nullcontext(lambda: None)


class Analysis(Struct, frozen=True):
    """What one reading of captures showed: everything, and what a filter leaves of it.

    ``summary`` and ``findings`` are those of all telegrams; ``chosen`` is what the filter chose, None without one.
    ``values`` are those of the chosen telegrams, None without definitions. ``compared`` are the variables that several
    lists, or pages, have; ``happened`` is why findings are there. None where nobody asked.
    """

    infos: Sequence[SourceInfo]
    state: TrackerState
    summary: Summary
    findings: Sequence[Finding]
    values: Values | None = None
    chosen: Chosen | None = None
    compared: Comparisons | None = None
    happened: Happenings | None = None


class _Wanted(Struct, frozen=True):
    """What is asked for beside figures and findings."""

    values: bool = False
    compare: bool = False
    causes: bool = False
    names: bool = True


def _witness(source: Source) -> Witness:
    from nvscope.tracker.evidence.witness import Witness  # noqa: PLC0415

    return Witness(live=any_live(source.infos))


class Inquiry(Struct, frozen=True, dict=True):
    """Captures, and how to read them: with which project, ports and timeout, watched by whom.

    ``captures`` are the paths of files, which are opened when something is asked, and read from their beginning each
    time; or a source of any kind, of which one thing can be asked. ``timeout_ns`` is how long an answer may take, None
    for what the project says. ``asked`` is the part of the captures that is read, None for all: frames are counted, and
    times told, from its first frame, as if nothing else had been captured. ``protocols`` are those that are looked for.
    ``copies`` are those of streams, which are read once.
    """

    captures: Sequence[str] | Source
    project: Project = field(default_factory=Project)
    ports: PortRules | None = None
    timeout_ns: int | None = None
    watch: Watch = _nobody
    asked: AskedRange | None = None
    protocols: Sequence[Protocol] = PROTOCOLS
    copies: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def layouts(self) -> Layouts | None:
        """The telegrams of the lists whose variables are defined, None where there are none."""
        if not any(entry.variables for entry in self.project.definition.lists):
            return None
        from nvscope.definition.layouts import Layouts  # noqa: PLC0415

        return Layouts(self.project.definition)

    def defined_layouts(self) -> Layouts:
        """Return ``layouts``; UsageError where there are none."""
        if self.layouts is None:
            raise self.nothing_defined()
        return self.layouts

    def nothing_defined(self) -> UsageError:
        """Return the error that no list with variables is defined, and why as far as the files tell."""
        definition = self.project.definition
        if not self.project.files:
            return UsageError("no list is defined", next_step="name the files that the PLC project exports")
        if definition.left_out:
            what = "what could be read of the definition files declares no variables of a list"
            return UsageError(what, next_step="correct what was left out, or export it again")
        if definition.lists:
            what = "the definition files declare no variables of their lists"
            return UsageError(what, next_step="name the exported lists with their declarations")
        what = "the definition files declare types, but no list"
        return UsageError(what, next_step="name the exported list too")

    @cached_property
    def pdos(self) -> Pdos | None:
        """The frames of the lists that are defined on CAN, None where there are none."""
        return pdos_of(self.project.definition)

    def reading(self, chosen: DisplayFilter | None = None, *, all_frames: bool = False) -> Reading:
        """Return how the captures are read, with a filter or without.

        ``all_frames``: frames in which nothing is found are wanted too.
        """
        choose = None
        if chosen is not None:
            from nvscope.view.display_filter import PacketChoice  # noqa: PLC0415

            choose = PacketChoice(chosen)
        return reading_of(
            self.project, self.ports, self.pdos, choose=choose, timeout_ns=self.timeout_ns, protocols=self.protocols,
            all_frames=all_frames,
        )  # fmt: skip

    @property
    def paths(self) -> Sequence[str]:
        """The paths of the files; none of a source of another kind."""
        return self.captures if isinstance(self.captures, Sequence) else ()

    def open(self) -> Source:
        """Return the captures, or the part of them that is asked for, as one source, to be read once."""
        source = self._whole()
        return source if self.asked is None else part_of(source, self.asked, lambda: self._end_ns)

    def _whole(self) -> Source:
        if not isinstance(self.captures, Sequence):
            return self.captures
        return open_source(self.captures, renamed=self.project.channels, copies=self.copies)

    def latest_ns(self, told: str) -> int | None:
        """Return the latest time of the captures, None where they hold no packet; nothing else of them is looked at.

        UsageError where they cannot be read twice; ``told`` is how a person finds in it what needs to know the end.
        """
        if once := self.read_once:
            raise UsageError(
                f"{told}: {once} has no end that is known before it is there", next_step="name a file instead"
            )
        source = self._whole()
        with self.watch(source) as progress:
            return latest_ns(source, progress)

    @cached_property
    def _end_ns(self) -> int | None:
        assert self.asked
        return self.latest_ns(self.asked.told_from_end)

    def run(
        self, source: Source, observers: Sequence[Observer], chosen: DisplayFilter | None = None, *,
        watch: Watch | None = None, all_frames: bool = False,
    ) -> Iterator[Told]:  # fmt: skip
        """Tell a source to observers, as ``nvscope.engine.run`` does; ``watch`` takes the place of the inquiry's."""
        with (watch or self.watch)(source) as progress:
            for told in run(source, self.reading(chosen, all_frames=all_frames), observers):
                yield told
                progress()

    @cached_property
    def names(self) -> Names:
        """The names of lists and nodes."""
        from nvscope.view.fields.verdicts import Names  # noqa: PLC0415

        lists = self.project.definition.by_key().items()
        nodes = self.project.node_names.items()
        return Names(
            {key: entry.name for key, entry in lists if entry.name},
            {address.halves(text): name for text, name in nodes},
            self.project.definition.parameters,
        )

    @cached_property
    def fields(self) -> Vocabulary:
        """What expressions may name; what is judged cannot be read with these."""
        return self._fields(None)

    def filter(self, expression: str, *, all_frames: bool = False, names: bool = True) -> DisplayFilter:
        """Return a display filter that is ready to be asked of the telegrams of these captures.

        Where it asks for what is known in the end only, the captures are read for it. ``all_frames``: it may ask for
        what only frames have that are no telegrams; ``names``: causes tell nodes by their names. UsageError, with the
        place, where the expression cannot be understood, or where captures cannot be read twice.
        """
        from nvscope.view.display_filter import DisplayFilter  # noqa: PLC0415

        chosen = DisplayFilter(expression, self.fields)
        if chosen.of_others and not all_frames:
            from nvscope.view.fields.frame import of_others  # noqa: PLC0415

            raise of_others(chosen.of_others)
        if not chosen.judged:
            return chosen
        if once := self.read_once:
            raise UsageError(
                f"{', '.join(chosen.judged)}: known when the whole capture was read, and {once} cannot be read twice",
                next_step="name a file instead",
            )
        return self.filter_by(expression, self._read(_Wanted(causes=chosen.causes, names=names)))

    def analyze(
        self, expression: str | None = None, *, values: bool = False, compare: bool = False, causes: bool = True,
        names: bool = True, others: Sequence[Observer] = (),
    ) -> Analysis:  # fmt: skip
        """Read the captures, judge them, and choose among it what an expression chooses.

        ``values``: the variables are wanted too; ``compare``: those that several lists have are compared; ``causes``:
        why findings are there, with the ``names`` of nodes; ``others`` observe too. UsageError as ``filter``, and
        without definitions to compare by.
        """
        if compare and self.layouts is None:
            raise UsageError(
                "--compare needs to know the variables of the lists",
                next_step="name the exported lists and their types with --gvl FILE",
            )
        wanted = _Wanted(values=values, compare=compare, causes=causes, names=names)
        if expression is None:
            return self._read(wanted, others=others)
        from nvscope.view.chosen import Chosen  # noqa: PLC0415

        chosen = self.filter(expression, names=names)
        found = self._read(wanted, chosen, others=others)
        left = Chosen(found.state, chosen, found.findings, found.happened.causes if found.happened else ())
        return replace(found, chosen=left)

    def report(
        self, found: Analysis, *, names: bool = True, values: bool = False, drawn: bool = False,
        listed: Sequence[str] = (), secrets: bool = False,
    ) -> dict[str, Any]:  # fmt: skip
        """Return the report on an analysis for which causes were asked as data (schema ``nvscope.report/2``).

        ``names``: with those of the nodes; ``values``: with the variables of each list, where they are defined;
        ``drawn``: as a document whose rows are made when they are asked for, one after the other; ``listed``: of lists
        that are meant by one of these names, identifiers or keys alone; ``secrets``: with the passwords that pages
        wrote, or showed. UsageError where none is.
        """
        from nvscope.view.documents.report import report_document  # noqa: PLC0415

        rows = None
        if values and found.values is not None:
            from nvscope.view.documents.variables import values_by_list  # noqa: PLC0415

            rows = values_by_list(found.state, found.values)
        summary, findings = found.summary, found.findings
        if found.happened is None:
            raise ValueError("a report tells causes, and nobody asked for them")
        causes = found.happened.causes
        if found.chosen is not None:
            summary, findings, causes = found.chosen.summary(summary), found.chosen.findings, found.chosen.causes
        if listed:
            summary, findings, causes = self._of_lists(found, summary, findings, causes, listed)
        document = report_document(
            summary, findings, found.infos, self.project.definition, rows,
            node_names=self.project.node_names if names else {}, whole=found.summary, all_findings=found.findings,
            causes=causes, left_out=found.happened.left_out, drawn=drawn, secrets=secrets,
        )  # fmt: skip
        if found.chosen is not None:
            document["filter"] = {"expression": found.chosen.expression, "telegrams": summary.capture.chosen}
        if self.project.definition.lists:
            from nvscope.analysis.missing import missing  # noqa: PLC0415

            called = self.project.node_names if names else {}
            document["missing"] = missing(found, self.project, summary, findings, causes, called)
        if found.compared is not None:
            document |= found.compared.document(summary.end_ns, secrets=secrets)
        return document

    def _of_lists(
        self, found: Analysis, summary: Summary, findings: Sequence[Finding], causes: Sequence[Cause],
        listed: Sequence[str],
    ) -> tuple[Summary, Sequence[Finding], Sequence[Cause]]:  # fmt: skip
        from nvscope.definition.selection import keys_named  # noqa: PLC0415
        from nvscope.view.listed import causes_of_lists, names_of_seen_lists, of_lists  # noqa: PLC0415

        names = {key: entry.name for key, entry in self.project.definition.by_key().items()}
        seen = names_of_seen_lists(found.summary, found.findings, names)
        wanted = {key for name in listed for key in keys_named(seen, name)}
        return *of_lists(summary, findings, wanted), causes_of_lists(causes, wanted)

    def _read(
        self, wanted: _Wanted, chosen: DisplayFilter | None = None, *, others: Sequence[Observer] = ()
    ) -> Analysis:  # fmt: skip
        source = self.open()
        witness = _witness(source) if wanted.causes else None
        listeners = () if witness is None else (witness,)
        state = self.state(values=wanted.values, listeners=listeners)
        observers: list[Observer] = [state, *others, *listeners]
        compared = None
        if wanted.compare and self.layouts is not None:
            from nvscope.analysis.compared import Comparisons  # noqa: PLC0415

            compared = Comparisons.by(self.layouts, self.project)
            observers += compared.observers
        for _ in self.run(source, observers, chosen):
            pass
        found = self._snapshot(state, source, witness, node_names=None if wanted.names else {})
        return Analysis(
            found.infos, state, found.summary, found.findings, state.values, compared=compared, happened=found.happened
        )  # fmt: skip

    def state(self, *, values: bool = False, listeners: Listeners = ()) -> TrackerState:
        """Return a state that has seen nothing, and goes by the definitions; ``values`` are kept if they are wanted."""
        from nvscope.tracker.state import TrackerState  # noqa: PLC0415

        taken = None
        if self.layouts is not None:
            from nvscope.tracker.variables.values import Values  # noqa: PLC0415

            taken = Values(self.layouts, wanted=values)
        return TrackerState(values=taken, others=accumulators_of(self.protocols), listeners=listeners)

    def _snapshot(self, state: TrackerState, source: Source, witness: Witness | None, **how: Any) -> Snapshot:
        from nvscope.analysis.snapshot import snapshot  # noqa: PLC0415

        return snapshot(state, source, self.project, self.pdos, protocols=self.protocols, witness=witness, **how)

    def session(self) -> Session[Snapshot]:
        """Return the captures to be read in a thread of its own, and looked at meanwhile; it has to be started."""
        from nvscope.engine.session import Session  # noqa: PLC0415

        source, reading = self.open(), self.reading()
        state = self.state(listeners=(witness := _witness(source),))

        def look() -> Snapshot:
            return self._snapshot(state, source, witness, overdue=True, figures=True)

        return Session(source, reading, [state, witness], look)

    def _fields(self, verdicts: Verdicts | None) -> Vocabulary:
        from nvscope.view.fields.vocabulary import vocabulary  # noqa: PLC0415

        further = [kind for one in self.protocols for kind in one.findings()]
        return vocabulary(self.layouts, self.names, verdicts, fields_of(self.protocols), further)

    def filter_by(self, expression: str, found: Analysis) -> DisplayFilter:
        """Return a display filter that goes by what an analysis found; nothing is read. UsageError as ``filter``."""
        from nvscope.view.display_filter import DisplayFilter  # noqa: PLC0415
        from nvscope.view.fields.verdicts import Verdicts  # noqa: PLC0415

        nodes = [address.halves(text) for text in found.summary.addresses]
        causes = found.happened.causes if found.happened else ()
        verdicts = Verdicts(found.summary, nodes, found.findings, causes)
        return DisplayFilter(expression, self._fields(verdicts), verdicts)

    @property
    def read_once(self) -> str:
        """What of the captures can be read only once, as told to a person; "" where all can be read again."""
        once = next((path for path in self.paths if is_stream(path) and path not in self.copies), "")
        if once:
            return "stdin" if once == STDIN else "a pipe"
        return "" if isinstance(self.captures, Sequence) else "what is no file"
