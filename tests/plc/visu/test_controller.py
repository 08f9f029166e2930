"""What a controller answers: the published requests, access, faults, and files."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from dissectors.http import Side, decoded, end_of_head, read_chunks, read_head
from dissectors.webvisu import Answer, read_reply, read_request
from nvscope.definition.visu_variables import variables_in
from nvscope.plc.visu.controller import Controller, Handled, Result
from nvscope.plc.visu.http_request import Flaw, HttpRequest
from tests.plc.visu.peers import PAGE, table_of

# The program of the article, and the request for all of its variables.
ARTICLE = """
"PLC_PRG.AddressedVariable" = { address = "0,0,1,0", value = true }
"PLC_PRG.StringVariable" = { address = "4,0,6,8", value = "abcde" }
"PLC_PRG.ByteVariable" = { address = "4,6,1,2", value = 7 }
"PLC_PRG.WordVariable" = { address = "4,7,2,3", value = 1000 }
".OUT0" = { address = "2,0,0,0" }
"""
ALL_OF_IT = b"|0|5|0|0|0|1|0|1|4|0|6|8|2|4|6|1|2|3|4|7|2|3|4|2|0|0|0|"
FAULTS = """
"ro" = { address = "4,0,2,1", access = "ro", value = 1 }
"wo" = { address = "4,2,2,1", access = "wo", value = 2 }
"refuse" = { address = "4,4,2,1", refuse = true }
"unreadable" = { address = "4,6,2,1", unreadable = true }
"stuck" = { address = "4,8,2,1", stuck = true, value = 5 }
"status" = { address = "4,10,2,1", status = 503 }
"more" = { address = "4,12,2,1", surplus = 2 }
"fewer" = { address = "4,14,2,1", surplus = -1 }
"drop" = { address = "4,16,2,1", drop = true }
"silent" = { address = "4,18,2,1", silent = true }
"late" = { address = "4,20,2,1", delay = "1s" }
"text" = { address = "4,22,4,8", value = "a" }
"""


def controller(folder: Path, variables: str = ARTICLE, head: str = "") -> Controller:
    return Controller(table_of(folder, variables, head))


def asked(one: Controller, body: bytes) -> tuple[Handled, bytes]:
    handled = one.received(HttpRequest("POST", PAGE, body))
    return handled, handled.reply.partition(b"\r\n\r\n")[2]


def test_the_published_request_is_answered_by_position(tmp_path: Path) -> None:
    assert asked(controller(tmp_path), ALL_OF_IT)[1] == b"|1|abcde|7|1000|0|"


def test_the_published_write_changes_the_value(tmp_path: Path) -> None:
    one = controller(tmp_path)
    handled, content = asked(one, b"|1|1|0|4|6|1|2|9|")
    assert (handled.result, content) == (Result.ANSWERED, b"|0|")
    assert [(each.before, each.after) for each in handled.touched] == [("7", "9")]
    assert asked(one, b"|0|1|0|4|6|1|2|")[1] == b"|9|"


def test_who_counts_wrong_reads_what_he_names_and_writes_nothing(tmp_path: Path) -> None:
    one = controller(tmp_path)
    handled, content = asked(one, b"|0|100|0|4|6|1|2|1|4|7|2|3|")
    assert (handled.declared, content) == (100, b"|7|1000|")
    handled, content = asked(one, b"|1|2|0|4|6|1|2|9|")
    assert (handled.result, handled.status) == (Result.MALFORMED, 400)
    assert asked(one, b"|0|1|0|4|6|1|2|")[1] == b"|7|"


@pytest.mark.parametrize("body", [b"", b"|", b"|0|0|", b"|2|1|0|4|6|1|2|", b"|0|1|a|4|6|1|2|", b"hello", b"\xff" * 99])
def test_what_is_no_request_is_told_so(tmp_path: Path, body: bytes) -> None:
    handled, _ = asked(controller(tmp_path), body)
    assert (handled.result, handled.status) == (Result.MALFORMED, 400)


@pytest.mark.parametrize(
    "body", [b"|1|1|0|4|6|1|2|256|", b"|1|1|0|4|6|1|2|x|", b"|1|1|0|4|0|6|8|abcdef|", b"|1|1|0|9|9|1|2|1|"]
)
def test_what_is_no_value_there_is_refused(tmp_path: Path, body: bytes) -> None:
    handled, content = asked(controller(tmp_path), body)
    assert (handled.result, handled.status, content) == (Result.REFUSED, 200, b"|1|")


def test_of_several_writes_all_are_done_or_none(tmp_path: Path) -> None:
    one = controller(tmp_path)
    assert asked(one, b"|1|2|0|4|6|1|2|9|1|4|7|2|3|x|")[0].result is Result.REFUSED
    assert asked(one, ALL_OF_IT)[1] == b"|1|abcde|7|1000|0|"


@pytest.mark.parametrize(
    ("body", "result", "status", "content"),
    [
        (b"|0|1|0|4|0|2|1|", Result.ANSWERED, 200, b"|1|"),
        (b"|1|1|0|4|0|2|1|9|", Result.REFUSED, 200, b"|1|"),
        (b"|0|1|0|4|2|2|1|", Result.ANSWERED, 200, b"|???|"),
        (b"|1|1|0|4|2|2|1|9|", Result.ANSWERED, 200, b"|0|"),
        (b"|1|1|0|4|4|2|1|9|", Result.REFUSED, 200, b"|1|"),
        (b"|0|1|0|4|6|2|1|", Result.ANSWERED, 200, b"|???|"),
        (b"|1|1|0|4|8|2|1|9|", Result.ANSWERED, 200, b"|0|"),
        (b"|0|1|0|4|10|2|1|", Result.REFUSED, 503, b""),
        (b"|0|1|0|4|12|2|1|", Result.ANSWERED, 200, b"|0|0|0|"),
        (b"|0|1|0|4|14|2|1|", Result.ANSWERED, 200, b"|"),
        (b"|0|1|0|4|16|2|1|", Result.DROPPED, 0, b""),
        (b"|0|1|0|4|18|2|1|", Result.SILENT, 0, b""),
        (b"|0|1|0|4|99|2|1|", Result.ANSWERED, 200, b"|???|"),
    ],
)
def test_access_and_faults(tmp_path: Path, body: bytes, result: Result, status: int, content: bytes) -> None:
    handled, found = asked(controller(tmp_path, FAULTS), body)
    assert (handled.result, handled.status, found) == (result, status, content)


def test_a_stuck_value_stays_and_a_late_answer_is_late(tmp_path: Path) -> None:
    one = controller(tmp_path, FAULTS)
    asked(one, b"|1|1|0|4|8|2|1|9|")
    assert asked(one, b"|0|1|0|4|8|2|1|")[1] == b"|5|"
    assert asked(one, b"|0|1|0|4|20|2|1|")[0].delay_ns == 1_000_000_000


@pytest.mark.parametrize(
    "head",
    ["", 'http = "1.0"', "keep_alive = true", "chunked = true", "gzip = true", "content_length = false",
     "bare_lf = true", "chunked = true\ngzip = true", "trailing_pipe = false"],
)  # fmt: skip
def test_however_it_is_packed_it_says_the_same(tmp_path: Path, head: str) -> None:
    reply = controller(tmp_path, head=head).received(HttpRequest("POST", PAGE, ALL_OF_IT)).reply
    end = end_of_head(reply, 0, len(reply))
    told = read_head(reply[:end], Side.SERVER)
    assert told is not None
    content = read_chunks(reply, end, len(reply)).content if "chunked" in head else reply[end:]
    body, request = decoded(content, told.coding), read_request(ALL_OF_IT)
    assert body is not None
    assert request is not None
    assert read_reply(request, body).values == ("1", "abcde", "7", "1000", "0")
    assert read_reply(request, body).answer is Answer.DONE
    assert ("gzip" in head) == (told.coding == "gzip")


def test_its_lists_say_where_everything_lies(tmp_path: Path) -> None:
    one = controller(tmp_path, ARTICLE + '".CurrentPassword" = { type = "STRING(40)" }\n"ä<&" = { type = "INT" }')
    (names, system) = (
        variables_in(one.received(HttpRequest("GET", f"/plc/{name}")).reply.partition(b"\r\n\r\n")[2])
        for name in ("plc_visu.xml", "visu_ini.xml")
    )
    assert [(name, place.text) for name, place in names.listed] == [
        ("PLC_PRG.AddressedVariable", "0,0,1,0"), ("PLC_PRG.StringVariable", "4,0,6,8"),
        ("PLC_PRG.ByteVariable", "4,6,1,2"), ("PLC_PRG.WordVariable", "4,7,2,3"), (".OUT0", "2,0,0,0"),
        ("ä<&", "4,50,2,1"),
    ]  # fmt: skip
    assert [(name, place.text) for name, place in system.listed] == [(".CurrentPassword", "4,9,41,8")]


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (HttpRequest("GET", PAGE), 200), (HttpRequest("HEAD", PAGE), 200),
        (HttpRequest("GET", "/PLC/webvisu.htm"), 404),
        (HttpRequest("POST", "/", ALL_OF_IT), 404), (HttpRequest("DELETE", PAGE), 405), (Flaw.NO_HTTP, 400),
        (Flaw.BODY_TOO_LONG, 413), (Flaw.HEAD_TOO_LONG, 431),
    ],
)  # fmt: skip
def test_all_else_has_its_status(tmp_path: Path, request_: HttpRequest | Flaw, status: int) -> None:
    handled = controller(tmp_path).received(request_)
    assert handled.reply.startswith(b"HTTP/1.1 %d " % status)
    assert isinstance(request_, Flaw) or request_.method != "HEAD" or handled.reply.endswith(b"\r\n\r\n")


def test_gzip_is_that_of_everybody(tmp_path: Path) -> None:
    _, content = asked(controller(tmp_path, head="gzip = true"), b"|0|1|0|4|6|1|2|")
    assert gzip.decompress(content) == b"|7|"
