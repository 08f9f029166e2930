"""The diagnosis: all results, and the one line that answers the question."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from nvscope.doctor.case import Case
from nvscope.doctor.checks import CHECKS, Where
from nvscope.doctor.result import Result, State
from nvscope.doctor.telegrams import TELEGRAMS, told_of
from nvscope.units import duration
from nvscope.version import head

SCHEMA = "nvscope.doctor/1"
_FIRST = "set right what stands above, and ask once more"


class Diagnosis(Struct, frozen=True):
    """``results`` are those of all checks that apply, in the order of the table; ``not_told`` the names of the others.

    ``state`` is that of the whole: no problem, a problem although telegrams come, or nothing.
    """

    verdict: str
    state: State
    results: Sequence[Result]
    not_told: Sequence[str]
    case: Case

    @property
    def problems(self) -> Sequence[Result]:
        return [one for one in self.results if one.state is State.PROBLEM]


def diagnose(case: Case) -> Diagnosis:
    """Judge a case by all checks; of a file, by those that look at traffic."""
    applying = [check for check in CHECKS if case.machine is not None or check.where is Where.TRAFFIC]
    results = [result for check in applying for result in check.judge(case)]
    if any(one.state is State.PROBLEM and one.check != TELEGRAMS for one in results):
        results = [replace(one, next_step=_FIRST) if _is_silence(one) else one for one in results]
    state = State.PROBLEM if any(one.state is State.PROBLEM for one in results) else State.OK
    names = {check.name for check in applying}
    not_told = [check.name for check in CHECKS if check.name not in names]
    return Diagnosis(_verdict(case, results), state, results, not_told, case)


def _is_silence(one: Result) -> bool:
    return one.check == TELEGRAMS and one.state is State.PROBLEM


def _verdict(case: Case, results: Sequence[Result]) -> str:
    while_told = f" in {duration(case.listened_ns)}" if case.listened_ns else ""
    comma = "," if while_told else ""
    reasons = [one.brief for one in results if one.state is State.PROBLEM and one.check != TELEGRAMS and one.brief]
    if case.heard:
        told = f"{told_of(case, case.heard)}{comma}{while_told}"
        return f"Telegrams come: {told}" + (f"; but {reasons[0]}" if reasons else "")
    what = f"No telegram on {case.expected.told_ports}{while_told}"
    if reasons:
        return f"{what}: {reasons[0]}"
    return f"{what}, and nothing of {'this machine' if case.machine else 'the file'} explains it"


def document(found: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis as data (schema ``nvscope.doctor/1``)."""
    case = found.case
    return {
        **head(SCHEMA),
        "verdict": found.verdict,
        "state": found.state.value,
        "live": case.machine is not None,
        "listened_ns": case.listened_ns,
        "expected": {
            "ports": list(case.expected.ports),
            "lists": [str(key) for key in case.expected.lists],
            "groups": list(case.expected.groups),
        },
        "places": [
            {
                "name": place.name,
                "sees_all": place.sees_all,
                "frames": case.traffic.frames[number],
                "drops": place.dropped,
                "failure": place.failure or None,
            }
            for number, place in enumerate(case.places)
        ],
        "telegrams": sum(times for flow, times in case.heard),
        "left_out": case.traffic.left_out,
        "results": [
            {
                "check": one.check,
                "state": one.state.value,
                "about": one.about or None,
                "seen": one.seen,
                "next": one.next_step or None,
            }
            for one in found.results
        ],
        "not_told": list(found.not_told),
    }
