"""Passwords of a controller by their bytes: what the client hides, and what the log of a served one does."""

from __future__ import annotations

from pathlib import Path

import pytest

from dissectors.webvisu import Place
from nvscope.definition.visu_variables import VisuVariables
from nvscope.plc.visu.controller import Controller
from nvscope.plc.visu.http_request import HttpRequest
from nvscope.plc.visu.log import request_row
from nvscope.plc.visu.variables import known_of, needs_names
from tests.plc.visu.peers import PAGE, table_of

PASSWORD = Place(4, 10, 21, 8)
TABLE = """
".CurrentPassword" = { address = "4,10,21,8", value = "geheim" }
"PRG.speed" = { address = "4,0,4,6", value = 1.5 }
"""


def test_a_variable_in_the_bytes_of_a_password_is_one_whatever_it_is_called() -> None:
    names = VisuVariables(listed=[("PRG.alias", Place(4, 30, 2, 1)), ("PRG.next", Place(4, 31, 2, 1))])
    known = known_of(
        [("plc_visu.xml", names), ("visu_ini.xml", VisuVariables(listed=[(".CurrentPassword", PASSWORD)]))]
    )
    secret = {one.name: one.is_secret for one in known.listed}
    assert secret == {"PRG.alias": True, "PRG.next": False, ".CurrentPassword": True}
    assert [known.find(word).is_secret for word in ("4,10,21,9", "4,8,4,5", "4,6,4,5")] == [True, True, False]


@pytest.mark.parametrize(("word", "needs"), [("4,10,21,9", True), ("4,10,21,11", True), ("4,10,4,5", False)])
def test_names_are_fetched_for_what_is_no_number(word: str, needs: bool) -> None:
    assert needs_names([word]) == needs


def test_the_log_of_a_served_controller_hides_them(tmp_path: Path) -> None:
    table = table_of(tmp_path, TABLE)
    handled = Controller(table).received(HttpRequest("POST", PAGE, b"|1|2|0|4|10|21|9|neues|1|4|0|4|6|2.5|"))
    row = request_row(handled, table.passwords, "10.0.0.1", 50_000, 0)
    assert [one["secret"] for one in row["variables"]] == [True, False]
    assert "neues" not in str(row)
