"""Columns of ports: where they are all that tells rows of pairs apart, they stay however narrow the screen is."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.view.lines.plant import parameters, transactions, visu
from nvscope.view.lines.plant.tables import cells
from nvscope.view.lines.table import Line, align

LATENCY = {"count": 1, "p50": 10_000_000, "p99": 10_000_000, "max": 10_000_000}


def sdo_row(partner: str, port: int) -> dict[str, Any]:
    return {
        "requester": "10.0.0.20", "requester_name": None, "partner": partner, "partner_name": None,
        "port": port, "requests": 7, "replies": 6, "errors": {},
        "busy": 0, "timeouts": 1, "retransmissions": 0, "unexpected": 0, "undeliverable": 1, "copies": 0,
        "latency_ns": LATENCY,
    }  # fmt: skip


def visu_row(server: str, port: int) -> dict[str, Any]:
    names = (
        "connections", "reads", "writes", "entries", "variables", "replies", "refused", "unanswered", "cut",
        "gap_bytes", "miscounted", "ambiguous",
    )  # fmt: skip
    ends = {"client": "10.0.0.20", "client_name": None, "server": server, "server_name": None, "port": port}
    return dict.fromkeys(names, 1) | ends | {"latency_ns": LATENCY, "polling_ns": LATENCY}


def watched_row(server: str, port: int) -> dict[str, Any]:
    names = ("requests", "replies", "unanswered", "refused", "odd", "writes")
    return dict.fromkeys(names, 1) | {
        "protocol": "sdo", "client": "10.0.0.20", "client_name": None, "server": server, "server_name": None,
        "port": port, "per_s": 1.0, "latency_ns": LATENCY, "last_write": None,
    }  # fmt: skip


def shown(which: str, *ends: tuple[str, int], width: int = 50) -> list[str]:
    """Return the table of some pairs; each end is a partner and its port."""
    if which == "sdo":
        measures, rows, _ = parameters.parameters({"sdo": [sdo_row(*one) for one in ends], "nodes": [], "lists": []})
    elif which == "visu":
        measures, rows, _ = visu.visu({"visu": [visu_row(*one) for one in ends], "nodes": [], "lists": []})
    else:
        measures, found = transactions.pair_table([watched_row(*one) for one in ends], 0)
        rows = list(found)
    lines: list[Line] = align([one.column for one in measures], [cells(measures, row) for row in rows], width)
    return ["".join(cell.text for cell in line) for line in lines]


@pytest.mark.parametrize("which", ["sdo", "visu", "watched"])
def test_the_port_stays_where_it_alone_tells_rows_apart(which: str) -> None:
    heading, first, second, *_ = shown(which, ("10.0.0.10", 1202), ("10.0.0.10", 1300))
    assert "port" in heading
    assert "1202" in first
    assert "1300" in second


@pytest.mark.parametrize("which", ["sdo", "visu", "watched"])
def test_the_port_gives_way_where_addresses_tell_rows_apart(which: str) -> None:
    heading, first, second, *last = shown(which, ("10.0.0.10", 1202), ("10.0.0.11", 1300), width=34)
    assert "port" not in heading
    assert "10.0.0.10" in first
    assert "10.0.0.11" in second
    assert "port," in " ".join(last)
