"""Passwords that are asked for as something else: the type selects the form of a text, not the memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.tracker.readings.form import HIDDEN
from nvscope.tracker.visu.on_demand import NAME, VisuState
from tests.analysis.transactions.talk import PANEL, PRESS, post, reply
from tests.analysis.transactions.test_transactions import transactions
from tests.oracle.builders import START
from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line
from tests.packets import batch_of
from tests.program_here import run_text
from tests.tracker.visu.followed import by_the_rules, followed, seen

NAMES = (
    b"<visu-ini-file><variablelist>"
    b'<variable name=".CurrentPassword">4,10,21,8</variable><variable name="PRG.alias">4,10,21,8</variable>'
    b'<variable name="PRG.part">4,28,4,5</variable><variable name="PRG.speed">4,0,4,6</variable>'
    b"</variablelist></visu-ini-file>"
)
FORMS = "4,10,21,8", "4,10,21,9", "4,10,21,11", "4,28,4,5", "4,30,1,2", "4,0,40,9"
SECRET, OPEN = "71017734", "31.25"


def talk(place: str) -> Line:
    """Let a page learn names, read a variable and one that is no password, write the first, and read it again."""
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    fields = place.replace(",", "|")
    line.ask(post(f"|0|2|0|{fields}|1|4|0|4|6|")).answer(reply(f"|{SECRET}|{OPEN}|"))
    line.ask(post(f"|1|1|0|{fields}|{SECRET}1|")).answer(reply("|0|"))
    return line.ask(post(f"|0|1|0|{fields}|")).answer(reply(f"|{SECRET}2|"))


@pytest.mark.parametrize("place", FORMS)
def test_every_form_is_found(place: str) -> None:
    frames = talk(place).frames
    findings = seen(frames)[1]
    assert findings == by_the_rules(frames).findings()
    assert [(one["code"], one["count"]) for one in findings] == [("NV801", 1), ("NV803", 3)]
    state = followed([batch_of(frames)]).others[NAME]
    assert isinstance(state, VisuState)
    assert state.known is not None
    assert [one.is_secret for one in state.known.writes.kept] == [True]


@pytest.mark.parametrize(
    ("values", "shown"),
    [("|geh|eim|a|", 1), ("|???|a|b|", 0), ("|geheim|???|b|", 1), ("|geheim|a|", 1), ("|???|a|", 0), ("||a|b|", 1)],
)
def test_a_password_is_seen_whatever_belongs_to_it(values: str, shown: int) -> None:
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    line.ask(post("|0|2|0|4|10|21|8|1|4|60|21|8|")).answer(reply(values))
    findings = seen(line.frames)[1]
    assert findings == by_the_rules(line.frames).findings()
    assert [one["count"] for one in findings if one["code"] == "NV803"] == [1] * shown


@pytest.mark.parametrize("place", FORMS[1:4:2])
def test_no_face_shows_it(place: str, tmp_path: Path) -> None:
    path = str(tmp_path / "c.pcap")
    write_pcap(talk(place).frames, tmp_path / "c.pcap")
    faces = (
        ("vars", path), ("vars", path, "--json"), ("vars", path, "--history"), ("vars", path, "--at", "1000"),
        ("packets", path), ("packets", path, "-v"), ("report", path, "-v"), ("report", path, "--json"),
        ("export", path, "--list", f"visu/{PRESS}", "-w", "-"), ("export", path, "--form", "long", "-w", "-.ndjson"),
    )  # fmt: skip
    for words in faces:
        done = run_text(*words)
        assert SECRET not in done.stdout + done.stderr, words
    assert OPEN in run_text("vars", path).stdout
    assert f"{SECRET}2" in run_text("vars", path, "--show-secrets").stdout


def test_what_is_brought_to_screens_and_recordings_is_hidden() -> None:
    said = [one for told in transactions(talk("4,10,21,9").frames) for one in told.said if one.name == "4,10,21,9"]
    assert {(one.text, one.value) for one in said} == {(HIDDEN, HIDDEN)}
    assert {one.old_text for one in said} == {None, HIDDEN}


def test_the_finding_says_under_what_it_was_asked_for(tmp_path: Path) -> None:
    for place, told in (("4,10,21,9", "bytes of a password in clear 3 times, as 4,10,21,9."),
                        ("4,28,4,5", "bytes of a password in clear 3 times, as PRG.part.")):  # fmt: skip
        write_pcap(talk(place).frames, tmp_path / "c.pcap")
        assert (
            f"{PANEL} and {PRESS} transmitted {told}" in run_text("report", str(tmp_path / "c.pcap"), "--json").stdout
        )


def test_what_came_before_the_names_is_what_it_was_called_then() -> None:
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    line.ask(post("|0|1|0|4|10|21|9|")).answer(reply(f"|{SECRET}|"))
    line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    assert seen(line.frames)[1] == by_the_rules(line.frames).findings() == []


def test_a_password_that_has_another_name_in_a_later_list_stays_one() -> None:
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    both = '<v><variablelist>%s<variable name="PRG.x">4,10,21,9</variable></variablelist></v>'
    for more in ("", '<variable name=".CurrentPassword">4,10,21,9</variable>'):
        line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(both % more))
    line.ask(post("|0|1|0|4|10|21|9|")).answer(reply(f"|{SECRET}|"))
    assert [one["code"] for one in seen(line.frames)[1]] == ["NV803"]
    assert seen(line.frames)[1] == by_the_rules(line.frames).findings()
