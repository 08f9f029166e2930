"""Scenarios of CAN at random, as TOML text: one or two buses, lists with and without definition, some of the faults."""

from __future__ import annotations

import random

from tests.simulate.random_scenario import Table, toml

TRAFFIC = ("heartbeat", "emergency", "nmt", "sync", "time", "sdo", "frame", "remote", "fd")
ERRORS = ("tx-timeout", "lost-arbitration", "controller", "protocol", "bus-error", "no-acknowledgement", "counters")


def random_can_scenario(seed: int) -> str:
    """Return a scenario that is not wild: its truth is exact."""
    chance = random.Random(seed)
    channels = ["can0", "can1"][: chance.choice([1, 1, 2])]
    buses = [{"channel": channel, "bit_rate": chance.choice(["250k", "500k", "1M"])} for channel in channels]
    lists = [plan(chance, number, channels) for number in range(chance.randint(1, 5))]
    tables = (
        {"bus": buses, "can_list": lists} | traffic(chance, channels) | faults(chance, lists) | events(chance, lists)
    )
    if chance.random() < 0.3:
        tables["error_frames"] = [
            {
                "channel": chance.choice(channels),
                "kind": chance.sample(ERRORS, chance.randint(1, 2)),
                "interval": f"{chance.randint(200, 900)}ms",
                "jitter": "20ms",
                "rx_errors": chance.randint(0, 255),
            }
        ]
    if chance.random() < 0.2:
        tables["bus_off"] = [{"channel": chance.choice(channels), "at": "2s", "outage": f"{chance.randint(20, 700)}ms"}]
    return toml({"title": f"random {seed}", "seed": seed, "duration": chance.choice(["5s", "8s"])}, tables)


def plan(chance: random.Random, number: int, channels: list[str]) -> Table:
    packed = chance.random() < 0.7
    pdos = chance.choice([1, 1, 2, 3, 5])
    sizes = (
        [8] * (pdos - 1) + [chance.randint(1, 8)] if packed else [chance.choice([1, 2, 3, 4, 8]) for _ in range(pdos)]
    )
    return {
        "name": f"list{number}",
        "cob_id": 0x110 + 0x10 * number,
        "channel": chance.choice(channels),
        "extended": chance.random() < 0.1,
        "bytes": sizes,
        "packed": packed,
        "defined": chance.random() < 0.7,
        "interval": f"{chance.choice([50, 73, 100, 400])}ms",
        "jitter": f"{chance.choice([0, 300, 1000])}us",
        "phase": f"{chance.randint(0, 30)}ms",
        "mode": chance.choice(["cyclic", "cyclic", "cyclic", "on_change"]),
        "values": chance.choice(["ramp", "noise", "constant"]),
    }


def faults(chance: random.Random, lists: list[Table]) -> dict[str, list[Table]]:
    found: dict[str, list[Table]] = {}
    for entry in lists:
        if chance.random() < 0.4:
            # Of two sendings next to each other, what is left must not look like one.
            subindex = chance.randrange(len(entry["bytes"]))
            found.setdefault("loss", []).append({"list": entry["name"], "probability": 0.03, "subindex": subindex})
        if chance.random() < 0.3:
            found.setdefault("wrong_dlc", []).append(
                {"list": entry["name"], "every": chance.randint(5, 40), "bytes": chance.randint(0, 8)}
            )
        if chance.random() < 0.2 and entry["mode"] == "cyclic":
            found.setdefault("late", []).append({"list": entry["name"], "every": 17, "by": "20ms"})
    return found


def events(chance: random.Random, lists: list[Table]) -> dict[str, list[Table]]:
    found: dict[str, list[Table]] = {}
    names = [entry["name"] for entry in lists]
    if chance.random() < 0.2:
        found["stop"] = [{"list": chance.choice(names), "at": "1500ms"}]
    if chance.random() < 0.3:
        found["pause"] = [{"list": chance.choice(names), "at": "1s", "by": f"{chance.choice([70, 400, 1700])}ms"}]
    if chance.random() < 0.3:
        found["burst"] = [{"list": chance.choice(names), "at": "3s", "count": 4, "gap": "4ms"}]
    if chance.random() < 0.1:
        found["clock_step"] = [{"at": "1s", "by": chance.choice(["-2s", "5s"])}]
    return found


def traffic(chance: random.Random, channels: list[str]) -> dict[str, list[Table]]:
    rows = []
    for kind in TRAFFIC:
        if chance.random() > 0.3:
            continue
        row: Table = {"kind": kind, "channel": chance.choice(channels), "interval": f"{chance.randint(20, 900)}ms"}
        row["jitter"] = "2ms"
        if kind in {"frame", "remote", "fd"}:
            row |= {"cob_id": chance.randint(0x200, 0x280), "extended": chance.random() < 0.3}
        rows.append(row | ({"node": chance.randint(1, 127)} if kind in {"heartbeat", "emergency", "sdo"} else {}))
    return {"can_traffic": rows}
