"""Which variable of which list a name of a configuration means, and what its column holds."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.datalogger.configuration import NamedVariable, Session
from nvscope.datalogger.configuration_file import read_configuration
from nvscope.datalogger.logged import Content, resolve, task_list
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.position import Position
from nvscope.definition.project_datalogger import DataLoggerSettings
from nvscope.definition.project_file import read_project
from nvscope.errors import ConfigurationError
from tests.datalogger.plants import configuration
from tests.test_captures_index import CAPTURES

PLC = """<GVL><Declarations><![CDATA[VAR_GLOBAL
 xRun : BOOL; fTemp : REAL; rLong : LREAL; sText : STRING(20); wsText : WSTRING(5); tRun : TIME; eState : E_State;
 nRange : INT (0..10); ulBig : ULINT; aPos : ARRAY [0..1, 1..2] OF INT; stAxis : ST_Axis; Prg1_speed : INT;
END_VAR]]></Declarations><NetvarSettings Protocol="UDP"><ListIdentifier>{index}</ListIdentifier><Pack>True</Pack>
<Checksum>False</Checksum><Acknowledge>False</Acknowledge><CyclicTransmission>True</CyclicTransmission>
<TransmissionOnChange>False</TransmissionOnChange><TransmissionOnEvent>False</TransmissionOnEvent>
<Interval>T#50ms</Interval><ProtocolSettings><ProtocolSetting Name="Broadcast Adr." Value="255.255.255.255" />
<ProtocolSetting Name="Port" Value="1202" /></ProtocolSettings></NetvarSettings></GVL>"""
TYPES = """TYPE ST_Axis : STRUCT pos : LREAL; vel : REAL; END_STRUCT END_TYPE
TYPE E_State : (Off, On) INT; END_TYPE"""


@pytest.fixture
def layouts(tmp_path: Path) -> Layouts:
    (tmp_path / "press.gvl").write_text(PLC.format(index=1), encoding="utf-8")
    (tmp_path / "axis.gvl").write_text(PLC.format(index=2).replace("fTemp", "fPress"), encoding="utf-8")
    (tmp_path / "types.st").write_text(TYPES, encoding="utf-8")
    return Layouts(load_definitions([str(tmp_path)]))


def session(*uris: str, general: str = "") -> Session:
    """Return a session with these variables, the first of them in line 1."""
    path = CAPTURES / "datalogger" / "vendor-example.dl.config"
    found = read_configuration(str(path)).session
    named = tuple(NamedVariable(uri, Position("c.xml", line, 5)) for line, uri in enumerate(uris, 1))
    changed = {name: getattr(found, name) for name in found.__struct_fields__} | {"variables": named}
    return Session(**changed | ({"task": general} if general else {}))


def meant(uri: str, layouts: Layouts, *given: tuple[str, str]) -> str:
    """Return the list and the element that a name means, or what is wrong with it."""
    found = resolve(session(uri), layouts, DataLoggerSettings(given))
    if found.left_out:
        return str(found.left_out[0])
    return f"{found.logged[0].key} {found.logged[0].element}"


@pytest.mark.parametrize(
    ("uri", "element"),
    [
        ("Arp.Plc.Eclr/fTemp", "udp/1202/1 fTemp"),
        ("fTemp", "udp/1202/1 fTemp"),
        ("Arp.Plc.Eclr/FTEMP", "udp/1202/1 fTemp"),
        ("Arp.Plc.Eclr/Prg1.fTemp", "udp/1202/1 fTemp"),
        ("Arp.Plc.Eclr/axis.xRun", "udp/1202/2 xRun"),
        ("Arp.Plc.Eclr/press.stAxis.pos", "udp/1202/1 stAxis.pos"),
        ("Arp.Plc.Eclr/press.aPos[1,2]", "udp/1202/1 aPos[1, 2]"),
    ],
)
def test_names_tell(layouts: Layouts, uri: str, element: str) -> None:
    assert meant(uri, layouts) == element


@pytest.mark.parametrize(
    ("uri", "mistake"),
    [
        (
            "a/xRun",
            "c.xml, line 1, column 5: Variable, attribute name: 'a/xRun': 2 lists have a variable of this name: ",
        ),
        ("a/fTemq", "no list has a variable of this name\n  Near it: fTemp."),
        ("a/Other.stAxis.position", "no list has a variable of this name"),
        ("a/press.stAxis", "it has 2 parts, and a column holds one value\n  Name a part, such as stAxis.pos."),
        ("a/zzzzzz", "Name the exported lists with --gvl, or say in [datalogger.variables] which variable it is."),
    ],
)
def test_mistakes_say_where_and_what_is_near(layouts: Layouts, uri: str, mistake: str) -> None:
    assert mistake in meant(uri, layouts)


def test_the_project_file_goes_before_names(layouts: Layouts) -> None:
    assert meant("a/fTemp", layouts, ("a/fTemp", "axis:fPress")) == "udp/1202/2 fPress"
    assert meant("a/fTemp", layouts, ("a/fTemp", "2:xRun")) == "udp/1202/2 xRun"
    assert meant("a/fTemp", layouts, ("a/fTemp", "fPress")) == "udp/1202/2 fPress"
    assert "[datalogger.variables] says 'acis:x': no list is named 'acis'" in meant("a/b", layouts, ("a/b", "acis:x"))
    assert "2 lists have a variable of this name" in meant("a/b", layouts, ("a/b", "xRun"))


def test_a_mistake_in_the_project_file_is_told_where_it_is(tmp_path: Path) -> None:
    (tmp_path / "press.gvl").write_text(PLC.format(index=1), encoding="utf-8")
    (tmp_path / "types.st").write_text(TYPES, encoding="utf-8")
    text = 'definitions = ["press.gvl", "types.st"]\n[datalogger.variables]\n"a/b" = "press:fTmp"\n'
    text += '[datalogger.tasks]\nT = "prss"\n'
    (tmp_path / "nvscope.toml").write_text(text, encoding="utf-8")
    project = read_project(tmp_path / "nvscope.toml")
    own, layouts = session("a/b", general="T"), Layouts(project.definition)
    told = str(resolve(own, layouts, project.datalogger).left_out[0])
    assert "nvscope.toml, line 3, column 1: datalogger.variables.a/b: " in told
    assert "[datalogger.variables] says 'press:fTmp': no list has a variable of this name\n  Near it: fTemp." in told
    with pytest.raises(ConfigurationError, match=r"nvscope\.toml, line 5, column 1: datalogger\.tasks\.T: "):
        task_list(own, (), layouts, project.datalogger)


@pytest.mark.parametrize(
    ("element", "declared", "content"),
    [
        ("xRun", "TINYINT", Content.INTEGER), ("fTemp", "FLOAT", Content.REAL), ("rLong", "DOUBLE", Content.REAL),
        ("sText", "TEXT", Content.TEXT), ("wsText", "TEXT", Content.TEXT), ("tRun", "INT", Content.INTEGER),
        ("eState", "SMALLINT", Content.INTEGER), ("nRange", "SMALLINT", Content.INTEGER),
        ("ulBig", "BIGINT", Content.INTEGER),
    ],
)  # fmt: skip
def test_columns_are_declared_by_types(layouts: Layouts, element: str, declared: str, content: Content) -> None:
    (found,) = resolve(session(f"a/press.{element}"), layouts, DataLoggerSettings()).logged
    assert (found.declared, found.content) == (declared, content)


def test_columns_are_in_the_order_of_their_names(layouts: Layouts) -> None:
    found = resolve(session("b/fTemp", "a/press.xRun", "a/fPress"), layouts, DataLoggerSettings())
    assert [one.uri for one in found.logged] == ["a/fPress", "a/press.xRun", "b/fTemp"]


def test_the_list_of_a_task(layouts: Layouts) -> None:
    own = session("a/fTemp", general="Cyclic100")
    logged = resolve(own, layouts, DataLoggerSettings()).logged
    assert str(task_list(own, logged, layouts, DataLoggerSettings())) == "udp/1202/1"
    told = DataLoggerSettings(tasks=(("Cyclic100", "axis"),))
    assert str(task_list(own, logged, layouts, told)) == "udp/1202/2"
    assert str(task_list(session("a/fTemp", general="AXIS"), logged, layouts, DataLoggerSettings())) == "udp/1202/2"
    both = session("a/fTemp", "a/fPress", general="Cyclic100")
    of_both = resolve(both, layouts, DataLoggerSettings()).logged
    with pytest.raises(ConfigurationError, match="which list the task 'Cyclic100' sends is not known"):
        task_list(both, of_both, layouts, DataLoggerSettings())
    with pytest.raises(ConfigurationError, match="no list is named 'nobody'"):
        task_list(own, logged, layouts, DataLoggerSettings(tasks=(("Cyclic100", "nobody"),)))


def test_configurations_of_tests_are_read(tmp_path: Path) -> None:
    (tmp_path / "c.xml").write_text(configuration(["a/b"]), encoding="utf-8")
    assert read_configuration(str(tmp_path / "c.xml")).session.time_format == "Iso8601"
