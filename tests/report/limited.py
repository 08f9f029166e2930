"""The law of limited reports: what is said with a limit of streams is said without one, too, or is unknown.

Sums over several streams are those of what is told apart: there may be less of everything, and never more findings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

Document = Mapping[str, Any]

OF_A_PLACE = {"NV402", "NV403"}
"""Findings whose senders are compared with each other: which of them differs hangs on who came before."""

IN_PART = {
    "NV101", "NV102", "NV103", "NV104", "NV105", "NV106", "NV107",  # of any kind of telegrams
    "NV302", "NV303", "NV305", "NV402", "NV403", "NV501",
}  # fmt: skip
"""Findings about one stream or node that may count less than there is."""

ERRORS = ("sLastError", "tLastError", "nErrorCount")
AWAITED = ("missing_acknowledgements", "checksum_mismatches", "bootup_unanswered")


def invented(limited: Document, unlimited: Document) -> list[str]:
    """Return what a limited report says and the unlimited one on the same capture does not."""
    return [*_findings(limited, unlimited), *_figures(limited, unlimited)]


def _places(finding: Document) -> Iterator[tuple[Any, ...]]:
    code = finding["code"]
    for number in finding.get("lists") or [finding["list"]]:
        key = number
        if code in ("NV601", "NV602"):  # of a definition: said of no channel, or of those on which it is seen
            key = key.rpartition("/")[2]
        yield code, key, None if code in OF_A_PLACE else finding["node"], finding["subindex"]


def _findings(limited: Document, unlimited: Document) -> Iterator[str]:
    known: dict[tuple[Any, ...], list[Document]] = {}
    for finding in unlimited["findings"]:
        for place in _places(finding):
            known.setdefault(place, []).append(finding)
            known.setdefault((*place[:2], None, place[3]), []).append(finding)  # said of nobody in particular
    for finding in limited["findings"]:
        if finding["code"] == "NV906":
            continue
        for place in _places(finding):
            others = known.get(place, [])
            if not any(other["severity"] == finding["severity"] for other in others):
                yield f"{place}: {finding['message']}"
                continue
            most = sum(other["count"] for other in others)
            whole = None not in place[2:] and finding["code"] not in IN_PART
            if finding["count"] > most and finding["code"] not in OF_A_PLACE:
                yield f"{place}: {finding['count']} of {most} events"
            elif whole and finding["count"] != most:
                yield f"{place}: {finding['count']} events, not {most}"


def _figures(limited: Document, unlimited: Document) -> Iterator[str]:
    lists = {entry["key"]: entry for entry in unlimited["lists"]}
    for entry in limited["lists"]:
        key, whole = entry["key"], lists[entry["key"]]
        streams = {(stream["node"], stream["subindex"]): stream for stream in whole["streams"]}
        for stream in entry["streams"]:
            place = stream["node"], stream["subindex"]
            yield from _unlike(stream, streams[place], f"{key} {place}")
        nodes = {node["address"]: node["diag"] for node in whole["nodes"]}
        diags = [(entry["diag"], whole["diag"], key)]
        diags += [(node["diag"], nodes[node["address"]], f"{key} {node['address']}") for node in entry["nodes"]]
        for own, other, where in diags:
            yield from _unlike({name: own[name] for name in ERRORS}, other, where)
        for name in AWAITED:
            number = entry["counters"][name]
            if number is not None and number > whole["counters"][name]:
                yield f"{key} {name}: {number}, not {whole['counters'][name]}"
    buses = {bus["channel"]: bus for bus in unlimited.get("buses", ())}
    for bus in limited.get("buses", ()):
        told = {name: value for name, value in bus.items() if name != "identifiers"}
        yield from _unlike(told, buses[bus["channel"]], bus["channel"])


def _unlike(own: Document, other: Document, where: str) -> Iterator[str]:
    """Yield the figures that are known and others than those of the unlimited report."""
    for name, value in own.items():
        if isinstance(value, Mapping) and isinstance(other[name], Mapping):
            yield from _unlike(value, other[name], f"{where} {name}")
        elif value is not None and value != other[name]:
            yield f"{where} {name}: {value}, not {other[name]}"
