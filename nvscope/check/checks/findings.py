"""Checks of what a report says: its findings and causes; and whether a capture is good enough to be judged."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from nvscope.causes.catalogue import KINDS
from nvscope.check.check import Check, Evidence
from nvscope.check.happened_while import Happened, judged_of, judged_while, title_of, watch_what_happens
from nvscope.check.parameters import AMOUNT, Parameter, one_of
from nvscope.check.verdict import Judged, Verdict
from nvscope.enumeration import first_few
from nvscope.findings.catalogue import CATALOGUE as FINDINGS
from nvscope.findings.finding import Finding
from nvscope.findings.kind import Severity
from nvscope.list_key import ListKey
from nvscope.toml_table import LENGTH, TEXT, array, choice
from nvscope.units import count_of, duration

_SEVERITY = choice(*(one.name.lower() for one in Severity))
_FINDINGS = one_of("code or name of a finding", [text for one in FINDINGS.values() for text in (one.code, one.name)])
_CAUSES = one_of("kind of a cause", [one.name for one in KINDS])
_MOST_NAMED = 3
_SECOND_NS = 1_000_000_000


def _told(titles: list[str]) -> str:
    return first_few(titles, _MOST_NAMED, between="; ")


def _lists_of(known: Evidence, finding: Finding) -> set[ListKey]:
    """Return the lists that a finding is about; none where it is about the capture, or a channel."""
    if finding.key is not None:
        return {finding.key}
    numbers = finding.lists if finding.list_number is None else (finding.list_number,)
    return {known.keys[number] for number in numbers if number in known.keys}


def _concerns(
    known: Evidence, about: set[ListKey], nodes: Iterable[int], lists: Collection[ListKey], told: Mapping[str, Any]
) -> bool:  # fmt: skip
    """Tell whether what is about some lists and nodes is what a rule is for; without any told, everything is."""
    if told["list_named"] and not about & set(lists):
        return False
    if not told["node"]:
        return True
    named = set(told["node"])
    addresses = [address for one in nodes if (address := known.node(one)) is not None]
    return any({one, known.project.node_names.get(one, one)} & named for one in addresses)


def _of_found(known: Evidence, every: Sequence[Happened], told: Mapping[str, Any], unit: str) -> Judged:
    """Return the verdict on all that should not be there, as far as it is judged."""
    found, verdict, reason = judged_while(every, told["watched"])
    unknown = [] if found else known.unknown_nodes(told["node"])
    if unknown:
        nobody = f"no node is called {', '.join(unknown)}"
        return Judged(Verdict.INCONCLUSIVE, reason=nobody, limit=0, unit=unit, vacuous=True)
    return judged_of(found, verdict, reason or _told([title_of(one) for one in found]), unit)


def _findings(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    least, allowed = Severity.of(told["severity"]), set(told["allow"])
    found = [
        one for one in known.findings
        if one.kind.severity >= least and not {one.code, one.kind.name} & allowed
        and _concerns(known, _lists_of(known, one), set() if one.node is None else {one.node}, lists, told)
    ]  # fmt: skip
    yield _of_found(known, found, told, "findings")


def _causes(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    least, allowed = Severity.of(told["severity"]), set(told["allow"])
    found = [
        one for one in known.causes
        if one.severity >= least and one.kind.name not in allowed
        and _concerns(known, set(one.lists), set(one.nodes), lists, told)
    ]  # fmt: skip
    yield _of_found(known, found, told, "causes")


def _quality(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    length_ns = known.covered_ns
    step_ns, stepped_ns = max(((step_ns, at_ns) for at_ns, step_ns in known.frames.clock_steps), default=(0, None))
    # What is told in figures is what is broken first; of a capture that is good enough, what it lost.
    drops = Judged(Verdict.PASS, worst=known.drops, limit=told["max_drops"], unit="frames")
    broken = []
    if known.drops > told["max_drops"]:
        broken.append((f"it lost {count_of(known.drops, 'frame')}", drops))
    if length_ns < told["min_duration"]:
        least = Judged(
            Verdict.PASS, worst=length_ns / _SECOND_NS, limit=told["min_duration"] / _SECOND_NS, above=False, unit="s"
        )
        broken.append((f"it is {duration(told['min_duration'] - length_ns)} too short", least))
    if step_ns > told["max_clock_step"]:
        most = told["max_clock_step"] / _SECOND_NS
        step = Judged(Verdict.PASS, worst=step_ns / _SECOND_NS, limit=most, unit="s", first_ns=stepped_ns)
        broken.append((f"its clock stepped back by {duration(step_ns)}", step))
    if known.truncated:
        broken.append((f"it ends before its end: {known.truncated}", Judged(Verdict.PASS)))
    judged = broken[0][1] if broken else drops
    told_of = "; ".join(text for text, _ in broken)
    yield replace(judged, verdict=Verdict.FAIL if broken else Verdict.PASS, reason=told_of)


_NODE = Parameter("node", array(TEXT, single=True), "of these nodes only, by address or name", ())

CHECKS = (
    Check(
        "findings", "capture", "A report has no findings but those that are allowed.", "findings", "there is one",
        'check = "findings"\nseverity = "error"\nallow = ["NV502"]', _findings,
        (
            Parameter("severity", _SEVERITY, "from which on they count", "warning"),
            Parameter("allow", array(_FINDINGS, single=True), "codes or names of those that may be", ()), _NODE,
        ),
        watch_what_happens, at_times=True, of_all=True,
    ),
    Check(
        "causes", "capture", "A report has no causes but those that are allowed.", "causes", "there is one",
        'check = "causes"\nallow = ["node-restart"]', _causes,
        (
            Parameter("severity", _SEVERITY, "from which on they count", "warning"),
            Parameter("allow", array(_CAUSES, single=True), "kinds of those that may be", ()), _NODE,
        ),
        watch_what_happens, at_times=True, of_all=True,
    ),
    Check(
        "capture_quality", "capture", "The capture is good enough to be judged.", "frames that it lost",
        "it lost more than max_drops, is shorter than min_duration, ends before its end, or its clock stepped",
        'check = "capture_quality"\nmin_duration = "30s"', _quality,
        (
            Parameter("max_drops", AMOUNT, "so many frames may be lost while capturing", 0),
            Parameter("min_duration", LENGTH, "how long it has to be", 0),
            Parameter("max_clock_step", LENGTH, "so far its clock may step back", 1_000_000),
        ),
        of_all=True,
    ),
)  # fmt: skip
