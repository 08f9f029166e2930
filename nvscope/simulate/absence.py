"""Absence: frames that nobody sees, be it that their node is not there, or that the capture lacks them."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I32, I64, Bool
from nvscope.simulate.draft import Draft
from nvscope.simulate.incidents import PowerOff, Unplugged
from nvscope.simulate.noise import chance, noise_key
from nvscope.simulate.scenario import Scenario


def present_rows(draft: Draft, ts_ns: I64, template: I32) -> Bool:
    """Return which frames come from a node that has power and cable. Shapes (n,)."""
    scenario = draft.scenario
    present = np.ones(len(ts_ns), np.bool_)
    absences: list[PowerOff | Unplugged] = [*scenario.power_off, *scenario.unplugged]
    for absence in absences:
        address = draft.hosts[scenario.node_numbers[absence.node]].address
        own = np.array([entry.source == address for entry in draft.templates] or [False], np.bool_)
        gone = own[template] & (ts_ns >= absence.at_ns)
        if absence.until_ns is not None:
            gone &= ts_ns < absence.until_ns
        present &= ~gone
    return present


def captured_rows(scenario: Scenario, ts_ns: I64) -> Bool:
    """Return which frames the capture does not lack. Shapes (n,)."""
    captured = np.ones(len(ts_ns), np.bool_)
    for position, loss in enumerate(scenario.capture_loss):
        lacking = np.zeros(len(ts_ns), np.bool_)
        if loss.probability:
            key = noise_key(scenario.seed, "capture loss", position)
            lacking = chance(key, np.arange(len(ts_ns)), loss.probability)
        for moment in loss.at:
            lacking |= (ts_ns >= moment) & (ts_ns < moment + loss.lasting_ns)
        lacking &= ts_ns >= loss.from_ns
        if loss.until_ns is not None:
            lacking &= ts_ns < loss.until_ns
        captured &= ~lacking
    return captured
