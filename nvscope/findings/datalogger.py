"""NV95x: what is wrong with databases of DataLoggers. They are found by audits of such files, not in captures."""

from __future__ import annotations

from nvscope.findings.kind import FindingKind, Severity

LOSS_TOLD = FindingKind(
    "NV951",
    "loss-told",
    Severity.NOTE,
    meaning=(
        "A row behind the first has ConsistentDataSeries 0: the logger itself says that data was lost before it. What "
        "is there is right; what happened in between is not known. A row in which it is neither 0 nor 1, as loggers do "
        "not write it, says nothing of that; it is told under the same code as a warning."
    ),
    causes=(
        "the ring buffer was full before its rows were written: the SD card is too slow, or writeInterval too small",
        "deleting the oldest rows of a large file took too long (deleteRatio)",
        "of a recording from the network: telegrams were lost, or their list stopped",
        "neither 0 nor 1: the row was edited, or a program wrote it",
    ),
    next_steps=(
        "Raise bufferCapacity or writeInterval, or log fewer variables, less often.",
        "Of files beyond 10 MB: lower deleteRatio, or roll over to another file (rollover).",
    ),
    of_databases=True,
    judged=False,
)
LOSS_NOT_TOLD = FindingKind(
    "NV952",
    "loss-not-told",
    Severity.ERROR,
    meaning=(
        "Every value should be stored (storeChangesOnly is false), yet more than one and a half intervals lie between "
        "a row and the one before, and ConsistentDataSeries does not say so. Whoever takes the series for complete "
        "counts, averages and integrates wrongly. Of any table: where nothing but the row ids says that rows are "
        "missing, that is told under the same code as a warning."
    ),
    causes=(
        "the logger or the controller was stopped and started again: the series goes on in the same file",
        "rows were deleted, or several databases put together, by hand",
        "the clock of the controller was set forward",
        "samples were dropped where the logger does not notice it",
        "where nvscope logged: a cycle of a list without a Counter, as on CAN, did not come or could not be decoded; "
        "that its row is missing is true, whether it was lost nobody knows",
        "in the first row of x.db: a short closed file was not copied; no number tells that one is missing",
    ),
    next_steps=(
        "Compare the times with the controller's log of starts and downloads, and with its clock.",
        "Without --config the interval is the median of the table: name the configuration to judge by what was asked "
        "for.",
    ),
    of_databases=True,
    judged=False,
)
CHANGES_MISSED = FindingKind(
    "NV953",
    "changes-missed",
    Severity.ERROR,
    meaning=(
        "The change counter of a variable goes up by more than 1 from one stored value to the next: values in between "
        "are not in the database, and no row says that data was lost. Steps behind a loss that is told (NV951) are "
        "counted there."
    ),
    causes=(
        "rows were lost between the ring buffer and the file",
        "rows were deleted, or several databases put together, by hand",
        "in the first row of x.db: a short closed file was not copied; no number tells that one is missing",
    ),
    next_steps=(
        "Do not count or time changes of this variable around these rows.",
        "Raise bufferCapacity; write to a faster card, or into RAM.",
    ),
    of_databases=True,
    judged=False,
)
COUNTER_CORRUPT = FindingKind(
    "NV954",
    "counter-corrupt",
    Severity.ERROR,
    meaning=(
        "The change counter of a variable goes back, stands still while the value changes, or is no count, and the row "
        "is no restart. Where the counter behind a row goes on from the one before it as if that row had counted "
        "rightly, its counter alone is wrong, and no change is missing. A restart is a row in which every variable is "
        "stored and all counters are 0; what the logger does not know yet is NULL there, behind ConsistentDataSeries "
        "0. It is told under the same code as a note."
    ),
    causes=(
        "rows of several databases or sessions were put together",
        "the file was edited, or damaged in a way that SQLite does not notice",
        "an error of the logger's firmware, or of a program that writes such files",
    ),
    next_steps=(
        "Compare with the original file on the controller.",
        "Of restarts: compare with the controller's log of starts and downloads.",
    ),
    of_databases=True,
    judged=False,
)
CLOCK_SET = FindingKind(
    "NV955",
    "clock-set",
    Severity.WARNING,
    meaning=(
        "Timestamps run back from one row to a later one of the same task. Sorted by time, the rows have another order "
        "than that in which they were written, and durations across such a place are wrong."
    ),
    causes=(
        "the controller's clock was set back: by NTP, by hand, after a start without a battery",
        "rows of several databases were put together",
    ),
    next_steps=(
        "Synchronize the controller by NTP before logging starts.",
        "Order by rowid, not by Timestamp.",
    ),
    of_databases=True,
    judged=False,
)
MIXED_TIME = FindingKind(
    "NV956",
    "mixed-time",
    Severity.WARNING,
    meaning=(
        "Timestamps of one table are of several forms: raw numbers beside ISO texts, local times by their kind bits, "
        "or what is no time at all. Programs that read the column as one type sort and subtract it wrongly."
    ),
    causes=(
        "tsfmt was changed, and the logger went on in the same file",
        "a program that writes local time, where UTC is meant",
        "rows of several databases were put together",
    ),
    next_steps=("Begin a new file when tsfmt changes. Convert before you sort: nvscope reads both forms as UTC.",),
    of_databases=True,
    judged=False,
)
DOCUMENT_STYLE = FindingKind(
    "NV957",
    "document-style",
    Severity.NOTE,
    meaning=(
        "A row holds a counter without its value, or a value without its counter. The logger's document shows counters "
        "repeated beside unchanged values; controllers leave both NULL. Either can be read; queries for "
        "`_change_count IS NOT NULL` find more rows than there are changes."
    ),
    causes=("a program that writes as the document shows it", "recorded with `--document-style`", "edited rows"),
    next_steps=("Look for changes by the value, or by a counter that differs from the one before.",),
    of_databases=True,
    judged=False,
)
CHANGE_WITHOUT_CHANGE = FindingKind(
    "NV958",
    "change-without-change",
    Severity.NOTE,
    meaning=(
        "A value was stored as a change, and equals the one before. Nothing is lost; counts of changes are too high."
    ),
    causes=(
        "the value went there and back between two samples",
        "a real number changed by less than its column holds",
        "a program that stores every value in a table of changes",
    ),
    next_steps=("Compare neighbours where changes are counted.",),
    of_databases=True,
    judged=False,
)
SERIES_BROKEN = FindingKind(
    "NV959",
    "series-broken",
    Severity.ERROR,
    meaning=(
        "Files of a series are missing, overlap in time, or are damaged: `x.db.0`, `x.db.1` … and at the end `x.db` "
        "are one series. What such a file held is not in the audit, and values behind it begin unknown. That the "
        "newest closed file is missing, no number tells: it is where as much time as a file lasts lacks in front of "
        "`x.db`. That the oldest files are gone is as configured (maxFiles), and no finding."
    ),
    causes=(
        "the file was copied while the logger wrote it, or a transfer broke off",
        "power was lost, or the card pulled, while it was written",
        "files of several sessions or controllers lie in one folder",
    ),
    next_steps=(
        "Copy the file again from the controller: closed files (with a number) do not change any more.",
        "What SQLite can still find: `sqlite3 FILE .recover`.",
    ),
    of_databases=True,
    judged=False,
)
