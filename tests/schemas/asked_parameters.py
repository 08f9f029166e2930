"""The schema of what comes of asking the Parameter Manager, and documents of all that can come of it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_args

from dissectors.netvar import PARAMETER_ERRORS, PARAMETER_REQUESTS
from nvscope.errors import ExitCode
from nvscope.plc.parameter.conversation import Ending, Ignored
from nvscope.plc.parameter.document import Verdict
from nvscope.plc.parameter.message import REPLY_OF
from tests.plc.parameter.peers import bound, peer, served, unused_port
from tests.plc.parameter.wire import READ, READ_REPLY, WRITE, WRITE_REPLY, heard, said
from tests.program_here import run
from tests.schemas.shapes import PORT, Schema, document, duration, maybe, record, several, text, whole, word
from tests.schemas.variables import ANY_VALUE, UNIT

_U16 = 0xFFFF
_ANSWERS = (*REPLY_OF.values(), *PARAMETER_ERRORS)
_HEXADECIMAL = "^([0-9a-f]{2})*$"


def asked_parameters() -> Schema:
    """Return the schema of ``sdo read --json`` and ``sdo write --json``."""
    held = ANY_VALUE | {"description": "bytes in hexadecimal; null of what is no finite number"}
    value = _value(maybe(several(_element(held), "null where the type is not known, or the bytes are none of it")))
    entered = _value(several(_element({"type": ["boolean", "number", "string"]})))
    exchange = record(
        {
            "request": word(service.name for service in PARAMETER_REQUESTS),
            "counter": whole("", 0, _U16),
            "ended": word(ending.value for ending in Ending),
            "answer": maybe(word([service.name for service in _ANSWERS], "null without one")),
            "latency_ns": maybe(duration("from the last request to its answer")),
            "transmissions": whole("how many times the request was sent", 1),
            "busy": whole("how many of them were answered by ODStateBusy"),
            "undelivered": maybe(text("why it came back")),
            "ignored": record({reason.value: whole() for reason in Ignored})
            | {"description": "datagrams that were no answer, by why they are none"},
            "others": several(text("address"), "others that sent something meanwhile"),
        }
    )
    return document(
        "sdo", "`nvscope sdo read --json`, `nvscope sdo write --json`: a parameter of a controller, and what was said",
        {
            "verb": word(("read", "write")),
            "outcome": word(get_args(Verdict), "read and written are good"),
            "partner": text("address"),
            "partner_name": maybe(text("what the project calls it")),
            "port": PORT,
            "index": whole("", 0, _U16),
            "subindex": whole("", 0, _U16),
            "name": maybe(text("what the project calls it")),
            "type": maybe(text("that of the value, or of its elements; null where nobody said it")),
            "unit": UNIT,
            "value": maybe(value | {"description": "what it holds now; null where that is not known"}),
            "before": maybe(value | {"description": "what it held before it was written"}),
            "wanted": maybe(entered | {"description": "what was to be written"}),
            "exchanges": several(exchange, "the read; of a write the read before it, itself, and the read behind it"),
        },
    )  # fmt: skip


def _element(value: Schema) -> Schema:
    name = maybe(text("of a member, or its place in an array; null where the value has one element"))
    return record({"name": name, "value": value, "text": text("as an engineer writes it")})


def _value(elements: Schema) -> Schema:
    items = whole("elements, as the telegram counts them", 0, _U16)
    return record({"items": items, "bytes": text("all of them, in hexadecimal", _HEXADECIMAL), "elements": elements})


_TABLE = """
"1:0" = { type = "REAL", value = 1.5 }
"1:1" = { type = "BOOL", value = [true, false], busy = 1 }
"1:2" = { type = "STRING(4)", value = "abc", access = "ro" }
"1:3" = { type = "TIME", value = "T#1s" }
"1:4" = { type = "UINT", value = 7, stuck = true }
"1:5" = { type = "UINT", access = "wo" }
"1:6" = { type = "UINT", silent = true }
"""
_PROJECT = """
[nodes]
"127.0.0.1" = { name = "press" }
[parameters]
"1:0" = { name = "rSetpoint", type = "REAL" }
"1:1" = { name = "axDoors", type = "ARRAY [1..2] OF BOOL" }
"""
_PATIENT, _BRIEF = "20s", "30ms"
_NAN = b"\0\0\xc0\x7f"
_READ = (
    "press rSetpoint", "press axDoors", "127.0.0.1 1 0", "127.0.0.1 1 1 --type BOOL --items 2",
    "127.0.0.1 1 2 --type STRING(4)",
    "127.0.0.1 1 3 --type TIME", "127.0.0.1 1 3 --type LTIME", "127.0.0.1 9 9",
)  # fmt: skip
_WRITTEN = (
    "press rSetpoint 2.5", "press axDoors TRUE TRUE", "127.0.0.1 1 1 FALSE TRUE --type BOOL",
    "127.0.0.1 1 2 x --type STRING(4)", "127.0.0.1 1 3 T#2s --type TIME",
    "127.0.0.1 1 3 7 --type USINT", "127.0.0.1 1 4 8 --type UINT", "127.0.0.1 1 5 8 --type UINT",
)  # fmt: skip


def documents_of_parameters() -> Iterator[dict[str, Any]]:
    """Yield what is told of reads and writes of a controller on this machine, and of others that are none."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (plant := folder / "plant").mkdir()
        (plant / "nvscope.toml").write_text(_PROJECT, encoding="utf-8")
        with served(folder, _TABLE) as one:
            for words in _READ:
                yield _asked(plant if "press" in words else folder, "read", words.split(), one.port)
            for words in _WRITTEN:
                yield _asked(plant if "press" in words else folder, "write", [*words.split(), "--yes"], one.port)
            yield _asked(folder, "read", ["127.0.0.1", "1", "6"], one.port, _BRIEF)
        yield _asked(folder, "read", ["127.0.0.1", "1", "6"], unused_port())
        with bound("127.0.0.9") as other, peer(lambda came, _: [said(READ_REPLY, *heard(came)[1:5])], other) as away:
            yield _asked(folder, "read", ["127.0.0.1", "1", "6"], away.port, "500ms")
        with peer(_only_first) as once:
            yield _asked(plant, "write", ["press", "rSetpoint", "1", "--yes"], once.port, "500ms")
        with peer(lambda came, _: [said(READ_REPLY, *heard(came)[1:5], _NAN)]) as odd:
            yield _asked(plant, "read", ["press", "rSetpoint"], odd.port)


def _only_first(came: bytes, number: int) -> Sequence[bytes]:
    asked = heard(came)
    answers = {READ: said(READ_REPLY, *asked[1:5], _NAN), WRITE: said(WRITE_REPLY, *asked[1:5])}
    return [] if number == 2 else [answers[asked.service]]


def _asked(folder: Path, verb: str, words: Sequence[str], port: int, timeout: str = _PATIENT) -> dict[str, Any]:
    done = run("sdo", verb, *words, "--json", "--port", str(port), "--timeout", timeout, cwd=folder)
    assert done.returncode not in (ExitCode.USAGE, ExitCode.BUG), done.stderr.decode()
    return dict(json.loads(done.stdout))
