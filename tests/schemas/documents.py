"""All schemas, by name: what stands in ``nvscope/schemas`` is written from here."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import nvscope.schemas
from nvscope.tracker.figures import FIGURES
from tests.schemas.asked_parameters import asked_parameters
from tests.schemas.asked_visu import asked_visu
from tests.schemas.audit import audit
from tests.schemas.check import captures_difference, check, rules
from tests.schemas.definitions import difference, doctor, explain, fields, layout, lint
from tests.schemas.packets import packets
from tests.schemas.paths import Told, paths_of
from tests.schemas.report import report
from tests.schemas.shapes import Schema
from tests.schemas.simulated import simulated_truth
from tests.schemas.variables import at, history, inference, last_values
from tests.schemas.watch import watch

FOLDER = Path(nvscope.schemas.__file__).parent

SCHEMAS: Mapping[str, Callable[[], Schema]] = {
    "report": report,
    "vars": last_values,
    "history": history,
    "at": at,
    "infer": inference,
    "layout": layout,
    "lint": lint,
    "diff": difference,
    "fields": fields,
    "explain": explain,
    "doctor": doctor,
    "truth": simulated_truth,
    "watch": watch,
    "check": check,
    "captures-diff": captures_difference,
    "audit": audit,
    "sdo": asked_parameters,
    "visu": asked_visu,
}

BINARY: Mapping[str, Callable[[], Schema]] = {"packets": packets, "rules": rules}
"""Of what no command prints: bytes whose layout is described, and files that people write."""


def path_of(name: str) -> Path:
    """Return the file of a schema."""
    return FOLDER / f"{name}.json"


def file_text(schema: Schema) -> str:
    """Return a schema as its file has it."""
    return json.dumps(schema, indent=2, ensure_ascii=True) + "\n"


PROMISED = Path(__file__).with_name("promised.txt")
"""What documents promise to those who read them: a line for each place, with its types and its words."""


def told_of(schemas: Mapping[str, Schema]) -> dict[str, Told]:
    """Return what all schemas say, by the names of documents and paths within them, and the units of figures."""
    units = {f"figure/{one.name}": Told(frozenset((one.unit or "text").split())) for one in FIGURES}
    return units | {
        f"{name}/{path}": told for name, one in schemas.items() for path, told in paths_of(one).items() if path
    }


def promised() -> dict[str, Told]:
    """Return what is promised."""
    return dict(Told.read(line) for line in PROMISED.read_text(encoding="utf-8").splitlines())


def binding(known: Mapping[str, Told], schemas: Mapping[str, Schema]) -> dict[str, Told]:
    """Return what still binds of what was promised: a schema with another number begins anew."""
    renewed = {
        name for name, one in schemas.items()
        if (said := known.get(f"{name}/schema")) is not None and one["title"] not in said.words
    }  # fmt: skip
    return {path: told for path, told in known.items() if path.partition("/")[0] not in renewed}


def promised_with(known: Mapping[str, Told], schemas: Mapping[str, Schema]) -> str:
    """Return the text of what is promised, with all that is new: places, and words of known ones."""
    now = told_of(schemas)
    bound = binding(known, schemas)
    joined = {**now, **{path: told.joined(now.get(path, told)) for path, told in bound.items()}}
    return "".join(f"{joined[path].line(path)}\n" for path in sorted(joined))
