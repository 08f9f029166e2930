"""Second senders of a list that count along with its sender, as who wants to pass for it does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nvscope.simulate.scenario import Scenario

if TYPE_CHECKING:
    from nvscope.simulate.schedule import Writer


def count_along(scenario: Scenario, writers: Sequence[Writer], columns: Mapping[str, npt.NDArray[Any]]) -> None:
    """Let telegrams have the next Counter of the list's first sender, in the columns of a schedule.

    What is sent before that one has sent anything stays as it is.
    """
    first_second = len(writers) - len(scenario.second_sender)
    for second, writer in zip(scenario.second_sender, writers[first_second:], strict=True):
        if not second.counts_along:
            continue
        owner = next(one for one in writers if one.entry == writer.entry)
        for subindex in range(len(writer.shapes)):
            own, other = (np.flatnonzero(columns["stream"] == one.first_stream + subindex) for one in (writer, owner))
            last = np.searchsorted(columns["sent_ns"][other], columns["sent_ns"][own], "right") - 1
            own, last = own[last >= 0], last[last >= 0]
            columns["counter"][own] = columns["counter"][other][last] + np.uint16(1)
