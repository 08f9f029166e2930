"""Every rule by a sample that it finds and one that it leaves alone."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import pytest

from dissectors.can.canopen import PREDEFINED, services_within
from nvscope.definition.lint import RULES, Mistake, lint
from nvscope.definition.load import definition_of, load_definitions, read_definitions
from nvscope.definition.wanted_files import wanted_files

SETTINGS = {
    "ListIdentifier": "7", "Pack": "True", "Checksum": "False", "Acknowledge": "False", "CyclicTransmission": "True",
    "TransmissionOnChange": "False", "TransmissionOnEvent": "False", "Interval": "T#50ms", "MinGap": "T#20ms",
}  # fmt: skip


def gvl(
    text: str = "bRun : BOOL;", protocol: str = "UDP", address: str = "255.255.255.255", **changed: str | None
) -> str:
    """Return an exported list whose variables begin in line 4; a setting that is None is left out."""
    settings = "".join(f"<{key}>{value}</{key}>" for key, value in (SETTINGS | changed).items() if value is not None)
    return (
        f"<GVL>\n<Declarations><![CDATA[\nVAR_GLOBAL\n{text}\nEND_VAR]]></Declarations>\n"
        f'<NetvarSettings Protocol="{protocol}">{settings}<ProtocolSettings>'
        f'<ProtocolSetting Name="Broadcast Adr." Value="{address}"/></ProtocolSettings></NetvarSettings></GVL>'
    )


def can(text: str = "a : DWORD;", **changed: str | None) -> str:
    return gvl(text, "CAN", **changed)


def mistakes(path: Path, files: Sequence[str]) -> list[Mistake]:
    """Return what is found in files that are called a, b, …"""
    names = []
    for number, text in enumerate(files):
        suffix = "xml" if text.startswith("<?") else "gvl" if text.startswith("<") else "st"
        names.append(path / f"{'abcdef'[number]}.{suffix}")
        names[-1].write_text(text, encoding="utf-8")
    return linted(*map(str, names))


def linted(*paths: str) -> list[Mistake]:
    read = read_definitions(wanted_files(paths))
    return lint(list(read.files.values()), definition_of(read))


GLOBALS = (
    "{constants}VAR_GLOBAL a : FB_Unknown; b : ARRAY [0..N] OF Big; c : Both; e : (x, y); f : Exchanged; END_VAR "
    "TYPE Big : STRUCT m : ARRAY [1..N] OF LREAL; s : STRING(999); END_STRUCT Both : UNION w : WORD; END_UNION "
    "Exchanged : ARRAY [5..1] OF INT; END_TYPE"
)


def test_of_global_variables_nobody_knows_whether_they_are_sent(tmp_path: Path) -> None:
    """Of one that has an identifier, all is told; and a note says how to tell one."""
    text = GLOBALS.format(constants="VAR_GLOBAL CONSTANT N : INT := 99; END_VAR ")
    alone = {each.rule.id for each in mistakes(tmp_path, [text])}
    assert alone == {"identifier-missing", "contradiction"}
    body = GLOBALS.format(constants="").removeprefix("VAR_GLOBAL ").partition(" END_VAR ")
    sent = {each.rule.id for each in mistakes(tmp_path, [gvl(body[0]), f"{body[2]} {CONSTANT.replace('n :', 'N :')}"])}
    assert sent >= {"unknown-size", "size-by-name", "union", "contradiction"}
    assert "identifier-missing" not in sent
    nameless = [each.rule.id for each in mistakes(tmp_path, [gvl("a : FB_Unknown;", ListIdentifier=None)])]
    assert nameless == ["identifier-missing", "unknown-size"]


def test_a_type_that_no_sent_list_reaches_has_sizes_that_matter_to_nobody(tmp_path: Path) -> None:
    types = "TYPE T : STRUCT m : STRING(n); END_STRUCT Other : ARRAY [0..n] OF INT; END_TYPE"
    (found,) = mistakes(tmp_path, [gvl("x : ARRAY [0..1] OF T;"), types, CONSTANT])
    assert found.place.message == "the length of T.m is n"


def told(found: Sequence[Mistake]) -> list[str]:
    return [
        f"{Path(each.place.position.file).name}:{each.place.position.line}:{each.place.position.column} "
        f"{each.rule.id}: {each.place.message}"
        for each in found
    ]


CONSTANT = "VAR_GLOBAL CONSTANT n : INT := 3; END_VAR"
LONG = "aPos : ARRAY [0..9] OF REAL; aLog : ARRAY [1..100] OF DINT;"

ENUMERATION = (
    "<?xml version='1.0'?><project><types><dataTypes><dataType name='E'><baseType><enum><values><value name='off'/>"
    "</values>{}</enum></baseType></dataType></dataTypes></types></project>"
)

SAMPLES: list[tuple[str, list[str], str, list[str]]] = [
    (
        "unreadable",
        [gvl("a : INT;"), "TYPE T : STRUCT m : ; END_STRUCT END_TYPE"],
        "b.st:1:21 found ';', expected a type",
        [gvl("a : INT;"), "TYPE T : STRUCT m : INT; END_STRUCT END_TYPE"],
    ),
    (
        "unreadable",
        [gvl("a : INT;"), "TYPE INT : STRUCT m : INT; END_STRUCT END_TYPE"],
        "b.st:1:6 INT is an elementary type and cannot be declared",
        [gvl("a : INT;"), "TYPE INTS : STRUCT m : INT; END_STRUCT END_TYPE"],
    ),
    (
        "assumed-base",
        [gvl("a : E;"), ENUMERATION.format("")],
        "b.xml:1:78 the base type of E is not in this export, INT is assumed",
        [gvl("a : E;"), ENUMERATION.format("<baseType><USINT/></baseType>")],
    ),
    (
        "contradiction",
        [gvl("a : SINT(0..128);")],
        "a.gvl:4:13 128 does not fit into SINT",
        [gvl("a : SINT(0..127);")],
    ),
    (
        # What no list needs is nobody's contradiction.
        "contradiction",
        [gvl("a : T;"), "TYPE T : INT(5..3); END_TYPE"],
        "b.st:1:14 the upper bound 3 is below the lower bound 5",
        [gvl("a : INT;"), "TYPE T : INT(5..3); END_TYPE"],
    ),
    (
        "duplicate-identifier",
        [gvl(), gvl("nCount : DINT;")],
        "b.gvl:3:1 b has the identifier 7 on port 1202, which a has too (",
        [gvl(), gvl("nCount : DINT;", ListIdentifier="8")],
    ),
    (
        "unknown-size",
        [gvl("a : INT;\np : POINTER TO INT;")],
        "a.gvl:5:1 nobody knows how many bytes p : POINTER has",
        [gvl("a : INT;")],
    ),
    ("unknown-size", [gvl("t : TON;")], "a.gvl:4:1 nobody knows how many bytes t : TON has", [gvl("t : TIME;")]),
    (
        "union",
        [gvl("u : U;"), "TYPE U : UNION a : INT; b : DINT; END_UNION END_TYPE"],
        "a.gvl:4:1 u : U is a UNION",
        [gvl("u : U;"), "TYPE U : STRUCT a : INT; b : DINT; END_STRUCT END_TYPE"],
    ),
    ("empty-list", [gvl("")], "a.gvl:3:1 a has no variables", [gvl()]),
    ("identifier-missing", [gvl(ListIdentifier=None)], "a.gvl:3:1 a has no list identifier", [gvl()]),
    (
        "identifier-over-255",
        [gvl(ListIdentifier="256")],
        "a.gvl:3:1 the identifier 256 of a needs more than 8 bits",
        [gvl(ListIdentifier="255"), can(ListIdentifier="800")],
    ),
    (
        "never-sent",
        [gvl(CyclicTransmission="False")],
        "a.gvl:3:1 a is sent neither cyclically, nor on change, nor on an event",
        [gvl(CyclicTransmission="False", TransmissionOnEvent="True")],
    ),
    (
        "interval-zero",
        [gvl(Interval="T#0ms")],
        "a.gvl:3:1 a is cyclic with an interval of 0",
        [gvl(Interval="T#0ms", CyclicTransmission="False", TransmissionOnChange="True")],
    ),
    (
        "interval-below-gap",
        [gvl(Interval="T#10ms")],
        "a.gvl:3:1 the interval of a, 10.0 ms, is shorter than its minimum gap of 20.0 ms",
        [gvl(Interval="T#20ms")],
    ),
    (
        "cut-variable",
        [gvl(LONG)],
        "a.gvl:4:30 aLog is cut between aLog[54] (SubIndex 0) and aLog[55] (SubIndex 1)",
        [
            gvl("aPos : ARRAY [0..63] OF REAL; aLog : ARRAY [0..63] OF REAL; stAxis : A;"),
            "TYPE A : STRUCT a : REAL; b : INT; END_STRUCT END_TYPE",
        ],
    ),
    (
        "cut-variable",
        [gvl("a : ARRAY [1..513] OF BYTE;")],
        "a.gvl:4:1 a is cut between a[256] (SubIndex 0) and a[257] (SubIndex 1), and at 1 more place",
        [gvl("a : ARRAY [1..256] OF BYTE;")],
    ),
    (
        "cut-variable",
        [gvl("a : ARRAY [1..3] OF INT; b : ARRAY [1..3] OF INT;", Pack="False")],
        "a.gvl:4:1 a and 1 more variable of a go in a telegram for each element: it is not packed",
        [gvl("a, b : INT;", Pack="False")],
    ),
    (
        "long-string",
        [gvl("s : STRING(256);")],
        "a.gvl:4:1 s : STRING(256) has 257 bytes, more than the 256 of a telegram",
        [gvl("s : STRING(255);")],
    ),
    (
        "long-string",
        [gvl("s : WSTRING(128);")],
        "a.gvl:4:1 s : WSTRING(128) has 258 bytes, more than the 256 of a telegram",
        [gvl("s : WSTRING(127);")],
    ),
    (
        "many-telegrams",
        [gvl("a : ARRAY [1..5121] OF BYTE;")],
        "a.gvl:3:1 a takes 21 telegrams",
        [gvl("a : ARRAY [1..5120] OF BYTE;")],
    ),
    (
        "size-by-name",
        [gvl("a : ARRAY [0..n] OF INT;"), CONSTANT],
        "a.gvl:4:15 the upper bound of a is n",
        [gvl("a : ARRAY [0..2 + 1] OF INT;"), CONSTANT],
    ),
    (
        "size-by-name",
        [gvl("s, t : STRING((n + 1) * 2);"), CONSTANT],
        "a.gvl:4:16 the length of s, t is (n + 1) * 2",
        [gvl("s : STRING(8);"), CONSTANT],
    ),
    (
        "size-by-name",
        [gvl("x : T;"), "TYPE T : STRUCT m : STRING(n); END_STRUCT END_TYPE", CONSTANT],
        "b.st:1:28 the length of T.m is n",
        [gvl("x : INT := n;"), CONSTANT],
    ),
    (
        "initial-value",
        [gvl("a : INT := 5; b, c : BYTE := 300;")],
        "a.gvl:4:30 the initial value 300 of b does not fit into BYTE",
        # The bits of a type may be meant.
        [gvl("a : INT := 16#FFFF; b : SINT := -128; c : REAL := 300; d : USINT(0..n) := 9; e : T := 300;"), CONSTANT],
    ),
    (
        "initial-value",
        [gvl("a : INT(0..3) := 9;")],
        "a.gvl:4:18 the initial value 9 of a does not fit into INT (0..3)",
        [gvl("a : INT(0..9) := 9;")],
    ),
    (
        "initial-value",
        [gvl("a : WORD := USINT#-1;")],
        "a.gvl:4:13 the initial value -1 of a does not fit into USINT",
        [gvl("a : WORD := USINT#255;")],
    ),
    (
        "initial-value",
        [gvl("a : INT;"), "VAR_GLOBAL CONSTANT many : BYTE := 300; END_VAR"],
        "b.st:1:36 the initial value 300 of many does not fit into BYTE",
        # A bound that needs it cannot be.
        [gvl("a : ARRAY [0..many] OF INT;"), "VAR_GLOBAL CONSTANT many : BYTE := 300; END_VAR"],
    ),
    (
        "contradiction",
        [gvl("a : ARRAY [0..many] OF INT;"), "VAR_GLOBAL CONSTANT many : BYTE := 300; END_VAR"],
        "b.st:1:36 300 does not fit into BYTE",
        [gvl("a : INT;"), "VAR_GLOBAL CONSTANT many : BYTE := 300; END_VAR"],
    ),
    (
        "acknowledge-broadcast",
        [gvl(Acknowledge="True")],
        "a.gvl:3:1 a wants acknowledgements, and is sent to 255.255.255.255",
        [gvl(Acknowledge="True", address="10.0.0.7")],
    ),
    (
        "checksum-broadcast",
        [gvl(Checksum="True", address="225.10.10.11")],
        "a.gvl:3:1 a carries a checksum, and is sent to 225.10.10.11",
        [gvl(Checksum="True", address="10.0.0.7"), can(Checksum="True", ListIdentifier="1")],
    ),
    (
        "NV601",
        [can("a : ARRAY [0..3] OF LREAL;", ListIdentifier="1792"), can(ListIdentifier="1795")],
        "b.gvl:3:1 b takes 0x703, a 0x700 to 0x703 (",
        [can("a : ARRAY [0..3] OF LREAL;", ListIdentifier="1792"), can(ListIdentifier="1796")],
    ),
    (
        "NV602",
        [can("a : ARRAY [0..1] OF LREAL;", ListIdentifier="384")],
        "a.gvl:3:1 a takes 0x180 to 0x181, which CANopen uses for TPDO1 of node 1",
        [can(ListIdentifier="384")],
    ),
    (
        "can-identifier",
        [can("a, b : LREAL;", ListIdentifier="2047")],
        "a.gvl:3:1 a takes 0x7FF to 0x800, beyond 0x7FF",
        [can(ListIdentifier="2047")],
    ),
    (
        "can-long-element",
        [can("s : STRING(8);", ListIdentifier="384")],
        "a.gvl:4:1 s : STRING(8) has 9 bytes, more than a CAN frame",
        [can("s : STRING(7);")],
    ),
    (
        "can-unsupported",
        [can(Checksum="True", TransmissionOnEvent="True")],
        "a.gvl:3:1 a is sent over CAN with a checksum and an event",
        [can(), gvl(Checksum="True")],
    ),
]


@pytest.mark.parametrize(("rule", "hit", "message", "miss"), SAMPLES)
def test_each_rule(rule: str, hit: list[str], message: str, miss: list[str], tmp_path: Path) -> None:
    found = [each for each in mistakes(tmp_path, hit) if each.rule.id == rule]
    assert len(found) == 1, told(mistakes(tmp_path, hit))
    place, _, said = message.partition(" ")
    assert told(found)[0].startswith(f"{place} {rule}: {said}")
    assert rule not in {each.rule.id for each in mistakes(tmp_path, miss)}


def test_every_rule_has_a_sample_and_says_what_to_do() -> None:
    assert {rule.id for rule in RULES} == {sample[0] for sample in SAMPLES}
    assert len({rule.id for rule in RULES}) == len(RULES)
    for rule in RULES:
        assert rule.summary
        assert rule.why.endswith(".")
        assert rule.next_step.endswith(".")


def test_a_plain_list_is_fine(tmp_path: Path) -> None:
    assert mistakes(tmp_path, [gvl("bRun : BOOL; nCount : UDINT; aPos : ARRAY [0..9] OF REAL;")]) == []


def test_the_same_file_given_twice_is_no_duplicate(tmp_path: Path) -> None:
    file = tmp_path / "a.gvl"
    file.write_text(gvl(), encoding="utf-8")
    (tmp_path / "link.gvl").symlink_to(file)
    paths = [str(file), f"{tmp_path}/./a.gvl", str(tmp_path / "link.gvl")]
    assert len(read_definitions(wanted_files(paths)).files) == 1
    assert linted(*paths) == []


def test_the_files_of_both_sides_are_no_duplicate_as_long_as_they_say_the_same(tmp_path: Path) -> None:
    for side, text in (("sender", "a : INT;"), ("reader", "a : INT; // shown"), ("other", "a : DINT;")):
        (tmp_path / side).mkdir()
        (tmp_path / side / "press.gvl").write_text(gvl(text), encoding="utf-8")
    sides = [str(tmp_path / side / "press.gvl") for side in ("sender", "reader")]
    assert linted(*sides) == []
    for files in permutations([*sides, str(tmp_path / "other" / "press.gvl")]):
        assert [each.rule.id for each in linted(*files)] == ["duplicate-identifier"]


def test_mistakes_are_in_the_order_of_the_files_and_lines(tmp_path: Path) -> None:
    second = gvl("s : STRING(300);\np : POINTER TO INT;", ListIdentifier="300")
    found = mistakes(tmp_path, [gvl(Interval="T#0ms"), second])
    assert [text.split(" ")[0] for text in told(found)] == ["a.gvl:3:1", "b.gvl:3:1", "b.gvl:4:1", "b.gvl:5:1"]


def test_a_list_over_several_connections_is_told_once(tmp_path: Path) -> None:
    export = (
        "(* @GLOBAL_VARIABLE_LIST := 'L' *)\nVAR_GLOBAL\np : POINTER TO INT;\nEND_VAR\n(* @OBJECT_END := 'L' *)\n"
        "(* @CONNECTIONS := L\nNUMOFCONNECTIONS : 2\nCOBID : 1\nPORT : 1202\nCOBID : 2\nPORT : 1202\n*)\n"
    )
    file = tmp_path / "a.exp"
    file.write_text(export, encoding="utf-8")
    assert [entry.list_id for entry in load_definitions([str(file)]).lists] == [1, 2]
    assert [each.rule.id for each in linted(str(file))] == ["unknown-size"]


def test_the_predefined_connection_set_is_in_order_and_without_overlap() -> None:
    numbers = [number for service in PREDEFINED for number in (service.first, service.last)]
    assert numbers == sorted(numbers)
    for service in PREDEFINED:
        assert services_within(service.first, service.last) == (service,)
    assert services_within(0x680, 0x6FF) == ()
    assert [service.name for service in services_within(0x07F, 0x101)] == ["SYNC", "EMCY", "TIME"]
