"""Whom nodes send their lists to, and whether a switch shows what is for one station alone."""

from __future__ import annotations

import numpy as np

from nvscope.causes.case import Case
from nvscope.engine.keys import FrameKind
from nvscope.engine.runs import distinct


def hidden_by_switch(case: Case, node: int) -> str:
    """Return why nothing of a node may be seen although it sends, "" where that is not so.

    All that it sends goes to one station each, and nothing that these send to one station was ever seen: then the
    capture may be no mirror port, and a switch shows such frames only as long as it does not know where they belong.
    """
    flows = case.facts.state.lists.flows
    data = np.isin(flows.column("kind"), [FrameKind.DATA, FrameKind.MALFORMED_DATA])
    to = distinct(flows.column("destination")[data & (flows.column("source") == node)].astype(np.int64)).tolist()
    if not to or min(to) < 0 or any(one in case.last_acknowledgement_ns for one in to):
        return ""
    who = f"{case.address(to[0])} alone" if len(to) == 1 else "one station each"
    return f"what it sends is for {who}, and no answer of it was seen: is this capture at a mirror port?"
