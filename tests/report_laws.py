"""What has to hold within any report, whatever it is about: orders, and what is told of the findings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from ipaddress import ip_address
from typing import Any

SEVERITIES = ("error", "warning", "note")
FRAMES_NAMED = 10

Row = Mapping[str, Any]


def broken_laws(report: Row) -> list[str]:
    """Return what does not hold in a report, a line each."""
    return [*_orders(report), *_verdicts(report), *_frames(report), *_drops(report["capture"])]


def _orders(report: Row) -> Iterator[str]:
    lists, findings = report["lists"], report["findings"]
    yield from _rising("lists", lists, lambda row: list_order(row["key"]))
    for row in lists:
        for key in ("senders", "readers"):
            yield from _rising(f"{row['key']} {key}", row[key], node_order)
        yield from _rising(f"{row['key']} nodes", row["nodes"], lambda node: node_order(node["address"]))
        yield from _rising(f"{row['key']} streams", row["streams"], _stream_order)
    yield from _rising("findings", findings, _finding_order, distinct=False)


def list_order(key: str) -> tuple[Any, ...]:
    """Return by what lists are sorted: transport, port or channel, identifier (29 bits behind 11)."""
    transport, _, rest = key.partition("/")
    place, _, identifier = rest.rpartition("/")
    number = int(identifier.removesuffix("x"))
    return transport, int(place) if transport == "udp" else place, identifier.endswith("x"), number


def node_order(address: str) -> tuple[int, int]:
    """Return by what nodes are sorted: IPv4 before IPv6, then the address as a number."""
    parsed = ip_address(address)
    return parsed.version, int(parsed)


def _stream_order(row: Row) -> tuple[Any, ...]:
    return () if row["node"] is None else node_order(row["node"]), row["subindex"]


def _finding_order(row: Row) -> tuple[Any, ...]:
    place: tuple[Any, ...] = ("can", row["channel"]) if row.get("channel") and row["list"] is None else ()
    place = place if row["list"] is None else list_order(row["list"])
    node = () if row["node"] is None else node_order(row["node"])
    return (
        SEVERITIES.index(row["severity"]),
        row["code"],
        place,
        node,
        -1 if row["subindex"] is None else row["subindex"],
    )


def _rising(what: str, rows: Sequence[Any], order: Any, *, distinct: bool = True) -> Iterator[str]:
    keys = [order(row) for row in rows]
    if keys != sorted(keys):
        yield f"{what} are not in order"
    if distinct and len(set(keys)) < len(keys):
        yield f"{what} are there twice"


def _verdicts(report: Row) -> Iterator[str]:
    found: dict[str, list[str]] = {row["key"]: [] for row in report["lists"]}
    beside = []
    for finding in report["findings"]:
        concerned = finding.get("lists", []) if finding["list"] is None else [finding["list"]]
        for key in concerned:
            found.get(key, []).append(finding["severity"])
        if not any(key in found for key in concerned) and "lists" not in finding:
            beside.append(finding["severity"])
    for row in report["lists"]:
        status = next((word for word in SEVERITIES if word in found[row["key"]]), "ok")
        statuses = (*SEVERITIES, "ok")
        # What a filter hides makes no list good.
        hidden = "filter" in report and statuses.index(row["status"]) < statuses.index(status)
        if row["status"] != status and not hidden:
            yield f"{row['key']} is {row['status']}, and its worst finding {status}"
    counted = {
        "lists": _counted([row["status"] for row in report["lists"]], (*SEVERITIES, "ok")),
        "findings": _counted([row["severity"] for row in report["findings"]], SEVERITIES),
        "findings_beside_lists": _counted(beside, SEVERITIES),
    }
    if report["totals"] != counted:
        yield f"totals are {report['totals']}, and counted {counted}"


def _counted(words: Sequence[str], known: Sequence[str]) -> dict[str, int]:
    counts = Counter(words)
    return {word: counts[word] for word in known}


def _frames(report: Row) -> Iterator[str]:
    for row in report["findings"]:
        named, cut = len(row["frames"]), row["frames_cut"]
        if named > FRAMES_NAMED or cut != (max(row["count"] - named, 0) if named else 0):
            yield f"{row['code']} happened {row['count']} times, names {named} frames and cuts {cut}"


def _drops(capture: Row) -> Iterator[str]:
    parts = capture["drops_by"]
    if (parts is None) != (capture["drops"] is None):
        yield f"drops are {capture['drops']}, by part {parts}"
    elif parts is not None and (sum(parts.values()) > capture["drops"] or 0 in parts.values()):
        yield f"{capture['drops']} drops are {parts}"
