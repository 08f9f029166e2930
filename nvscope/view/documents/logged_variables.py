"""Variables of databases as rows of documents: ``list`` is ``db/`` and the name of the file or series of files.

Nobody sent them: ``rows`` are those that have a value.
"""

from __future__ import annotations

from typing import Any

from nvscope.tracker.datalogger.variables import DatabaseVariable
from nvscope.view.documents.read_variables import RowShape


def _nothing(variable: DatabaseVariable) -> dict[str, Any]:
    return {}


LOGGED_ROWS = RowShape("rows", _nothing, _nothing, may_fail=False, never="no value")
