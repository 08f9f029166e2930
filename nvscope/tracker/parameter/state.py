"""ParameterState: the requests of the Parameter Manager, from the first one on that anybody sends.

Most plants have none: until then nothing of it is imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.netvar import PARAMETER_REQUESTS
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.told import Told

if TYPE_CHECKING:
    from nvscope.tracker.parameter.transactions import Transactions


class ParameterState:
    """What became of all requests, ``known``: None before there is any request, reply, or message about one."""

    SPLIT_BY: ClassVar = SplitBy.LIST  # of no list: all go to the first part

    def __init__(self) -> None:
        self.known: Transactions | None = None

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if self.known is None:
            if not is_spoken_of(told):
                return
            from nvscope.tracker.parameter.transactions import Transactions  # noqa: PLC0415

            self.known = Transactions()
        self.known.observe(told)

    def take(self, part: ParameterState, share: Share) -> None:
        """Take over what the first part has counted: it has all of it."""
        if not share.part:
            self.known = part.known


def is_spoken_of(told: Told) -> bool:
    """Tell whether a batch has anything of the Parameter Manager."""
    if not len(told):
        return False
    quoted = told.batch.quoted
    return bool(len(told.laid.parameters)) or (
        len(quoted) > 0 and bool(np.isin(quoted.header["id"], PARAMETER_REQUESTS).any())
    )
