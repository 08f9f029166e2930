"""``[webvisu]`` of the project file: further ports, and files with the names of variables."""

from __future__ import annotations

from pathlib import Path

import pytest

from dissectors.webvisu import Place
from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_project
from nvscope.errors import ConfigurationError
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of

PAGE = "<visualisation><variablelist><variable name='{name}'>4,144,1,0</variable></variablelist></visualisation>"


def project(folder: Path, told: str, **files: str) -> Project:
    for name, content in files.items():
        (folder / f"{name}.xml").write_text(content)
    path = folder / "nvscope.toml"
    path.write_text(f"[webvisu]\n{told}\n")
    return read_project(path)


def test_ports_and_names(tmp_path: Path) -> None:
    found = project(tmp_path, 'ports = 8081\nvariables = ["a.xml", "b*.xml"]', a=PAGE.format(name="PLC_PRG.x"),
                    b1=PAGE.replace("144", "146").format(name="PLC_PRG.y"))  # fmt: skip
    assert found.webvisu is not None
    assert found.webvisu.ports == (8081,)
    assert [(Path(one.file).name, one.controller, one.variables.names) for one in found.webvisu.lists] == [
        ("a.xml", "", {Place(4, 144, 1, 0): "PLC_PRG.x"}), ("b1.xml", "", {Place(4, 146, 1, 0): "PLC_PRG.y"}),
    ]  # fmt: skip


def test_nothing_is_said() -> None:
    assert read_project(None).webvisu is None


@pytest.mark.parametrize(
    ("told", "what"),
    [
        ("ports = 70000", "ports"),
        ('variables = "missing.xml"', "missing.xml"),
        ('variables = "none*.xml"', "no file is called 'none*.xml'"),
        ('variables = "empty.xml"', "lists no variables"),
        ("port = 80", "port"),
        (
            'controllers = { press = "a.xml" }',
            "column 1: webvisu.controllers.\"press\": 'press' is no IP address",
        ),
        ('[webvisu.controllers]\n"10.0.0.5" = 5', 'webvisu.controllers."10.0.0.5"'),
        ('[webvisu.controllers]\n"::ffff:10.0.0.5" = []\n"10.0.0.5" = []', "the controller 10.0.0.5 is there twice"),
        ('[webvisu.controllers]\n"10.0.0.5" = ["no*.xml"]', 'line 3, column 1: webvisu.controllers."10.0.0.5"[0]'),
    ],
)
def test_mistakes_are_told(tmp_path: Path, told: str, what: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        project(tmp_path, told, empty="<a/>")
    assert what in str(error.value)


def test_captures_are_read_so(tmp_path: Path) -> None:
    line = Line(server=("10.0.0.5", 8081)).open()
    body = b"|1|1|0|4|144|1|0|1|"
    line.ask(b"POST / HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
    batches = [batch_of(line.frames)]
    known = project(tmp_path, 'ports = 8081\nvariables = "a.xml"', a=PAGE.format(name="PLC_PRG.xToggle"))
    inquiry = Inquiry(Batches(batches), known)
    (row,) = inquiry.report(inquiry.analyze())["visu_writes"]
    assert (row["variable"], row["new"]) == ("PLC_PRG.xToggle", "1")
    without = Inquiry(Batches(batches))
    assert "visu" not in without.report(without.analyze())
