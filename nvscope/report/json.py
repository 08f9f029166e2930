"""The report for programs: JSON of schema ``nvscope.report/1``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what tables for people need takes longer to import than a small report to write
    from nvscope.report.content import Report


def render(report: Report) -> str:
    """Return the report as indented JSON in the order given, ending with a line break.

    Plain printable ASCII, whatever the texts hold: what else there is in them is written as JSON escapes. ValueError
    for a number that JSON does not know.
    """
    text = json.dumps(report, indent=2, ensure_ascii=True, allow_nan=False)
    return text.replace("\x7f", "\\u007f") + "\n"
