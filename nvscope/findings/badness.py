"""Which of several findings of one kind is the worst, where one of them is shown for all."""

from __future__ import annotations

import re

from nvscope.findings.loss import TELEGRAM_GAP
from nvscope.findings.timing import JITTER

_FIGURE_FIRST = {TELEGRAM_GAP.code, JITTER.code}
"""What these say has first the figure that tells how bad it is: telegrams lost, percent of jitter."""

_FIGURE = re.compile(r"\d+(?: \d{3})*(?:\.\d+)?")


def badness(code: str, message: str, count: int) -> float:
    """Return a number that is larger the worse a finding of a kind is: what was lost, the jitter, else its events."""
    figure = _FIGURE.search(message) if code in _FIGURE_FIRST else None
    return float(figure[0].replace(" ", "") if figure else count)
