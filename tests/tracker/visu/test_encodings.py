"""Texts of pages that say how they are encoded, and what is made of them wherever values are shown."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu_page import encoding_said
from nvscope.definition.visu_encoding import encoding_of
from tests.definition.lists import telegram
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line
from tests.program_here import run, run_text
from tests.tracker.visu.shown_and_carried import GVL

PLACE = "4|60|81|8"
LIST = (
    b'<visualisation><variablelist><variable name="PRG.sText">4,60,81,8</variable>'
    b'<variable name=".CurrentPassword">4,8,41,8</variable></variablelist></visualisation>'
)
TEXTS = {
    "UTF-8": "Größe 20 € Δ", "UTF8": "темп", "Cp1251": "Насос №1", "windows-1251": "Ёлка", "ISO8859_1": "Größe",
    "ISO-8859-15": "5 €", "KOI8_R": "вода", "Big5": "溫度", "EUC_JP": "温度", "SJIS": "ソ温度", "GBK": "温度",
    "MS932": "ポンプ", "EUC_KR": "온도", "x-windows-874": "น้ำ",
}  # fmt: skip


def applet(name: str, quote: str = '"') -> bytes:
    parameter = f"<PARAM NAME={quote}ENCODINGSTRING{quote} VALUE={quote}{name}{quote}>"
    return f'<html><applet code="webvisu.class"><param name="STARTVISU" value="PLC_VISU">{parameter}</applet>'.encode()


class Page(Line):
    """A page that says to one controller what it wants."""

    def __init__(self, server: str = "10.0.0.5", port: int = 80, client_port: int = 50_000) -> None:
        super().__init__(("10.0.0.9", client_port), (server, port))
        self.open()

    def loads(self, file: str, content: bytes, status: str = "200 OK") -> Page:
        self.ask(f"GET /plc/{file} HTTP/1.1\r\n\r\n".encode())
        said = b"HTTP/1.1 %s\r\nContent-Length: %d\r\n\r\n%s" % (status.encode(), len(content), content)
        for start in range(0, len(said), 60_000):
            self.answer(said[start : start + 60_000])
        return self

    def posts(self, body: bytes, answer: bytes) -> Page:
        self.ask(b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
        self.answer(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (len(answer), answer))
        return self

    def reads(self, value: bytes, place: str = PLACE) -> Page:
        return self.posts(f"|0|1|0|{place}|".encode(), b"|%s|" % value)

    def writes(self, value: bytes, place: str = PLACE) -> Page:
        return self.posts(f"|1|1|0|{place}|".encode() + value + b"|", b"|0|")


def asked(verb: str, frames: Sequence[Frame], folder: Path, *words: str, toml: str = "") -> Any:
    """Return what a verb says of frames, as JSON or text."""
    write_pcap(frames, folder / "c.pcap")
    (folder / "nvscope.toml").write_text(toml)
    done = run(verb, "c.pcap", "--project", "nvscope.toml", *words, cwd=folder, environment={"COLUMNS": "200"})
    text = done.stdout.decode()
    return json.loads(text) if "--json" in words else text


def written(frames: Sequence[Frame], folder: Path, toml: str = "") -> list[tuple[str | None, str | None]]:
    report = asked("report", frames, folder, "--json", toml=toml)
    return [(row["old"], row["new"]) for row in report["visu_writes"]]


def of_encoding(name: str) -> list[Frame]:
    text, codec = TEXTS[name], encoding_of(name).name
    line = Page().loads("webvisu.htm", applet(name)).loads("plc_visu.xml", LIST)
    return line.reads(b"before").reads(text.encode(codec)).writes(f"{text}!".encode(codec)).frames


@pytest.mark.parametrize("name", TEXTS)
def test_texts_are_shown_as_their_page_has_them(name: str, tmp_path: Path) -> None:
    frames, text = of_encoding(name), TEXTS[name]
    assert written(frames, tmp_path) == [(text, f"{text}!")]
    (row,) = [row for row in asked("vars", frames, tmp_path, "--json")["page_variables"] if row["place"] == "4,60,81,8"]
    assert row["value"] == f"{text}!"


def test_everything_that_shows_values_agrees(tmp_path: Path) -> None:
    frames, text = of_encoding("UTF-8"), TEXTS["UTF-8"]
    assert f"PRG.sText = {text}!" in asked("packets", frames, tmp_path)
    assert f" = {text}!" in asked("packets", frames, tmp_path, "-V")
    assert "page, its texts are in UTF-8" in asked("packets", frames, tmp_path)
    chosen = ("-Y", f'visu.value == "{text}"', "-T", "fields", "-e", "visu.value")
    assert asked("packets", frames, tmp_path, *chosen).split("\n")[0] == text
    history = asked("vars", frames, tmp_path, "--history", "visu/10.0.0.5/PRG.sText", "--json")
    assert [row["new"] for row in history["page_changes"]] == ["before", text, f"{text}!"]
    run("export", "c.pcap", "-w", "long.csv", "--list", "visu/*", cwd=tmp_path)
    assert text in (tmp_path / "long.csv").read_text("utf-8-sig")
    findings = [one["message"] for one in asked("report", frames, tmp_path, "--json")["findings"]]
    assert any(f": {text} → {text}!" in one for one in findings)


def test_a_list_that_is_compared_with_a_page_is_shown_in_its_encoding(tmp_path: Path) -> None:
    (tmp_path / "plant.gvl").write_text(GVL)
    text = "ä5"
    data = bytes(10) + text.encode().ljust(6, b"\0") + bytes(7)
    frames = [telegram(data, 6, subindex=0, counter=1, list_id=9, ts_ns=0)]
    line = Page().loads("webvisu.htm", applet("UTF-8"))
    line.loads("plc_visu.xml", LIST.replace(b"PRG.sText", b".sText").replace(b",81,", b",6,"))
    line.reads(text.encode(), "4|60|6|8")
    report = asked("report", [*line.frames, *frames], tmp_path, "--compare", "--gvl", "plant.gvl", "--json")
    (row,) = report["page_hops"]
    assert (row["from"]["value"], row["to"]["value"], row["equal"]) == (text, text, True)


def test_the_old_value_of_a_password_that_nobody_knows_is_none(tmp_path: Path) -> None:
    line = Page().loads("plc_visu.xml", LIST)
    line.writes(b"one", "4|8|41|8").writes(b"two", "4|8|41|8")
    report = asked("report", line.frames, tmp_path, "--json")
    assert [(row["old"], row["old_known"], row["hidden"]) for row in report["visu_writes"]] == [
        (None, False, True), (None, True, True),
    ]  # fmt: skip
    shown = asked("report", line.frames, tmp_path, "-v")
    rows = [one for one in shown.splitlines() if ".CurrentPassword" in one and "confirmed" in one]
    assert [one.count("(hidden)") for one in rows] == [1, 2]


def test_what_the_project_says_goes_before_what_pages_say(tmp_path: Path) -> None:
    frames = Page().loads("webvisu.htm", applet("UTF-8")).writes("Насос".encode("cp1251")).frames
    frames = [*frames, *Page("10.0.0.6", client_port=50_001).writes("насос".encode("koi8-r")).frames]
    toml = '[webvisu]\nencoding = "windows-1251"\nencodings = { "10.0.0.6" = "KOI8_R" }'
    write_pcap(frames, tmp_path / "c.pcap")
    (tmp_path / "nvscope.toml").write_text(toml)
    shown = run_text("packets", "c.pcap", "--project", "nvscope.toml", "--show-secrets", cwd=tmp_path).stdout
    assert "= Насос" in shown
    assert "= насос" in shown
    assert "page, its texts are in UTF-8; they are read as cp1251" in shown


def test_a_project_names_only_encodings_that_can_be_used(tmp_path: Path) -> None:
    write_pcap(Page().frames, tmp_path / "c.pcap")
    for name, why in (("UTF-16", "ASCII is not one byte"), ("klingon", "no encoding is known that is called")):
        (tmp_path / "nvscope.toml").write_text(f'[webvisu]\nencoding = "{name}"')
        done = run_text("report", "c.pcap", "--project", "nvscope.toml", cwd=tmp_path)
        assert done.returncode == 2
        assert "webvisu.encoding" in done.stderr
        assert why in done.stderr


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("UTF-16", "in UTF-16, ASCII is not one byte a character: '|' would part no values"),
        ("ISO2022JP", "in ISO2022JP, ASCII is not one byte a character: '|' would part no values"),
        ("klingon", "no encoding is known that is called 'klingon'"),
    ],
)
def test_an_encoding_that_cannot_be_used_is_told_and_changes_nothing(name: str, why: str, tmp_path: Path) -> None:
    line = Page().loads("plc_visu.xml", LIST).loads("webvisu.htm", applet(name)).writes(b"Gr\xf6\xdfe")
    report = asked("report", line.frames, tmp_path, "--json")
    assert [row["new"] for row in report["visu_writes"]] == ["Größe"]
    (told,) = [one["message"] for one in report["findings"] if one["code"] == "NV809"]
    assert told == f"10.0.0.5 sent a page that says an encoding of texts that cannot be used: {why}."
    assert f"page, its texts are in an encoding that cannot be used: {why}" in asked("packets", line.frames, tmp_path)


def test_bytes_that_are_no_text_stay_visible(tmp_path: Path) -> None:
    line = Page().loads("webvisu.htm", applet("UTF-8")).loads("plc_visu.xml", LIST).writes(b"Gr\xf6\xc3\x9fe")
    assert written(line.frames, tmp_path) == [(None, r"Gr\xf6ße")]


def test_a_bar_within_a_character_parts_values_and_the_only_text_is_joined(tmp_path: Path) -> None:
    text = "ポンプ"  # its first character is 0x83 0x7C
    line = Page().loads("webvisu.htm", applet("SJIS")).loads("plc_visu.xml", LIST)
    line.reads(text.encode("sjis")).writes(text.encode("sjis"))
    assert written(line.frames, tmp_path) == [(text, text)]


def test_what_came_before_the_page_is_shown_by_it_from_then_on(tmp_path: Path) -> None:
    utf8 = "Größe".encode()
    line = Page().loads("plc_visu.xml", LIST).reads(utf8).writes(utf8)
    line.loads("webvisu.htm", applet("UTF-8")).writes(utf8)
    assert written(line.frames, tmp_path) == [("GrÃ¶Ã\x9fe", "GrÃ¶Ã\x9fe"), ("Größe", "Größe")]
    (row,) = [row for row in asked("vars", line.frames, tmp_path, "--json")["page_variables"] if row["type"]]
    assert (row["value"], row["changes"]) == ("Größe", 0)


def test_numbers_headers_and_other_types_are_no_texts(tmp_path: Path) -> None:
    line = Page().loads("webvisu.htm", applet("UTF-8")).writes("ä".encode(), "4|0|2|9")
    assert written(line.frames, tmp_path) == [(None, "Ã¤")]


def test_passwords_stay_hidden(tmp_path: Path) -> None:
    line = Page().loads("webvisu.htm", applet("UTF-8")).loads("plc_visu.xml", LIST)
    line.reads("gehäim".encode(), "4|8|41|8").writes("gehäim2".encode(), "4|8|41|8")
    for verb, words in (("packets", ("-V",)), ("vars", ()), ("report", ("-v",))):
        shown = asked(verb, line.frames, tmp_path, *words)
        assert "geh" not in shown
    assert "gehäim2" in asked("packets", line.frames, tmp_path, "--show-secrets")


def test_pages_that_do_not_count(tmp_path: Path) -> None:
    line = Page().loads("plc_visu.xml", LIST)
    line.loads("webvisu.htm", applet("UTF-8"), "404 Not Found").loads("x.txt", applet("UTF-8"))
    line.loads("x.htm", b"<!-- " + applet("UTF-8") + b" -->").loads("y.html", b"<p>ENCODINGSTRING UTF-8</p>")
    cut = b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n" + applet("UTF-8")
    line.ask(b"GET /plc/z.htm HTTP/1.1\r\n\r\n").answer(cut)
    other = Page("10.0.0.6", client_port=50_002).loads("webvisu.htm", applet("UTF-8"))
    own = Page(client_port=50_003).writes("ä".encode())
    frames = [*line.frames, *other.frames, *own.frames]
    assert written(frames, tmp_path) == [(None, "Ã¤")]
    assert asked("packets", line.frames, tmp_path).count("page, its texts") == 0


@pytest.mark.parametrize(
    "page",
    [
        b"<param " * 150_000, b"<!--" * 250_000, b'<param name="a" value="b">' * 40_000 + b"encodingstring",
        b"<param " + b"a=" * 500_000 + b"encodingstring", b"<param name=encodingstring" * 40_000,
        b"<param name='" * 80_000 + b"encodingstring", (b"<param " + b"a " * 900 + b">") * 500 + b"encodingstring",
        b"<param name=encodingstring value='" + b"x" * 1900 + b"'>" + b"\0" * 900_000,
        b"<param name=encodingstring value=>", b"<param name=encodingstring><param value=UTF-8>", b"\xff\xfe<\0p\0",
    ],
    ids=range(11),
)  # fmt: skip
def test_hostile_pages_take_no_time_and_change_nothing(page: bytes, tmp_path: Path) -> None:
    line = Page().loads("plc_visu.xml", LIST).loads("webvisu.htm", page).writes(b"Gr\xf6\xdfe")
    began = process_time()
    encoding_said(page)
    assert process_time() - began < 2
    assert written(line.frames, tmp_path) == [(None, "Größe")]


@pytest.mark.parametrize(
    "text",
    [
        '<PARAM NAME="ENCODINGSTRING" VALUE="UTF-8">', "<param value='UTF-8' name=encodingstring />",
        "<param\nname = EncodingString\r\n value=UTF-8>", "<param name=ENCODINGSTRING value=UTF-8/>",
        '<param data-name="x" name="ENCODINGSTRING" value=" UTF-8 "><param name="ENCODINGSTRING" value="Big5">',
        '<!-- <param name="ENCODINGSTRING" value="Big5"> --><param name="ENCODINGSTRING" value="UTF-8">',
    ],
)  # fmt: skip
def test_parameters_are_found_in_any_case_and_with_any_quotes(text: str) -> None:
    assert encoding_said(f"<html><applet>{text}</applet></html>".encode()) == "UTF-8"


@examples(60)
@given(st.data())
def test_any_text_of_an_encoding_is_shown_as_it_was_written(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(sorted(TEXTS)))
    codec = encoding_of(name).name
    letters = st.characters(codec="utf-8", exclude_characters="|\r\n\0", exclude_categories=("Cs",))
    text = data.draw(st.text(letters, max_size=20).map(lambda one: one.encode(codec, "ignore").decode(codec)))
    line = Page().loads("webvisu.htm", applet(name)).loads("plc_visu.xml", LIST)
    line.writes(text.encode(codec))
    with TemporaryDirectory() as folder:
        assert written(line.frames, Path(folder)) == [(None, text)]
