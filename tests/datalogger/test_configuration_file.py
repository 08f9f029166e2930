"""Configurations: the attributes of the reference with their defaults, and mistakes with file, line and near names."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.datalogger.configuration import ATTRIBUTES, Session
from nvscope.datalogger.configuration_file import read_configuration, written
from nvscope.errors import ConfigurationError
from tests.datalogger.plants import configuration
from tests.test_captures_index import CAPTURES

FOLDER = CAPTURES / "datalogger"
VARIABLES = '<Variables><Variable name="Arp.Plc.Eclr/a"/></Variables>'


def document(general: str = 'name="n"', sink: str = 'dst="a.db"', rest: str = VARIABLES) -> str:
    return (
        f"<DataLoggerConfigDocument>\n <General {general}/>\n <Datasink {sink}/>\n {rest}\n</DataLoggerConfigDocument>"
    )


def many(count: int) -> str:
    return "".join(f'<Variable name="v{one}"/>' for one in range(count))


def session_of(tmp_path: Path, text: str) -> Session:
    path = tmp_path / "c.xml"
    path.write_text(text, encoding="utf-8")
    return read_configuration(str(path)).session


def mistake_in(tmp_path: Path, text: str) -> str:
    path = tmp_path / "c.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(str(path))
    return str(caught.value).replace(str(path), "c.xml")


def told(session: Session) -> dict[str, str]:
    return {one.name: one.told(getattr(session, one.field)) for one in ATTRIBUTES}


def test_the_configuration_of_a_controller() -> None:
    found = read_configuration(str(FOLDER / "genuine-5min.config.xml"))
    assert found.unknown == ()
    assert told(found.session) == {
        "name": "datalogger-web-app", "samplingInterval": "250ms", "publishInterval": "1s", "bufferCapacity": "100",
        "taskContext": "", "type": "db", "dst": "/opt/plcnext/database-web-app.db", "rollover": "true",
        "maxFiles": "30", "writeInterval": "1000", "maxFileSize": "5000000", "storeChangesOnly": "true",
        "deleteRatio": "30", "tsfmt": "Iso8601",
    }  # fmt: skip
    assert len(found.session.variables) == 20
    assert str(found.session.variables[0].position).endswith("genuine-5min.config.xml, line 12, column 15")


def test_the_vendors_example_says_little_and_the_rest_is_as_by_default() -> None:
    session = read_configuration(str(FOLDER / "vendor-example.dl.config")).session
    assert (session.time_format, session.block_rows, session.max_files, session.delete_percent) == ("Raw", 1000, -1, 5)
    assert session.files == 1


def test_what_is_not_said_is_as_by_default(tmp_path: Path) -> None:
    assert told(session_of(tmp_path, document())) == {
        "name": "n", "samplingInterval": "500ms", "publishInterval": "500ms", "bufferCapacity": "2", "taskContext": "",
        "type": "db", "dst": "a.db", "rollover": "false", "maxFiles": "-1", "writeInterval": "1000", "maxFileSize": "",
        "storeChangesOnly": "false", "deleteRatio": "30", "tsfmt": "Raw",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "duration_ns"),
    [
        ("250ms", 250_000_000),
        ("1s", 10**9),
        ("2 m", 120 * 10**9),
        (" 1h ", 3600 * 10**9),
        ("50us", 50_000),
        ("0.5s", 500_000_000),
    ],
)
def test_durations_have_the_suffixes_of_the_reference(tmp_path: Path, text: str, duration_ns: int) -> None:
    assert session_of(tmp_path, document(f'name="n" samplingInterval="{text}"')).sampling_ns == duration_ns


@pytest.mark.parametrize(
    ("rollover", "max_files", "files"),
    [
        ("true", "3", 3),
        ("true", "-1", None),
        ("true", "-7", None),
        ("true", "0", 1),
        ("true", "1", 1),
        ("false", "9", 1),
    ],
)
def test_how_many_files_there_are(tmp_path: Path, rollover: str, max_files: str, files: int | None) -> None:
    sink = f'dst="a.db" rollover="{rollover}" maxFiles="{max_files}"'
    assert session_of(tmp_path, document(sink=sink)).files == files


@pytest.mark.parametrize(
    ("general", "mistake"),
    [
        ('samplingInterval="1s"', "General has no attribute name: the session's name\n  Write name="),
        ('name="PCWE_x"', "'PCWE_x' begins with PCWE_, which is reserved"),
        (
            'name="n" samplingIntervall="1s"',
            "General, attribute samplingIntervall: is not known\n  Write samplingInterval.",
        ),
        ('name="n" samplingInterval="10"', "'10' is no duration such as 50ms"),
        ('name="n" samplingInterval="-1s"', "'-1s' is no duration"),
        ('name="n" samplingInterval="0s"', "'0s' is not between 1us and 366 days"),
        ('name="n" publishInterval="1d"', "'1d' is no duration"),
        ('name="n" publishInterval="1.0000000001s"', "is no whole number of nanoseconds"),
        (
            'name="n" bufferCapacity="0"',
            "'0' is not between 1 and 1000000\n  bufferCapacity: data sets in the ring buffer; without it, 2.",
        ),
        ('name="n" bufferCapacity="many"', "'many' is no whole number"),
        ('name="n" taskContext=" "', "' ' is empty"),
        ('name="n" rollover="true"', "General, attribute rollover: belongs to <Datasink>"),
    ],
)
def test_mistakes_in_general(tmp_path: Path, general: str, mistake: str) -> None:
    assert mistake in mistake_in(tmp_path, document(general))


@pytest.mark.parametrize(
    ("sink", "mistake"),
    [
        ('type="db"', "line 3, column 2: Datasink has no attribute dst: which file"),
        ('dst="a.db" type="file"', "'file' is neither db nor volatile"),
        ('dst="a.db" rollover="yes"', "'yes' is neither true nor false"),
        ('dst="a.db" deleteRatio="0"', "'0' is not between 1 and 100"),
        ('dst="a.db" deleteRatio="101"', "'101' is not between 1 and 100"),
        ('dst="a.db" tsfmt="iso"', "'iso' is neither Raw nor Iso8601"),
        ('dst="a.db" writeInterval="0"', "'0' is not between 1 and"),
        ('dst="a.db" maxFileSize="-1"', "'-1' is not between 1 and"),
        ('dst="a.db"\n  storeChangeOnly="true"', "line 4, column 3: Datasink, attribute storeChangeOnly: is not known"),
    ],
)
def test_mistakes_in_the_sink(tmp_path: Path, sink: str, mistake: str) -> None:
    assert mistake in mistake_in(tmp_path, document(sink=sink))


@pytest.mark.parametrize(
    ("rest", "mistake"),
    [
        ("", "no variable is named"),
        ("<Variables/>", "no variable is named"),
        ("<Variables><Variable/></Variables>", "a variable has no name"),
        ('<Variables><Variable name="a"/><Variable name="a"/></Variables>', "'a' is there already, in line 4"),
        ('<Variables><Variable name="a"/><Variable name="A"/></Variables>', "'A' differs from 'a' by its case alone"),
        (f"<Variables>{many(997)}</Variables>", "997 variables are named, and a session has 996 at most"),
        (f"{VARIABLES}{VARIABLES}", "there are two elements <Variables>"),
        ('<Variables><Variabel name="a"/></Variables>', "no element is called <Variabel>\n  Write <Variable>."),
        (
            '<Variables><Variable nam="a"/></Variables>',
            "line 4, column 23: Variable, attribute nam: is not known\n  Write name.",
        ),
        (f"{VARIABLES}<Generall/>", "no element is called <Generall>\n  Write <General>."),
        ('<Variables><Variable name="a&#27;b"/></Variables>', "no well-formed XML"),
    ],
)  # fmt: skip
def test_mistakes_in_the_rest(tmp_path: Path, rest: str, mistake: str) -> None:
    assert mistake in mistake_in(tmp_path, document(rest=rest))


def test_996_variables_are_no_mistake(tmp_path: Path) -> None:
    assert len(session_of(tmp_path, document(rest=f"<Variables>{many(996)}</Variables>")).variables) == 996


@pytest.mark.parametrize("text", ["", "no xml", "<a/>", "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "\0" * 40])
def test_what_is_no_configuration_is_told(tmp_path: Path, text: str) -> None:
    assert mistake_in(tmp_path, text).startswith("c.xml")


def test_what_nobody_knows_is_told_and_left_aside(tmp_path: Path) -> None:
    path = tmp_path / "c.xml"
    rest = f'{VARIABLES}\n <TriggerCondition taskContext="x"/>'
    path.write_text(document('name="n" flavour="x"', rest=rest), encoding="utf-8")
    found = read_configuration(str(path))
    assert [one.replace(str(path), "c.xml") for one in found.unknown] == [
        "c.xml, line 5, column 2: element <TriggerCondition>: not known, and left aside",
        "c.xml, line 2, column 20: General, attribute flavour: not known, and left aside",
    ]
    rest = '<Variables kind="x">\n<Variable name="a" names="b" unit="mm"><Trigger/></Variable>\n<Group/>\n</Variables>'
    path.write_text(document(rest=rest).replace('name="n"/>', 'name="n"><Deep/></General>'), encoding="utf-8")
    found = read_configuration(str(path))
    assert [one.replace(str(path), "c.xml").replace(": not known, and left aside", "") for one in found.unknown] == [
        "c.xml, line 2, column 20: element <Deep>",
        "c.xml, line 4, column 13: Variables, attribute kind",
        "c.xml, line 5, column 40: element <Trigger>",
        "c.xml, line 5, column 20: Variable, attribute names",
        "c.xml, line 5, column 30: Variable, attribute unit",
        "c.xml, line 6, column 1: element <Group>",
    ]
    assert [one.uri for one in found.session.variables] == ["a"]


def test_namespaces_do_not_matter(tmp_path: Path) -> None:
    text = document().replace("<General", "<x:General").replace("<DataLoggerConfigDocument>", (
        '<DataLoggerConfigDocument xmlns:x="http://x" xmlns="http://www.phoenixcontact.com/schema/dataloggerconfig">'
    ))  # fmt: skip
    assert session_of(tmp_path, text).name == "n"


@pytest.mark.parametrize("name", ["genuine-5min.config.xml", "vendor-example.dl.config", "every-attribute.config.xml"])
def test_what_is_written_is_read_as_the_same(tmp_path: Path, name: str) -> None:
    session = read_configuration(str(FOLDER / name)).session
    again = session_of(tmp_path, written(session, [one.uri for one in session.variables]))
    assert told(again) == told(session)
    assert [one.uri for one in again.variables] == [one.uri for one in session.variables]


def test_all_mistakes_are_told_up_to_ten(tmp_path: Path) -> None:
    path = tmp_path / "c.xml"
    wrong = 'deleteRatio="130" rollover="maybe" tsfmt="Iso" maxfilesize="1"'
    path.write_text(configuration(["a/b", "a/b"], 'bufferCapacity="0"', wrong), encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(str(path))
    told = [caught.value, *caught.value.others]
    assert [one.what.partition(": ")[0].rpartition(" ")[2] for one in told] == [
        "bufferCapacity", "deleteRatio", "rollover", "tsfmt", "maxfilesize", "name"
    ]  # fmt: skip
    assert all(one.where.startswith(f"{path}, line 1, column ") for one in told)
    assert str(caught.value).count("c.xml, line 1") == len(told)
    path.write_text(configuration(["a/b"] * 13), encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(str(path))
    assert [one.what for one in caught.value.others[-1:]] == ["and 2 more mistakes"]
    assert len(caught.value.others) == 10


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"<a", ["no well-formed XML", "Correct the file there"]),
        (
            b"\xd4\xc3\xb2\xa1" + bytes(40),
            ["this is no configuration of a DataLogger: ", "Name an XML file"],
        ),
        (None, ["cannot be read", "Check the path of the configuration."]),
    ],
)
def test_what_is_no_configuration_is_not_sent_back_for_export(
    content: bytes | None, told: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "nothing-like-it"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(str(path))
    assert all(part in str(caught.value) for part in told), str(caught.value)
