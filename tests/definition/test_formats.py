"""The file formats: what each of them tells about lists, variables and types."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nvscope.definition.load import load_definitions
from nvscope.definition.model import ListDefinition, Problem, UnknownName
from nvscope.definition.position import Position
from nvscope.definition.source import MAX_FILE_BYTES, decode
from nvscope.definition.variables import elements, size_bytes_of
from nvscope.errors import ConfigurationError
from tests.definition.declared import SAMPLES, shown

PEERS = Path(__file__).parent.parent.parent / "captures" / "peers"
MINIMAL_GVL = "<GVL><Declarations>VAR_GLOBAL a : INT; END_VAR</Declarations>{}</GVL>"


def sample(*names: str) -> list[str]:
    return [str(SAMPLES / name) for name in names]


def variables(definition: ListDefinition) -> dict[str, str]:
    return {variable.name: shown(variable.type) for variable in definition.variables}


def failure(path: Path, data: bytes) -> ConfigurationError:
    path.write_bytes(data)
    with pytest.raises(ConfigurationError) as caught:
        load_definitions([str(path)])
    assert caught.value.next_step
    return caught.value


def test_gvl() -> None:
    axis, types = sample("axis.gvl", "axis_types.st")
    (found,) = load_definitions([axis, types]).lists
    assert variables(found) == {
        "bStart": "BOOL",
        "nSpeed": "INT",
        "stAxis": "STRUCTURE pos: LREAL; vel: REAL;",
        "aLimits": "ARRAY[0..3] OF DINT",
        "sText": "STRING(30)",
    }
    assert found == ListDefinition(
        "axis", Position(axis, 3, 1), found.variables, list_id=42, port=1300, address="225.10.10.11", acknowledge=True,
        interval_ns=50_000_000, min_gap_ns=20_000_000,
    )  # fmt: skip
    assert found.variables[2].position == Position(axis, 6, 2)
    assert load_definitions([types, axis]) == load_definitions([axis, types])


def test_lists_of_the_captures() -> None:
    paths = [str(path) for path in sorted(PEERS.iterdir()) if path.suffix in {".gvl", ".st"}]
    lists = {found.list_id: found for found in load_definitions(paths).lists}
    counts = {list_id: sum(1 for each in found.variables for _ in elements(each)) for list_id, found in lists.items()}
    assert counts == {42: 11, 1: 6, 3: 4, 7: 129}
    sizes = {list_id: sum(size_bytes_of(each.type) for each in found.variables) for list_id, found in lists.items()}
    assert sizes == {42: 68, 1: 36, 3: 11, 7: 546}


def test_gvl_without_its_types_says_what_is_missing() -> None:
    definition = load_definitions(sample("axis.gvl"))
    (unknown,) = definition.flaws_of(definition.lists)
    assert isinstance(unknown, UnknownName)
    assert (unknown.name, unknown.constant) == ("Axis", False)
    assert str(unknown.position) == f"{SAMPLES / 'axis.gvl'}, line 6, column 11"


def test_gvl_that_says_little(tmp_path: Path) -> None:
    file = tmp_path / "GVL_Line 1.gvl"
    file.write_text(MINIMAL_GVL.format("<NetvarSettings><ListIdentifier> 9 </ListIdentifier></NetvarSettings>"))
    (found,) = load_definitions([str(file)]).lists
    assert (found.name, found.list_id, found.port, found.address, found.interval_ns) == (
        "GVL_Line 1", 9, 1202, "255.255.255.255", None,
    )  # fmt: skip


def test_gvl_with_escaped_declarations(tmp_path: Path) -> None:
    file = tmp_path / "a.gvl"
    file.write_text(
        "<GVL><!-- ä -->\n<Declarations>VAR_GLOBAL a : STRING := &apos;ü&lt;&#x41;&apos;;<!-- ; -->\n b : XINT;"
        " END_VAR</Declarations><NetvarSettings/></GVL>",
        encoding="utf-8",
    )
    definition = load_definitions([str(file)])
    (unknown,) = definition.flaws_of(definition.lists)
    assert str(unknown.position) == f"{file}, line 3, column 6"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("<Pack>maybe</Pack>", "Pack: 'maybe' is neither True nor False"),
        ("<ListIdentifier>70000</ListIdentifier>", "ListIdentifier: '70000' is no number from 0 to 65535"),
        ("<ListIdentifier/>", "ListIdentifier: '' is no number from 0 to 65535"),
        ("<Interval>soon</Interval>", "Interval: 'soon' is no duration such as 50ms, 2.5s or T#1m30s"),
        ("<MinGap>T#-5ms</MinGap>", "MinGap: a time cannot be negative here"),
        (
            '<ProtocolSettings><ProtocolSetting Name="Port" Value="x"/></ProtocolSettings>',
            "Port: 'x' is no number from 0 to 65535",
        ),
        (
            '<ProtocolSettings><ProtocolSetting Name="Broadcast Adr." Value="here"/></ProtocolSettings>',
            "'here' is no IP address",
        ),
    ],
)
def test_settings_that_cannot_be(settings: str, message: str, tmp_path: Path) -> None:
    text = MINIMAL_GVL.format(f"\n<NetvarSettings>{settings}</NetvarSettings>")
    error = failure(tmp_path / "a.gvl", text.encode())
    assert error.what == message
    assert error.where.startswith(f"{tmp_path / 'a.gvl'}, line 2, column ")


def test_export_of_v2_3() -> None:
    (path,) = sample("plant.exp")
    definition = load_definitions([path])
    first, second = definition.lists
    valve = "STRUCTURE open: BOOL; position: INT(0..100);"
    assert variables(first) == {"valve": f"ARRAY[1..3] OF {valve}", "text": "STRING(20)"}
    assert first.variables == second.variables
    assert (first.name, first.list_id, first.port, first.pack, first.interval_ns) == (
        "Valves", 7, 1202, True, 100_000_000,
    )  # fmt: skip
    assert (second.name, second.list_id, second.port, second.interval_ns) == ("Valves", 8, 1203, None)
    assert first.variables[0].position == Position(path, 36, 2)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ("Grüße, 5 °C".encode("cp1252"), "Grüße, 5 °C"),
        ("Скорость насоса".encode("cp1251"), "Скорость насоса"),
        ("Größe, Скорость".encode(), "Größe, Скорость"),
        ("ä".encode("utf-8-sig"), "ä"),
        ("\ufeffä".encode("utf-16-le"), "ä"),
        (b'<?xml version="1.0" encoding="cp1251"?>\xd1', '<?xml version="1.0" encoding="cp1251"?>С'),
    ],
)
def test_encodings_are_recognised(data: bytes, text: str) -> None:
    assert decode(data, "a.exp") == text


def test_the_encoding_that_was_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "a.exp"
    file.write_bytes("VAR_GLOBAL größe : INT; END_VAR".encode("cp850"))
    assert load_definitions([str(file)], encoding="cp850").lists[0].variables[0].name == "größe"
    with pytest.raises(ConfigurationError, match="no utf-8") as caught:
        load_definitions([str(file)], encoding="utf-8")
    assert caught.value.where == f"{file}, line 1, column 14"
    with pytest.raises(ConfigurationError, match="no encoding is called 'klingon'"):
        load_definitions([str(file)], encoding="klingon")


def test_comments_that_do_not_nest(tmp_path: Path) -> None:
    file = tmp_path / "a.exp"
    text = "(* @NESTEDCOMMENTS := '{}' *)\nVAR_GLOBAL (* a (* b *) c : INT; (* *) *) d : INT; END_VAR"
    file.write_text(text.format("No").replace(" *) d", " d"))
    assert list(variables(load_definitions([str(file)]).lists[0])) == ["c", "d"]
    file.write_text(text.format("Yes"))
    assert list(variables(load_definitions([str(file)]).lists[0])) == ["d"]


def test_each_object_says_whether_its_comments_nest(tmp_path: Path) -> None:
    file = tmp_path / "a.exp"
    objects = (("Yes", "(* a (* b *) *)"), ("No", "(* a (* b *)"), ("Ja", "(* (* *) *)"), ("Nein", "(* (* *)"))
    file.write_text(
        "".join(
            f"(* @NESTEDCOMMENTS := '{word}' *)\n(* @GLOBAL_VARIABLE_LIST := 'L{number}' *)\n"
            f"VAR_GLOBAL {comment} v{number} : INT; END_VAR\n(* @OBJECT_END := 'L{number}' *)\n"
            for number, (word, comment) in enumerate(objects)
        )
    )
    found = load_definitions([str(file)]).lists
    assert [(entry.name, list(variables(entry))) for entry in found] == [(f"L{n}", [f"v{n}"]) for n in range(4)]


def test_twincat() -> None:
    paths = sample("Line.TcGVL", "E_State.TcDUT")
    definition = load_definitions(paths)
    (found,) = definition.lists
    assert (found.name, found.list_id) == ("GVL_Line", None)
    assert variables(found) == {
        "eState": "(idle=0, running=1, fault=128) UINT",
        "aStation": "ARRAY[1..2] OF BOOL",
    }
    assert dict(found.variables[0].attributes) == {"TcLinkTo": "TIID^Device"}
    assert found.variables[0].position == Position(paths[0], 10, 2)


def test_plcopen() -> None:
    (path,) = sample("press.xml")
    (found,) = load_definitions([path]).lists
    assert found.name == "Presses"
    assert variables(found) == {
        "press": (
            "STRUCTURE mode: (off=0, manual=5, automatic=6) USINT;"
            " force: ARRAY[0..1] OF ARRAY[1..2] OF REAL; percent: USINT(0..100); note: STRING(12);"
        ),
        "started": "DT",
    }
    assert found.variables[0].position == Position(path, 46, 13)


def test_plcopen_that_says_too_little(tmp_path: Path) -> None:
    globals_of = "<project>\n<globalVars name='G'>{}</globalVars></project>"
    variable = "<variable name='a'><type>{}</type></variable>"
    assert failure(tmp_path / "a.xml", globals_of.format("<variable><type><INT/></type></variable>").encode()).what == (
        "the element variable has no name"
    )
    found = []
    for text in (
        "<variable name='a'/>",
        variable.format(""),
        variable.format("<array><baseType><INT/></baseType></array>"),
        variable.format("<array><dimension lower='0'/><baseType><INT/></baseType></array>"),
        variable.format("<array><dimension lower='0' upper='+'/><baseType><INT/></baseType></array>"),
        variable.format("<enum><values/></enum>"),
    ):
        after = "<variable name='z'><type><INT/></type></variable>"
        (tmp_path / "a.xml").write_bytes(globals_of.format(text + after).encode())
        (entry,) = load_definitions([str(tmp_path / "a.xml")]).lists
        assert list(variables(entry)) == ["a", "z"]
        (problem,) = entry.flaws
        assert isinstance(problem, Problem)
        found.append(f"{problem.what} column {problem.position.column}")
    assert found == [
        "the element variable has no type column 22",
        "the element type holds no type column 41",
        "the array has no dimension column 47",
        "dimension: lower or upper is missing column 54",
        "'+' is no value column 54",
        "the enumeration has no values column 47",
    ]
    told = []
    for text in ("<INTEGER/>", "<derived name='Valve'/>", "<string length='n'/>"):
        (tmp_path / "a.xml").write_bytes(globals_of.format(variable.format(text)).encode())
        definition = load_definitions([str(tmp_path / "a.xml")])
        (unknown,) = definition.flaws_of(definition.lists)
        assert isinstance(unknown, UnknownName)
        told.append((unknown.name, unknown.position.line, unknown.position.column, unknown.constant))
    assert told == [("INTEGER", 2, 47, False), ("Valve", 2, 47, False), ("n", 2, 47, True)]


def test_the_name_of_a_file_does_not_matter(tmp_path: Path) -> None:
    for name in ("axis.gvl", "plant.exp", "Line.TcGVL", "press.xml", "axis_types.st", "E_State.TcDUT"):
        (tmp_path / f"{name}.txt").write_bytes((SAMPLES / name).read_bytes())
    paths = sorted(str(path) for path in tmp_path.iterdir())
    assert len(load_definitions(paths).lists) == 5


def test_a_type_in_two_files(tmp_path: Path) -> None:
    same, other = tmp_path / "same.st", tmp_path / "other.st"
    same.write_text("TYPE AXIS : STRUCT pos : LREAL; (* [mm] *) vel : REAL; END_STRUCT END_TYPE")
    first, user = tmp_path / "first.st", tmp_path / "user.st"
    first.write_text((SAMPLES / "axis_types.st").read_text())
    user.write_text("VAR_GLOBAL a : Axis; b : INT; END_VAR")
    definition = load_definitions(list(map(str, [first, same, user])))
    (problem,) = definition.flaws_of(definition.lists)
    assert isinstance(problem, Problem)
    assert (problem.what, str(problem.position)) == (
        "the type AXIS is declared twice, differently", f"{same}, line 1, column 6",
    )  # fmt: skip
    assert variables(definition.lists[0]) == {"a": "AXIS", "b": "INT"}
    other.write_text(first.read_text().replace("\t", " // a comment\n "))
    definition = load_definitions(list(map(str, [first, other, user])))
    assert definition.flaws_of(definition.lists) == []
    assert variables(definition.lists[0])["a"] == "STRUCTURE pos: LREAL; vel: REAL;"


def test_of_several_projects_in_a_folder_each_has_its_own_types_and_constants(tmp_path: Path) -> None:
    for project, kind, size in (("press", "INT", 3), ("oven", "LREAL", 5)):
        (tmp_path / project / "types").mkdir(parents=True)
        (tmp_path / project / "lists").mkdir()
        (tmp_path / project / "types" / "axis.st").write_text(f"TYPE Axis : STRUCT pos : {kind}; END_STRUCT END_TYPE")
        (tmp_path / project / "types" / "sizes.st").write_text(f"VAR_GLOBAL CONSTANT n : INT := {size}; END_VAR")
        (tmp_path / project / "lists" / "List.st").write_text("VAR_GLOBAL a : Axis; b : STRING(n); END_VAR")
    definition = load_definitions([str(tmp_path)])
    assert definition.flaws_of(definition.lists) == []
    assert [variables(entry) for entry in definition.lists] == [
        {"a": "STRUCTURE pos: LREAL;", "b": "STRING(5)"},
        {"a": "STRUCTURE pos: INT;", "b": "STRING(3)"},
    ]


def test_constants_of_one_name_in_two_lists(tmp_path: Path) -> None:
    for name, value, bound in (("A", 1, "n"), ("B", 2, "n"), ("C", 3, "B.n")):
        text = f"VAR_GLOBAL CONSTANT n : INT := {value}; END_VAR VAR_GLOBAL x : INT(0..{bound}); END_VAR"
        (tmp_path / f"{name}.st").write_text(text)
    paths = [str(tmp_path / f"{name}.st") for name in "ABC"]
    assert [variables(found)["x"] for found in load_definitions(paths).lists] == ["INT(0..1)", "INT(0..2)", "INT(0..2)"]
    (tmp_path / "D.st").write_text("VAR_GLOBAL x : INT(0..n); END_VAR")
    definition = load_definitions([*paths, str(tmp_path / "D.st")])
    (problem,) = definition.flaws_of(definition.lists)
    assert isinstance(problem, Problem)
    assert problem.what == "the constant 'n' has several values"
    assert variables(definition.lists[-1]) == {"x": "INT"}


@pytest.mark.parametrize(
    ("text", "message", "place"),
    [
        ("<GVL>\n <Declarations></GVL>", "this is no well-formed XML: mismatched tag", (2, 18)),
        (
            "<GVL>\n<!------ x -->",
            "this is no well-formed XML: '--' stands within a comment, where XML allows none",
            (2, 5),
        ),
        (
            "<GVL>\n<!-- x ---></GVL>",
            "this is no well-formed XML: '--' stands within a comment, where XML allows none",
            (2, 8),
        ),
        ("<GVL>\n<!-- x --></GVX>", "this is no well-formed XML: mismatched tag", (2, 13)),
        ("\n<page/>", "no format of definitions has the root element 'page'", (2, 1)),
        ("<GVL/>", "the element Declarations is missing", (1, 1)),
        ("<project/>", "the file declares neither types nor variables", (1, 1)),
        ("<TcPlcObject/>", "the file holds no object", (1, 1)),
        ("<project><dataType/></project>", "the file declares neither types nor variables", (1, 1)),
        ("<!DOCTYPE GVL SYSTEM 'x'><GVL/>", "the XML has document type or entities that no definition needs", (1, 25)),
        ("<a>" * 1_000, "elements are nested deeper than 200", (1, 601)),
    ],
)
def test_xml_that_is_no_definition(text: str, message: str, place: tuple[int, int], tmp_path: Path) -> None:
    error = failure(tmp_path / "a.gvl", text.encode())
    assert (error.what, error.where) == (message, str(Position(str(tmp_path / "a.gvl"), *place)))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read") as caught:
        load_definitions([str(tmp_path / "missing.gvl")])
    assert caught.value.where == str(tmp_path / "missing.gvl")
    with pytest.raises(ConfigurationError, match="no definition file is in it"):
        load_definitions([str(tmp_path)])
    assert "larger than 16.0 MB" in failure(tmp_path / "large.st", b" " * (MAX_FILE_BYTES + 1)).what


def test_what_is_no_text_is_not_read_as_one(tmp_path: Path) -> None:
    capture = failure(tmp_path / "a.pcap", (PEERS.parent / "telegrams.pcap").read_bytes())
    assert (capture.what, capture.where) == ("a capture, no definition file", str(tmp_path / "a.pcap"))
    program = failure(tmp_path / "plant.gvl", b"\x7fELF 'not closed\n\0")
    assert (program.what, program.where) == (
        "no definition file: binary data", f"{tmp_path / 'plant.gvl'}, line 1, column 1",
    )  # fmt: skip
    assert "binary data" in failure(tmp_path / "packed", bytes(range(1, 256))).what


def test_a_prolog_that_names_another_encoding_makes_no_binary_file(tmp_path: Path) -> None:
    file = tmp_path / "a.gvl"
    text = f'<?xml version="1.0" encoding="utf-8"?><!-- {"Скорость насоса " * 20}-->{MINIMAL_GVL.format("")}'
    file.write_bytes(text.encode("cp1251"))
    assert list(variables(load_definitions([str(file)]).lists[0])) == ["a"]


def test_a_stray_control_character_makes_no_binary_file(tmp_path: Path) -> None:
    file = tmp_path / "a.exp"
    file.write_bytes(b"VAR_GLOBAL a : INT; (* \x07 a bell, in a comment that is long enough *) END_VAR")
    assert list(variables(load_definitions([str(file)]).lists[0])) == ["a"]


@pytest.mark.parametrize("end", [b"\x1a", b"\r\n\x1a\r\n", b"\x1a\x1a\0\0\0"])
def test_a_ctrl_z_ends_the_text(end: bytes, tmp_path: Path) -> None:
    file = tmp_path / "a.exp"
    file.write_bytes(b"VAR_GLOBAL\r\n a : INT; END_VAR" + end)
    assert list(variables(load_definitions([str(file)]).lists[0])) == ["a"]
    assert "binary data" not in failure(tmp_path / "b.exp", b"VAR_GLOBAL \x1a a : INT; END_VAR").what


@pytest.mark.parametrize(
    ("module", "call", "foreign"),
    [
        ("nvscope.definition.model", "pass", set()),
        ("nvscope.definition.load", f"load_definitions([{str(SAMPLES / 'axis_types.st')!r}])", {"lark"}),
        ("nvscope.definition.load", f"load_definitions([{str(SAMPLES / 'E_State.TcDUT')!r}])", {"lark", "defusedxml"}),
    ],
)
def test_parsers_are_imported_where_they_are_needed(module: str, call: str, foreign: set[str]) -> None:
    code = f"import sys; from {module} import *; {call}; print(*{{'lark', 'defusedxml'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == foreign
