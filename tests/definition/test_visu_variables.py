"""Variable lists of WebVisu pages: what public ones look like, and what is none."""

from __future__ import annotations

import pytest

from dissectors.webvisu import Place, is_password
from nvscope.definition.visu_variables import read_visu_variables, variables_in
from nvscope.errors import ConfigurationError

PAGE = """<?xml version="1.0" encoding="ISO-8859-1"?>

<visualisation>
	<time-stamp>1562759301,3496843729</time-stamp>
	<name>PLC_VISU</name>
	<element type="simple"><text-format><![CDATA[a|b]]></text-format></element>
	<variablelist>
		<variable name="PLC_PRG.sStraße">4,146,81,8</variable>
		<variable name="PLC_PRG.xToggle"> 4, 144,1,0</variable>
		<variable name="">4,1,1,0</variable>
		<variable name="PLC_PRG.x">4,1,1</variable>
		<variable>4,1,1,0</variable>
	</variablelist>
</visualisation>"""
SETTINGS = """<visu-ini-file><variablelist>
<variable name="CurrentPasswords[0]">4,524,21,8</variable><variable name=".CurrentUserLevel">4,522,2,1</variable>
</variablelist><receiptlist/></visu-ini-file>"""
SYMBOLS = """<SymbolTable><SymbolVarList>
<Var Type="INT" RefId="4" Offset="12" Access="ReadWrite">PLC_PRG.counter</Var>
<Var Type="bool" RefId="2" Offset="48">.OUT0</Var>
<Var Type="ARRAY" RefId="4" Offset="12">PLC_PRG.a</Var><Var Type="INT" RefId="x" Offset="12">PLC_PRG.b</Var>
</SymbolVarList></SymbolTable>"""


def test_a_page() -> None:
    found = read_visu_variables("plc_visu.xml", PAGE.encode("latin-1"))
    assert found.names == {Place(4, 146, 81, 8): "PLC_PRG.sStraße", Place(4, 144, 1, 0): "PLC_PRG.xToggle"}
    assert found.stamp == "1562759301,3496843729"


def test_settings_and_symbols() -> None:
    assert variables_in(SETTINGS.encode()).names == {
        Place(4, 524, 21, 8): "CurrentPasswords[0]",
        Place(4, 522, 2, 1): ".CurrentUserLevel",
    }
    assert variables_in(SYMBOLS.encode()).names == {Place(4, 12, 2, 1): "PLC_PRG.counter", Place(2, 48, 1, 0): ".OUT0"}


@pytest.mark.parametrize("content", [b"", b"|0|", b"<a>", b"<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", b"\x00\x01"])
def test_what_cannot_be_read_has_none_over_the_network_and_is_an_error_as_a_file(content: bytes) -> None:
    assert not variables_in(content).names
    with pytest.raises(ConfigurationError):
        read_visu_variables("plc_visu.xml", content)


@pytest.mark.parametrize(
    "name",
    ["CurrentPasswords[7]", ".CurrentPassword", "currentPASSWORD", "PLC.CurrentPassword", " .CurrentPassword ",
     ".CurrentPasswords [1]", ".CurrentPasswords[0, 1]"],
)  # fmt: skip
def test_passwords(name: str) -> None:
    assert is_password(name)


@pytest.mark.parametrize("name", [".CurrentUserLevel", "CurrentPasswordsX", "PLC_PRG.Password", "CurrentPasswords[x]"])
def test_no_passwords(name: str) -> None:
    assert not is_password(name)
