"""What was asked of the Parameter Manager, and what came of it, as data (schema ``nvscope.sdo/1``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from msgspec import Struct

from dissectors.netvar import Service
from nvscope.definition.variables import Scalar, type_text
from nvscope.plc.parameter.conversation import Ending, Ignored, Outcome
from nvscope.plc.parameter.value import value_row
from nvscope.version import head
from nvscope.view.value_texts import unit_of

if TYPE_CHECKING:
    from nvscope.definition.variables import Type

_SCHEMA = "nvscope.sdo/1"

Verdict = Literal[
    "read", "written", "misfit", "differs", "unverified", "cancelled", "refused", "busy", "silent", "undelivered"
]
"""What came of it all: the first two are good. A misfit is no value of its type, an unverified one was written, but not
read back."""

_ENDED: dict[Ending, Verdict] = {
    Ending.REFUSED: "refused", Ending.BUSY: "busy", Ending.SILENT: "silent", Ending.UNDELIVERED: "undelivered",
}  # fmt: skip


class Parameter(Struct, frozen=True):
    """A parameter of a partner, and what is known of it; ``type`` is that of the value, or of its elements."""

    address: str
    port: int
    index: int
    subindex: int
    node_name: str = ""
    name: str = ""
    type: Type | None = None


def read_document(parameter: Parameter, outcome: Outcome) -> dict[str, Any]:
    """Return what came of a read."""
    value = _answered(parameter, outcome)
    verdict: Verdict = _ENDED.get(outcome.ending, "read")
    if value is not None and parameter.type is not None and value["elements"] is None:
        verdict = "misfit"
    return _document(parameter, "read", verdict, [outcome], value=value)


def write_document(
    parameter: Parameter, items: int, data: bytes, outcomes: Sequence[Outcome], *, cancelled: bool = False
) -> dict[str, Any]:
    """Return what came of a write: of the read before it, the write itself, and the read behind it, as far as it came.

    ``cancelled``: somebody did not want it when the value before was known.
    """
    before, after = _answered(parameter, outcomes[0]), None
    wanted = value_row(parameter.type, items, data)
    if cancelled:
        verdict: Verdict = "cancelled"
    elif len(outcomes) == 1 and before is not None:
        verdict = "misfit"
    else:
        verdict = _ENDED.get(outcomes[-1].ending, "written")
    if len(outcomes) > 2:
        after = _answered(parameter, outcomes[2])
        if after is None:
            # Who wrote it was told that it is written: of what can only be written, nobody can know more.
            verdict = "written" if _is_write_only(outcomes[2]) else "unverified"
        elif (after["items"], after["elements"]) != (items, wanted["elements"]):
            # By values: what is behind the end of a text may be anything.
            verdict = "differs"
    return _document(parameter, "write", verdict, outcomes, value=after, before=before, wanted=wanted)


def is_misfit(items: int, data: bytes, before: Outcome) -> bool:
    """Tell whether what a parameter holds has another size than what is to be written."""
    answer = before.answer
    return before.ending is Ending.REPLIED and answer is not None and (answer.items, len(answer.data)) != (
        items, len(data),
    )  # fmt: skip


def may_be_written(before: Outcome) -> bool:
    """Tell whether it is worth writing after a read: where that was answered, or refused for the access alone."""
    return before.ending is Ending.REPLIED or _is_write_only(before)


def _is_write_only(outcome: Outcome) -> bool:
    return (
        outcome.ending is Ending.REFUSED
        and outcome.answer is not None
        and outcome.answer.service == Service.ODErrorReplyAccess
    )


def _answered(parameter: Parameter, outcome: Outcome) -> dict[str, Any] | None:
    if outcome.ending is not Ending.REPLIED or outcome.answer is None:
        return None
    return value_row(parameter.type, outcome.answer.items, outcome.answer.data)


def _document(
    parameter: Parameter, verb: str, verdict: Verdict, outcomes: Sequence[Outcome], *,
    value: dict[str, Any] | None, before: dict[str, Any] | None = None, wanted: dict[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    return {
        **head(_SCHEMA),
        "verb": verb,
        "outcome": verdict,
        "partner": parameter.address,
        "partner_name": parameter.node_name or None,
        "port": parameter.port,
        "index": parameter.index,
        "subindex": parameter.subindex,
        "name": parameter.name or None,
        "type": type_text(parameter.type) if parameter.type else None,
        "unit": unit_of(parameter.type) if isinstance(parameter.type, Scalar) else None,
        "value": value,
        "before": before,
        "wanted": wanted,
        "exchanges": [_exchange(one) for one in outcomes],
    }


def _exchange(outcome: Outcome) -> dict[str, Any]:
    return {
        "request": outcome.request.service.name,
        "counter": outcome.request.counter,
        "ended": outcome.ending.value,
        "answer": outcome.answer.service.name if outcome.answer else None,
        "latency_ns": outcome.latency_ns,
        "transmissions": outcome.transmissions,
        "busy": outcome.busy,
        "undelivered": outcome.why or None,
        "ignored": {reason.value: outcome.ignored.get(reason, 0) for reason in Ignored},
        "others": list(outcome.others),
    }
