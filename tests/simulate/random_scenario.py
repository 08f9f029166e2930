"""Scenarios at random: a small plant with every kind of fault in some of them, as TOML text."""

from __future__ import annotations

import random
from typing import Any

Table = dict[str, Any]

COUNTERS = ("stream", "stream", "stream", "telegram", "send", "list", "constant")
MALFORMED = ("short", "stub", "wrong_length", "byte_swapped_length", "unknown_service")
GROUPS = (["10.0.0.255", "225.10.10.11"], ["ff02::1", "ff05::abcd"])
CHANCE_FAULTS: dict[str, Table] = {
    "loss": {"probability": 0.02},
    "fragmented": {"probability": 0.005},
    "duplicate": {"probability": 0.02},
    "overtaken": {"probability": 0.01},
    "truncated": {"probability": 0.02},
    "wrong_checksum": {"probability": 0.02},
    "checksum_flag": {"probability": 0.01},
    "reserved_flags": {"probability": 0.02},
    "ascii_identity": {"probability": 0.01},
    "malformed": {"probability": 0.02},
    "missing_acknowledgement": {"probability": 0.05},
    "negative_acknowledgement": {"probability": 0.03},
    "unexpected_acknowledgement": {"probability": 0.01},
    "unreachable": {"probability": 0.01},
    "late": {"every": 17},
    "shape": {"probability": 0.01},
}


def random_scenario(seed: int) -> str:
    """Return a scenario that is not wild: its truth is exact."""
    chance = random.Random(seed)
    version6 = chance.random() < 0.2
    nodes = [node(chance, number, "fd00::" if version6 else "10.0.0.") for number in range(chance.randint(2, 4))]
    lists = [plan(chance, number, nodes) for number in range(chance.randint(1, 5))]
    for name in {entry["sender"] for entry in lists}:
        own = [entry for entry in lists if entry["sender"] == name]
        counter = next(entry for entry in nodes if entry["name"] == name)
        if counter["counter"] == "list" and len(own) > 1:
            for entry in own:
                entry["bytes"] = entry["bytes"][:1]
    readers = [reader(chance, lists, nodes) for _ in range(chance.randint(0, 4))]
    readers = list({(entry["node"], entry["list"]): entry for entry in readers}.values())
    tables = {"node": nodes, "list": lists, "reader": readers, "traffic": traffic(chance, nodes)}
    tables["parameter"] = parameters(chance, nodes)
    tables |= faults(chance, lists, nodes, readers) | events(chance, lists, nodes)
    top = {
        "title": f"random {seed}",
        "seed": seed,
        "duration": chance.choice(["3s", "5s", "8s"]),
        "link": chance.choice(["ethernet", "ethernet", "sll", "sll2", "raw", "null", "loop"]),
        "snap_length": chance.choice([0, 0, 0, 0, 100]),
    }
    return toml(top, tables)


def node(chance: random.Random, number: int, network: str) -> Table:
    entry: Table = {
        "name": f"n{number}",
        "address": f"{network}{number + 1}",
        "counter": chance.choice(COUNTERS),
        "first_value": chance.choice([0, 1, 1, 1]),
    }
    if chance.random() < 0.2:
        entry["last_value"] = chance.choice([255, 65_534])
    elif chance.random() < 0.2:
        entry["first_value"] = chance.randint(65_300, 65_500)
        entry["carry_into_flags"] = chance.random() < 0.5
    entry["changing_port"] = chance.random() < 0.3
    entry["ip_options"] = chance.random() < 0.2
    entry["vlan"] = chance.choice([[], [], [7], [7, 100]])
    return entry


def plan(chance: random.Random, number: int, nodes: list[Table]) -> Table:
    entry: Table = {
        "name": f"list{number}",
        "index": number + 1,
        "port": chance.choice([1202, 1202, 1300]),
        "sender": chance.choice(nodes)["name"],
        "bytes": [chance.choice([0, 1, 2, 4, 37, 256]) for _ in range(chance.choice([1, 1, 2, 3]))],
        "packed": chance.random() < 0.8,
        "interval": f"{chance.choice([20, 50, 73, 100, 400])}ms",
        "jitter": f"{chance.choice([0, 0, 300, 1000])}us",
        "phase": f"{chance.randint(0, 30)}ms",
        "mode": chance.choice(["cyclic", "cyclic", "cyclic", "on_change"]),
        "values": chance.choice(["ramp", "noise"]),
        "acknowledge": chance.random() < 0.5,
        "destination": chance.choice(["broadcast", *GROUPS[":" in nodes[0]["address"]], chance.choice(nodes)["name"]]),
    }
    if entry["destination"] == entry["sender"]:
        entry["destination"] = "broadcast"
    if chance.random() < 0.5:
        entry["checksum"] = chance.randint(0, 255)
    return entry


def reader(chance: random.Random, lists: list[Table], nodes: list[Table]) -> Table:
    entry: Table = {
        "node": chance.choice(nodes)["name"],
        "list": chance.choice(lists)["name"],
        "delay": f"{chance.choice([500, 2000, 4000])}us",
        "jitter": f"{chance.choice([0, 900])}us",
        "echo_counter": chance.random() < 0.5,
        "to": chance.choice(["sender", "sender", "broadcast"]),
    }
    if chance.random() < 0.3:
        entry["boot_up"] = [f"{chance.randint(0, 2900)}ms"]
        entry["boot_up_rejected"] = chance.random() < 0.3
    return entry


def faults(
    chance: random.Random, lists: list[Table], nodes: list[Table], readers: list[Table]
) -> dict[str, list[Table]]:
    found: dict[str, list[Table]] = {}
    for kind, choice in CHANCE_FAULTS.items():
        if chance.random() > 0.4:
            continue
        target = chance.choice(lists)
        entry = {"list": target["name"]} | choice
        match kind:
            case "duplicate" if chance.random() < 0.5:
                entry["behind"] = chance.randint(1, 4)
            case "overtaken":
                entry["by"] = chance.randint(1, 4)
            case "loss" if chance.random() < 0.5:
                entry["run"] = chance.choice([2, 5, 70])
            case "wrong_checksum":
                if "checksum" not in target:
                    continue
            case "truncated":
                entry["payload_bytes"] = chance.choice([0, 11, 12, 19, 20, 21])
            case "malformed":
                entry["kind"] = chance.choice(MALFORMED)
                entry["payload_bytes"] = chance.randint(12, 19)
                entry["service"] = chance.choice([0, 5, 6])
            case "unexpected_acknowledgement":
                entry["reader"] = chance.choice(nodes)["name"]
                entry["to"] = chance.choice(["sender", "broadcast"])
            case "unreachable":
                entry["host"] = chance.choice(nodes)["name"]
                entry["of"] = chance.choice(["data", "acknowledgement"])
                entry["quote"] = chance.choice(["full", "full", "header"])
            case "late":
                entry["by"] = "9ms"
            case "shape":
                entry |= {"items": 3, "bytes": 6}
            case "missing_acknowledgement" if readers and chance.random() < 0.3:
                entry = {"list": target["name"], "from": "2s"}
        found[kind] = [entry]
    return found


def events(chance: random.Random, lists: list[Table], nodes: list[Table]) -> dict[str, list[Table]]:
    found: dict[str, list[Table]] = {}
    names = [entry["name"] for entry in lists]
    if chance.random() < 0.2:
        found["stop"] = [{"node": chance.choice(lists)["sender"], "at": "1500ms"}]
    if chance.random() < 0.3:
        found["pause"] = [{"list": chance.choice(names), "at": "1s", "by": f"{chance.choice([70, 400, 1700])}ms"}]
    if chance.random() < 0.3:
        found["burst"] = [{"list": chance.choice(names), "at": "2s", "count": 4, "gap": "1ms"}]
    first_values = {entry["name"]: entry["first_value"] for entry in nodes}
    restartable = [
        name
        for name in sorted({entry["sender"] for entry in lists})
        if first_values[name] <= 1 and all(entry["interval"] != "400ms" for entry in lists if entry["sender"] == name)
    ]
    if restartable and chance.random() < 0.3:
        outage = chance.choice(["0s", "30ms", "700ms"])
        found["restart"] = [{"node": chance.choice(restartable), "at": "1700ms", "outage": outage}]
    if chance.random() < 0.2:
        target = chance.choice(lists)
        others = [entry for entry in nodes if entry["name"] != target["sender"] and entry["counter"] == "stream"]
        if others:
            second = {"list": target["name"], "node": others[0]["name"], "from": "700ms", "checksum": 3}
            found["second_sender"] = [second]
    if chance.random() < 0.15:
        found["clock_step"] = [{"at": "1s", "by": chance.choice(["-2s", "-3ms", "5s"])}]
    if chance.random() < 0.15:
        found["mirrored"] = [{"from": chance.choice(["0s", "1s"])}]
    return found


def traffic(chance: random.Random, nodes: list[Table]) -> list[Table]:
    kinds = ["dns", "tcp", "ping", "udp", "parameter"]
    ends = {"node": nodes[0]["name"], "to": nodes[1]["name"]}
    return [
        {"kind": kind, "interval": f"{chance.randint(20, 900)}ms", "jitter": "3ms"} | ends
        for kind in kinds
        if chance.random() < 0.3
    ]


def parameters(chance: random.Random, nodes: list[Table]) -> list[Table]:
    """Return conversations about two parameters, so that some are about what others write."""
    found = []
    for _ in range(chance.choice([0, 0, 1, 3])):
        asking, asked = chance.sample([entry["name"] for entry in nodes], 2)
        entry = {
            "node": asking, "to": asked, "index": 0x2000 + chance.randrange(2), "write": chance.random() < 0.5,
            "bytes": chance.choice([0, 2, 4, 256]), "port": chance.choice([1202, 1202, 1300]),
            "values": [chance.randrange(256) for _ in range(chance.randrange(3))],
            "first_value": chance.choice([1, 65_530]), "interval": f"{chance.randint(90, 900)}ms", "jitter": "3ms",
            "latency": f"{chance.choice([1, 3, 240, 300])}ms",
        }  # fmt: skip
        for outcome in ("unanswered", "refused", "undeliverable", "late"):
            entry[outcome] = sorted({chance.randint(1, 20) for _ in range(chance.choice([0, 0, 2]))})
        found.append(entry)
    return found


def toml(top: Table, tables: dict[str, list[Table]]) -> str:
    lines = [f"{key} = {shown(value)}" for key, value in top.items()]
    for name, rows in tables.items():
        for row in rows:
            lines += ["", f"[[{name}]]", *(f"{key} = {shown(value)}" for key, value in row.items())]
    return "\n".join(lines) + "\n"


def shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(shown(entry) for entry in value)}]"
    return f'"{value}"' if isinstance(value, str) else str(value)
