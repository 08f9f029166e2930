"""``nvscope gvl``, as people call it: what is printed, how wide, and how it ends."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.definition.test_lint import can, gvl
from tests.program_here import run_text

SENDER = gvl("\tbRun : BOOL;\n\tnState : INT;\n\trForce : REAL;\n\taPos : ARRAY [0..9] OF REAL;\n\tnCount : UDINT;")
READER = gvl("\tbRun : BOOL;\n\tnState : INT;\n\taPos : ARRAY [0..9] OF REAL;\n\tnCount : UDINT;", Interval="T#0ms")
RENAMED = SENDER.replace("nCount", "nParts")


def nvscope(*arguments: str, cwd: Path, columns: int = 80) -> subprocess.CompletedProcess[str]:
    return run_text("gvl", *arguments, cwd=cwd, environment={"COLUMNS": str(columns)})


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in (("press.gvl", SENDER), ("hmi.gvl", READER), ("renamed.gvl", RENAMED)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_mistakes_are_printed_with_their_places(files: Path) -> None:
    done = nvscope("lint", "press.gvl", "hmi.gvl", cwd=files)
    assert done.returncode == 1
    assert done.stdout.startswith("hmi.gvl:3:1: warning: hmi is cyclic with an interval of 0 [interval-zero]\n    The")
    assert "\npress.gvl:3:1: error: press has the identifier 7 on port 1202, which hmi has too\n" in done.stdout
    assert done.stdout.endswith("\n\nFound 1 error, 1 warning in 2 lists in 2 files.\n")


def test_nothing_found_says_so(files: Path) -> None:
    done = nvscope("lint", "press.gvl", "press.gvl", cwd=files)
    assert (done.returncode, done.stdout) == (0, "Nothing to complain about: 1 list in 1 file.\n")


def test_notes_alone_are_no_failure(files: Path) -> None:
    (files / "note.gvl").write_text(gvl(ListIdentifier="300"), encoding="utf-8")
    done = nvscope("lint", "note.gvl", cwd=files)
    assert done.returncode == 0
    assert done.stdout.endswith("Found 1 note in 1 list in 1 file.\n")


def test_mistakes_as_json(files: Path) -> None:
    done = nvscope("lint", "hmi.gvl", "--json", cwd=files)
    document = json.loads(done.stdout)
    assert (done.returncode, document["schema"]) == (1, "nvscope.lint/1")
    (mistake,) = document["mistakes"]
    assert (mistake["rule"], mistake["severity"], mistake["list"]) == ("interval-zero", "warning", "hmi")
    assert (mistake["file"], mistake["line"], mistake["column"]) == ("hmi.gvl", 3, 1)
    assert [rule["id"] for rule in document["rules"]] == ["interval-zero"]


def test_rules_can_be_read(tmp_path: Path) -> None:
    told = nvscope("lint", "--rules", cwd=tmp_path).stdout
    rules = json.loads(nvscope("lint", "--rules", "--json", cwd=tmp_path).stdout)["rules"]
    assert len(rules) > 15
    for rule in rules:
        assert f"{rule['id']} ({rule['severity']}): " in told


def test_what_is_the_same_on_the_wire_ends_with_0(files: Path) -> None:
    done = nvscope("diff", "press.gvl", "renamed.gvl", cwd=files)
    assert done.returncode == 0
    assert "nCount: called nParts in B" in done.stdout
    assert "accepted (Items 14, Length 71), every value is right; only names\n" in done.stdout
    assert done.stdout.endswith("Same on the wire: 1 list that both sides have.\n")
    assert "same on the wire, nothing differs." in nvscope("diff", "press.gvl", "press.gvl", cwd=files).stdout


def test_what_differs_ends_with_1_and_shows_where_values_land(files: Path) -> None:
    done = nvscope("diff", "press.gvl", "hmi.gvl", cwd=files)
    assert done.returncode == 1
    assert "  rForce : REAL: only A has it\n" in done.stdout
    assert "  SubIndex 0: not accepted: A sends Items 14, Length 71, B expects Items 13,\n" in done.stdout
    assert [line.split() for line in done.stdout.splitlines() if "–" in line] == [
        ["0–2", "bRun", "…", "nState", "(2", "items)", "the", "same"],
        ["3–6", "rForce", ":", "REAL", "aPos[0]", ":", "REAL"],
        ["7–42", "aPos[0]", "…", "[8]", ":", "REAL", "aPos[1]", "…", "[9]", ":", "REAL"],
        ["43–46", "aPos[9]", ":", "REAL", "nCount", ":", "UDINT"],
        ["47–50", "nCount", ":", "UDINT", "nothing"],
    ]
    document = json.loads(nvscope("diff", "press.gvl", "hmi.gvl", "--json", cwd=files).stdout)
    assert (document["schema"], document["same_on_wire"]) == ("nvscope.diff/2", False)
    assert document["lists"][0]["telegrams"][0]["bytes"][1]["b"]["first"] == "aPos[0]"


def test_each_side_has_its_own_types(files: Path) -> None:
    (files / "list.gvl").write_text(gvl("stAxis : Axis;"), encoding="utf-8")
    for name, member in (("a.st", "REAL"), ("b.st", "DINT")):
        (files / name).write_text(f"TYPE Axis : STRUCT pos : {member}; END_STRUCT END_TYPE", encoding="utf-8")
    both = nvscope("diff", "list.gvl", "list.gvl", "--types", "a.st", cwd=files)
    assert both.returncode == 0
    own = nvscope("diff", "list.gvl", "list.gvl", "--a-types", "a.st", "--b-types", "b.st", cwd=files)
    assert own.returncode == 1
    assert "stAxis: stAxis.pos : REAL in A, stAxis.pos : DINT in B" in own.stdout
    assert "accepted, and misread" in own.stdout


def test_telegrams_that_never_reach_the_reader(files: Path) -> None:
    (files / "other.gvl").write_text(SENDER.replace("<ListIdentifier>7<", "<ListIdentifier>8<"), encoding="utf-8")
    done = nvscope("diff", "press.gvl", "other.gvl", cwd=files, columns=120)
    assert done.returncode == 1
    assert "  list identifier: A 7, B 8\n  A reader of B gets none of A's telegrams; what follows is" in done.stdout
    assert "none of A's telegrams" not in nvscope("diff", "press.gvl", "hmi.gvl", cwd=files, columns=120).stdout


def test_an_element_without_a_place_leaves_the_answer_open(files: Path) -> None:
    (files / "open.gvl").write_text(gvl("a : BYTE; p : POINTER TO BOOL; z : DINT;"), encoding="utf-8")
    done = nvscope("diff", "open.gvl", "open.gvl", cwd=files, columns=120)
    assert done.returncode == 1
    assert "SubIndex 0: nobody knows how many bytes p has in A. From it on, nothing can be compared." in done.stdout
    assert done.stdout.endswith("\nNot known to be the same: 1 of 1 list that both sides have.\n")
    document = json.loads(nvscope("diff", "open.gvl", "open.gvl", "--json", cwd=files).stdout)
    (entry,) = document["lists"]
    assert (document["same_on_wire"], entry["same_on_wire"], entry["identical"]) == (None, None, False)
    (telegram,) = entry["telegrams"]
    assert (telegram["accepted"], telegram["same"]) == (None, None)
    assert telegram["a"] == {"items": None, "length": None, "unknown": "p"}


def test_lists_on_can_are_compared_by_cob_id_and_dlc(files: Path) -> None:
    for name, text in (("a.gvl", "a : DWORD; b : DWORD; c : INT;"), ("b.gvl", "a : LWORD; c : INT;")):
        (files / name).write_text(can(text, ListIdentifier="272"), encoding="utf-8")
    done = nvscope("diff", "a.gvl", "b.gvl", cwd=files, columns=120)
    assert done.returncode == 1
    assert done.stdout.startswith("a (list 0x110 on CAN): different.\n")
    assert "  COB-ID 0x111: every byte is the same on both sides.\n" in done.stdout
    assert "  COB-ID 0x110: accepted, and misread: both have DLC 8, but not the same variables.\n" in done.stdout
    assert not {"Items", "Length", "port", "SubIndex"} & set(done.stdout.split())
    (entry,) = json.loads(nvscope("diff", "a.gvl", "b.gvl", "--json", cwd=files).stdout)["lists"]
    assert entry["a"]["port"] is None
    assert [telegram["cob_id"] for telegram in entry["telegrams"]] == [0x110, 0x111]
    assert [telegram["accepted"] for telegram in entry["telegrams"]] == [True, True]
    assert [telegram["same"] for telegram in entry["telegrams"]] == [False, True]


def test_long_maps_are_cut_and_json_has_them_all(files: Path) -> None:
    """Every second variable has another type, so that no two rows are alike."""
    for name, kind in (("one.gvl", "REAL"), ("two.gvl", "DINT")):
        members = "".join(f"v{number} : {kind if number % 2 else 'INT'};" for number in range(40))
        (files / name).write_text(gvl(members), encoding="utf-8")
    done = nvscope("diff", "one.gvl", "two.gvl", cwd=files)
    assert "28 more rows, up to byte 119: --json shows all." in done.stdout
    document = json.loads(nvscope("diff", "one.gvl", "two.gvl", "--json", cwd=files).stdout)
    assert len(document["lists"][0]["telegrams"][0]["bytes"]) == 40


@pytest.mark.parametrize("columns", [40, 80, 140])
@pytest.mark.parametrize(
    "arguments", [("lint", "press.gvl", "hmi.gvl"), ("lint", "--rules"), ("diff", "press.gvl", "hmi.gvl")]
)
def test_no_line_is_wider_than_the_terminal(arguments: tuple[str, ...], columns: int, files: Path) -> None:
    done = nvscope(*arguments, cwd=files, columns=columns)
    assert max(map(len, done.stdout.splitlines())) <= columns
    assert "\x1b" not in done.stdout


def test_names_from_files_are_shown_as_they_are_and_obeyed_by_nothing(files: Path) -> None:
    evil = files / "a\x1b[31mb.gvl"
    evil.write_text(gvl("", Interval="T#0ms"), encoding="utf-8")
    for verb in (("lint", evil.name), ("diff", evil.name, "press.gvl")):
        shown = nvscope(*verb, cwd=files).stdout
        assert "\x1b" not in shown
        assert "a\\x1b[31mb.gvl" in shown


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("lint",), "no definition is given"),
        (("lint", "nowhere.gvl"), "nowhere.gvl: cannot be read"),
        (("diff", "press.gvl", "nowhere.gvl"), "nowhere.gvl: cannot be read"),
        (("diff", "press.gvl"), "Missing argument 'B'"),
        (("diff", "press.gvl", "types.st"), "types.st: no list is defined"),
        (("diff", "press.gvl", "bad.gvl"), "bad.gvl, line 4, column 5: found ';', expected a type"),
        (("lint", "bad.gvl"), "bad.gvl, line 4, column 5: found ';', expected a type"),
    ],
)
def test_wrong_input_is_a_usage_error(arguments: tuple[str, ...], said: str, files: Path) -> None:
    (files / "bad.gvl").write_text(gvl("a : ;"), encoding="utf-8")
    (files / "types.st").write_text("TYPE T : INT; END_TYPE", encoding="utf-8")
    done = nvscope(*arguments, cwd=files)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_list_on_can_has_cob_ids_and_no_header(tmp_path: Path) -> None:
    (tmp_path / "press.gvl").write_text(
        "<GVL><Declarations><![CDATA[VAR_GLOBAL a : LREAL; b : INT; c : INT; s : STRING(20); d : INT; END_VAR]]>"
        "</Declarations><NetvarSettings Protocol='CAN'><ListIdentifier>400</ListIdentifier></NetvarSettings></GVL>"
    )
    done = nvscope("layout", "press.gvl", cwd=tmp_path)
    heads = [line.strip() for line in done.stdout.splitlines() if "COB-ID" in line]
    assert heads == ["COB-ID 0x190: DLC 8", "COB-ID 0x191: DLC 4", "COB-ID ?: DLC ?", "COB-ID ?: DLC ?"]
    assert "on CAN, packed" in done.stdout
    assert "described nowhere" in done.stdout
    document = json.loads(nvscope("layout", "--json", "press.gvl", cwd=tmp_path).stdout)
    assert (document["lists"][0]["port"], document["lists"][0]["assumed"]) == (None, True)
