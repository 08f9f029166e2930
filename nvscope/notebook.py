"""Captures in notebooks and scripts: what the program knows of them, as polars data frames.

::

    import nvscope

    plant = nvscope.open("plant.pcapng", definitions=["axis.gvl", "types.st"])
    plant.findings
    plant.values("axis")

Captures are opened at once, so that a wrong path is told there, and read when something is asked of them. Errors are
those of ``nvscope.errors``; what could not be shown is a warning.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from nvscope.analysis.attached_project import with_attached
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.attaching import that_may_attach
from nvscope.capture.content import STDIN
from nvscope.capture.open import open_source
from nvscope.definition.project import find_project
from nvscope.definition.project_file import read_project
from nvscope.errors import UsageError
from nvscope.extras import require
from nvscope.tracker.figures import (
    BIT_RATES,
    BUS_COUNTERS,
    BUS_ERRORS,
    DIAGNOSIS,
    INTERVALS,
    LIST_COUNTERS,
    LOADS,
    PACE,
    RATE,
    REMOTE,
    STREAM_COUNTERS,
    TELEGRAMS,
    Figure,
    Of,
)
from nvscope.units import list_key
from nvscope.view.documents.figures import lookup
from nvscope.view.escape import visible

if TYPE_CHECKING:
    import polars as pl

    from nvscope.analysis.inquiry import Analysis
    from nvscope.capture.source import SourceInfo
    from nvscope.export.lists import Lists

AnyPath = str | os.PathLike[str]
_MOST_NAMED = 10


def open_captures(
    captures: AnyPath | Sequence[AnyPath],
    definitions: AnyPath | Sequence[AnyPath] | None = None,
    *,
    project: AnyPath | bool | None = None,
    where: str | None = None,
) -> Captures:
    """Return capture files, or all those of a directory, as one timeline that can be asked.

    ``definitions`` are files that the PLC project exports, with those of the types they use; they take the place of
    those that a project file names; without either, those that a recording brings are taken. ``project`` is that
    file; True looks for ``nvscope.toml`` upwards from the working directory. ``where`` is a display filter. Names
    that no file declares are a warning. UsageError where the filter cannot be understood or polars and pyarrow are
    not installed, UnreadableInput where a file cannot be opened or is no capture.
    """
    require("data frames need", "polars", "pyarrow")
    paths = _paths("captures", captures)
    files = None if definitions is None else _paths("definitions", definitions)
    found = find_project(Path.cwd()) if project is True else Path(project) if project else None
    inquiry = Inquiry(paths, with_attached(read_project(found, files), that_may_attach(paths)).project)
    if not paths:
        raise UsageError("no capture file is given", next_step="name one, or a directory of them")
    # A pipe can be opened only once: it has to wait until something is asked.
    openable = [path for path in paths if path != STDIN and (not Path(path).exists() or _is_stored(path))]
    if openable:
        open_source(openable)
    if inquiry.project.files:
        from nvscope.view.lines.definition_flaws import definition_flaws  # noqa: PLC0415

        definition = inquiry.project.definition
        for sentence in definition_flaws(definition, [entry for entry in definition.lists if entry.key]):
            warnings.warn(sentence, stacklevel=2)
    return Captures(inquiry, where)


def _is_stored(path: str) -> bool:
    return Path(path).is_file() or Path(path).is_dir()


def _paths(what: str, given: AnyPath | Sequence[AnyPath]) -> list[str]:
    several = [given] if isinstance(given, str | os.PathLike) else given
    if not isinstance(several, Iterable) or not all(isinstance(path, str | os.PathLike) for path in several):
        raise UsageError(
            f"{what} are not {given!r:.80}", next_step="give the path of a file as text or Path, or a list of them"
        )
    return [os.fspath(path) for path in several]


class Captures:
    """Captures that were opened with ``nvscope.open``: their lists, streams, findings, telegrams and values."""

    def __init__(self, inquiry: Inquiry, where: str | None = None) -> None:
        self._inquiry = inquiry
        self._where = where
        self._warned: set[str] = set()
        if where is not None:
            from nvscope.view.display_filter import DisplayFilter  # noqa: PLC0415

            DisplayFilter(where, inquiry.fields)  # raises where it cannot be understood

    def __repr__(self) -> str:
        shown = f", where={self._where!r}" if self._where else ""
        return f"nvscope.open({list(self._inquiry.paths)!r}{shown})"

    def where(self, expression: str) -> Captures:
        """Return the same captures with a display filter (-Y) of this expression instead of the present one.

        UsageError, with the place, where it cannot be understood.
        """
        return Captures(self._inquiry, expression)

    @cached_property
    def report(self) -> dict[str, Any]:
        """The report as data (schema ``nvscope.report/2``), as ``nvscope report --json`` prints it.

        It is without the values of variables, for which there are ``values`` and ``at``.
        """
        return self._inquiry.report(self._analysis)

    @property
    def truncations(self) -> pl.DataFrame:
        """A row a file that could not be read to its end: path, offset in it, and why."""
        cut = [(info.path, info.truncation) for info in self._analysis.infos if info.truncation]
        rows = [{"path": path, "offset": told.offset, "message": told.message} for path, told in cut]
        return _frame(rows, {"path": str, "offset": int, "message": str})

    @cached_property
    def _analysis(self) -> Analysis:
        found = self._inquiry.analyze(self._where, causes=True)
        self._warn_of_cuts(found.infos)
        return found

    def _warn_of_cuts(self, infos: Iterable[SourceInfo]) -> None:
        """Warn of files that could not be read to their end, once for each of these captures."""
        for info in infos:
            if info.truncation and info.path not in self._warned:
                self._warned.add(info.path)
                told = f"{info.path}, offset {info.truncation.offset}: {info.truncation.message}"
                warnings.warn(visible(told), stacklevel=3)

    @cached_property
    def lists(self) -> pl.DataFrame:
        """A row a list: key, status, who sends and reads it, and all its figures by their names; on CAN, a channel."""
        figures = (*DIAGNOSIS, *LIST_COUNTERS, *PACE)
        rows = _looked_up(self.report["lists"], figures, Of.LIST)
        kinds: dict[str, _Kind] = {"key": str, "port": int, "channel": str, "id": int, "name": str, "status": str}
        return _frame(rows, kinds | {"senders": [str], "readers": [str]} | _kinds(figures))

    @cached_property
    def nodes(self) -> pl.DataFrame:
        """A row a node and list that it sends or reads: address, name, and its figures on that list."""
        figures = (*DIAGNOSIS, *PACE)
        rows = [{"list": entry["key"]} | node for entry in self.report["lists"] for node in entry["nodes"]]
        return _frame(_looked_up(rows, figures, Of.NODE), {"list": str, "address": str, "name": str} | _kinds(figures))

    @cached_property
    def streams(self) -> pl.DataFrame:
        """A row a stream: list, node, SubIndex, and its figures, such as ``lost``, ``interval_p50`` and ``jitter``.

        On CAN also the COB-ID and how many remote frames asked for it.
        """
        figures = (REMOTE, TELEGRAMS, *STREAM_COUNTERS, *INTERVALS, *PACE)
        rows = [{"list": entry["key"]} | stream for entry in self.report["lists"] for stream in entry["streams"]]
        kinds: dict[str, _Kind] = {"list": str, "node": str, "subindex": int, "cob_id": int}
        kinds |= _kinds([REMOTE, TELEGRAMS]) | {"counter_scope": str} | _kinds(STREAM_COUNTERS)
        kinds |= {"items": int, "length": int, "checksum": int} | _kinds((*INTERVALS, *PACE))
        return _frame(_looked_up(rows, figures, Of.STREAM), kinds)

    @cached_property
    def buses(self) -> pl.DataFrame:
        """A row a CAN bus: channel, and its figures; what error frames tell is null where there are none."""
        figures = (*BUS_COUNTERS, *BIT_RATES, *LOADS, *BUS_ERRORS, RATE)
        rows = _looked_up(self.report.get("buses", ()), figures, Of.BUS)
        return _frame(rows, {"channel": str} | _kinds(figures))

    @cached_property
    def findings(self) -> pl.DataFrame:
        """A row a finding, the worst first; ``first`` and ``last`` are the times of its events."""
        rows = [one | {"first": one["first_ns"], "last": one["last_ns"]} for one in self.report["findings"]]
        kinds: dict[str, _Kind] = dict.fromkeys(("code", "name", "severity", "list", "node"), str)
        kinds |= {"subindex": int, "count": int, "first": "time", "last": "time", "frames": [int]}
        kinds["frames_cut"] = int
        return _frame(rows, kinds | {"message": str, "hint": str})

    @cached_property
    def causes(self) -> pl.DataFrame:
        """A row a cause: what happened that explains findings; what is not over, ``until`` null, comes first.

        ``codes`` are those of the findings that it explains.
        """
        rows = [
            one | {"since": one["since_ns"], "until": one["until_ns"]}
            | {"codes": sorted({finding["code"] for finding in one["findings"]})}
            for one in self.report["causes"]
        ]  # fmt: skip
        texts, lists, times = ("title", "next", "channel"), ("checked", "lists", "nodes", "codes"), ("since", "until")
        kinds: dict[str, _Kind] = {"kind": str, "severity": str, **dict.fromkeys(texts, str)}
        kinds |= {**{key: [str] for key in lists}, **dict.fromkeys(times, "time"), "frames": [int], "frames_cut": int}
        return _frame(rows, kinds)

    def telegrams(self, *fields: str) -> pl.DataFrame:
        """Return a row a telegram and a column a field; without ``fields`` those of the header.

        UsageError for a field that there is not: ``nvscope keys --fields`` lists them.
        """
        from nvscope.analysis.default_fields import default_fields  # noqa: PLC0415
        from nvscope.analysis.packets import packets  # noqa: PLC0415
        from nvscope.export.frames import Collected  # noqa: PLC0415
        from nvscope.export.telegrams import TelegramTable  # noqa: PLC0415
        from nvscope.export.unwritten import beyond_time  # noqa: PLC0415
        from nvscope.view.fields.frame import output_field  # noqa: PLC0415
        from nvscope.view.rows.frames import PacketRows  # noqa: PLC0415

        inquiry = self._inquiry
        named = [output_field(name, inquiry.fields) for name in fields]
        chosen = None if self._where is None else inquiry.filter(self._where)
        source = inquiry.open()
        table = TelegramTable(named or default_fields(inquiry, source))
        collected = Collected(table.schema)
        table.open(collected)
        for rows in packets(source, inquiry.reading(chosen), PacketRows()):
            table.add(rows)
        table.finish()
        self._warn_of_cuts(source.infos)
        if table.beyond_time:
            warnings.warn(beyond_time(table.beyond_time, "values(form='long')"), stacklevel=2)
        return collected.frame()

    def values(self, name: str | int | None = None, *, form: Literal["wide", "long"] = "wide") -> pl.DataFrame:
        """Return the values of the variables that definitions name.

        ``wide``: a row a telegram and a column a variable, of the list that ``name`` says (name, identifier or key; not
        needed where there is only one). ``long``: a row a variable and telegram, of all lists or of that one. What a
        telegram did not send is null. Times of the type are durations, or times without a zone; one that is beyond 292
        years or the year 2262 is null, and in the long form in ``unsigned``. An enumeration has a second column with
        the names. What nobody has described is bytes.

        Telegrams that were left out are a warning. UsageError where no such list is defined.
        """
        from nvscope.analysis.values import values  # noqa: PLC0415
        from nvscope.export.frames import long_frame, wide_frame  # noqa: PLC0415
        from nvscope.export.unwritten import beyond_time, left_out  # noqa: PLC0415
        from nvscope.view.rows.defined import DefinedTelegrams  # noqa: PLC0415

        if form not in ("wide", "long"):
            raise UsageError(f"form is not {form!r:.80}", next_step="give form='wide' or form='long'")
        inquiry = self._inquiry
        lists = self._defined(name)
        if form == "wide" and len(lists) > 1:
            told = ", ".join(f"{entry.name} ({list_key(str(key))})" for key, entry in lists[:_MOST_NAMED])
            raise UsageError(
                "several lists are defined, and each is a table of its own",
                next_step=f"name one of {told}, or ask for form='long'",
            )
        chosen = None if self._where is None else inquiry.filter(self._where)
        telegrams = DefinedTelegrams(inquiry.defined_layouts(), keys=[key for key, _ in lists])
        source = inquiry.open()
        rows = values(source, inquiry.reading(chosen), telegrams)
        frame, beyond = wide_frame(telegrams, rows) if form == "wide" else (long_frame(telegrams, rows), 0)
        self._warn_of_cuts(source.infos)
        for sentence in [*([beyond_time(beyond)] if beyond else []), *left_out(telegrams)]:
            warnings.warn(sentence, stacklevel=2)
        return frame

    def history(self, name: str, *, of: str | None = None, every: bool = False) -> pl.DataFrame:
        """Return a row a change of the variables of a name, in the order of the capture.

        ``name`` is that of a variable, a structure or an array, or a pattern with *; ``of`` is the list, where several
        have it. ``every``: a row a telegram, changed or not. ``old`` and ``new`` are texts as an engineer writes them,
        ``value`` is the new one where it is a number or BOOL that a float holds exactly; durations are ns. UsageError
        where nothing has the name.
        """
        from nvscope.analysis.history import Changes  # noqa: PLC0415
        from nvscope.view.documents.history import change_row  # noqa: PLC0415

        changes = Changes(self._inquiry, name, listed=of, every=every, expression=self._where)
        rows = [
            row | {"time": row["time_ns"], "old": row["old_text"], "new": row["new_text"], "value": _number(row["new"])}
            for row in map(change_row, changes)
        ]
        self._warn_of_cuts(changes.source.infos)
        kinds: dict[str, _Kind] = {"time": "time", "frame": int, "list": str, "list_name": str, "name": str}
        kinds |= {"sender": str, "subindex": int, "changed": bool, "old": str, "new": str, "value": float}
        return _frame(rows, kinds)

    def at(self, time: str) -> pl.DataFrame:
        """Return what all variables were at a time: ``5s`` after the start, ``-2s`` before the end, ``#1234`` a frame.

        Also ``08:00:01.5`` or ``2026-01-31 08:00:01.5Z``. ``age`` is how old the telegram was; where there was none,
        ``text`` is null and ``missing`` says why. UsageError for what is no time of the capture.
        """
        from nvscope.analysis.moment import at  # noqa: PLC0415
        from nvscope.view.asked_time import parse_time  # noqa: PLC0415
        from nvscope.view.documents.history import at_document  # noqa: PLC0415

        asked = parse_time("at", time)
        found = at(self._inquiry, asked, expression=self._where, told=f"at {time}")
        self._warn_of_cuts(found.source.infos)
        layouts = self._inquiry.defined_layouts()
        document = at_document(found.moment, layouts, found.time_ns, expression=self._where)
        rows = [{**row, "age": row["age_ns"], "value": _number(row["value"])} for row in document["variables"]]
        kinds: dict[str, _Kind] = {"list": str, "list_name": str, "sender": str, "subindex": int, "name": str}
        kinds |= {"type": str, "text": str, "value": float, "age": "duration", "frame": int, "missing": str}
        return _frame(rows, kinds)

    def infer(self) -> pl.DataFrame:
        """Return a row a field that is proposed for lists without a definition, with its grade and the evidence."""
        from nvscope.analysis.inference import infer  # noqa: PLC0415
        from nvscope.view.documents.inference import inference_document, proposals  # noqa: PLC0415

        inferred = infer(self._inquiry, expression=self._where)
        self._warn_of_cuts(inferred.source.infos)
        samples = inferred.samples
        rows = [
            {"list": entry["list"], "sender": entry["sender"], "subindex": telegram["subindex"], **proposed}
            for entry in inference_document(proposals(samples), samples)["lists"]
            for telegram in entry["telegrams"]
            for layout in telegram["layouts"][:1]
            for proposed in layout["fields"]
        ]
        kinds: dict[str, _Kind] = {"list": str, "sender": str, "subindex": int, "offset": int, "bytes": int}
        kinds |= {"name": str, "type": str, "grade": str, "probability": float, "evidence": str}
        return _frame(rows, kinds)

    def _defined(self, name: str | int | None) -> Lists:
        from nvscope.export.lists import lists_to_write  # noqa: PLC0415

        return lists_to_write(self._inquiry.defined_layouts(), () if name is None else (str(name),))


_Kind = type | list[type] | Literal["time", "duration"]
_KIND_OF_UNIT: dict[str, _Kind] = {"time": "time", "ns": "duration", "percent": float, "per second": float, "": str}
"""By unit; the others are whole numbers."""


def _kinds(figures: Iterable[Figure]) -> dict[str, _Kind]:
    return {figure.name: _KIND_OF_UNIT.get(figure.unit, int) for figure in figures}


def _looked_up(rows: Iterable[dict[str, Any]], figures: Iterable[Figure], of: Of) -> list[dict[str, Any]]:
    """Return rows of a report with their figures by name beside what they have."""
    looks = [(figure.name, lookup(figure, of)) for figure in figures]
    return [row | {name: look(row) for name, look in looks} for row in rows]


_MOST_EXACT = 1 << 53
"""Up to here, a float holds every whole number."""


def _number(value: object) -> float | None:
    """Return a value as a number, None where it is none, or one that a float can only come close to."""
    if not isinstance(value, bool | int | float) or (isinstance(value, int) and abs(value) > _MOST_EXACT):
        return None
    return float(value)


def _frame(rows: Sequence[dict[str, Any]], kinds: Mapping[str, _Kind]) -> pl.DataFrame:
    """Return some columns of rows; absolute times, in reports decimal strings, are times in UTC."""
    import polars as pl  # noqa: PLC0415

    plain = {str: pl.String, int: pl.Int64, float: pl.Float64, bool: pl.Boolean}
    columns = []
    for name, kind in kinds.items():
        cells = [row.get(name) for row in rows]  # lists on UDP have a port, those on CAN a channel
        if kind == "time":
            moments = [None if cell is None else int(cell) for cell in cells]
            columns.append(pl.Series(name, moments, pl.Int64).cast(pl.Datetime("ns", "UTC")))
        elif kind == "duration":
            columns.append(pl.Series(name, cells, pl.Int64).cast(pl.Duration("ns")))
        elif isinstance(kind, list):
            columns.append(pl.Series(name, cells, pl.List(plain[kind[0]])))
        else:
            assert isinstance(kind, type)
            columns.append(pl.Series(name, cells, plain[kind]))
    return pl.DataFrame(columns)
