"""Whom nodes send their lists to, and whether a switch shows what is for one station alone."""

from __future__ import annotations

from nvscope.causes.case import Case


def hidden_by_switch(case: Case, node: int) -> str:
    """Return why nothing of a node may be seen although it sends, "" where that is not so.

    All that it sends goes to one station each, and nothing that these send to one station was ever seen: then the
    capture may be no mirror port, and a switch shows such frames only as long as it does not know where they belong.
    """
    receivers = case.unreached.receivers
    to = sorted(set().union(*(receivers.get((entry.number, node), ()) for entry in case.lists_of_node(node))))
    if not to or to[0] < 0 or any(one in case.last_acknowledgement_ns for one in to):
        return ""
    who = f"{case.address(to[0])} alone" if len(to) == 1 else "one station each"
    return f"what it sends is for {who}, and no answer of it was seen: is this capture at a mirror port?"
