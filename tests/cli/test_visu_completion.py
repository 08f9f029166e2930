"""What a shell proposes behind ``nvscope visu``: variables of the files that are named."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from nvscope.cli.completion import visu_variables

LIST = """<visualisation><variablelist>
<variable name="PLC_PRG.a">4,0,2,1</variable><variable name=".OUT0">2,0,0,0</variable>
</variablelist></visualisation>"""


def test_files_have_the_words(tmp_path: Path) -> None:
    (tmp_path / "plc_visu.xml").write_text(LIST)
    known = SimpleNamespace(params={"variables": [str(tmp_path / "plc_visu.xml")]})
    assert visu_variables(known, "") == ["PLC_PRG.a", ".OUT0"]
    assert visu_variables(known, "plc") == ["PLC_PRG.a"]


def test_without_them_there_are_none(tmp_path: Path) -> None:
    assert visu_variables(SimpleNamespace(params={"variables": None}), "") == []
    assert visu_variables(SimpleNamespace(params={"variables": [str(tmp_path / "none.xml")]}), "") == []
