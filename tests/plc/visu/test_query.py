"""Older pages that ask by URLs: addresses, formats, writes."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import TYPES, Place
from nvscope.plc.visu.controller import Controller, Result
from nvscope.plc.visu.http_request import HttpRequest
from nvscope.plc.visu.query import direct_place, formatted
from nvscope.plc.visu.table import ServedTable
from tests.laws import examples
from tests.plc.visu.peers import table_of

VARIABLES = """
"PLC_PRG.nSetpoint" = { address = "0,460,2,1", value = -5 }
"PLC_PRG.rReal" = { address = "0,8,4,6", value = 3.14159 }
"PLC_PRG.xStart" = { address = "0,0,1,0", value = true }
"PLC_PRG.fixed" = { address = "0,1,1,2", value = 7, access = "ro" }
"PLC_PRG.mute" = { address = "0,2,1,2", silent = true }
"PLC_PRG.broken" = { address = "0,3,1,2", status = 503 }
".OUT0" = { address = "2,48,0,0", value = true }
"PLC_PRG.hidden" = { address = "0,4,1,2", unreadable = true }
"""


@pytest.fixture
def controller(tmp_path: Path) -> Controller:
    return Controller(table_of(tmp_path, VARIABLES))


def got(controller: Controller, target: str) -> tuple[int, bytes]:
    """Return status and body of what a GET brings."""
    handled = controller.received(HttpRequest("GET", target))
    return handled.status, handled.reply.partition(b"\r\n\r\n")[2]


@pytest.mark.parametrize(
    ("address", "place"),
    [
        ("MB0", "0,0,1,2"), ("%QX3.0", "2,48,0,0"), ("mw230", "0,460,2,3"), ("MD1", "0,4,4,5"), ("IX0.15", "1,15,0,0"),
        ("QW3", "2,6,2,3"), ("MX3.0", None), ("QX3.16", None), ("MW", None), ("MW-1", None), ("XW1", None), ("", None),
        ("MW²", None), ("MW1 ", "0,2,2,3"), ("MW12345678", None),
    ],
)  # fmt: skip
def test_an_address_is_a_place(address: str, place: str | None) -> None:
    found = direct_place(address)
    assert (found and found.text) == place


@pytest.mark.parametrize(
    ("target", "content"),
    [
        ("/READPI?ADR=MW230&FORMAT=%d", b"-5"), ("/plc/readpi?adr=mw230&format=%25u", b"65531"),
        ("/READPI?ADR=%25MW230&FORMAT=%04x", b"fffb"), ("/READPI?ADR=MW230", b"-5"),
        ("/READPI?ADR=MD2&FORMAT=%.2f", b"3.14"),
        ("/READPI?ADR=MD2&FORMAT=%d", b"3"), ("/READPI?ADR=MB0&FORMAT=%d", b"1"), ("/READPI?ADR=QX3.0", b"1"),
        ("/READPI?ADR=MB0&FORMAT=%n%n%n", b"1"), ("/READPI?ADR=MB0&FORMAT=%s", b"1"),
        ("/READPI?ADR=MB4&FORMAT=%d", b"???"),
        ("/READPI?ADR=MW77&FORMAT=%d", b"???"),
        ("/READPI?ADR1=MW230&FORMAT1=%d&ADR2=MD2&FORMAT2=%.1f&ADR3=MB1", b"-5\n3.1\n7"),
        ("/plc/webvisu.htm?READPI?ADR=MW230&FORMAT=%u", b"65531"), ("/a?x=1&READPI?ADR=MD2&FORMAT=%d", b"3"),
    ],
)  # fmt: skip
def test_values_are_read_in_the_format_that_is_wanted(controller: Controller, target: str, content: bytes) -> None:
    assert got(controller, target) == (200, content)


def test_a_write_is_done_as_a_whole_or_refused(controller: Controller) -> None:
    assert got(controller, "/WRITEPI?ADR1=MW230&VALUE1=12&FORMAT1=%d&ADR2=MB0&VALUE2=0") == (200, b"")
    assert got(controller, "/READPI?ADR1=MW230&ADR2=MB0") == (200, b"12\n0")
    for target in (
        "ADR1=MW230&VALUE1=13&ADR2=MB1&VALUE2=8", "ADR1=MW230&VALUE1=99999", "ADR1=MW230", "ADR1=MW99&VALUE1=1",
    ):  # fmt: skip
        assert got(controller, f"/WRITEPI?{target}") == (403, b"")
    assert got(controller, "/READPI?ADR1=MW230&ADR2=MB1") == (200, b"12\n7")


def test_what_is_to_go_wrong_goes_wrong_for_older_pages_too(controller: Controller) -> None:
    assert controller.received(HttpRequest("GET", "/READPI?ADR=MB2")).result is Result.SILENT
    assert got(controller, "/READPI?ADR=MB3") == (503, b"")
    for target in (
        "/READPI?",
        "/READPI?ADR=",
        "/READPI?ADR=a%00b",
        "/WRITEPI?VALUE=1",
        "/READPI?ADR=MB0&ADR2=PLC_PRG.x",
    ):
        assert got(controller, target)[0] == 400
    assert controller.received(HttpRequest("HEAD", "/READPI?ADR=MB0")).status == 400


FORMATS = st.one_of(st.text(max_size=12), st.from_regex(r"%0?\d{0,2}(\.\d{1,2})?l?[diuxXfeEgGs]", fullmatch=True))


@given(
    FORMATS,
    st.sampled_from(range(len(TYPES))),
    st.sampled_from([0, 1, 2, 4, 8, 20]),
    st.text("0123456789-.aé", max_size=12),
)
@examples()
def test_no_format_breaks_anything(wanted: str, kind: int, size: int, raw: str) -> None:
    assert len(formatted(Place(0, 0, size, kind), raw, wanted)) <= 420


@given(st.text("?&=%ADRFORMT1MW2.", max_size=40), st.text(max_size=60))
@examples()
def test_no_url_breaks_anything(front: str, text: str) -> None:
    handled = Controller(ServedTable(entries=())).received(HttpRequest("GET", f"/{front}READPI?{text}"))
    assert handled.status in (200, 400)
