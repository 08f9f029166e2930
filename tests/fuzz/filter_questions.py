"""Questions with a filter: a part of the whole, and nothing else."""

from __future__ import annotations

from typing import Any

from tests.fuzz.asked import READ, Asked

EXPRESSIONS = (
    "nv.index == 1", "nv.flags.ack", "list.lost > 0", "list.name == \"axis\"", "list.nSendCount > 3",
    "finding.code == \"NV201\"", "finding.severity == \"error\"", "finding.code in {\"NV405\", \"NV101\", \"NV502\"}",
    "finding.count > 1 && list.id < 10", "node.lost > 0 || nv.subindex == 0", "nv.data[0:2] == 01:02",
    "frame.time_relative < 0.5", "frame.time_delta > 1", "ip.src in {10.0.0.0/8} && !nv.fault", "nv.counter & 1",
    "cause.kind == \"second-sender\"", "cause.severity == \"error\" && finding.count > 1", "!cause.kind",
    "nv.data contains \"a\"", "finding.message matches \"lost\"",
)  # fmt: skip


def ask_filtered(asked: Asked, whole: Any) -> None:
    rng = asked.rng
    expression = rng.choice(EXPRESSIONS)
    names = [row["name"] for entry in whole["lists"] for row in entry.get("values") or ()]
    if names and rng.random() < 0.5:
        name = rng.choice(names).replace(" ", "")
        expression = rng.choice(("var.{}", "var.{} == 1", "var.{} > 0.5", 'var.{} contains "a"', "!var.{}")).format(
            name
        )
    asked.on_capture("report", "-Y", expression, *rng.choice(((), ("--md",), ("-v",))))
    report = asked.on_capture("report", "--json", "-Y", expression)
    chosen = asked.on_capture("packets", "-T", "ndjson", "-Y", expression)
    assert (report.code in READ) == (chosen.code in READ)
    if report.code not in READ:
        return
    _check_part(report.document(), whole)
    assert report.document()["filter"]["telegrams"] == len(chosen.records())
    rest = asked.on_capture("packets", "-T", "ndjson", "-Y", f"!({expression})").records()
    everything = asked.on_capture("packets", "-T", "ndjson", defined=False).records()
    capture = whole["capture"]
    assert len(everything) == capture["telegrams"] + capture.get("can_frames", 0), len(everything)
    frames = sorted(row["frame.number"] for row in [*chosen.records(), *rest])
    if "finding." in expression or "cause." in expression:
        # A telegram may show a finding or cause that is chosen, and one that is not.
        frames = sorted(set(frames))
    assert frames == [row["frame.number"] for row in everything], expression
    asked.on_capture("packets", "-V", "-c", "30", *rng.choice(((), ("-x",))))
    asked.on_capture("packets", "-c", "30", "-Y", expression)


def _check_part(part: Any, whole: Any) -> None:
    """Rows of a filtered report are rows of the whole one."""
    lists = {entry["key"]: entry for entry in whole["lists"]}
    for entry in part["lists"]:
        full = lists[entry["key"]]
        for name in ("diag", "counters", "name", "port", "channel", "id"):
            assert entry.get(name) == full.get(name), name
        for name in ("nodes", "streams"):
            assert all(row in full[name] for row in entry[name]), name
        for row in entry.get("values") or ():
            same = [one for one in full["values"] if _row_key(one) == _row_key(row) and one["name"] == row["name"]]
            assert same
            assert row["telegrams"] <= same[0]["telegrams"]
    assert all(finding in whole["findings"] for finding in part["findings"])
    assert part["capture"] == whole["capture"]


def _row_key(row: Any) -> tuple[str, int]:
    return row["sender"], row["subindex"]
