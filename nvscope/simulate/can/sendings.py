"""Sendings of lists on CAN: where an observer could not tell them apart."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I32, I64, U32
from nvscope.simulate.ordering import order_by
from nvscope.simulate.scenario import Scenario


def check_sendings(scenario: Scenario, entry: I32, sending: I32, identifier: U32, ts_ns: I64) -> None:
    """Raise ConfigurationError where an observer could not tell the sendings of a list apart.

    That is where a PDO comes after one of a later sending, or where what is left of two sendings looks like one. The
    columns are those of ``CanFrames``, shape (n,), in the order of time.
    """
    order = order_by(entry.astype(np.int64) + 1)
    entry, sending, identifier, times = entry[order], sending[order], identifier[order], ts_ns[order]
    same = (entry[1:] == entry[:-1]) & (entry[1:] >= 0)
    half_ns = np.array([plan.interval_ns // 2 for plan in scenario.can_list] + [0], np.int64)[entry[1:]]
    step = np.diff(sending)
    near = np.diff(times) <= half_ns
    wrong = same & ((step < 0) | ((step > 0) & (np.diff(identifier.astype(np.int64)) > 0) & near))
    for place in np.flatnonzero(wrong)[:1].tolist():
        plan = scenario.can_list[int(entry[place])]
        raise scenario.error(
            f"can_list[{int(entry[place])}]",
            f"sendings {int(sending[place]) + 1} and {int(sending[place + 1]) + 1} of '{plan.name}' run into each "
            "other: no observer can tell them apart",
            "Leave more time between them, or set wild = true.",
        )
