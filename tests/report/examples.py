"""Reports written by hand, of schema ``nvscope.report/2``: what the faces are tried on.

The builders only fill in what a report must have; every figure that matters to an example is given where it is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

START_NS = 1_714_651_387_123_456_789  # 2024-05-02 12:03:07.123456789 UTC
MS = 1_000_000
S = 1_000_000_000

COUNTERS = (
    "lost", "lost_claimed", "gaps", "longest_gap", "duplicates", "overtaken", "restarts", "malformed", "truncated",
    "missing_acknowledgements", "negative_acknowledgements", "checksum_mismatches", "bootup_requests",
    "bootup_unanswered", "send_rejected",
)  # fmt: skip


def at(offset_ns: int) -> str:
    """Return an absolute time as a report has it."""
    return str(START_NS + offset_ns)


def diag(**components: Any) -> dict[str, Any]:
    return {
        "nSendCount": 0, "tLastSend": None, "nReceiveCount": 0, "tLastReceive": None, "nWriteCount": 0,
        "sLastError": "NOERROR", "tLastError": None, "nErrorCount": 0, "nAcknowledges": 0, **components,
    }  # fmt: skip


def pace() -> dict[str, Any]:
    """Return what comes last of lists, nodes and streams; texts tell jitter by intervals, and nothing else of it."""
    return {"rate": 20.0, "jitter": None, "latency_ns": {"count": 0, "p50": None, "p99": None, "max": None}}


def node(address: str, name: str | None = None, **components: Any) -> dict[str, Any]:
    return {"address": address, "name": name, "diag": diag(**components), **pace()}


def interval(count: int, *statistics_ns: int, nominal: int | None) -> dict[str, Any]:
    """Return intervals with min, mean, max, stddev, p50, p95, p99; without any where there are no statistics."""
    names = ("min", "mean", "max", "stddev", "p50", "p95", "p99")
    values = statistics_ns or (None,) * len(names)
    return {"count": count, **dict(zip(names, values, strict=True)), "nominal": nominal}


def stream(address: str, subindex: int, telegrams: int, interval_ns: dict[str, Any], **facts: Any) -> dict[str, Any]:
    return {
        "node": address, "subindex": subindex, "telegrams": telegrams, "counter_scope": "stream", "lost": 0,
        "lost_claimed": 0, "duplicates": 0, "overtaken": 0, "restarts": 0, "interval_ns": interval_ns, "items": 12,
        "length": 68,
        "checksum": None, **pace(), **facts,
    }  # fmt: skip


def udp_list(port: int, index: int, name: str | None = None, **parts: Any) -> dict[str, Any]:
    counters = {**dict.fromkeys(COUNTERS, 0), **parts.pop("counters", {})}
    return {
        "key": f"udp/{port}/{index}", "transport": "udp", "port": port, "id": index, "name": name, "senders": [],
        "readers": [], "diag": diag(), "counters": counters, "nodes": [], "streams": [], **pace(), **parts,
    }  # fmt: skip


def finding(code: str, name: str, severity: str, message: str, hint: str, **parts: Any) -> dict[str, Any]:
    return {
        "code": code, "name": name, "severity": severity, "list": None, "node": None, "subindex": None, "count": 1,
        "extent": None, "first_ns": None, "last_ns": None, "frames": [], "message": message, "hint": hint, **parts,
        "frames_cut": parts["count"] - len(parts["frames"]) if "frames" in parts and "count" in parts else 0,
    }  # fmt: skip


SEVERITIES = ("error", "warning", "note")


def cause(kind: str, severity: str, title: str, next_step: str, *checked: str, **parts: Any) -> dict[str, Any]:
    """Return a cause; ``findings`` are those that it explains."""
    behind = [{key: one[key] for key in ("code", "list", "node", "subindex")} for one in parts.pop("findings", ())]
    return {
        "kind": kind, "severity": severity, "lists": [], "nodes": [], "channel": None, "since_ns": None,
        "until_ns": None, "frames": [], "frames_cut": 0, "title": title, "checked": list(checked), "next": next_step,
        "findings": behind, **parts,
    }  # fmt: skip


def report(
    capture: dict[str, Any], lists: list[dict[str, Any]], findings: list[dict[str, Any]],
    causes: Sequence[dict[str, Any]] = (),
) -> dict[str, Any]:  # fmt: skip
    """Return a report, in which lists have the status that the findings give them."""
    named = {entry["key"] for entry in lists}
    on = {key: {one["severity"] for one in findings if one["list"] == key} for key in named}
    status = {key: next((word for word in SEVERITIES if word in own), "ok") for key, own in on.items()}
    beside = [one for one in findings if one["list"] not in named]
    return {
        "schema": "nvscope.report/2",
        "tool": {"name": "nvscope", "version": "0.1.0"},
        "capture": {
            "sources": [], "frames": 0, "telegrams": 0, "other_frames": 0, "drops": None, "drops_by": None,
            "start_ns": None, "end_ns": None, "until_ns": None, **capture,
        },
        "totals": {
            "lists": {word: sum(own == word for own in status.values()) for word in (*SEVERITIES, "ok")},
            "findings": {word: sum(one["severity"] == word for one in findings) for word in SEVERITIES},
            "findings_beside_lists": {word: sum(one["severity"] == word for one in beside) for word in SEVERITIES},
        },
        "causes": list(causes),
        "lists": [entry | {"status": status[entry["key"]]} for entry in lists],
        "findings": findings,
    }  # fmt: skip


CLEAN = report(
    {
        "sources": [{"path": "press-line.pcapng", "format": "pcapng", "bytes": 1_234_567, "frames": 5_120}],
        "frames": 5_120, "telegrams": 4_801, "other_frames": 319, "drops": 0, "start_ns": at(0), "end_ns": at(120 * S),
    },
    [
        udp_list(
            1202, 7, "axis", senders=["192.168.1.10"], readers=["192.168.1.20"],
            diag=diag(nSendCount=2_400, tLastSend=at(119_950 * MS), nReceiveCount=4_800, tLastReceive=at(119_951 * MS),
                      nWriteCount=2_400, nAcknowledges=2_400),
            nodes=[
                node("192.168.1.10", "press", nSendCount=2_400, tLastSend=at(119_950 * MS), nReceiveCount=2_400,
                     tLastReceive=at(119_951 * MS)),
                node("192.168.1.20", None, nReceiveCount=2_400, tLastReceive=at(119_950 * MS), nWriteCount=2_400,
                     nAcknowledges=2_400),
            ],
            streams=[
                stream("192.168.1.10", 0, 2_400, interval(2_399, 48_912_000, 50_000_411, 51_204_000, 401_322,
                                                          50_012_000, 50_700_000, 50_933_000, nominal=50_012_000),
                       checksum=0x5A),
            ],
        ),
        udp_list(
            1202, 8, senders=["192.168.1.20"],
            diag=diag(nSendCount=1, tLastSend=at(60 * S), nReceiveCount=1, tLastReceive=at(60 * S), nWriteCount=1),
            nodes=[node("192.168.1.20", None, nSendCount=1, tLastSend=at(60 * S))],
            streams=[stream("192.168.1.20", 0, 1, interval(0, nominal=None), items=1, length=21)],
        ),
    ],
    [],
)  # fmt: skip

TROUBLED = report(
    {
        "sources": [
            {"path": "/captures/2024-05-02/hall-3-night-shift-part-1.pcapng.zst", "format": "pcapng",
             "bytes": 812_345_678, "frames": 9_000_000},
            {"path": "/captures/2024-05-02/hall-3-night-shift-part-2.pcapng.zst", "format": "pcapng",
             "bytes": 91_234_567, "frames": 1_240_017},
        ],
        "frames": 10_240_017, "telegrams": 9_412_330, "other_frames": 827_687, "drops": 17, "start_ns": at(0),
        "end_ns": at(43_200 * S),
    },
    [
        udp_list(
            1202, 1, "conveyor", senders=["192.168.1.10", "192.168.1.77"], readers=["192.168.1.20", "192.168.1.21"],
            diag=diag(nSendCount=4_305_600_123, tLastSend=at(43_199_950 * MS), nReceiveCount=4_305_712_345,
                      tLastReceive=at(43_199_951 * MS), nWriteCount=4_305_500_000, sLastError="NOACKNOWLEDGEMENT",
                      tLastError=at(43_100 * S), nErrorCount=112_222, nAcknowledges=65_536 + 41),
            counters={"lost": 1_204, "lost_claimed": 1_204, "gaps": 977, "longest_gap": 31,
                      "duplicates": 3, "restarts": 2,
                      "missing_acknowledgements": 112_181, "negative_acknowledgements": 41},
            nodes=[
                node("192.168.1.10", "press", nSendCount=4_305_600_000, tLastSend=at(43_199_950 * MS),
                     sLastError="NOACKNOWLEDGEMENT", tLastError=at(43_100 * S), nErrorCount=112_222),
                node("192.168.1.20", "palletizer", nReceiveCount=4_305_600_123, tLastReceive=at(43_199_950 * MS),
                     nWriteCount=4_305_500_000, nAcknowledges=65_536),
                node("192.168.1.21", None, nReceiveCount=4_305_600_123, tLastReceive=at(43_199_950 * MS),
                     nWriteCount=4_305_500_000, nAcknowledges=41),
                node("192.168.1.77", None, nSendCount=123, tLastSend=at(7_200 * S)),
            ],
            streams=[
                stream("192.168.1.10", 0, 2_152_800_000, interval(2_152_799_999, 3_120_000, 20_000_122, 812_000_000,
                                                                  4_222_100, 20_003_000, 21_200_000, 24_100_000,
                                                                  nominal=20_000_000), lost=602, lost_claimed=602,
                       restarts=2, length=276, items=64, checksum=0x2F),
                stream("192.168.1.10", 1, 2_152_800_000, interval(2_152_799_999, 3_118_000, 20_000_122, 812_004_000,
                                                                  4_222_900, 20_003_000, 21_200_000, 24_300_000,
                                                                  nominal=20_000_000), lost=602, lost_claimed=602,
                       duplicates=3, length=80, items=15, checksum=0x31),
                stream("192.168.1.77", 0, 123, interval(122, 1_000_000_000, 58_536_585_366, 3_600_000_000_000,
                                                        12_000_000_000, 1_001_000_000, 61_000_000_000,
                                                        3_500_000_000_000, nominal=None), counter_scope="unused",
                       length=84, items=16),
            ],
        ),
        udp_list(
            1202, 7, "axis", senders=["192.168.1.10"],
            diag=diag(nSendCount=864_000, tLastSend=at(43_199_950 * MS), nReceiveCount=864_000,
                      tLastReceive=at(43_199_950 * MS), nWriteCount=864_000),
            nodes=[node("192.168.1.10", "press", nSendCount=864_000, tLastSend=at(43_199_950 * MS))],
            streams=[stream("192.168.1.10", 0, 864_000, interval(863_999, 48_912_000, 50_000_411, 151_204_000,
                                                                 5_401_322, 50_012_000, 50_700_000, 80_933_000,
                                                                 nominal=50_000_000))],
        ),
        udp_list(
            1300, 42, senders=["2001:db8:10:20:30:40:50:60"],
            diag=diag(nSendCount=1_440, tLastSend=at(43_180 * S), nReceiveCount=1_440, tLastReceive=at(43_180 * S),
                      nWriteCount=1_440),
            nodes=[node("2001:db8:10:20:30:40:50:60", None, nSendCount=1_440, tLastSend=at(43_180 * S))],
            streams=[
                stream("2001:db8:10:20:30:40:50:60", 0, 720, interval(719, 10_000_000, 60_000_000_000, 120_000_000_000,
                                                                      9_000_000_000, 59_000_000_000, 100_000_000_000,
                                                                      119_000_000_000, nominal=None)),
                stream("2001:db8:10:20:30:40:50:60", 3, 720, interval(719, 999_960_000, 60_000_000_000, 120_000_000_000,
                                                                      9_000_000_000, 30_000_000_000, 100_000_000_000,
                                                                      119_000_000_000, nominal=None)),
            ],
        ),
        udp_list(1300, 43, senders=["10.0.0.9"], diag=diag(nSendCount=5, tLastSend=at(S), nReceiveCount=5,
                                                           tLastReceive=at(S), nWriteCount=5),
                 nodes=[node("10.0.0.9", None, nSendCount=5, tLastSend=at(S))],
                 streams=[stream("10.0.0.9", 0, 5, interval(4, 1_000, 2_500, 4_000, 1_100, 2_000, 4_000, 4_000,
                                                            nominal=None))]),
    ],
    [
        finding("NV201", "telegram-gap", "error",
                "1 204 telegrams are missing in 977 gaps, 0.1 % of what was sent; the longest gap is 31.",
                "Compare with the drops of the capture (NV901), then read the error counters of the switch ports.",
                list="udp/1202/1", node="192.168.1.10", subindex=0, count=977, first_ns=at(12 * S),
                last_ns=at(43_000 * S), frames=[1_204, 5_120, 77_812, 100_204, 100_207, 3_120_412, 3_120_420, 8_120_001,
                                                9_000_123, 9_120_412]),
        finding("NV301", "no-acknowledgement", "error",
                "112 181 of 4 305 600 000 telegrams that asked for an acknowledgement got none before the next "
                "telegram or within 1.0 s; 192.168.1.20 and 192.168.1.21 acknowledged others.",
                "Read nErrorCount on 192.168.1.10; if it stays, mirror the port of the sender and capture again.",
                list="udp/1202/1", node="192.168.1.10", subindex=0, count=112_181, first_ns=at(3 * S),
                last_ns=at(43_100 * S), frames=[122, 131]),
        finding("NV401", "several-senders", "error",
                "2 nodes send this list: 192.168.1.10 (4 305 600 000 telegrams) and 192.168.1.77 (123).",
                "Find 192.168.1.77 and stop it, or give its list another identifier.",
                list="udp/1202/1", count=1, first_ns=at(7_000 * S), last_ns=at(7_000 * S), frames=[1_402_112]),
        finding("NV502", "jitter", "warning", "The jitter is 61.8 % of the interval of 50.0 ms.",
                "Make the interval a multiple of the task cycle.",
                list="udp/1202/7", node="192.168.1.10", subindex=0, first_ns=at(0), last_ns=at(43_199_950 * MS)),
        finding("NV901", "capture-drops", "warning", "17 frames were dropped while capturing.",
                "Record again with a capture filter and a larger buffer before looking for loss.", count=17),
        finding("NV205", "counter-unused", "note", "All 123 telegrams have the Counter 1.",
                "Judge loss by the intervals.", list="udp/1202/1", node="192.168.1.77", subindex=0,
                first_ns=at(7_000 * S), last_ns=at(7_200 * S), frames=[1_402_112]),
        finding("NV503", "burst", "note", "5 telegrams came within 10.0 µs.", "Set a minimum gap.", list="udp/1300/43",
                node="10.0.0.9", subindex=0, first_ns=at(S), last_ns=at(S), frames=[97]),
    ],
    [
        cause("second-sender", "error", "A further node sends list conveyor since 7 000.0 s: 192.168.1.77",
              "Stop 192.168.1.77, or give its list another identifier: readers take turns between both.",
              "192.168.1.10: 64 items in 276 bytes, checksum 16#2F", "192.168.1.77: 16 items in 84 bytes",
              "different hardware addresses: two devices, not one address twice",
              lists=["udp/1202/1"], nodes=["192.168.1.77", "192.168.1.10"], since_ns=at(7_000 * S), frames=[1_402_112],
              findings=[{"code": "NV401", "list": "udp/1202/1", "node": None, "subindex": None}]),
        cause("reader-silent", "error", "None of 2 readers answered for list conveyor, 112 181 times", "Their logs.",
              "they answered the others, in 3.5 ms", lists=["udp/1202/1"], nodes=["192.168.1.20", "192.168.1.21"],
              since_ns=at(3 * S), until_ns=at(43_100 * S),
              findings=[{"code": "NV301", "list": "udp/1202/1", "node": "192.168.1.10", "subindex": 0}]),
        cause("loss-of-list", "error", "List conveyor of press lost 1 204 telegrams, from 12.0 s to 43 000.0 s",
              "The error counters of the sender's switch port, and whether its stack drops when a cycle has several "
              "telegrams.", "no other sender lost any then: not the capture", "0.1 % of what it sends",
              lists=["udp/1202/1"], nodes=["192.168.1.10"], since_ns=at(12 * S), until_ns=at(43_000 * S),
              findings=[{"code": "NV201", "list": "udp/1202/1", "node": "192.168.1.10", "subindex": 0}]),
        cause("sender-late", "warning", "Node press sent list axis late, 7 times from 3.0 s to 43 100.0 s",
              "The cycle and priority of the task that sends it.", "up to 151.2 ms, 3.0 times the nominal 50.0 ms",
              lists=["udp/1202/7"], nodes=["192.168.1.10"], since_ns=at(3 * S), until_ns=at(43_100 * S),
              findings=[{"code": "NV502", "list": "udp/1202/7", "node": "192.168.1.10", "subindex": 0}]),
    ],
)  # fmt: skip

NO_TELEGRAMS = report(
    {
        "sources": [{"path": "office.pcap", "format": "pcap", "bytes": 54_321, "frames": 412}],
        "frames": 412, "other_frames": 412, "start_ns": at(0), "end_ns": at(31 * S),
    },
    [],
    [
        finding("NV904", "unsupported-link-type", "warning", "12 frames have link type 127 (IEEE 802.11 radiotap).",
                "Record on an Ethernet interface.", count=12, frames=[1, 2, 3], first_ns=at(0), last_ns=at(5 * S)),
    ],
)  # fmt: skip

NO_FRAMES = report({"sources": [{"path": "empty.pcap", "format": "pcap", "bytes": 24, "frames": 0}]}, [], [])

NO_FRAMES_THEN = report({"sources": [{"path": "day.pcap", "format": "pcap", "bytes": 99_000, "frames": 990}]}, [], [])

ONLY_PARAMETERS = report(
    {
        "sources": [{"path": "sdo.pcap", "format": "pcap", "bytes": 999, "frames": 9}],
        "frames": 9, "telegrams": 8, "other_frames": 1, "start_ns": at(0), "end_ns": at(400 * MS),
    },
    [],
    [],
)  # fmt: skip

_EVIL = "\x1b[2J\x1b]0;owned\x07"
_TURNED = "\u202egpj.exe"

HOSTILE = report(
    {
        "sources": [{"path": f"{_EVIL}a|b\n`rm`.pcap\udc80", "format": "pcap", "bytes": 4_096, "frames": 3}],
        "frames": 3, "telegrams": 3, "other_frames": 0, "start_ns": at(0), "end_ns": at(1),
    },
    [
        udp_list(
            1202, 666, f"[bold]{_TURNED}[/bold]", senders=["10.0.0.1"],
            diag=diag(nSendCount=3, tLastSend=at(1), nReceiveCount=3, tLastReceive=at(1), nWriteCount=3),
            nodes=[node("10.0.0.1", f"<img src=x>|@all\u200b{_EVIL}", nSendCount=3, tLastSend=at(1))],
            streams=[stream("10.0.0.1", 0, 3, interval(2, -5, 1, 7, 8, 1, 7, 7, nominal=None),
                            counter_scope="\x9b31m")],
        ),
    ],
    [
        finding("NV402", "shape-changed", "error", f"The name is {_TURNED} and C:\\new, seen at https://example.org.",
                "1. Ask #1 <b>now</b>\r\n| or | later |", list="udp/1202/666", node="10.0.0.1", subindex=0,
                first_ns=at(1), last_ns=at(1), frames=[3]),
    ],
    [
        cause("definition-differs", "error", f"List [bold]{_TURNED}[/bold] does not fit its definition since 0.0 s",
              "1. Ask #1 <b>now</b>\r\n| or | later |", f"<img src=x>|@all{_EVIL} sends C:\\new", "**not** bold",
              lists=["udp/1202/666"], nodes=["10.0.0.1"], since_ns=at(1),
              findings=[{"code": "NV402", "list": "udp/1202/666", "node": "10.0.0.1", "subindex": 0}]),
    ],
)  # fmt: skip

ALIKE = report(
    {
        "sources": [{"path": "line.pcap", "format": "pcap", "bytes": 800_600, "frames": 4_823}],
        "frames": 4_823, "telegrams": 4_823, "start_ns": at(0), "end_ns": at(20 * S),
    },
    [
        udp_list(
            1202, index, f"GVL_NetVars_Conveyor_Station{index:02}_Send", senders=[f"192.168.1.{10 + index % 2}"],
            diag=diag(nSendCount=119, nErrorCount=0), counters={"lost": 1 + index % 3, "gaps": 1},
            nodes=[node(f"192.168.1.{10 + index % 2}", f"Hall3_Press_Line_{('Left', 'Right')[index % 2]}")],
            streams=[
                stream(f"192.168.1.{10 + index % 2}", 0, 119, interval(118, 98 * MS, 100 * MS, 201 * MS, MS, 100 * MS,
                                                                       101 * MS, 101 * MS, nominal=100 * MS)),
            ],
        )
        for index in range(1, 13)
    ],
    [
        *(
            finding("NV201", "telegram-gap", "error", f"{1 + index % 3} of 120 telegrams lost, all in one gap.",
                    "First rule out the capture: drops in the capture (NV901).", list=f"udp/1202/{index}",
                    node=f"192.168.1.{10 + index % 2}", subindex=0, first_ns=at(4 * S + index * 100 * MS),
                    last_ns=at(4 * S + index * 100 * MS), frames=[1_600 + index], extent=1 + index % 3)
            for index in range(1, 13)
        ),
        *(
            finding("NV504", "stopped", "error", "Silent for the last 8.0 s; nominal is 100.0 ms.",
                    "See whether all lists of this node stopped together (controller, cable) or only this one (task).",
                    list=f"udp/1202/{index}", node=f"192.168.1.{10 + index % 2}", subindex=0,
                    first_ns=at(12 * S + index * 1_000), last_ns=at(12 * S + index * 1_000), frames=[4_700 + index])
            for index in range(1, 13) if index != 5
        ),
    ],
    [
        *(
            cause("node-silent", "error", f"Node Hall3_Press_Line_{side} is silent since 12.0 s (6 lists)",
                  "Its power and LEDs, then its cable and switch port. Its task comes last.",
                  "nothing of it came afterwards, ARP included", nodes=[f"192.168.1.{10 + number}"],
                  lists=[f"udp/1202/{index}" for index in range(1, 13) if index % 2 == number and index != 5],
                  since_ns=at(12 * S),
                  findings=[{"code": "NV504", "list": f"udp/1202/{index}", "node": f"192.168.1.{10 + number}",
                             "subindex": 0} for index in range(1, 13) if index % 2 == number and index != 5])
            for number, side in enumerate(("Left", "Right"))
        ),
        cause("capture-incomplete", "error", "The capture lacks 25 telegrams, since 4.1 s",
              "Capture with more room: a faster mirror port.", "up to 2 senders lose within 0.1 s of each other",
              lists=[f"udp/1202/{index}" for index in range(1, 13)], since_ns=at(4 * S), until_ns=at(6 * S),
              findings=[{"code": "NV201", "list": f"udp/1202/{index}", "node": f"192.168.1.{10 + index % 2}",
                         "subindex": 0} for index in range(1, 13)]),
    ],
)  # fmt: skip

EXAMPLES = {
    "clean": CLEAN,
    "troubled": TROUBLED,
    "no-telegrams": NO_TELEGRAMS,
    "no-frames": NO_FRAMES,
    "no-frames-then": NO_FRAMES_THEN,
    "only-parameters": ONLY_PARAMETERS,
    "hostile": HOSTILE,
    "alike": ALIKE,
}
