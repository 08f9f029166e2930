"""Files as engineering tools write them, in shapes that no document describes."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.definition.load import load_definitions
from nvscope.definition.model import ListDefinition, Problem
from nvscope.definition.packing import pack
from nvscope.definition.variables import Enumeration, Structure
from nvscope.errors import ConfigurationError

INT = "<type><INT/></type>"
EXTENSION = "http://www.3s-software.com/plcopenxml"


def lists(path: Path, text: str) -> tuple[ListDefinition, ...]:
    path.write_text(text, encoding="utf-8", newline="")
    return load_definitions([str(path)]).lists


def elements(definition: ListDefinition) -> list[str]:
    return [element.name for telegram in pack(definition) for element in telegram.elements]


def plcopen(resources: str, project_data: str = "") -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?><project xmlns="http://www.plcopen.org/xml/tc6_0200">'
        f"<types><dataTypes/><pous/></types><instances><configurations>{resources}</configurations></instances>"
        f"<addData>{project_data}</addData></project>"
    )


def variable(name: str, kind: str = INT, value: str = "") -> str:
    initial = f'<initialValue><simpleValue value="{value}"/></initialValue>' if value else ""
    return f'<variable name="{name}">{kind}{initial}</variable>'


def derived(name: str) -> str:
    return f'<type><derived name="{name}"/></type>'


def data(name: str, content: str) -> str:
    return f'<data name="{EXTENSION}/{name}" handleUnknown="implementation">{content}</data>'


def global_list(content: str, attributes: str = "") -> str:
    return f'<globalVars name="GVL"{attributes}>{content}</globalVars>'


def test_plcopen_tells_a_list_of_several_blocks_twice(tmp_path: Path) -> None:
    array = '<type><array><dimension lower="1" upper="N"/><baseType><BYTE/></baseType></array></type>'
    parts = global_list(variable("first") + variable("last", array)) + global_list(
        variable("N", value="2"), ' constant="true"'
    )
    mixed = data("mixedattrsvarlist", f"<MixedAttrsVarList>{parts}</MixedAttrsVarList>")
    whole = variable("first") + variable("N", value="2") + variable("last", array)
    (found,) = lists(
        tmp_path / "a.xml", plcopen("", data("globalvars", global_list(f"{whole}<addData>{mixed}</addData>")))
    )
    assert elements(found) == ["first", "last[1]", "last[2]"]


def test_plcopen_lists_of_one_name_in_two_controllers_are_two(tmp_path: Path) -> None:
    resources = "".join(
        f'<configuration name="{device}"><resource name="R">{global_list(variable(device))}</resource></configuration>'
        for device in ("press", "robot")
    )
    found = lists(tmp_path / "a.xml", plcopen(resources))
    assert [(entry.name, elements(entry)) for entry in found] == [("GVL", ["press"]), ("GVL", ["robot"])]


def test_plcopen_structure_inherits(tmp_path: Path) -> None:
    inheritance = data("datatypeinheritance", "<Inheritance><Extends>Base</Extends></Inheritance>")
    types = (
        f'<dataType name="Axis"><baseType><struct>{variable("own")}</struct></baseType>'
        f"<addData>{inheritance}</addData></dataType>"
        f'<dataType name="Base"><baseType><struct>{variable("inherited")}</struct></baseType></dataType>'
    )
    (found,) = lists(
        tmp_path / "a.xml", plcopen("", data("datatype", types) + global_list(variable("axis", derived("Axis"))))
    )
    assert isinstance(found.variables[0].type, Structure)
    assert elements(found) == ["axis.inherited", "axis.own"]


def test_plcopen_base_of_an_enumeration_stands_in_its_plain_text_only(tmp_path: Path) -> None:
    text = "TYPE Mode :\n(\n off := 0, // (not) INT;\n on\n) USINT := on;\nEND_TYPE"
    plain = data(
        "interfaceasplaintext",
        f'<InterfaceAsPlainText><xhtml xmlns="http://www.w3.org/1999/xhtml">{text}</xhtml></InterfaceAsPlainText>',
    )
    values = '<values><value name="off" value="0"/><value name="on" value="1"/></values>'
    mode = f'<dataType name="Mode"><baseType><enum>{values}</enum></baseType><addData>{plain}</addData></dataType>'
    (found,) = lists(tmp_path / "a.xml", plcopen("", mode + global_list(variable("mode", derived("Mode")))))
    kind = found.variables[0].type
    assert isinstance(kind, Enumeration)
    assert kind.base.name == "USINT"


@pytest.mark.parametrize(
    "body",
    [
        "_FBD_BODY\n_COMMENT\n'don't stop here'\n_END_COMMENT\n",
        "_TEXT 'open (* bracket'\n",
        "{ open\n",
        'LD "inch\n',
    ],
)
def test_exp_bodies_follow_rules_of_their_own(tmp_path: Path, body: str) -> None:
    text = (
        "(* @NESTEDCOMMENTS := 'Yes' *)\nPROGRAM Main\nVAR\nEND_VAR\n(* @END_DECLARATION := '0' *)\n"
        f"{body}END_PROGRAM\n\n"
        "(* @NESTEDCOMMENTS := 'Yes' *)\n(* @GLOBAL_VARIABLE_LIST := 'Drive' *)\nVAR_GLOBAL\n speed : INT;\nEND_VAR\n"
        "(* @OBJECT_END := 'Drive' *)\n(* @CONNECTIONS := Drive\nNUMOFCONNECTIONS : 0\n*)\n"
        f"VISUALISATION Overview\n{body}END_VISUALISATION\n"
    )
    (found,) = lists(tmp_path / "a.exp", text)
    assert (found.name, elements(found)) == ("Drive", ["speed"])


def test_declarations_with_conditions_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "List.st"
    text = "VAR_GLOBAL\n{attribute 'x'}\n{IF defined (LONG)}\n a : LREAL;\n{ELSE}\n a : REAL;\n{END_IF}\nEND_VAR\n"
    with pytest.raises(ConfigurationError) as caught:
        lists(file, text)
    assert caught.value.where == f"{file}, line 3, column 1"
    assert "a condition that only the compiler knows" in caught.value.what
    assert "the branch that the controller compiles" in caught.value.next_step


def test_conditions_within_programs_do_not_matter(tmp_path: Path) -> None:
    text = "FUNCTION_BLOCK Block\n{IF defined (X)}\n;\n{END_IF}\nEND_FUNCTION_BLOCK\nVAR_GLOBAL\n a : INT;\nEND_VAR\n"
    (found,) = lists(tmp_path / "List.st", text)
    assert elements(found) == ["a"]


def test_exp_function_blocks_are_known_types(tmp_path: Path) -> None:
    text = (
        "FUNCTION_BLOCK Motor\nVAR\nEND_VAR\n(* @END_DECLARATION := '0' *)\n;\nEND_FUNCTION_BLOCK\n"
        "(* @GLOBAL_VARIABLE_LIST := 'Drive' *)\nVAR_GLOBAL\n motor : Motor;\nEND_VAR\n(* @OBJECT_END := 'Drive' *)\n"
    )
    (found,) = lists(tmp_path / "a.exp", text)
    assert elements(found) == ["motor"]


TWINCAT = '<?xml version="1.0"?><TcPlcObject Version="1.1">{}</TcPlcObject>'
NOTHING_DECLARED = {
    "only a comment.st": "(* to be done *)\n// later\n",
    "only a pragma.st": "{attribute 'qualified_only'}\n",
    "a function.st": "FUNCTION Twice : INT\nVAR_INPUT a : INT; END_VAR\nTwice := 2 * a;\nEND_FUNCTION\n",
    "a program's declaration.st": "PROGRAM Main\nVAR\n a : INT;\nEND_VAR\n",
    "a program.exp": "(* @NESTEDCOMMENTS := 'Yes' *)\nPROGRAM Main\nVAR\nEND_VAR\n"
    "(* @END_DECLARATION := '0' *)\n;\nEND_PROGRAM\n",
    "an empty list.TcGVL": TWINCAT.format('<GVL Name="a"><Declaration><![CDATA[ ]]></Declaration></GVL>'),
    "a task.TcTTO": TWINCAT.format('<Task Name="PlcTask"><CycleTime>10000</CycleTime></Task>'),
    "programs.xml": plcopen(""),
}


@pytest.mark.parametrize("name", NOTHING_DECLARED)
def test_a_file_that_declares_nothing_does_not_stop_the_others(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(NOTHING_DECLARED[name], encoding="utf-8")
    (tmp_path / "List.st").write_text("VAR_GLOBAL a : INT; END_VAR", encoding="utf-8")
    (found,) = load_definitions([str(tmp_path / name), str(tmp_path / "List.st")]).lists
    assert elements(found) == ["a"]


def test_plcopen_initial_values_matter_only_where_something_depends_on_them(tmp_path: Path) -> None:
    (found,) = lists(tmp_path / "a.xml", plcopen(global_list(variable("a", value="a ?? b") + variable("c"))))
    assert elements(found) == ["a", "c"]
    constant = global_list(variable("N", value="a ?? b"), ' constant="true"')
    array = '<type><array><dimension lower="1" upper="N"/><baseType><BYTE/></baseType></array></type>'
    (found,) = lists(tmp_path / "b.xml", plcopen(constant + global_list(variable("last", array) + variable("c"))))
    assert elements(found) == ["last", "c"]
    (problem,) = found.flaws
    assert isinstance(problem, Problem)
    assert problem.what == "a constant integer is expected"
