"""The project file: what it may say, what follows from it, and what is told of mistakes in it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition.buses import BusSettings
from nvscope.definition.limits import Limits
from nvscope.definition.model import Problem
from nvscope.definition.parameters import ParameterDefinition
from nvscope.definition.project import Project, find_project
from nvscope.definition.project_file import document, read_project
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import String
from nvscope.definition.wanted_files import MAX_DEFINITION_FILES
from nvscope.engine.reading import TIMEOUT_NS
from nvscope.errors import ConfigurationError
from nvscope.list_key import ANY_CHANNEL, ListKey
from tests.laws import examples

PLANT = """
definitions = ["plc/**/*.gvl", "types/*.st"]
ports = [1300, 1202]
[nodes]
"192.168.1.10" = { name = "press", reads = [7, "udp/1202/8"] }
"fe80::1" = { name = "robot" }
"::ffff:10.0.0.2" = { reads = [9] }
[lists.42]
name = "drives"; port = 1202; interval = "20ms"; min_gap = "5ms"
[lists.0x181]
name = "io"; transport = "can"; pack = false
[buses.can0]
bit_rate = "250k"; data_bit_rate = 2_000_000
[buses."can*"]
bit_rate = 500000
[limits]
jitter_percent = 40
acknowledgement = "250ms"
[keys]
"view.filter" = "/"
""".replace("; ", "\n")

GVL = """<GVL><Declarations><![CDATA[VAR_GLOBAL nSpeed : INT; END_VAR]]></Declarations>
<NetvarSettings Protocol="UDP"><ListIdentifier>{identifier}</ListIdentifier><Interval>T#50ms</Interval>{more}
</NetvarSettings></GVL>"""
ON_1202 = '<ProtocolSettings><ProtocolSetting Name="Port" Value="1202" /></ProtocolSettings>'
PLCOPEN = """<project xmlns="http://www.plcopen.org/xml/tc6_0200"><instances><configurations>
<configuration name="c"><resource name="r"><globalVars name="Axis">
<variable name="nPos"><type><DINT /></type></variable></globalVars>
</resource></configuration></configurations></instances></project>"""


def plant(base: Path, text: str, **files: str) -> Project:
    """Return the project of a text, with definition files beside it: ``a_gvl`` stands for ``plc/a.gvl``."""
    (base / "plc").mkdir(exist_ok=True)
    for name, content in files.items():
        (base / "plc" / ".".join(name.rsplit("_", 1))).write_text(content)
    path = base / "nvscope.toml"
    path.write_text(text, encoding="utf-8")
    return read_project(path)


def mistake(base: Path, text: str) -> tuple[str, str, str]:
    """Return where, what and the next step of the error that a text gives."""
    with pytest.raises(ConfigurationError) as caught:
        plant(base, text)
    where = caught.value.where.removeprefix(str(base / "nvscope.toml"))
    return where, caught.value.what, caught.value.next_step


def lists(project: Project) -> list[tuple[str, int | None, int]]:
    """Return name, identifier and port of all lists."""
    return [(entry.name, entry.list_id, entry.port) for entry in project.definition.lists]


def test_a_whole_project(tmp_path: Path) -> None:
    (tmp_path / "types").mkdir()
    (tmp_path / "types" / "axis.st").write_text("TYPE Axis : STRUCT a : INT; END_STRUCT END_TYPE")
    project = plant(tmp_path, PLANT, axis_gvl=GVL.format(identifier=42, more=""))
    assert project.path == tmp_path / "nvscope.toml"
    assert [Path(file).name for file in project.files] == ["axis.gvl", "axis.st"]
    assert project.node_names == {"192.168.1.10": "press", "fe80::1": "robot"}
    assert project.readers == {"192.168.1.10": ((None, 7), (1202, 8)), "10.0.0.2": ((None, 9),)}
    assert project.ports == (1300, 1202)
    assert project.limits == Limits(jitter_percent=40, acknowledgement_ns=250_000_000)
    assert project.buses.of("can0") == BusSettings(250_000, 2_000_000)
    assert project.buses.of("can1") == BusSettings(500_000)
    assert project.buses.of("vcan0") == BusSettings()
    assert project.keys == {"view.filter": "/"}
    drives, io = project.definition.lists
    assert (drives.name, drives.list_id, drives.port, len(drives.variables)) == ("drives", 42, 1202, 1)
    assert (drives.interval_ns, drives.min_gap_ns) == (20_000_000, 5_000_000)
    assert (io.name, io.list_id, io.protocol, io.pack, io.variables) == ("io", 0x181, "CAN", False, ())
    assert project.definition.nominal_intervals_ns() == {ListKey.udp(1202, 42): 20_000_000}


def test_without_a_file_all_is_as_usual() -> None:
    project = read_project(None)
    assert project == Project()
    assert project.definition.lists == ()
    assert project.limits.acknowledgement_ns == TIMEOUT_NS


def test_an_empty_file_says_nothing(tmp_path: Path) -> None:
    project = plant(tmp_path, "")
    assert project == Project(path=tmp_path / "nvscope.toml")


def test_it_is_found_upwards(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b"
    deep.mkdir(parents=True)
    above = tmp_path / "nvscope.toml"
    above.write_text("")
    assert find_project(deep) == above
    nearer = tmp_path / "a" / "nvscope.toml"
    nearer.symlink_to("nowhere")  # reading it will say that it cannot be read
    assert find_project(deep) == nearer
    assert find_project(tmp_path) == above


def test_files_are_sorted_whatever_the_order_of_the_patterns_each_once(tmp_path: Path) -> None:
    for name in ("b.gvl", "a.gvl", ".hidden/c.gvl", "deep/er/d.gvl"):
        path = tmp_path / "plc" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(GVL.format(identifier=1, more=""))
    project = plant(tmp_path, 'definitions = ["plc/b.gvl", "plc/**/*.gvl"]')
    assert [os.path.relpath(file, tmp_path / "plc") for file in project.files] == ["a.gvl", "b.gvl", "deep/er/d.gvl"]
    assert len(plant(tmp_path, 'definitions = "plc/**"').files) == 3
    assert len(plant(tmp_path, 'definitions = "plc/.hidden/*"').files) == 1
    assert plant(tmp_path, f"definitions = '{tmp_path}/plc/a*'").files == (str(tmp_path / "plc" / "a.gvl"),)


def test_other_files_take_the_place_of_the_projects_own(tmp_path: Path) -> None:
    plant(tmp_path, 'definitions = "plc/*.gvl"\n[lists.9]\nname = "nine"', a_gvl=GVL.format(identifier=7, more=""))
    other = tmp_path / "other.gvl"
    other.write_text(GVL.format(identifier=9, more=""))
    project = read_project(tmp_path / "nvscope.toml", [str(other)])
    assert lists(project) == [("nine", 9, 1202)]
    assert project.files == (str(other),)


def test_the_first_port_is_that_of_lists_without_one(tmp_path: Path) -> None:
    text = 'definitions = "plc/*.gvl"\nports = [1400, 1202]\n[lists.9]\nname = "alone"'
    files = {"a_gvl": GVL.format(identifier=7, more=""), "b_gvl": GVL.format(identifier=8, more=ON_1202)}
    assert lists(plant(tmp_path, text, **files)) == [("a", 7, 1400), ("b", 8, 1202), ("alone", 9, 1400)]


def test_a_list_is_on_can_where_it_has_a_channel(tmp_path: Path) -> None:
    text = 'definitions = "plc/*.gvl"\n[lists.0x181]\nchannel = "can1"\n[lists.0x182]\ntransport = "can"'
    one, other = plant(tmp_path, text, a_gvl=GVL.format(identifier=0x181, more="")).definition.lists
    assert (one.name, one.on_can, one.key, len(one.variables)) == ("a", True, ListKey.can("can1", 0x181), 1)
    assert (other.on_can, other.key, other.variables) == (True, ListKey.can(ANY_CHANNEL, 0x182), ())


def test_of_a_list_on_both_the_settings_are_those_of_its_transport(tmp_path: Path) -> None:
    """A gateway sends one list on UDP and on CAN: two files define it with one identifier."""
    files = {"a_gvl": GVL.format(identifier=7, more=""), "b_gvl": GVL.format(identifier=7, more="")}
    files["b_gvl"] = files["b_gvl"].replace('"UDP"', '"CAN"')
    for said, keys in (
        ('channel = "can0"', [ListKey.udp(1202, 7), ListKey.can("can0", 7)]),
        ('transport = "can"\nname = "x"', [ListKey.udp(1202, 7), ListKey.can(ANY_CHANNEL, 7)]),
        ('transport = "udp"\nport = 1202\nname = "x"', [ListKey.udp(1202, 7), ListKey.can(ANY_CHANNEL, 7)]),
    ):
        found = plant(tmp_path, f'definitions = "plc/*.gvl"\n[lists.7]\n{said}', **files).definition.lists
        assert [entry.key for entry in found] == keys
        assert [entry.name for entry in found].count("x") == said.count('"x"')


def test_a_list_without_identifier_gets_it_by_its_name(tmp_path: Path) -> None:
    text = 'definitions = "plc/*.xml"\n[lists.7]\nname = "axis"\nport = 1300'
    (entry,) = plant(tmp_path, text, a_xml=PLCOPEN).definition.lists
    assert (entry.name, entry.list_id, entry.port, entry.variables[0].name) == ("axis", 7, 1300, "nPos")
    named_otherwise = plant(tmp_path, text.replace('"axis"', '"other"'), a_xml=PLCOPEN)
    assert lists(named_otherwise) == [("Axis", None, 1202), ("other", 7, 1300)]


def test_the_projects_word_wins_and_its_port_chooses_among_several(tmp_path: Path) -> None:
    one = GVL.format(identifier=7, more=ON_1202)
    alone = plant(tmp_path, 'definitions = "plc/*.gvl"\n[lists.7]\nport = 1300', a_gvl=one)
    assert lists(alone) == [("a", 7, 1300)]
    several = {"a_gvl": one, "b_gvl": one.replace('"1202"', '"1300"')}
    text = 'definitions = "plc/*.gvl"\n[lists.7]\ninterval = "1s"\n'
    both = plant(tmp_path, text, **several).definition.nominal_intervals_ns()
    assert both == {ListKey.udp(1202, 7): 1_000_000_000, ListKey.udp(1300, 7): 1_000_000_000}
    chosen = plant(tmp_path, f"{text}port = 1300", **several).definition.nominal_intervals_ns()
    assert chosen == {ListKey.udp(1202, 7): 50_000_000, ListKey.udp(1300, 7): 1_000_000_000}


def test_what_is_not_sent_cyclically_has_no_interval(tmp_path: Path) -> None:
    project = plant(tmp_path, '[lists.7]\ninterval = "1s"\ncyclic = false\n[lists.8]\ninterval = "0ms"')
    assert project.definition.nominal_intervals_ns() == {ListKey.udp(1202, 7): 0}


@pytest.mark.parametrize("key", ["385", "0x181", '"16#181"', '"0X181"'])
def test_identifiers_are_written_in_several_ways(key: str, tmp_path: Path) -> None:
    assert lists(plant(tmp_path, f"[lists.{key}]\nname = 'io'")) == [("io", 385, 1202)]


def test_parameters_have_names_and_types_of_one_node_or_of_all(tmp_path: Path) -> None:
    told = """[nodes]
"10.0.0.1" = { name = "press" }
[parameters]
"8192:1" = { name = "nMode", type = "int" }
"press/0x2000:1" = { name = "rSpeed", type = "REAL" }
"::ffff:10.0.0.2/16#2000:1" = { type = "STRING( 20 )" }
"0x2001:0" = { name = "sName", type = "wstring" }
"""
    known = plant(tmp_path, told).definition.parameters
    assert known is not None
    mode, speed = known.of("10.0.0.9", 0x2000, 1), known.of("10.0.0.1", 0x2000, 1)
    assert mode is not None
    assert speed is not None
    assert (mode.name, mode.type, speed.name, speed.type) == ("nMode", SCALARS["INT"], "rSpeed", SCALARS["REAL"])
    assert known.of("10.0.0.2", 0x2000, 1) == ParameterDefinition(0x2000, 1, "", String(20), "10.0.0.2")
    assert known.of("10.0.0.2", 0x2001, 0) == ParameterDefinition(0x2001, 0, "sName", String(wide=True))
    assert known.of("10.0.0.1", 0x2000, 2) is None
    assert [known.name_of(f"10.0.0.{node}", 0x2000, 1) for node in (1, 2, 3)] == ["rSpeed", "0x2000:1", "nMode"]
    assert plant(tmp_path, "").definition.parameters is None


@pytest.mark.parametrize(
    ("text", "where", "what", "next_step"),
    [
        ("definition = 'a'", ": definition", "unknown key 'definition'", "nearest known one is 'definitions'"),
        ("ports = 70000", ", line 1, column 1: ports", "70000 is out of range: 1 to 65535", "a number from 1 to 65535"),
        ("\nports = [1,\n 70000]", ", line 2, column 1: ports[1]", "70000 is out of range", "a number from 1 to 65535"),
        ("limits.late_percent = 0 # late_percent = 0", ", line 1, column 1: limits.late_percent", "0 is out of", ""),
        ("[limits]\n'late_percent'= 0", ", line 2, column 1: limits.late_percent", "0 is out of range", ""),
        ("[nodes]\n\n'1.2.3.4' = { name = 'a', nme = 'x' }", ', line 3, column 1: nodes."1.2.3.4".nme', "unknown", ""),
        ("[lists.7]\nport = 1\n[lists.x]", ", line 3, column 2: lists.x", "is no identifier of a list", ""),
        ("ports = [1202,\n 1203\n x]", ", line 3, column 2", "no TOML: Unclosed array", ""),
        ("ports = yes", ", line 1, column 9", "no TOML: Invalid value", "stand in quotes"),
        ("ports = [", ", line 1, column 10", "no TOML: Invalid value", "stand in quotes"),
        ("definitions = 'no/*.gvl'", ": definitions[0]", "no file matches 'no/*.gvl'", "are relative to"),
        ("definitions = ['']", ": definitions[0]", "is empty", ""),
        ("definitions = 'a/b**'", ": definitions[0]", "cannot be followed: Invalid pattern", ""),
        ('definitions = "a\\u0000"', ": definitions[0]", "no file matches 'a\x00'", ""),
        ("[nodes]\npress = {}", ': nodes."press"', "'press' is no IP address", '"192.168.1.10" ='),
        ('[nodes]\n"fe80::1%eth0" = {}', ': nodes."fe80::1%eth0"', "is no IP address", ""),
        ('[nodes]\n"1.2.3.4" = { nme = "x" }', ': nodes."1.2.3.4".nme', "unknown key 'nme'", "is 'name'"),
        ('[nodes]\n"1.2.3.4" = "x"', ': nodes."1.2.3.4"', "a table is expected, found a text", "known are: name, "),
        ('[nodes]\n"1.2.3.4" = { name = " " }', ': nodes."1.2.3.4".name', "a name has 1 to 60 characters", ""),
        ('[nodes]\n"::1" = {}\n"0::1" = {}', ': nodes."0::1"', "the node ::1 is there twice", "Leave one"),
        ('[nodes]\n"1.2.3.4" = { reads = ["can/0/1"] }', ".reads[0]", "'can/0/1' is no list", "udp/1300/7"),
        ('[nodes]\n"1.2.3.4" = { reads = ["udp/0/1"] }', ".reads[0]", "'udp/0/1' is no list", "udp/1300/7"),
        ('[nodes]\n"1.2.3.4" = { reads = [65536] }', ".reads[0]", "65536 is out of range", ""),
        ('[parameters]\n"8192" = {}', ': parameters."8192"', "'8192' is no parameter", '"0x2000:1"'),
        ('[parameters]\n"0x10000:0" = {}', ': parameters."0x10000:0"', "is no parameter", ""),
        ('[parameters]\n"2000h:0" = {}', ': parameters."2000h:0"', "is no parameter", ""),
        ('[parameters]\n"1:65536" = {}', ': parameters."1:65536"', "is no parameter", ""),
        ('[parameters]\n"1:0" = {}\n"0x1:0" = {}', ': parameters."0x1:0"', "the parameter is there twice", "Leave"),
        ('[parameters]\n"1:0" = { typ = "INT" }', ': parameters."1:0".typ', "unknown key 'typ'", "is 'type'"),
        ('[parameters]\n"1:0" = { type = "BIT" }', ': parameters."1:0".type', "'BIT' is no type", "Known are BOOL"),
        ('[parameters]\n"1:0" = { type = "REEL" }', ".type", "declares 'REEL'", "Perhaps REAL is meant; else: add the"),
        ('[parameters]\n"1:0" = { type = "STRNG(20)" }', ".type", "declares 'STRNG'", "Perhaps STRING is"),
        ('[parameters]\n"1:0" = { type = "ST_Axis" }', ".type", "declares 'ST_Axis'", "Add the file"),
        ('[parameters]\n"1:0" = { type = "STRING(0)" }', ".type", "is no type", "STRING(n)"),
        ('[parameters]\n"press/1:0" = {}', ': parameters."press/1:0"', "no node is called 'press'", "[nodes]"),
        (
            '[nodes]\n"1.2.3.4" = { name = "press" }\n[parameters]\n"pres/1:0" = {}', ': parameters."pres/1:0"',
            "no node is called 'pres'", "The nearest known one is 'press'",
        ),
        (
            '[nodes]\n"1.2.3.4" = { name = "a" }\n[parameters]\n"a/1:0" = {}\n"1.2.3.4/1:0" = {}',
            ': parameters."1.2.3.4/1:0"', "the parameter of 1.2.3.4 is there twice", "Leave one",
        ),
        ("[lists.x]", ": lists.x", "'x' is no identifier of a list", "[lists.0x181]"),
        ("[lists.0x10000]", ": lists.0x10000", "'0x10000' is no identifier of a list", ""),
        ("[lists.7]\n[lists.0x7]", ": lists.0x7", "the list 7 is there twice", "Put both"),
        ("[lists.7]\nintervall = '1s'", ": lists.7.intervall", "unknown key 'intervall'", "is 'interval'"),
        ("[lists.7]\ninterval = '-1s'", ": lists.7.interval", "a duration cannot be negative here", ""),
        ("[lists.7]\ninterval = 50", ": lists.7.interval", "a duration is expected, found a whole number", '"50ms"'),
        ("[lists.7]\ntransport = 'tcp'", ": lists.7.transport", "'tcp' is none of the choices", "known are: can, udp"),
        ("[lists.7]\ntransport = 'udp'\nchannel = 'can0'", ": lists.7.channel", "a list on UDP has no channel", ""),
        ("[lists.7]\nchannel = 'can0'\nport = 1202", ": lists.7.port", "a list on CAN has no port", "Leave it out"),
        ("[lists.7]\nchannel = ''", ": lists.7.channel", "a name has 1 to 60 characters", ""),
        ("[lists.7]\nchannel = 0", ": lists.7.channel", "a text is expected", ""),
        ("[lists.2048]\ntransport = 'can'", ": lists.2048", "2048 is no COB-ID", "up to 0x7FF"),
        ("[limits]\nlate_percent = 0", ": limits.late_percent", "0 is out of range", ""),
        ("[limits]\njitter_percent = 1.5", ": limits.jitter_percent", "a whole number is expected", ""),
        ("[limits]\nacknowledgement = '0s'", ": limits.acknowledgement", "must be more than 0", ""),
        ("[limits]\njiter_percent = 1", ": limits.jiter_percent", "unknown key", "is 'jitter_percent'"),
        ("[buses.can0]\nbitrate = 1", ": buses.can0.bitrate", "unknown key 'bitrate'", "is 'bit_rate'"),
        ("[buses.can0]\nbit_rate = '9x'", ": buses.can0.bit_rate", "'9x' is no bit rate", '"250k"'),
        ("[buses.can0]\nbit_rate = 1.5", ": buses.can0.bit_rate", "a bit rate is expected", '"250k"'),
        ("[buses.can0]\nbit_rate = '99M'", ": buses.can0.bit_rate", "'99M' is no bit rate of CAN: 1000 to", ""),
        ("[limits]\nbus_load_percent = 0", ": limits.bus_load_percent", "0 is out of range", ""),
        ("[keys]\nquit = 1", ": keys.quit", "a text is expected", ""),
        ("a = " + "[" * 5000, "", "nested too deeply", ""),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_place(text: str, where: str, what: str, next_step: str, tmp_path: Path) -> None:
    told = mistake(tmp_path, text)
    assert told[0].endswith(where)
    assert what in told[1]
    assert next_step in told[2]


def test_a_key_that_stands_several_times_is_found_where_it_is_wrong(tmp_path: Path) -> None:
    where = mistake(tmp_path, "[lists.7]\nport = 1\n[lists.8]\n  port = 0")[0]
    assert where == ", line 4, column 3: lists.8.port"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    path = tmp_path / "nvscope.toml"
    for make, what in (
        (lambda: None, "No such file"),
        (path.mkdir, "Is a directory"),
    ):
        make()
        with pytest.raises(ConfigurationError, match=what) as caught:
            read_project(path)
        assert caught.value.where == str(path)
    path.rmdir()
    path.write_bytes(b"ports = [1202]\n# caf\xe9")
    with pytest.raises(ConfigurationError, match="not UTF-8") as caught:
        read_project(path)
    assert caught.value.where == f"{path}, line 2, column 6"
    path.write_bytes(b"#" * 2_000_000)
    with pytest.raises(ConfigurationError, match="larger than 1000000 bytes"):
        read_project(path)


def test_a_pattern_over_too_many_files_is_not_followed(tmp_path: Path) -> None:
    for number in range(MAX_DEFINITION_FILES + 1):
        (tmp_path / f"{number}.gvl").touch()
    assert "stands for more than 5 000 files" in mistake(tmp_path, "definitions = '*.gvl'")[1]


def test_a_mistake_in_a_definition_file_names_that_file(tmp_path: Path) -> None:
    text = GVL.format(identifier=7, more="")
    found = plant(tmp_path, "definitions = 'plc/*.gvl'", a_gvl=text.replace("INT", "REAL(0..1)")).definition
    (problem,) = found.flaws_of(found.lists)
    assert isinstance(problem, Problem)
    assert problem.what == "REAL has no subranges"
    assert str(problem.position).startswith(f"{tmp_path / 'plc' / 'a.gvl'}, line 1, column ")
    with pytest.raises(ConfigurationError, match="expected ';'") as caught:
        plant(tmp_path, "definitions = 'plc/*.gvl'", a_gvl=text.replace("INT;", "INT"))
    assert caught.value.where.startswith(f"{tmp_path / 'plc' / 'a.gvl'}, line 1, column ")


def test_all_keys_are_documented() -> None:
    text = document()
    for key in (
        "`definitions`",
        "`ports`",
        '## nodes."ADDRESS"',
        "`reads`",
        "## [lists.IDENTIFIER]",
        "`min_gap`",
        "`channel`",
        '## parameters."INDEX:SUBINDEX"',
        "`type` (type, ",
    ):
        assert key in text
    assert "- `late_percent` (whole number 1 to 1000000, default `250`): NV501" in text
    assert "- `acknowledgement` (duration above 0, default `1s`)" in text
    assert not any(line.startswith("    ") for line in text.splitlines())  # no block of code by mistake


PIECES = st.one_of(
    st.binary(max_size=4), st.sampled_from([b'"', b"[[", b"[lists.7]\n", b"= 1", b"\n", b"{}", b"1e400", b"= '9'"])
)
CHANGES = st.lists(st.tuples(st.integers(0, len(PLANT)), st.integers(0, 12), PIECES), min_size=1, max_size=6)


@examples(150)
@given(changes=CHANGES)
def test_any_file_is_a_project_or_a_mistake_that_is_named(
    changes: list[tuple[int, int, bytes]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    content = bytearray(PLANT.encode())
    for place, length, piece in changes:
        content[place : place + length] = piece
    # In a directory of its own: programs that other tests start in theirs look upwards for such a file.
    path = tmp_path_factory.getbasetemp() / "any" / "nvscope.toml"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    where = str(path)
    try:
        read_project(path, [])
    except ConfigurationError as error:
        where = error.where
    assert where.startswith(str(path))
