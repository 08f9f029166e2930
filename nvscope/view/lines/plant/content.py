"""What a report for people says, in sentences: one content, of which every face makes its own form.

Takes the report of schema ``nvscope.report/2``. Nothing here is escaped: text from outside passes the escape of the
face (``view.escape``), before or after, and never reaches a reader without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from msgspec import Struct

from nvscope import units
from nvscope.capture.formats import DATABASES
from nvscope.findings.capture import LIMIT_REACHED, TRUNCATED_FILE, UNSUPPORTED_LINK_TYPE
from nvscope.findings.kind import Severity
from nvscope.view.documents.verdicts import OK
from nvscope.view.lines.table import Cell, Tone

Report = Mapping[str, Any]
Row = Mapping[str, Any]

_SYMBOLS = {Severity.ERROR: "✗", Severity.WARNING: "!", Severity.NOTE: "·"}
_TONES = {Severity.ERROR: Tone.ERROR, Severity.WARNING: Tone.WARNING, Severity.NOTE: Tone.NOTE}
_MAX_SOURCES = 6


class Clock(Struct, frozen=True):
    """How absolute times are told: local or UTC, and relative to the start of the capture."""

    start_ns: int | None
    utc: bool

    @classmethod
    def of(cls, report: Report, *, utc: bool) -> Clock:
        """Return the clock of a report, whose capture may be without a start."""
        return cls(nanoseconds(report["capture"]["start_ns"]), utc)

    def moment(self, time_ns: int) -> str:
        """Return the time of day, with the date in front where it is not that of the start."""
        day = units.date(time_ns, utc=self.utc)
        if self.start_ns is not None and day == units.date(self.start_ns, utc=self.utc):
            return units.clock_time(time_ns, utc=self.utc)
        return units.absolute_time(time_ns, utc=self.utc)

    def second(self, time_ns: int) -> str:
        """Return a moment to the second."""
        return self.moment(time_ns).partition(".")[0]

    def since_start(self, time_ns: int) -> str:
        """Return the time since the start of the capture as an IEC literal: what is between the moments shown."""
        return units.since(time_ns, self.start_ns or 0)


def watched_until_ns(capture: Row) -> int | None:
    """Return up to when there was something to be seen: the last frame, or as long as a live source was watched."""
    known = [time_ns for name in ("end_ns", "until_ns") if (time_ns := nanoseconds(capture[name])) is not None]
    return max(known, default=None)


def nanoseconds(value: str | None) -> int | None:
    """Return an absolute time of the report, a decimal string, as a number."""
    return None if value is None else int(value)


def status(severity: Severity | None) -> Cell:
    """Return symbol and word for the worst severity found, or for none."""
    if severity is None:
        return Cell("✓ ok", Tone.GOOD)
    return Cell(f"{_SYMBOLS[severity]} {severity.word}", _TONES[severity])


def severity_of(word: str) -> Severity | None:
    """Return the severity that the status of a list is, None where it is ``ok``."""
    return None if word == OK else Severity.of(word)


def why_no_list(report: Report) -> str:
    """Return why a report has no list, in one line."""
    capture = report["capture"]
    if _lies_elsewhere(capture):
        return "No frame of the capture lies in the time that was asked for"
    if not capture["frames"]:
        if not _are_databases(capture):
            return "The capture holds no frames"
        return "No row of any database can be read" if _is_cut(report) else "No database has a row"
    if not capture["telegrams"]:
        if capture["frames"] == 1:
            return "The only frame is not a telegram of network variables"
        return f"None of {units.count(capture['frames'])} frames is a telegram of network variables"
    if "filter" in report:
        return "The filter chooses nothing that belongs to a list"
    return "No list: no telegram belongs to a network variables list"


def tally(by_severity: Mapping[str, int]) -> str:
    """Return how many findings of each severity there are: ``2 errors, 1 note``; "" where there are none."""
    return ", ".join(units.count_of(number, severity) for severity, number in by_severity.items() if number)


_PAIRS_OF = {
    "sdo": ("requester", "partner"), "visu": ("client", "server"), "visu_others": ("client", "server"),
}  # fmt: skip
"""The rows of a report that name who asks and who is asked, and under which keys."""


def node_names(report: Report) -> dict[str, str]:
    """Return the names of the nodes that have one, by address."""
    told = [(node["address"], node["name"]) for entry in report["lists"] for node in entry["nodes"]]
    for rows, ends in _PAIRS_OF.items():
        told += [(row[end], row[f"{end}_name"]) for row in report.get(rows, ()) for end in ends]
    return {address: name for address, name in told if name}


def source_facts(report: Report) -> list[tuple[str, str]]:
    """Return path and facts (format, size) of the first sources; what is left over has no path."""
    sources = report["capture"]["sources"]
    told = []
    for source in sources[:_MAX_SOURCES]:
        facts = [source["format"], units.data_size(source["bytes"])]
        if len(sources) > 1:
            facts.append(units.count_of(source["frames"], "row" if source["format"] in DATABASES else "frame"))
        told.append((source["path"], f"({', '.join(facts)})"))
    if len(sources) > _MAX_SOURCES:
        told.append(("", f"and {units.count_of(len(sources) - _MAX_SOURCES, 'more file')}"))
    return told


def rows_of_databases(report: Report) -> int:
    """Return how many of the frames are rows of databases."""
    return sum(row["rows"] for row in report.get("databases", ()))


def capture_lines(report: Report, clock: Clock) -> list[list[Cell]]:
    """Return what the capture holds, and from when to when it goes."""
    capture = report["capture"]
    if not capture["frames"]:
        return []
    can_frames, rows = capture.get("can_frames", 0), rows_of_databases(report)
    holds = f"{units.count_of(capture['frames'], 'frame')}: {units.count_of(capture['telegrams'], 'telegram')}, "
    if can_frames:
        holds += f"{units.count(can_frames)} on CAN, "
    if rows:
        holds += f"{units.count_of(rows, 'row')} of databases, "
    holds += units.count_of(capture["other_frames"] - can_frames - rows, "other")
    lines = [[Cell(holds if rows < capture["frames"] else units.count_of(rows, "row"))]]
    if rows == capture["frames"]:
        pass
    elif capture["drops"]:
        lines[0] += [Cell(", "), Cell(f"{units.count(capture['drops'])} dropped while capturing", Tone.WARNING)]
    elif capture["drops"] == 0:
        lines[0].append(Cell(", none dropped"))
    start_ns, end_ns = clock.start_ns, watched_until_ns(capture)
    if start_ns is not None and end_ns is not None:
        start, zone = units.absolute_time(start_ns, utc=clock.utc), units.zone(start_ns, utc=clock.utc)
        lines.append([Cell(f"{units.duration(end_ns - start_ns)} from {start} to {clock.moment(end_ns)} {zone}")])
    holes = [
        (nanoseconds(behind["start_ns"]) or 0) - (nanoseconds(before["end_ns"]) or 0)
        for before, behind in pairwise(capture.get("recordings", ()))
    ]
    if holes:
        told = f"{len(holes) + 1} recordings, nobody captured for up to {units.duration(max(holes))} between them"
        lines.append([Cell(told, Tone.WARNING)])
    left_out = sum(finding["count"] for finding in report["findings"] if finding["code"] == LIMIT_REACHED.code)
    if left_out:
        verb = "is" if left_out == 1 else "are"
        frames = units.count_of(left_out, "frame")
        told = f"{frames} {verb} left out of figures or findings: the limit was reached ({LIMIT_REACHED.code})"
        lines.append([Cell(told, Tone.WARNING)])
    if left_out := report.get("evidence_left_out"):
        told = f"{units.count_of(left_out, 'event')} left out, for which there was no room: causes may lack some"
        lines.append([Cell(told, Tone.WARNING)])
    if chosen := report.get("filter"):
        telegrams = capture["telegrams"] + capture.get("can_frames", 0)
        lines.append(filter_cells(chosen, telegrams, "; figures are those of the whole capture"))
    return lines


def filter_cells(chosen: Mapping[str, Any], all_telegrams: int, besides: str = "") -> list[Cell]:
    """Return the line that says what a filter chooses, and of how many telegrams if any; ``besides`` ends it."""
    numbers = []
    if all_telegrams:
        numbers.append(f"{units.count(chosen['telegrams'])} of {units.count_of(all_telegrams, 'telegram')}")
    if "finding." in chosen["expression"]:
        numbers.append("of each finding the first ten")
    told = f" ({', '.join(numbers)})" if numbers else ""
    return [Cell("shown: what "), Cell(chosen["expression"], Tone.STRONG), Cell(f" chooses{told}{besides}")]


def _are_databases(capture: Row) -> bool:
    """Tell whether nothing but databases was read."""
    return bool(capture["sources"]) and all(source["format"] in DATABASES for source in capture["sources"])


def _lies_elsewhere(capture: Row) -> bool:
    """Tell whether there are frames, but none in the part of the capture that the report is about."""
    return not capture["frames"] and any(source["frames"] for source in capture["sources"])


def _is_cut(report: Report) -> bool:
    """Tell whether something of the files could not be read."""
    return any(one["code"] == TRUNCATED_FILE.code for one in report["findings"])


_NO_FRAMES = (
    "Was the right interface recorded, and is its link up?",
    "Was there a capture filter that lets nothing pass? Record once without one.",
    "Was the file copied before the recording was stopped?",
)
_NO_ROWS = (
    "Has its logger run since the file was made? It writes rows in blocks; `nvscope audit FILE.db` tells of it.",
)
_NO_ROW_READ = ("Why can none be read? `nvscope audit FILE.db` tells, and what the rows hold all the same.",)
_NOTHING_CAME = {
    "interface": (
        "Is it the right interface, and is its link up?",
        "Does the capture filter let nothing pass? -f '' lets everything in.",
        "Does the switch send this port what others say to each other? It needs a mirror port, or a tap.",
    ),
    "udp": (
        "Do telegrams go to this port, and to everybody, to a group that was joined, or to this machine?",
        "Does a firewall of this machine drop them? An interface, -i NAME, shows what comes before it.",
    ),
    "stream": (
        "Does its writer pass on each packet at once? tcpdump does with -U.",
        "Does it capture on the right interface, and with a filter that lets something pass?",
    ),
}
"""What to check where a live source of a format brought nothing."""


def says_something(report: Report) -> bool:
    """Tell whether anybody was seen to send a list, or to ask for values in another way."""
    return any(report.get(name) for name in ("lists", "sdo", "visu", "databases"))


def advice(report: Report) -> tuple[str, ...]:
    """Return what to check where a capture shows no list at all; nothing where it shows one, or is not all shown."""
    capture = report["capture"]
    if says_something(report) or "filter" in report:
        return ()
    if _lies_elsewhere(capture):
        return ("Without --from-time and --to-time, the report says when the capture begins and ends.",)
    if not capture["frames"]:
        if _are_databases(capture):
            return _NO_ROW_READ if _is_cut(report) else _NO_ROWS
        formats = [source["format"] for source in capture["sources"]]
        return next((told for form, told in _NOTHING_CAME.items() if form in formats), _NO_FRAMES)
    if capture["telegrams"]:
        return (
            "Telegrams of the Parameter Manager (services 1 to 4, 20 to 28, 100) belong to no list: "
            "`nvscope packets` shows them.",
            "Were the frames cut so short that the list identifier was lost? Record without a snap length (`-s 0` of "
            "dumpcap and tcpdump).",
        )
    return (
        "Does the sender run, and the task its list belongs to? A list sent on change or on an event says nothing "
        "while nothing changes.",
        "Can the telegrams get to where you record? Broadcasts stay within their VLAN and do not pass routers; "
        "unicast is seen only where the sender's or the reader's port is mirrored.",
        "Was the right interface recorded, without a capture filter that leaves them out? Any port is recognized, "
        "not only 1202.",
        "Were the frames cut (snap length)? At least the first 12 bytes of the UDP payload are needed.",
        f"Are they encapsulated or fragmented? Findings {UNSUPPORTED_LINK_TYPE.code} and the other frames tell.",
        "`-d tcp.port==PORT,http` looks for WebVisu on a TCP port other than 80 and 8080.",
    )


def about(
    finding: Row, list_names: Mapping[str, str | None], node_names: Mapping[str, str]
) -> tuple[list[str], list[str]]:
    """Return what a finding is about: list and node with their names, and its SubIndex, as far as it has them."""
    named = []
    if finding["list"] is not None:
        named.append(_named(units.list_key(finding["list"]), list_names.get(finding["list"])))
    elif "channel" in finding:
        named.append(f"channel {finding['channel']}")
    if finding["node"] is not None:
        named.append(_named(finding["node"], node_names.get(finding["node"])))
    return named, part(finding)


def part(finding: Row) -> list[str]:
    """Return which telegram of its list a finding is about; on CAN, that is a COB-ID."""
    if finding["subindex"] is None:
        return []
    if "channel" not in finding:
        return [f"SubIndex {finding['subindex']}"]
    identifier = finding["list"].rpartition("/")[2]
    # An identifier of 29 bits is a list of its own.
    return [] if identifier.endswith("x") else [f"COB-ID {units.cob_id(int(identifier) + finding['subindex'])}"]


def list_names(report: Report) -> dict[str, str | None]:
    """Return the names of the lists, by key."""
    return {entry["key"]: entry["name"] for entry in report["lists"]}


def evidence(finding: Row, clock: Clock) -> str:
    """Return when a finding's events were, and in which frames."""
    first_ns, last_ns = nanoseconds(finding["first_ns"]), nanoseconds(finding["last_ns"])
    parts = []
    if first_ns is not None and last_ns is not None:
        first, last = clock.moment(first_ns), clock.moment(last_ns)
        if first == last:
            parts.append(f"{first} ({clock.since_start(first_ns)})")
        else:
            parts.append(f"{first} to {last} ({clock.since_start(first_ns)} to {clock.since_start(last_ns)})")
    frames = finding["frames"]
    if frames:
        more = finding["frames_cut"]
        text = ("frame " if len(frames) == 1 else "frames ") + ", ".join(str(frame) for frame in frames)
        parts.append(f"{text} and {units.count(more)} more" if more > 0 else text)
    return "; ".join(parts)


def _named(key: str, name: str | None) -> str:
    return f"{key} {name}" if name else key
