"""What a project says of DataLoggers: which variable of a list a variable of a session is, and which list a task."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from nvscope.errors import ConfigurationError
from nvscope.toml_table import TEXT, Place, ValueKind, key, mapping


def _texts(value: Any, place: Place) -> tuple[tuple[str, str], ...]:
    return tuple(mapping(TEXT).read(value, place).items())


@dataclass(frozen=True, slots=True)
class DataLoggerSettings:
    """What ``[datalogger]`` says: pairs of names; ``place`` is where, None where no file says it."""

    variables: tuple[tuple[str, str], ...] = key(
        ValueKind("table of text", _texts),
        "variables of lists by those of a DataLogger's configuration, where names do not tell: "
        '"Arp.Plc.Eclr/Prg1.Speed" = "axis:fSpeed"; a list is called as in --list',
        default=(),
    )
    tasks: tuple[tuple[str, str], ...] = key(
        ValueKind("table of text", _texts),
        'lists by tasks of the controller: Cyclic100 = "axis"',
        default=(),
    )
    place: Place | None = field(default=None, compare=False)

    def task_of(self, variable: str) -> str | None:
        """Return the task that stands in a full name, in front of the last part; None where it is none."""
        front = variable.rpartition("/")[0].rpartition("/")[2]
        return front if any(front == task for task, _ in self.tasks) else None

    def mistake(self, table: str, name: str, what: str, next_step: str, otherwise: str = "") -> ConfigurationError:
        """Return the error that something is wrong behind a name of a table; ``otherwise`` is where, without a file."""
        if self.place is None:
            return ConfigurationError(what, where=otherwise, next_step=next_step)
        return self.place.below(table).below(name).error(what, next_step)
