"""Transactions as data: a row a pair, whichever protocol it speaks, and a row each of its last transactions.

The rows of pairs stand in ``nvscope.watch/1``; figures are those of the report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nvscope.analysis.transactions.recent_transactions import TransactionsSeen
from nvscope.analysis.transactions.transaction import Pair, Protocol, Said, Transaction

Row = Mapping[str, Any]


def pair_rows(report: Row, seen: TransactionsSeen, seconds: int = 5) -> list[dict[str, Any]]:
    """Return a row a pair of a report (schema ``nvscope.report/2``), those of the Parameter Manager first.

    ``per_s`` is that of the last so many whole seconds.
    """
    return [
        *(_pair_row(_parameter_figures(row), seen, seconds) for row in report.get("sdo", ())),
        *(_pair_row(_visu_figures(row), seen, seconds) for row in report.get("visu", ())),
    ]


def pair_of(row: Row) -> Pair:
    """Return which pair a row is about."""
    return Pair(Protocol(row["protocol"]), row["client"], row["server"], row["port"])


def _parameter_figures(row: Row) -> dict[str, Any]:
    return {
        "protocol": Protocol.SDO.value,
        "client": row["requester"],
        "client_name": row["requester_name"],
        "server": row["partner"],
        "server_name": row["partner_name"],
        "port": row["port"],
        "requests": row["requests"],
        "replies": row["replies"],
        "unanswered": row["timeouts"],
        "refused": sum(row["errors"].values()),
        "odd": row["unexpected"] + row["undeliverable"],
        "latency_ns": row["latency_ns"],
    }


def _visu_figures(row: Row) -> dict[str, Any]:
    return {
        "protocol": Protocol.VISU.value,
        "client": row["client"],
        "client_name": row["client_name"],
        "server": row["server"],
        "server_name": row["server_name"],
        "port": row["port"],
        "requests": row["reads"] + row["writes"],
        "replies": row["replies"],
        "unanswered": row["unanswered"],
        "refused": row["refused"],
        "odd": row["miscounted"] + row["ambiguous"] + row["cut"],
        "latency_ns": row["latency_ns"],
    }


def _pair_row(figures: dict[str, Any], seen: TransactionsSeen, seconds: int) -> dict[str, Any]:
    known = seen.of(pair_of(figures), seconds)
    last = known.last_write
    return {
        **figures,
        "per_s": known.per_s,
        "writes": known.writes,
        "last_write": None if last is None else transaction_row(last),
    }


def transaction_rows(seen: TransactionsSeen, pair: Pair) -> Sequence[dict[str, Any]]:
    """Return a row each of the last transactions of a pair, the oldest first."""
    return [transaction_row(one) for one in seen.of(pair).transactions]


def transaction_row(one: Transaction) -> dict[str, Any]:
    """Return a transaction as data; what is told of its variables are texts."""
    return {
        "time_ns": str(one.time_ns),
        "frame": one.frame,
        "request_frame": one.asked_frame,
        "operation": one.operation.value,
        "outcome": one.outcome.value,
        "detail": one.detail or None,
        "latency_ns": one.latency_ns,
        "variables": [_said_row(said) for said in one.said],
        "left_out": one.left_out,
    }


def _said_row(said: Said) -> dict[str, Any]:
    return {"name": said.name, "old": said.old_text, "value": said.text}
