"""What a report for people says of what happened: the verdict, what it did to each list, and the causes.

Takes the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from nvscope import units
from nvscope.findings.kind import Severity
from nvscope.view.lines.plant import content
from nvscope.view.lines.plant.content import (
    Report,
    Row,
    nanoseconds,
    says_something,
    status,
    watched_until_ns,
    why_no_list,
)
from nvscope.view.lines.table import Cell, Tone


class Concern(NamedTuple):
    """What the causes say of one list: how bad the worst is, and what happened, in a word or two."""

    severity: Severity
    words: str


def severity_of(cause: Row) -> Severity:
    """Return how bad a cause is."""
    return Severity.of(cause["severity"])


def is_now(cause: Row) -> bool:
    """Tell whether what a cause says is still so at the end."""
    return cause["until_ns"] is None


def symbol(severity: Severity | None) -> Cell:
    """Return the mark of a severity; ``●`` where nothing is wrong."""
    if severity is None:
        return Cell("●", Tone.GOOD)
    told = status(severity)
    return Cell(told.text[0], told.tone)


def headline(report: Report) -> tuple[Cell, str]:
    """Return the mark and the line that answer whether something is broken, and how badly."""
    if report.get("databases") and not any(report.get(name) for name in ("lists", "sdo", "visu")):
        return _of_databases(report)
    if says_something(report):
        return _verdict(report)
    return Cell("●", Tone.WARNING), why_no_list(report)


def _verdict(report: Report) -> tuple[Cell, str]:
    faults = [cause for cause in report["causes"] if severity_of(cause) > Severity.NOTE]
    now = [cause for cause in faults if is_now(cause)]
    lists = len(report["lists"])
    concerned = _causes_of_lists(report)
    # On CAN, what has no name is an identifier: nobody knows whether it is a list.
    is_list = any(entry["transport"] != "can" or entry["name"] for entry in report["lists"])
    told = units.count_of(lists, "list" if is_list else "identifier")
    if not lists:
        told = f"no list, {_asked(report)}"
    if not faults:
        unanswered = sum(row["unanswered"] for row in report.get("visu", ()))
        well = f"{units.count_of(unanswered, 'request')} unanswered" if unanswered else "all is well"
        parts = [f"{told}, all well" if lists > 1 and not unanswered else f"{told}, {well}", *_extent(report)]
        return symbol(Severity.WARNING if unanswered else None), " · ".join(parts)
    passed = len(faults) - len(now)
    if not now:
        what = f"{units.count_of(passed, 'fault')}, {'all ' if passed > 1 else ''}passed"
    elif passed:
        what = f"{units.count_of(len(now), 'fault')} now, {units.count(passed)} passed"
    else:
        what = f"{units.count_of(len(now), 'fault')} now"
    if not lists:
        pass
    elif len(concerned) == lists:
        told += ", affected" if lists == 1 else ", all affected"
    else:
        told += f", {units.count(len(concerned)) if concerned else 'none'} affected"
    worst = max(map(severity_of, now), default=Severity.WARNING)
    return symbol(worst), f"{what} · {told}"


def _of_databases(report: Report) -> tuple[Cell, str]:
    """Return what there is where nothing is there but databases: whether all is well, an audit tells."""
    databases = report["databases"]
    lost = sum(row["lost"] for row in databases)
    parts = [units.count_of(len(databases), "database"), units.count_of(sum(row["rows"] for row in databases), "row")]
    if lost:
        parts.append(f"data lost before {units.count(lost)} of them")
    return Cell("●", Tone.WARNING if lost else Tone.PLAIN), " · ".join(parts)


def _asked(report: Report) -> str:
    """Return how many nodes were asked for something, where nobody sends a list."""
    partners = {row["partner"] for row in report.get("sdo", ())}
    servers = {row["server"] for row in report.get("visu", ())}
    parts = [
        f"{units.count_of(len(asked), 'node')} asked {how}"
        for asked, how in ((partners, "for parameters"), (servers, "by web visualization")) if asked
    ]  # fmt: skip
    return ", ".join(parts)


def _extent(report: Report) -> list[str]:
    """Return how long a healthy plant was watched, and how much was sent."""
    capture = report["capture"]
    start_ns, end_ns = nanoseconds(capture["start_ns"]), watched_until_ns(capture)
    parts = [] if start_ns is None or end_ns is None else [units.duration(end_ns - start_ns)]
    if capture["telegrams"]:
        parts.append(units.count_of(capture["telegrams"], "telegram"))
    if frames := capture.get("can_frames"):
        parts.append(f"{units.count_of(frames, 'frame')} on CAN")
    return parts


def concerns(report: Report) -> dict[str, Concern]:
    """Return what happened to the lists that causes concern, by key, in the order of the causes.

    Also to those that broke a rule by one that is not about them: what a reader does not answer that starts anew.
    """
    lists: Mapping[str, Row] = {entry["key"]: entry for entry in report["lists"]}
    end_ns = watched_until_ns(report["capture"]) or 0
    told = {}
    for key, causes in _causes_of_lists(report).items():
        entry, cause = lists[key], causes[0]
        if key in cause["lists"]:
            more = f" +{len(causes) - 1}" if len(causes) > 1 else ""
            told[key] = Concern(max(map(severity_of, causes)), _brief(cause, entry, end_ns) + more)
            continue
        unanswered = entry["counters"].get("missing_acknowledgements")
        words = f"{units.count(unanswered)} unanswered" if unanswered else _brief(cause, entry, end_ns)
        told[key] = Concern(content.severity_of(entry["status"]) or Severity.NOTE, words)
    return told


def _causes_of_lists(report: Report) -> dict[str, list[Row]]:
    """Return the causes that are about each list; of those that none is about, the one by which they broke a rule."""
    about: dict[str, list[Row]] = {}
    beside: dict[str, list[Row]] = {}
    for cause in report["causes"]:
        if severity_of(cause) > Severity.NOTE:
            for key in cause["lists"]:
                about.setdefault(key, []).append(cause)
            for finding in cause["findings"]:
                beside.setdefault(finding["list"], [cause])
    there = {entry["key"]: content.severity_of(entry["status"]) or Severity.NOTE for entry in report["lists"]}
    found = {key: causes for key, causes in about.items() if key in there}
    return found | {
        key: causes
        for key, causes in beside.items()
        if key not in found and there.get(key, Severity.NOTE) > Severity.NOTE
    }


def _brief(cause: Row, entry: Row, end_ns: int) -> str:
    """Return in a word or two what a cause did to a list."""
    # Where there are causes, what judged them is there already; else nothing of it is needed.
    from nvscope.causes.catalogue import BY_NAME  # noqa: PLC0415

    since_ns, until_ns = nanoseconds(cause["since_ns"]), nanoseconds(cause["until_ns"])
    lasted_ns = (end_ns if until_ns is None else until_ns) - (end_ns if since_ns is None else since_ns)
    counters = entry["counters"]
    kind = BY_NAME[cause["kind"]]
    if any(number == 0 and f"{{{name}}}" in kind.measured for name, number in counters.items()):
        return kind.brief  # what it does to others is not what it does to this one
    counted = {name: number for name, number in counters.items() if number}
    return (kind.measured or kind.brief).format_map(_Figures(counted, time=units.duration(lasted_ns)))


class _Figures(dict[str, str]):
    """The figures of a list, by name; what nobody knows is ``some``."""

    def __init__(self, counted: Mapping[str, int], **told: str) -> None:
        super().__init__({name: units.count(number) for name, number in counted.items()} | told)

    def __missing__(self, key: str) -> str:
        return "some"


def folded(report: Report) -> str:
    """Return what is said of the findings behind the causes, "" where there are none."""
    explained = sum(len(cause["findings"]) for cause in report["causes"])
    beside = len(report["findings"]) - explained
    parts = []
    if explained:
        verb = "is" if explained == 1 else "are"
        these = "this" if len(report["causes"]) == 1 else "these"
        parts.append(f"{units.count_of(explained, 'finding')} {verb} folded into {these}")
    if beside:
        parts.append(f"{units.count_of(beside, 'finding')} of little weight beside {'them' if explained else 'that'}")
    return ", ".join(parts)
