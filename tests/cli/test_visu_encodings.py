"""``nvscope visu read``, ``write`` and ``serve``, where the page says how its texts are encoded."""

from __future__ import annotations

import json
import socket
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import STRING, Place, read_request
from nvscope.definition.visu_encoding import encoding_of
from nvscope.plc.visu.body import write_body
from nvscope.plc.visu.http_request import HttpRequest
from nvscope.plc.visu.value import entered, shown
from tests.laws import examples
from tests.plc.visu.peers import Served, peer, replied, served
from tests.program_here import run_text

HEAD = 'encoding = "UTF-8"'
TABLE = """
"PRG.sText" = { address = "4,100,13,STRING", value = "5 € für" }
"PRG.sPlain" = { address = "4,120,11,STRING", value = "plain" }
"PRG.rSpeed" = { address = "4,140,4,REAL", value = 1.5 }
".CurrentPassword" = { address = "4,481,41,STRING", value = "gehäim" }
"""
BAR = "ポ"  # 0x83 0x7C in Shift_JIS


def visu(verb: str, url: str, *words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return run_text("visu", verb, url, *words, "--timeout", "20s", environment={"COLUMNS": "200"}, cwd=cwd)


def pages(one: Served) -> int:
    """Return how often the page was asked for."""
    return sum(handled.target.endswith(".htm") and handled.method == "GET" for handled in one.controller.handled)


def test_texts_are_read_as_the_page_says(tmp_path: Path) -> None:
    with served(tmp_path, TABLE, HEAD) as one:
        done = visu("read", one.url, "PRG.sText")
        assert "PRG.sText = '5 € für'" in done.stdout
        document = json.loads(visu("read", one.url, "PRG.sText", "--json").stdout)
    assert document["encoding"] == "utf-8"
    assert document["variables"][0]["value"] == {
        "raw": "5 € für".encode().decode("latin-1"), "value": "5 € für", "text": "'5 € für'",
    }  # fmt: skip


def test_the_page_is_asked_once_and_only_where_it_matters(tmp_path: Path) -> None:
    with served(tmp_path, TABLE, HEAD) as one:
        visu("read", one.url, "PRG.sPlain", "PRG.rSpeed", ".CurrentPassword")
        visu("write", one.url, "PRG.sPlain", "other", "--yes")
        assert pages(one) == 0
        visu("read", one.url, "PRG.sText", "--encoding", "utf-8")
        assert pages(one) == 0
        visu("read", one.url, "PRG.sText", "--every", "1ms", "--count", "3")
        assert pages(one) == 1
        visu("write", one.url, "PRG.sPlain", "ä", "--yes")
        assert pages(one) == 2


def test_a_page_that_was_looked_for_has_said_it(tmp_path: Path) -> None:
    with served(tmp_path, TABLE, HEAD) as one:
        done = visu("read", one.url.partition("/plc")[0], "PRG.sText")
        assert "'5 € für'" in done.stdout
        assert pages(one) == 1


def test_a_text_is_written_in_the_encoding_of_the_page(tmp_path: Path) -> None:
    with served(tmp_path, TABLE, HEAD) as one:
        done = visu("write", one.url, "PRG.sText", "7 € weg", "--yes")
        assert "'5 € für' → '7 € weg'" in done.stdout
        (touched,) = [handled.touched[0] for handled in one.controller.handled if handled.writes]
        assert (touched.after or "").encode("latin-1") == "7 € weg".encode()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("PRG.sText", "€€€€€"), "the text has 15 bytes in utf-8, a STRING(12) has room for 12"),
        (("PRG.sText", "€", "--encoding", "ISO-8859-1"), "'€' is no character of ISO-8859-1 (Western Europe)"),
        (("PRG.sText", "я", "--encoding", "Cp1252"), "'я' is no character of cp1252"),
        (("PRG.sText", BAR, "--encoding", "SJIS"), f"'{BAR}' has the byte of '|' in it in shift_jis"),
        (("PRG.sText", "a", "--encoding", "UTF-16"), "in UTF-16, ASCII is not one byte a character"),
        (("PRG.sText", "a", "--encoding", "klingon"), "no encoding is known that is called 'klingon'"),
    ],
)
def test_what_cannot_be_written_is_told(words: tuple[str, ...], told: str, tmp_path: Path) -> None:
    with served(tmp_path, TABLE, HEAD) as one:
        done = visu("write", one.url, *words, "--yes")
        assert done.returncode == 2
        assert told in done.stderr
        assert not any(handled.writes for handled in one.controller.handled)


def test_the_project_goes_before_the_page_and_the_option_before_both(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text('[webvisu]\nencodings = { "127.0.0.1" = "ISO-8859-1" }')
    with served(tmp_path, TABLE, HEAD) as one:
        by_project = visu("read", one.url, "PRG.sText", "--json", cwd=tmp_path)
        by_option = visu("read", one.url, "PRG.sText", "--json", "--encoding", "utf8", cwd=tmp_path)
    values = [json.loads(done.stdout)["variables"][0]["value"]["value"] for done in (by_project, by_option)]
    assert values == ["5 € für".encode().decode("latin-1"), "5 € für"]


def test_an_encoding_that_cannot_be_used_is_told() -> None:
    list_ = b'<v><variablelist><variable name="sText">4,0,11,8</variable></variablelist></v>'

    def answering(one: socket.socket, request: HttpRequest, _: int) -> None:
        page = b'<html><param name="ENCODINGSTRING" value="UTF-16"></html>'
        content = b"|\xe4|" if request.method == "POST" else list_ if request.target.endswith("xml") else page
        one.sendall(replied(content))

    with peer(answering) as one:
        done = visu("read", one.url, "sText")
    assert (done.returncode, done.stdout[:11]) == (0, "sText = 'ä'")
    assert "/plc/webvisu.htm: in UTF-16, ASCII is not one byte a character" in done.stderr
    assert "texts are read as ISO-8859-1, unless --encoding says otherwise" in done.stderr


def test_passwords_stay_hidden(tmp_path: Path) -> None:
    with served(tmp_path, TABLE, HEAD) as one:
        done = visu("read", one.url, ".CurrentPassword", "--json")
        assert "geh" not in done.stdout
        assert "'gehäim'" in visu("read", one.url, ".CurrentPassword", "--show-secrets").stdout


LETTERS = st.characters(codec="utf-8", exclude_characters="|\r\n\0", exclude_categories=("Cs",))


@examples(200)
@given(name=st.sampled_from(["UTF-8", "Cp1251", "ISO8859_1", "Big5", "EUC_JP", "SJIS", "GBK"]), text=st.text(LETTERS))
def test_any_text_goes_through_a_write(name: str, text: str) -> None:
    encoding = encoding_of(name)
    own = text.encode(encoding.name, "ignore").decode(encoding.name)
    where = Place(4, 0, 1 + len(own.encode(encoding.name)), STRING)
    if b"|" in own.encode(encoding.name):
        with pytest.raises(ValueError, match=r"has the byte of '\|' in it"):
            entered(where, f"'{own}'", encoding)
        return
    request = read_request(write_body(where, entered(where, f"'{own}'", encoding)))
    assert request is not None
    assert shown(where, request.entries[0].value or "", encoding).value == own
