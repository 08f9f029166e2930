"""Rules about who writes what: by short conversations, in all outputs, and what cannot be decided."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from defusedxml.ElementTree import fromstring

from nvscope.check import written_while
from nvscope.check.rules import rules_of
from nvscope.check.run import checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.definition.limits import Limits
from nvscope.definition.project import Project
from nvscope.errors import UsageError
from nvscope.simulate.scenario_file import load_scenario
from tests.check.requests import (
    DONE,
    FAILED,
    HMI,
    PRESS,
    READ_X,
    REFUSED,
    SERVICE,
    VALUE,
    WRITE,
    WRITE_PASSWORD,
    WRITE_X,
    WRITE_Y,
    asked,
    decided,
    file,
    in_turn,
    of_frames,
    page,
    post,
    reply,
    sent,
)
from tests.check.scenario_captures import SCENARIOS
from tests.laws import every_other
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import CLIENT, SERVER, Line
from tests.packets import batch_of, cut
from tests.program_here import run_text
from tests.simulate.simulation import Simulation

FAIL, PASS, OPEN = Verdict.FAIL, Verdict.PASS, Verdict.INCONCLUSIVE
NOBODY = "192.0.2.1"
PROJECT = f"""[nodes]
"{HMI}" = {{ name = "hmi" }}
"{SERVICE}" = {{ name = "laptop" }}
"{PRESS}" = {{ name = "press" }}
"{SERVER[0]}" = {{ name = "oven" }}

[parameters]
"0x2000:1" = {{ name = "set.speed", type = "INT" }}
"""


def writes(**told: Any) -> dict[str, Any]:
    return {"check": "writes", **told}


def session(*, service: bool = True) -> list[Frame]:
    """Return what a panel reads and writes, and, half a second later, a laptop."""
    panel = [
        *asked(0, counter=1, data=b"\1\0"), *asked(1000, counter=2, service=WRITE, data=b"\2\0"),
        *asked(2000, counter=3, service=WRITE, index=0x2001, answer=REFUSED),
    ]  # fmt: skip
    laptop = asked(2500, counter=9, service=WRITE, hmi=SERVICE, data=b"\7\0") if service else []
    return in_turn(panel, laptop, [sent(one) for one in (500, 1500, 4000)])


def subjects(frames: Sequence[Frame], rule: dict[str, Any], **how: Any) -> list[tuple[str | None, Verdict, int]]:
    (one,) = of_frames(frames, rule, **how)
    return [(each.node, each.verdict, each.count) for each in one.subjects]


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (writes(only_by=HMI), [(HMI, PASS, 0), (SERVICE, FAIL, 1)]),
        (writes(only_by=[HMI, SERVICE]), [(HMI, PASS, 0), (SERVICE, PASS, 0)]),
        (writes(only_by="10.0.0.0/24"), [(HMI, PASS, 0), (SERVICE, PASS, 0)]),
        (writes(only_by="10.0.0.0/31"), [(HMI, PASS, 0), (SERVICE, FAIL, 1)]),
        (writes(only_by="10.0.?.1"), [(HMI, PASS, 0), (SERVICE, FAIL, 1)]),
        (writes(only_by=NOBODY), [(HMI, FAIL, 2), (SERVICE, FAIL, 1)]),
        (writes(only_by=[]), [(HMI, FAIL, 2), (SERVICE, FAIL, 1)]),
        (writes(only_to="0x2000:1"), [(HMI, FAIL, 1), (SERVICE, PASS, 0)]),
        (writes(only_to="8192:1"), [(HMI, FAIL, 1), (SERVICE, PASS, 0)]),
        (writes(only_to="0X2000:01"), [(HMI, FAIL, 1), (SERVICE, PASS, 0)]),
        (writes(only_to="0x200?:*"), [(HMI, PASS, 0), (SERVICE, PASS, 0)]),
        (writes(only_to=["0x2000:0", "0x2001:0"]), [(HMI, FAIL, 2), (SERVICE, FAIL, 1)]),
        (writes(only_to="sdo/10.0.0.2/*"), [(HMI, PASS, 0), (SERVICE, PASS, 0)]),
        (writes(only_to="sdo/10.0.0.9/*"), [(HMI, FAIL, 2), (SERVICE, FAIL, 1)]),
        (writes(only_to="visu/*/*"), [(HMI, FAIL, 2), (SERVICE, FAIL, 1)]),
        (writes(only_by=HMI, only_to="0x2000:1"), [(HMI, FAIL, 1), (SERVICE, FAIL, 1)]),
        (writes(only_by=HMI, requester=HMI), [(HMI, PASS, 0)]),
        (writes(only_to="0x2000:1", client=SERVICE), [(SERVICE, PASS, 0)]),
        (writes(only_by=NOBODY, protocol="sdo", partner=PRESS), [(HMI, FAIL, 2), (SERVICE, FAIL, 1)]),
        (writes(only_by=NOBODY, protocol="visu"), [(None, PASS, 0)]),
        (writes(only_by=NOBODY, partner=HMI), [(None, PASS, 0)]),
    ],
)
def test_writes_of_parameters(rule: dict[str, Any], expected: list[tuple[str | None, Verdict, int]]) -> None:
    assert subjects(session(), rule) == expected


def test_a_verdict_has_what_was_written_over_what_and_the_frames() -> None:
    frames = session()
    (one,) = of_frames(frames, writes(only_by=HMI))
    _, broken = one.subjects
    (place,) = [number for number, frame in enumerate(frames, 1) if frame.ts_ns == 2500 * MILLISECOND]
    assert broken == Judged(
        FAIL, node=SERVICE, protocol="sdo", reason=f"0x2000:1 of {PRESS}: 02 00 → 07 00, confirmed", worst=1, limit=0,
        unit="writes", count=1, first_ns=2500 * MILLISECOND, frames=(place,),
    )  # fmt: skip
    (other,) = of_frames(frames, writes(only_to="0x2000:1", requester=HMI))
    assert other.subjects[0].reason == f"0x2001:1 of {PRESS}: ? → 01 00, refused"


def test_where_nobody_wrote_it_is_kept_and_says_so() -> None:
    frames = in_turn(asked(0, counter=1), sent(1000))
    (one,) = of_frames(frames, writes(only_by=NOBODY))
    assert (one.verdict, [each.reason for each in one.subjects]) == (PASS, ["nobody wrote anything"])
    # Of nothing that was recorded, nothing is known.
    (nothing,) = of_frames([], writes(only_by=NOBODY))
    assert nothing.verdict is OPEN


def test_where_others_are_not_heard_it_is_not_decided() -> None:
    (one,) = of_frames(session(), writes(only_by=[HMI, SERVICE]), hears_answers=False)
    assert one.verdict is OPEN
    (one,) = of_frames(session(), writes(only_by=HMI), hears_answers=False)
    assert one.verdict is FAIL


@pytest.mark.parametrize("visu", [False, True])
def test_where_there_is_no_room_for_all_it_is_not_decided(visu: bool) -> None:
    """What is known is judged all the same."""
    few = Project(limits=Limits(max_streams=1))
    frames = in_turn(session(), asked(3000, counter=4, service=WRITE, port=1203))
    if visu:
        frames = in_turn(talk(WRITE_X).frames, talk(WRITE_X, line=Line(("10.0.0.9", 50_000))).frames)
    rules = writes(only_by="10.0.0.0/24"), {"check": "transaction", "max_errors": 0}
    every = of_frames(frames, *rules, writes(only_by=NOBODY))
    assert [one.verdict for one in every] == [PASS, PASS if visu else FAIL, FAIL]
    some = of_frames(frames, *rules, writes(only_by=NOBODY), project=few)
    assert [one.verdict for one in some][1:] == [OPEN if visu else FAIL, FAIL]
    assert some[0].verdict is (PASS if visu else OPEN)
    assert OPEN in {one.verdict for one in some[1].subjects}


def test_a_name_that_nobody_has_given_decides_nothing() -> None:
    assert subjects(session(), writes(only_by="hmi")) == [(HMI, OPEN, 0), (SERVICE, OPEN, 0)]
    assert subjects(session(), writes(only_to=["set.*", "0x2000:1"])) == [(HMI, OPEN, 0), (SERVICE, PASS, 0)]
    assert subjects(session(), writes(only_by=HMI, only_to="set.*")) == [(HMI, OPEN, 0), (SERVICE, FAIL, 1)]
    assert subjects(session(), writes(only_by=NOBODY, requester="hmi")) == [(None, OPEN, 0)]


def test_when_and_warm_up_say_which_writes_are_judged() -> None:
    frames = session()
    assert subjects(frames, writes(only_by=NOBODY), warmup_ns=2 * SECOND) == [(HMI, FAIL, 1), (SERVICE, FAIL, 1)]
    assert subjects(frames, writes(only_by=NOBODY), warmup_ns=2 * SECOND + 1) == [(SERVICE, FAIL, 1)]
    (place,) = [number for number, frame in enumerate(frames, 1) if frame.ts_ns == 2500 * MILLISECOND]
    before = writes(only_by=NOBODY, when=f"frame.number < {place}")
    assert subjects(frames, before) == [(HMI, FAIL, 2)]
    assert subjects(frames, writes(only_by=HMI, when=f"frame.number > {place}")) == [(None, PASS, 0)]


def test_a_request_that_is_repeated_is_one_write() -> None:
    request = asked(0, None, counter=1, service=WRITE)
    again = asked(100, 3, counter=1, service=WRITE)
    assert subjects(in_turn(request, again, sent(900)), writes(only_by=NOBODY)) == [(HMI, FAIL, 1)]


@pytest.mark.parametrize(
    ("told", "what"),
    [
        ({}, "only_by, only_to, or both"), ({"requester": []}, "no node is in it"),
        ({"only_to": []}, "nothing is in it"),
        ({"only_by": "10.0.0.0/99"}, "is no network"), ({"only_by": HMI, "list": 7}, "about no list"),
        ({"only_to": ["*x"] * 101}, "more than 100 patterns"), ({"only_on": HMI}, "unknown key"),
        ({"only_by": 7}, "text is expected"),
    ],
)  # fmt: skip
def test_mistakes_are_told(told: dict[str, Any], what: str) -> None:
    with pytest.raises(UsageError) as found:
        of_frames(session(), writes(**told))
    assert any(what in str(one) for one in found.value.mistakes)  # type: ignore[attr-defined]


def talk(*bodies: bytes, line: Line | None = None, answer: bytes = DONE) -> Line:
    """Return a connection over which a page writes."""
    line = page(line)
    for body in bodies:
        line.ask(post(body)).answer(reply(answer)).wait(100 * MILLISECOND)
    return line


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (writes(only_by=CLIENT[0]), (PASS, 0)),
        (writes(only_by=NOBODY), (FAIL, 2)),
        (writes(only_to="PLC_PRG.*"), (PASS, 0)),
        (writes(only_to="plc_prg.x"), (FAIL, 1)),
        (writes(only_to="visu/*/PLC_PRG.?"), (PASS, 0)),
        (writes(only_to="visu/10.0.0.5/PLC_PRG.x"), (FAIL, 1)),
        (writes(only_to="visu/10.0.0.6/*"), (FAIL, 2)),
        (writes(only_to="sdo/*/*"), (FAIL, 2)),
        (writes(only_to=["4,144,1,0", "4,146,*,*"]), (PASS, 0)),
        (writes(only_to="4,144,1,0"), (FAIL, 1)),
        (writes(only_to="0x2000:1"), (FAIL, 2)),
        (writes(only_by=NOBODY, server=SERVER[0]), (FAIL, 2)),
    ],
)
def test_writes_of_pages(rule: dict[str, Any], expected: tuple[Verdict, int]) -> None:
    (one,) = of_frames(talk(WRITE_X, READ_X, WRITE_Y, answer=DONE).frames, rule)
    (judged,) = one.subjects
    assert (judged.verdict, judged.count) == expected
    assert (judged.protocol, judged.node) == ("visu", CLIENT[0])


def test_one_that_was_refused_was_written_all_the_same() -> None:
    (one,) = of_frames(talk(WRITE_X, answer=FAILED).frames, writes(only_by=NOBODY))
    assert (one.verdict, one.subjects[0].count) == (FAIL, 1)
    assert "PLC_PRG.x of 10.0.0.5" in one.subjects[0].reason


def test_variables_without_a_name_are_not_decided_by_names() -> None:
    frames = Line().open().ask(post(WRITE_X)).answer(reply(DONE)).frames
    (one,) = of_frames(frames, writes(only_to="PLC_PRG.*"))
    assert (one.verdict, one.subjects[0].reason) == (OPEN, "nobody has named 4,144,1,0")
    (one,) = of_frames(frames, writes(only_to="4,144,*,*"))
    assert one.verdict is PASS
    (one,) = of_frames(frames, writes(only_by=NOBODY, only_to="PLC_PRG.*"))
    assert one.verdict is FAIL


def test_where_bytes_are_missing_somebody_may_have_written() -> None:
    line = talk(WRITE_X)
    line.lose(True, 200)
    line.ask(post(READ_X)).answer(reply(VALUE)).ask(post(READ_X)).answer(reply(VALUE))
    (one,) = of_frames(line.frames, writes(only_by=CLIENT[0]))
    assert (one.verdict, "bytes of its connections are missing" in one.subjects[0].reason) == (OPEN, True)
    (one,) = of_frames(line.frames, writes(only_by=NOBODY))
    assert one.verdict is FAIL
    # Not where nothing but an acknowledgement tells so that the next reply contradicts.
    line = talk(WRITE_X)
    line.segment(False, ack=line.sent[True] + 200).ask(post(READ_X)).answer(reply(VALUE))
    assert of_frames(line.frames, writes(only_by=CLIENT[0]))[0].verdict is PASS


@pytest.mark.parametrize(
    ("body", "verdict"),
    [
        (b"|1|2|0|4|10|21|8|A|B|1|4|144|1|0|1|", FAIL),  # a text with a | in it hides nothing
        (b"|1|1|0|4|10|21|8|A|1|4|144|1|0|1|", OPEN),  # all of it a text, or two entries
        (b"|1|2|0|4|10|21|8|A|B|x|4|144|1|0|1|", OPEN),
        (b"|1|1|0|4|10|21|8|A|B|", PASS),
    ],
)
def test_texts_with_separators_hide_no_writes(body: bytes, verdict: Verdict) -> None:
    (one,) = of_frames(talk(body).frames, writes(only_to="4,10,21,8"))
    assert one.verdict is verdict
    assert verdict is not OPEN or "a text has | in it" in one.subjects[0].reason


OUTPUTS = ("--json", "--md", "--github", "--junit", "--sarif", None)


@pytest.mark.parametrize("output", OUTPUTS)
def test_passwords_and_what_is_hostile_are_in_no_output(output: str | None, tmp_path: Path) -> None:
    hostile = b"|1|1|0|4|144|1|0|<y>\x1b[31m%0A::error|"
    capture = file(talk(WRITE_PASSWORD, hostile, WRITE_X).frames, tmp_path / "x.pcap")
    rules = tmp_path / "x.rules.toml"
    rules.write_text(
        f'[[rule]]\nid = "who"\ncheck = "writes"\nonly_by = "{NOBODY}"\n'
        '[[rule]]\nid = "what"\ncheck = "writes"\nonly_to = ".Current*"\n'
    )
    out = tmp_path / "out"
    options = [] if output is None else [output, *([out] if output in ("--junit", "--sarif") else [])]
    done = run_text("check", capture, "--rules", rules, *options)
    assert done.returncode == 1, done.stderr
    told = out.read_text() if out.exists() else done.stdout
    assert "sesame" not in told
    assert "\x1b" not in told
    assert ".CurrentPassword" in told
    assert "31m" in told
    assert output not in ("--md", "--junit") or not re.search(r"(?<!\\)<y>", told)
    assert output != "--github" or not any(line.startswith("::error|") for line in told.splitlines())


def test_all_outputs_tell_who_wrote_and_where_it_is_shown(tmp_path: Path) -> None:
    capture, rules = file(session(), tmp_path / "x.pcap"), tmp_path / "x.rules.toml"
    rules.write_text(
        f'[[rule]]\nid = "who"\ncheck = "writes"\nonly_by = "{HMI}"\n'
        '[[rule]]\nid = "good"\ncheck = "transaction"\nmax_errors = "10%"\nseverity = "warning"\n'
    )
    done = run_text("check", capture, "--rules", rules, "--junit", "x.xml", "--sarif", "x.sarif", cwd=tmp_path)
    assert done.returncode == 1
    told = " ".join(done.stdout.split())
    assert f"✗ who sdo {SERVICE} worst 1 write limit 0 writes margin −1 write 0x2000:1 of {PRESS}: 02 00" in told
    assert f"! good sdo {HMI} → {PRESS}:1202 worst 33.3 % limit 10.0 %" in told
    command = f"nvscope packets {capture} -Y 'frame.number >= 4 && frame.number <= 12'"
    assert command in done.stdout
    (suite,) = fromstring((tmp_path / "x.xml").read_bytes())
    assert [(one.get("name"), one.get("classname"), [child.tag for child in one]) for one in suite] == [
        ("who", "nvscope.writes", ["failure"]), ("good", "nvscope.transaction", ["skipped"]),
    ]  # fmt: skip
    results = json.loads((tmp_path / "x.sarif").read_text())["runs"][0]["results"]
    assert [one["ruleId"] for one in results] == ["who", "good"]
    assert len({one["partialFingerprints"]["ruleAndSubject/v1"] for one in results}) == 2
    lines = run_text("check", capture, "--rules", rules, "--github").stdout.splitlines()
    assert [line.split(" ")[0] for line in lines if line.startswith("::")] == ["::error", "::warning"]
    dry = run_text("check", capture, "--rules", rules, "--dry-run").stdout.splitlines()
    assert dry[:2] == ["who   writes: writer", "good  transaction: pair"]


@pytest.mark.parametrize(
    ("rule", "code"),
    [
        ('check = "writes"\nonly_by = ["HMI", "laptop"]', 0),
        ('check = "writes"\nonly_by = "hmi"', 1),
        ('check = "writes"\nonly_by = "*m?"\nrequester = "hmi"', 0),
        ('check = "writes"\nonly_to = "set.*"', 1),
        ('check = "writes"\nonly_to = "SET.speed"\nclient = "laptop"', 0),
        ('check = "writes"\nonly_to = ["sdo/press/set.speed", "0x2001:1"]', 0),
        ('check = "writes"\nonly_to = ["sdo/oven/set.speed", "0x2001:1"]', 1),
        ('check = "transaction"\nrequester = "laptop"\npartner = "press"\nmax_errors = "0%"', 0),
        ('check = "transaction"\nrequester = "oven"\nmax_errors = "0%"', 3),
    ],
)
def test_nodes_and_parameters_go_by_their_names(rule: str, code: int, tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(PROJECT)
    file(session(), tmp_path / "x.pcap")
    (tmp_path / "x.rules.toml").write_text(f'[[rule]]\nid = "x"\n{rule}\n')
    done = run_text("check", "x.pcap", cwd=tmp_path)
    assert done.returncode == code, (done.stdout, done.stderr)
    assert code != 1 or "02 00" not in done.stdout  # values are those of their types


@pytest.mark.parametrize("key", ["only_by", "requester", "partner"])
def test_a_name_that_the_project_does_not_know_is_a_mistake(key: str, tmp_path: Path) -> None:
    gvl = "captures/peers/axis.gvl"
    (tmp_path / "nvscope.toml").write_text(f'definitions = ["{Path(gvl).resolve()}"]\n{PROJECT}')
    file(session(), tmp_path / "x.pcap")
    rule = f'check = "writes"\nonly_to = "*"\n{key} = "presss"'
    (tmp_path / "x.rules.toml").write_text(f'[[rule]]\nid = "x"\n{rule}\n')
    done = run_text("check", "x.pcap", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"rule[0].{key}: no node is called 'presss'" in done.stderr
    assert "press" in done.stderr.replace("presss", "")


@pytest.mark.parametrize("visu", [False, True])
def test_the_first_ones_have_room_however_it_is_cut(visu: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(written_while, "MOST_PLACES", 2)
    frames = talk(WRITE_Y, WRITE_X, WRITE_PASSWORD, WRITE_Y).frames if visu else None
    if frames is None:
        several = (asked(10 * at, counter=at, service=WRITE, index=0x2003 - at) for at in range(4))
        frames = in_turn(*several, sent(100))
    rules = writes(only_by=NOBODY), writes(only_by="10.0.0.0/24")
    found = [
        [(one.verdict, list(one.subjects)) for one in decided(cut(batch_of(frames), size), *rules)]
        for size in every_other(1, 2, 3, len(frames))
    ]
    assert found == [found[0]] * len(found)
    (_, broken), (kept, _) = found[0]
    assert (kept, OPEN in {one.verdict for one in broken}) == (OPEN, True)
    assert [one.count for one in broken if one.verdict is FAIL] == [3 if visu else 2]


@pytest.mark.parametrize(
    ("name", "rule", "expected"),
    [
        ("parameter-writes", writes(only_by="192.168.1.20"), {"192.168.1.20": PASS, "192.168.1.30": FAIL}),
        ("parameter-writes", writes(only_by="192.168.1.0/24"), {"192.168.1.20": PASS, "192.168.1.30": PASS}),
        ("parameter-writes", writes(only_to="0x2000:1"), {"192.168.1.20": PASS, "192.168.1.30": FAIL}),
        ("parameter-refused", writes(only_to="0x2010:0"), {"192.168.1.20": PASS}),
        ("parameter-refused", writes(only_to="0x2010:1"), {"192.168.1.20": FAIL}),
        ("parameter-manager", writes(only_by=NOBODY), {None: PASS}),
        ("plant-clean", writes(only_by=NOBODY), {None: PASS}),
    ],
)
def test_scenarios(name: str, rule: dict[str, Any], expected: dict[str | None, Verdict], tmp_path: Path) -> None:
    inquiry = Simulation(load_scenario(SCENARIOS / f"{name}.toml")).inquiry(tmp_path)
    (one,) = checked(inquiry, rules_of([{"id": "x", **rule}], "test")).decided
    assert {each.node: each.verdict for each in one.subjects} == expected
