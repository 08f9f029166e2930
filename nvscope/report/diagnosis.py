"""The diagnosis structures of lists and nodes as a table, and the counters that count for them.

Takes parts of the report of schema ``nvscope.report/2``. As in ``content``, nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nvscope import units
from nvscope.tracker.figures import DIAGNOSIS
from nvscope.view.lines.plant.content import Clock, Row, nanoseconds
from nvscope.view.lines.plant.tables import UNKNOWN, count_cell, counts_nothing, error_name
from nvscope.view.lines.table import NO_BREAK, NOTHING, Cell, Tone

_IEC_TYPE = {16: "UINT", 32: "UDINT"}


def diagnosis_rows(diags: Sequence[Row], clock: Clock) -> list[list[Cell]]:
    """Return a NetVarUDPDiagStruct table: a row for each component, a column for each of ``diags``.

    Below times stand the IEC times since the start, below counters that have wrapped what the controller shows.
    """
    rows = []
    for counter in DIAGNOSIS:
        values = [diag[counter.name] for diag in diags]
        label = Cell(counter.name)
        below: list[Cell] = []
        if counter.unit == "time":
            times = [nanoseconds(value) for value in values]
            rows.append([label, *(_known(time, clock.moment, NOTHING) for time in times)])
            below = [Cell("  since start", Tone.FAINT), *(_known(time, clock.since_start, "") for time in times)]
        elif counter.width_bits:
            rows.append([label, *(UNKNOWN if value is None else count_cell(value) for value in values)])
            below = [Cell(f"  as {_IEC_TYPE[counter.width_bits]}", Tone.FAINT)]
            below += (_wrapped(value, 1 << counter.width_bits) for value in values)
        else:
            rows.append([label, *(UNKNOWN if value is None else error_name(value) for value in values)])
        if counter.name == "tLastError":  # of errors that nobody knows, nobody knows when the last one was
            told = zip(diags, rows[-1][1:], strict=True)
            rows[-1][1:] = [UNKNOWN if diag["nErrorCount"] is None else cell for diag, cell in told]
        if any(cell.text for cell in below[1:]):
            rows.append(below)
    return rows


def counter_parts(entry: Row) -> tuple[list[str], list[str]]:
    """Return the counters of a list that have counted, each with its number, and the names of those that have not."""
    counters = dict(entry["counters"])
    # Where they are believed, what the counters claim is what was lost.
    on_udp, claimed = entry["transport"] == "udp", counters.pop("lost_claimed")
    unknown = {name for name, number in counters.items() if number is None and on_udp}
    unknown |= {"lost"} if not claimed and counts_nothing(entry) else set()
    told = [
        f"{name}{NO_BREAK}{'?' if name in unknown else units.count(number)}"
        for name, number in counters.items()
        if number or name in unknown
    ]
    if "lost" in unknown and claimed is not None:
        told[0] += f" ({units.count(claimed)}{NO_BREAK}claimed)"
    return told, [name for name, number in counters.items() if not number and name not in unknown]


def _known(time_ns: int | None, told: Callable[[int], str], otherwise: str) -> Cell:
    return Cell(otherwise, Tone.FAINT) if time_ns is None else Cell(told(time_ns))


def _wrapped(number: int | None, modulus: int) -> Cell:
    return Cell(units.count(number % modulus) if number is not None and number >= modulus else "")
