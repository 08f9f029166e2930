"""Transactions as JSON messages: one a reply, so that each tells by itself what was said, and how long that took.

What a reply says is all of it, as a message of a list is all of its telegram: whoever begins to look anywhere in a
recording sees whole values, and names that recur in each message take next to nothing in a compressed chunk. Requests
have no message of their own, but for those that write: who wrote what is to be seen even where no reply came.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from nvscope.analysis.transactions.transaction import Operation, Outcome, Room, Said, Transaction
from nvscope.view.escape import json_ascii

ROOM = Room(said=1_000, characters=255)
"""A message has so many values at most, and texts of so many characters, as a STRING has."""

ORIGIN = "_nv"
"""What a message tells of its frames, as messages of lists do."""


def transaction_schema(title: str) -> str:
    """Return the JSON Schema of messages of transactions."""
    values = {"type": "object", "properties": {}}
    outcomes = ", ".join(outcome.value for outcome in Outcome)
    operations = ", ".join(operation.value for operation in Operation)
    return json.dumps(
        {
            "title": title,
            "type": "object",
            "properties": {
                ORIGIN: {
                    "type": "object",
                    "properties": {
                        "frame": {"type": "integer", "description": "number of the frame, counted from the begin"},
                        "request_frame": {"type": "integer", "description": "that of the request, 0: of none"},
                    },
                },
                "client": {"type": "string", "description": "address of who asks"},
                "server": {"type": "string", "description": "address of who is asked"},
                "port": {"type": "integer", "description": "of who is asked"},
                "operation": {"type": "string", "description": operations},
                "outcome": {"type": "string", "description": outcomes},
                "detail": {"type": "string", "description": "what a refusal says"},
                "latency_ns": {"type": "integer", "description": "from the request to its reply; none without one"},
                "values": {**values, "description": "by name: what a reply says, or what is to be written"},
                "old": {**values, "description": "by name: what was known before of what is written"},
                "left_out": {"type": "integer", "description": "how many values there was no room for"},
            },
        }
    )


def transaction_message(one: Transaction) -> bytes:
    """Return a transaction as a message; what is not known is not in it."""
    told: dict[str, Any] = {
        ORIGIN: {"frame": one.frame, "request_frame": one.asked_frame or 0},
        "client": one.pair.client,
        "server": one.pair.server,
        "port": one.pair.port,
        "operation": one.operation.value,
        "outcome": one.outcome.value,
    }
    if one.detail:
        told["detail"] = one.detail
    if one.latency_ns is not None:
        told["latency_ns"] = one.latency_ns
    told["values"] = _values(one.said)
    if old := {said.name: said.old for said in one.said if said.old is not None}:
        told["old"] = old
    if one.left_out:
        told["left_out"] = one.left_out
    return json_ascii(json.dumps(told, ensure_ascii=False, allow_nan=False)).encode()


def _values(said: Sequence[Said]) -> Mapping[str, Any]:
    # Of one that is asked for twice, the last: both are of the same moment.
    return {one.name: one.value for one in said}
