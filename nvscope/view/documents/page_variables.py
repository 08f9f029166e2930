"""Variables of WebVisu pages as rows of documents.

``list`` is ``visu/`` and the address of the controller, which is the ``sender``; ``telegrams`` are the replies that
have a value, and confirmed writes. ``place`` is where it lies.
"""

from __future__ import annotations

from typing import Any

from nvscope.tracker.visu.variables import PageVariable
from nvscope.view.documents.read_variables import RowShape


def _whence(variable: PageVariable) -> dict[str, Any]:
    return {"sender": variable.sender}


def _further(variable: PageVariable) -> dict[str, Any]:
    return {"place": variable.place}


PAGE_ROWS = RowShape("telegrams", _whence, _further, may_fail=True, never="not readable")
