"""What an audit says in words, the same for a terminal and for Markdown."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence

from msgspec import Struct

from nvscope import units
from nvscope.datalogger.audit.audit import Audit, AuditedFile, AuditedTable
from nvscope.datalogger.audit.finding import Finding
from nvscope.datalogger.audit.time_strip import Mark
from nvscope.datalogger.audit.values import Value
from nvscope.findings.kind import FindingKind, Severity

_GAPS = {Mark.TOLD: "told by the logger", Mark.GAP: "not told", Mark.UNREAD: "not readable"}
_MOST_NAMED = 3
_ROWS_OF_NO_INTERVAL = 8
"""Of fewer rows, nobody can say that they come at no regular interval."""

_LONGEST_VALUE = 24

Names = Callable[[str], str]
"""Tells how a file is called, by its path."""


def verdict(audit: Audit) -> tuple[Severity | None, str]:
    """Return how bad it is, and whether the databases can be trusted, in a sentence; None: nothing could be read."""
    if audit.is_unreadable:
        files = "the file" if len(audit.files) == 1 else f"any of {units.count_of(len(audit.files), 'file')}"
        return None, f"Nothing of {files} can be read" if audit.files else "No database was found"
    counts = {severity: len(audit.of(severity)) for severity in Severity}
    told = [units.count_of(counts[one], one.word) for one in sorted(Severity, reverse=True) if counts[one]]
    listed = f": {', '.join(told)}" if told else ""
    if counts[Severity.ERROR]:
        return Severity.ERROR, f"Not to be trusted as it is{listed}"
    if counts[Severity.WARNING] or audit.unfit or audit.limits:
        why = "the configuration is not that of the tables" if audit.unfit else "more may be missing than is told"
        return Severity.WARNING, f"To be trusted with care{listed or f': {why}'}"
    if not any(table.audit.rows for table in audit.tables):
        return Severity.NOTE, "Empty: no row was written yet"
    return Severity.NOTE, f"To be trusted{listed or ': nothing is missing that is not told'}"


def about(table: AuditedTable, names: Names) -> list[str]:
    """Return what a table is, and of what time, in parts."""
    audit = table.audit
    parts = [_named(table.files, names), audit.table.name, units.count_of(audit.rows, "row")]
    first_ns, last_ns = audit.coverage.first_ns, audit.coverage.last_ns
    if first_ns is not None and last_ns is not None:
        parts.append(f"{units.duration(last_ns - first_ns)} from {units.absolute_time(first_ns, utc=True)} UTC")
    parts.append("changes only" if audit.table.only_changes else "every value")
    if audit.interval_ns is not None:
        parts.append(f"every {units.duration(audit.interval_ns)}")
    elif (of_parts := audit.part_intervals_ns) is not None:
        least, most = map(units.duration, of_parts)
        parts.append(f"every {least} to {most}, by part" if least != most else f"every {least}")
    elif not audit.table.only_changes and audit.rows - audit.untimed >= _ROWS_OF_NO_INTERVAL:
        parts.append("at no regular interval")
    if audit.task_count > 1:
        parts.append(units.count_of(audit.task_count, "task"))
    return parts


def coverage(table: AuditedTable) -> str:
    """Say how much of its time a table covers, '' where it has no time."""
    audit = table.audit
    if audit.covered is None:
        return ""
    time, share = audit.coverage, units.percent(round(audit.covered * 1_000_000), 1_000_000)
    gaps = time.gaps.total()
    if (gaps or time.off_ns) and share == "100 %":
        share = "nearly 100 %"
    parts = []
    if missing_ns := time.missing_ns - time.off_ns:
        listed = ", ".join(f"{units.count(time.gaps[mark])} {what}" for mark, what in _GAPS.items() if time.gaps[mark])
        parts.append(f"{units.duration(missing_ns)} missing in {units.count_of(gaps, 'gap')} ({listed})")
    elif not gaps:
        lost = f"loss is told before {units.count_of(audit.losses, 'row')}" if audit.losses else "no loss is told"
        is_judged = audit.interval_ns is not None or audit.part_intervals_ns is not None
        parts.append("no gap" if is_judged else lost)
    if time.off_ns:
        starts = units.count_of(audit.restarts, "new start")
        parts.append(f"off for up to {units.duration(time.off_ns)} in front of {starts}")
    return f"{share} of the time covered: {', '.join(parts)}"


def _named(files: Sequence[str], names: Names) -> str:
    first = names(files[0])
    return first if len(files) == 1 else f"{first} to {names(files[-1])} ({len(files)} files)"


class Group(Struct, frozen=True):
    """Findings of one kind that people read as one."""

    kind: FindingKind
    severity: Severity
    findings: tuple[Finding, ...]

    @property
    def shown(self) -> tuple[Finding, ...]:
        """The first of them."""
        return self.findings[:_MOST_NAMED]

    @property
    def more(self) -> str:
        """What is left out, '' where nothing is."""
        left = self.findings[_MOST_NAMED:]
        if not left:
            return ""
        places = sum(one.count for one in left)
        variables = {one.variable for one in left} - {None}
        files = {one.file for one in left}
        where = units.count_of(len(variables), "variable") if variables else units.count_of(len(files), "file")
        return f"and {units.count_of(places, 'place')} more in {where}; --json has all"


def groups(audit: Audit) -> list[Group]:
    """Return findings by their kind, the worst first; what is said of files that cannot be read is none of them."""
    unreadable = {file.path for file in audit.files if file.status == "unreadable"}
    findings = [one for one in audit.findings if one.file not in unreadable]
    found: dict[tuple[str, Severity], list[Finding]] = {}
    for one in findings:
        found.setdefault((one.kind.code, one.severity), []).append(one)
    ordered = sorted(found.items(), key=lambda item: (-item[0][1], item[0][0]))
    return [Group(own[0].kind, severity, tuple(own)) for (_, severity), own in ordered]


def place(finding: Finding, names: Names) -> str:
    """Say where a finding is: variable, file, rows, time."""
    parts = [finding.variable or "", names(finding.file)]
    if finding.rows:
        rows = ", ".join(map(str, sorted(finding.rows)))
        more = f" and {units.count(finding.rows_cut)} more" if finding.rows_cut else ""
        parts.append(f"{'row' if finding.count == 1 else 'rows'} {rows}{more}")
    if finding.first_ns is not None and finding.last_ns is not None:
        first = units.absolute_time(finding.first_ns, utc=True)
        same_day = units.date(finding.first_ns, utc=True) == units.date(finding.last_ns, utc=True)
        last = (
            units.clock_time(finding.last_ns, utc=True) if same_day else units.absolute_time(finding.last_ns, utc=True)
        )
        parts.append(first if finding.first_ns == finding.last_ns else f"{first} to {last}")
    return " · ".join(filter(None, parts))


def told_of_files(files: Sequence[AuditedFile]) -> Iterator[tuple[Severity, str]]:
    """Yield what people should know of files, and how bad it is."""
    for file in files:
        if file.status == "unreadable":
            yield (
                Severity.ERROR,
                f"{file.path}: {file.what}" + (f". {_sentence(file.next_step)}" if file.next_step else ""),
            )
        for note in file.notes:
            yield Severity.NOTE, f"{file.path}: {note}"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def _is_real(value: float) -> bool:
    """Tell whether a number was a REAL of four bytes: no more than seven of its digits say anything."""
    try:
        (real,) = struct.unpack("<f", struct.pack("<f", value))
    except OverflowError:
        return False
    return bool(real == value)


def shown_value(value: Value) -> str:
    """Return a value for a table, not escaped."""
    if value is None:
        return ""
    if isinstance(value, bytes):
        text = f"0x{value.hex()}"
    elif isinstance(value, str):
        text = f"'{value}'"
    elif isinstance(value, float):
        text = f"{value:.7g}" if _is_real(value) else f"{value:.9g}"
    else:
        text = str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 1]}…"
