"""The schema of what comes of asking a WebVisu, and documents of all that can come of it."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_args

from dissectors.webvisu import TYPES, Answer
from nvscope.errors import ExitCode
from nvscope.plc.visu.document import Purpose, State, Verdict
from nvscope.plc.visu.exchange import Ending
from nvscope.plc.visu.http_request import HttpRequest
from tests.plc.visu.peers import peer, replied, served, unused_port
from tests.program_here import run
from tests.schemas.shapes import (
    PORT,
    Schema,
    document,
    duration,
    maybe,
    record,
    several,
    text,
    time,
    truth,
    whole,
    word,
)

_STATUS = 999


def asked_visu() -> Schema:
    """Return the schema of ``visu read --json``, ``visu write --json`` and ``visu list --json``."""
    units = "durations in ns, dates in s"
    value = _value(["boolean", "number", "string", "null"], f"{units}; null of what is no value of its type")
    entered = _value(["boolean", "number", "string"], units)
    variable = record(
        {
            "name": maybe(text("null where it was asked for by where it lies, and no list names it")),
            "ref": whole("the memory area: 0 %M, 1 inputs, 2 outputs, 3 retain, 4 global; other targets have others"),
            "offset": whole("in bytes; of single inputs and outputs in bits"),
            "size": whole("in bytes; 0 is one bit"),
            "type_code": whole("code of the type"),
            "type": maybe(word(TYPES, "null of a code that nobody knows")),
            "secret": truth("whether it holds a password, or may"),
            "state": word(get_args(State), "what is known of its value; of a write, of the one that was read last"),
            "value": maybe(value | {"description": "what it holds now; null where that is not known, or hidden"}),
            "before": maybe(value | {"description": "what it held before it was written"}),
            "wanted": maybe(entered | {"description": "what was to be written"}),
        }
    )
    one = record(
        {
            "source": text("a file, or a URL"),
            "stamp": maybe(text("what it says of its time: places change with every download to the controller")),
            "variables": whole("how many it has"),
            "left_out": whole("how many more there was no room for"),
        }
    )
    exchange = record(
        {
            "purpose": word(get_args(Purpose)),
            "method": word(("GET", "POST")),
            "path": text(),
            "variables": whole("how many it was about"),
            "ended": word(ending.value for ending in Ending),
            "status": maybe(whole("of HTTP; null where none came", 0, _STATUS)),
            "answer": maybe(word([answer.value for answer in Answer], "null where it is no answer of a WebVisu")),
            "fields": maybe(whole("how many values came")),
            "latency_ns": maybe(duration("from before the connection was made to the end of the answer")),
            "why": maybe(text("how it ended, in the words of the system")),
            "location": maybe(text("where a redirection leads to, which is not followed")),
        }
    )
    return document(
        "visu", "`nvscope visu read|write|list --json`: variables of a controller by its WebVisu, and what was asked",
        {
            "at_ns": time("when all was asked"),
            "verb": word(("read", "write", "list")),
            "outcome": word(get_args(Verdict), "read, written and listed are good"),
            "url": text("the page"),
            "server": text("address"),
            "server_name": maybe(text("what the project calls it")),
            "port": PORT,
            "encoding": text("in which texts are read and written, as Python calls it"),
            "lists": several(one, "where names were taken from"),
            "variables": several(variable, "in the order in which they were asked for, or are listed"),
            "exchanges": several(exchange, "one after the other"),
        },
    )  # fmt: skip


def _value(types: list[str], told: str) -> Schema:
    read = {"type": types, "description": told}
    return record(
        {
            "raw": text("as it is on the wire, a character for each byte"),
            "value": read,
            "text": text("as an engineer writes it"),
        }
    )


_TABLE = """
"PLC_PRG.rSpeed" = { type = "REAL", value = 1.5 }
"PLC_PRG.xRun" = { type = "BOOL", value = true }
"PLC_PRG.sText" = { type = "STRING(5)", value = "a|b" }
"PLC_PRG.sOther" = { type = "STRING(5)", value = "ab" }
"PLC_PRG.tRamp" = { type = "TIME", value = "T#1s", access = "ro" }
"PLC_PRG.nStuck" = { type = "INT", value = 7, stuck = true }
"PLC_PRG.nMore" = { type = "INT", surplus = 2 }
"PLC_PRG.nBad" = { type = "INT", status = 503 }
"PLC_PRG.nWo" = { type = "INT", access = "wo" }
"PLC_PRG.nDrop" = { type = "INT", drop = true }
"PLC_PRG.nSilent" = { type = "INT", silent = true }
".CurrentPassword" = { type = "STRING(40)", value = "secret" }
"""
_PROJECT = '[nodes]\n"127.0.0.1" = { name = "press" }\n'
_PATIENT, _BRIEF = "20s", "100ms"
_EVERY_TYPE = [f"0,{code},2,{code}" for code in range(len(TYPES) + 1)]
_READ = (
    "PLC_PRG.rSpeed PLC_PRG.xRun PLC_PRG.sText", ".CurrentPassword", "PLC_PRG.sText PLC_PRG.sOther", "PLC_PRG.nMore",
    "PLC_PRG.nBad", "PLC_PRG.nWo", "PLC_PRG.nDrop", " ".join(_EVERY_TYPE),
)  # fmt: skip
_WRITTEN = (
    "PLC_PRG.rSpeed 2.5", "PLC_PRG.xRun FALSE", "PLC_PRG.sOther x", "PLC_PRG.tRamp 5", "PLC_PRG.nStuck 8",
    "PLC_PRG.nWo 3", ".CurrentPassword y",
)  # fmt: skip


def documents_of_visu() -> Iterator[dict[str, Any]]:
    """Yield what is told of a controller on this machine, and of servers that are none."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (plant := folder / "plant").mkdir()
        (plant / "nvscope.toml").write_text(_PROJECT, encoding="utf-8")
        with served(folder, _TABLE, 'stamp = "1,2"') as one:
            yield _asked(folder, "list", [f"127.0.0.1:{one.port}"])
            yield _asked(plant, "list", [f"press:{one.port}"])
            for words in _READ:
                yield _asked(folder, "read", [one.url, *words.split()])
            for words in _WRITTEN:
                yield _asked(folder, "write", [one.url, *words.split(), "--yes"])
            yield _asked(folder, "read", [one.url, "PLC_PRG.nSilent"], _BRIEF)
        with served(folder, _TABLE, "lists = false") as one:
            yield _asked(folder, "list", [one.url])
        yield _asked(folder, "read", [f"http://127.0.0.1:{unused_port()}/", "4,0,2,1"])
        for answer in (
            replied(b"", "404 Not Found"), b"SSH-2.0-x\r\n", replied(b"<html></html>"), replied(bytes(1_100_000)),
            b"HTTP/1.1 302 Found\r\nLocation: http://192.0.2.1/\r\nContent-Length: 0\r\n\r\n",
        ):  # fmt: skip
            with peer(answer) as other:
                yield _asked(folder, "read", [other.url, "4,0,2,1"])
        with peer(_old) as other:
            yield _asked(folder, "list", [other.url])
            yield _asked(folder, "read", [other.url, "PLC_PRG.nOld"])
            yield _asked(folder, "write", [other.url, "PLC_PRG.nOld", "5", "--yes"])
        with peer(replied(b"", "404 Not Found")) as other:
            yield _asked(folder, "read", [f"127.0.0.1:{other.port}", "4,0,2,1"])
        with peer(lambda one, _, number: one.sendall(replied((b"|1|", b"|0|", b"|")[number]))) as once:
            yield _asked(folder, "write", [once.url, "4,0,2,1", "5", "--yes"])


_LIST = b'<a><variablelist><variable name="PLC_PRG.nOld">4,0,2,1</variable></variablelist></a>'


def _old(one: socket.socket, request: HttpRequest, _: int) -> None:
    """Answer with a list without a time, and with values that are none."""
    body = _LIST if request.method == "GET" else b"|0|" if request.body.startswith(b"|1|") else b"|?|"
    one.sendall(replied(body))


def _asked(folder: Path, verb: str, words: Sequence[str], timeout: str = _PATIENT) -> dict[str, Any]:
    done = run("visu", verb, *words, "--json", "--timeout", timeout, cwd=folder)
    assert done.returncode not in (ExitCode.USAGE, ExitCode.BUG), done.stderr.decode()
    return dict(json.loads(done.stdout))
