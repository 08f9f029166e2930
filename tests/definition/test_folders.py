"""Whole folders of projects: what is no definition, what cannot be read, and what that does to the rest."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from nvscope.definition.load import load_definitions
from nvscope.definition.model import Definition
from nvscope.definition.variables import size_bytes_of
from nvscope.errors import ConfigurationError
from nvscope.view.lines.definition_flaws import definition_flaws

LIST = "VAR_GLOBAL nSpeed : INT; nLimit : Limit; END_VAR"
TYPE = "TYPE Limit : DINT(0..99); END_TYPE"


def folder(path: Path, files: Mapping[str, str | bytes]) -> Path:
    for name, content in files.items():
        file = path / "plc" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path / "plc"


def told(definition: Definition, path: Path) -> list[str]:
    return [sentence.replace(f"{path}/", "") for sentence in definition_flaws(definition)]


def sizes(definition: Definition) -> list[dict[str, int]]:
    return [{each.name: size_bytes_of(each.type) for each in entry.variables} for entry in definition.lists]


# As CoDeSys V2.3 writes them with "one file for each object"; the names are those of the objects.
OBJECTS = {
    "STANDARD.LIB 4.10.05 11_14_46.EXP": (
        "LIBRARY\r\nSTANDARD.LIB 4.10.05 11:14:46\r\n(* @LIBRARYSYMFILEINFO := '0' *)\r\nNumOfPOUs: 1\r\nTON: 0\r\n"
        "NumOfGVLs: 0\r\nEND_LIBRARY\r\n"
    ),
    "PLC Configuration.EXP": "\r\nPLC_CONFIGURATION\r\n_GLOBAL\r\n_VERSION: 3\r\n_END_GLOBAL\r\nPLC_END\r\n",
    "Alarm configuration.EXP": "\n_ALARMCONFIG\n_ALARMCONFIGNEXTTEXTID : 10002\n_ALARMCONFIGFORMATS : 'hh$':'mm'\n",
    "Task configuration.EXP": "\nRESOURCE\n{event_task : 'start','it's called','','FUNCTION f: DWORD'}\nEND_RESOURCE\n",
    "Tasks.EXP": "\r\nRESOURCE\r\n\r\nTASK main (PRIORITY := 1);\r\nPLC_PRG();\r\nEND_TASK\r\nEND_RESOURCE\r\n",
    "Workspace.EXP": "\n_WORKSPACE\n_GLOBALVISUALSETTINGS\n_VISUALSETTINGSFLAGS : 0,0,0,0\n_END_WORKSPACE\n",
    "Parameter Manager.EXP": "\r\n",
    "Panel.EXP": "(* @PATH := '' *)\r\n\r\nVISUALISATION Panel\r\n_VISU_TYPES : 1,1\r\n_BG_BMP : ''\r\n",
    "LIMIT.EXP": "(* @NESTEDCOMMENTS := 'Yes' *)\r\n(* @PATH := '' *)\r\nTYPE Limit : DINT (0..99); END_TYPE\r\n",
    "DRIVE.EXP": f"(* @NESTEDCOMMENTS := 'Yes' *)\r\n(* @GLOBAL_VARIABLE_LIST := 'Drive' *)\r\n{LIST}\r\n",
}


@pytest.mark.parametrize("one_by_one", [False, True])
def test_an_export_of_v2_3_with_a_file_for_each_object(one_by_one: bool, tmp_path: Path) -> None:
    path = folder(tmp_path, OBJECTS)
    definition = load_definitions(sorted(map(str, path.iterdir())) if one_by_one else [str(path)])
    assert told(definition, path) == []
    assert [entry.name for entry in definition.lists] == ["Drive"]
    assert sizes(definition) == [{"nSpeed": 2, "nLimit": 4}]


def test_what_is_no_definition_is_passed_over_in_a_folder(tmp_path: Path) -> None:
    path = folder(
        tmp_path,
        {
            "list.st": LIST, "types/limit.st": TYPE, "readme.md": "# Press\n", "plant.project": b"\0\1\2\3",
            "notes.st": "see the wiki", "icon.svg": "<svg><a></svg>", "config.xml": "<settings/>", "empty.st": "",
            "broken.xml": "<settings>", "photo.jpg": b"\xff\xd8\xff\xe0\0", ".git/x.st": "TYPE Limit : INT; END_TYPE",
            "page.xml": "<!DOCTYPE html><html></html>",
        },
    )  # fmt: skip
    definition = load_definitions([str(path)])
    assert told(definition, path) == []
    assert sizes(definition) == [{"nSpeed": 2, "nLimit": 4}]


def test_what_cannot_be_read_is_told_and_the_rest_is_read(tmp_path: Path) -> None:
    path = folder(
        tmp_path,
        {
            "list.st": LIST, "limit.st": TYPE, "a.gvl": "<GVL><Declarations></GVL>", "b.TcDUT": "version https://git-lfs",
            "c.st": f"{LIST}\nTYPE Cut : STRUCT a : INT;",
        },
    )  # fmt: skip
    definition = load_definitions([str(path)])
    assert told(definition, path) == [
        "left out: a.gvl, line 1, column 22: this is no well-formed XML: mismatched tag. Export the file again.",
        "left out: b.TcDUT: a Git LFS pointer, not the file itself. Fetch the file: git lfs pull.",
        "left out: c.st, line 2, column 27: found the end of the text, expected a name or END_STRUCT. "
        "Perhaps the text was cut off: export the file again.",
    ]
    assert sizes(definition) == [{"nSpeed": 2, "nLimit": 4}] * 2
    with pytest.raises(ConfigurationError, match="no well-formed XML"):
        load_definitions([str(path / "a.gvl")])
    alone = load_definitions([str(path / "a.gvl"), str(path / "limit.st"), str(path / "b.TcDUT")])
    assert [problem.what for problem in alone.left_out] == [
        "this is no well-formed XML: mismatched tag", "a Git LFS pointer, not the file itself",
    ]  # fmt: skip


def test_a_list_of_which_not_all_can_be_read_has_an_unknown_element_there(tmp_path: Path) -> None:
    path = folder(
        tmp_path,
        {
            "a.st": "VAR_GLOBAL a : INT; END_VAR\nVAR_GLOBAL b ; END_VAR\nVAR_GLOBAL c : INT; END_VAR",
            "b.st": "VAR_GLOBAL CONSTANT n : ; END_VAR\nVAR_GLOBAL a : STRING(n); b : INT; END_VAR",
        },
    )
    definition = load_definitions([str(path)])
    assert sizes(definition) == [{"a": 2, "?": 0, "c": 2}, {"a": 0, "b": 2}]
    assert told(definition, path) == [
        "left out: b.st, line 1, column 25: found ';', expected a type. "
        "Correct the declaration, or export the file again.",
        "of unknown size or values: a.st, line 2, column 14: found ';', expected ',', ':' or AT. "
        "Correct the declaration, or export the file again.",
        "constants that no file declares: n (b.st, line 2, column 23). Name the files that do, too: a .TcDUT, "
        "a PLCopen XML export, ST text, or a list of constants.",
    ]


def test_all_that_is_wrong_is_told_once_and_of_much_the_first(tmp_path: Path) -> None:
    types = {f"t{number:02}.st": f"TYPE T{number} : INT(5..3); END_TYPE" for number in range(30)}
    broken = {f"x{number:02}.st": "TYPE T : ; END_TYPE" for number in range(30)}
    uses = f"VAR_GLOBAL {' '.join(f'a{number} : T{number}; b{number} : T{number};' for number in range(30))} END_VAR"
    path = folder(tmp_path, types | broken | {"a.st": uses, "b.st": uses})
    found = told(load_definitions([str(path)]), path)
    assert len(found) == 22
    assert found[10] == "left out: 20 more"
    assert found[-1] == "of unknown size or values: 20 more"


FOREIGN = {
    "plant.export": (
        b'<?xml version="1.0" encoding="utf-8"?>\n<ExportFile>\n</ExportFile>',
        "an export of CODESYS objects (.export)",
        "Export PLCopenXML",
    ),
    "plant.project": (b"PK\3\4\0\0", "a project of CODESYS", "Link to file"),
    "old.pro": (b"CoDeSys+\0\1\2", "a project of CODESYS", "Export (.exp)"),
    "archive.zip": (b"PK\3\4\0\0", "a packed archive", "Unpack"),
    "axis.gvl": (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 900\n", "a Git LFS", "git lfs pull"),
    "page.st": (b"\n<!DOCTYPE html>\n<html lang='en'>", "an HTML page", "Raw"),
    "page.xml": (b"<?xml version='1.0'?>\n<!-- saved -->\n<html/>", "an HTML page", "Raw"),
    "data.st": (b'{"a": 1}', "JSON", "TYPE or VAR_GLOBAL"),
    "list.json": (b'[\n {"a": 1}]', "JSON", "TYPE or VAR_GLOBAL"),
    "manual.exp": (b"%PDF-1.7\n1 0 obj", "a PDF", "Export (.exp)"),
    "plc.tsproj": (b'<?xml version="1.0"?>\n<TcSmProject>', "a project of TwinCAT", "directory"),
    "plc.plcproj": (
        b'<Project DefaultTargets="Build" xmlns="http://schemas.microsoft.com/developer/msbuild/2003">',
        "a project of TwinCAT", "directory",
    ),
    "utf16.st": ("VAR_GLOBAL a : INT; END_VAR".encode("utf-16-le"), "the file looks like UTF-16", "Save it as UTF-8"),
}  # fmt: skip


@pytest.mark.parametrize("name", FOREIGN)
def test_a_file_of_another_kind_is_told_for_what_it_is(name: str, tmp_path: Path) -> None:
    content, what, next_step = FOREIGN[name]
    path = folder(tmp_path, {name: content})
    with pytest.raises(ConfigurationError) as caught:
        load_definitions([str(path / name)])
    assert caught.value.what.startswith(what)
    assert next_step in caught.value.next_step
    assert caught.value.where.startswith(str(path / name))


def test_a_pragma_in_front_is_no_json(tmp_path: Path) -> None:
    path = folder(tmp_path, {"a.st": "{attribute 'qualified_only'}\nVAR_GLOBAL a : INT; END_VAR"})
    assert sizes(load_definitions([str(path)])) == [{"a": 2}]


def test_a_folder_with_nothing_but_a_project_says_what_to_do(tmp_path: Path) -> None:
    path = folder(tmp_path, {"plant.project": b"PK\3\4\0\0", "readme.md": "# Press"})
    with pytest.raises(ConfigurationError) as caught:
        load_definitions([str(path)])
    assert caught.value.what == (
        f"no definition file is there; {path / 'plant.project'}: a project of CODESYS, which only CODESYS reads"
    )
    assert "Export PLCopenXML" in caught.value.next_step


def test_a_prolog_that_says_utf_16_in_bytes_of_utf_8_is_passed_over(tmp_path: Path) -> None:
    text = (
        '<?xml version="1.0" encoding="utf-16"?>\n<GVL><Declarations>VAR_GLOBAL ä : INT; END_VAR</Declarations></GVL>'
    )
    path = folder(tmp_path, {"a.gvl": text, "b.gvl": b"\xff\xfe" + text.encode("utf-16-le")})
    assert sizes(load_definitions([str(path)])) == [{"ä": 2}] * 2


@pytest.mark.parametrize("word", ["CONFIGURATION Plant\n", ""])
def test_text_with_configurations_has_the_global_variables_in_it(word: str, tmp_path: Path) -> None:
    text = f"""{TYPE}
{word}VAR_CONFIG
  PLC_PRG.bIn AT %IX0.0 : BOOL;
END_VAR
RESOURCE Main ON PLC
  {LIST}
  TASK Fast (INTERVAL := T#10ms, PRIORITY := 1);
  PROGRAM Run WITH Fast : PLC_PRG;
END_RESOURCE
VAR_ACCESS a : PLC_PRG.b : INT READ_ONLY; END_VAR
{"END_CONFIGURATION" if word else ""}
"""
    path = folder(tmp_path, {"a.st": text})
    assert sizes(load_definitions([str(path)])) == [{"nSpeed": 2, "nLimit": 4}]


def test_enumerations_of_plcopen_without_a_base_type_are_taken_for_int_and_told(tmp_path: Path) -> None:
    values = "<enum><values><value name='off'/></values>{}</enum>"
    declaration = "<xhtml>TYPE {} : (off){}; END_TYPE</xhtml>"
    plain = f"<addData><data><InterfaceAsPlainText>{declaration}</InterfaceAsPlainText></data></addData>"
    types = [
        ("Bare", values.format(""), ""),
        ("Told", values.format("<baseType><USINT/></baseType>"), ""),
        ("Written", values.format(""), plain.format("Written", " USINT")),
        ("Plain", values.format(""), plain.format("Plain", "")),
    ]
    declared = "".join(
        f"<dataType name='{name}'><baseType>{kind}</baseType>{more}</dataType>" for name, kind, more in types
    )
    used = "".join(f"<variable name='{name}'><type><derived name='{name}'/></type></variable>" for name, _, _ in types)
    lists = f"<instances><globalVars name='G'>{used}</globalVars></instances>"
    path = folder(tmp_path, {"a.xml": f"<project><types>{declared}</types>{lists}</project>"})
    definition = load_definitions([str(path)])
    assert sizes(definition) == [{"Bare": 2, "Told": 1, "Written": 1, "Plain": 2}]
    assert told(definition, path) == ["base type not in this export, INT assumed: Bare."]
