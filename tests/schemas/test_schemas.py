"""The schemas of the package: in step with the program, true of all that it writes, and of nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any, get_args

import pytest
from jsonschema import Draft202012Validator

from nvscope.plc.parameter.document import Verdict
from nvscope.plc.visu.document import Verdict as VisuVerdict
from tests.laws import in_full
from tests.once import made_once
from tests.report_laws import broken_laws
from tests.schemas.asked_parameters import documents_of_parameters
from tests.schemas.asked_visu import documents_of_visu
from tests.schemas.corpus import (
    COMMANDS,
    ODD_COMMANDS,
    SCENARIOS,
    WATCHED,
    asked,
    odd_plant,
    of_nothing,
    of_scenario,
    watched,
)
from tests.schemas.documents import (
    BINARY,
    FOLDER,
    PROMISED,
    SCHEMAS,
    binding,
    file_text,
    path_of,
    promised,
    promised_with,
    told_of,
)
from tests.schemas.paths import Told, paths_of, seen_in, type_of
from tests.schemas.shapes import title_of
from tests.schemas.validation import is_valid, mistakes_in

EACH = pytest.mark.parametrize("name", SCHEMAS)
AGAIN = "run `python -m tests.schemas`"
PACKAGE = FOLDER.parent


@pytest.mark.parametrize("name", [*SCHEMAS, *BINARY])
def test_files_are_in_step_with_the_tables_of_the_program(name: str) -> None:
    schema = (SCHEMAS | BINARY)[name]()  # type: ignore[operator]
    Draft202012Validator.check_schema(schema)
    assert path_of(name).read_text(encoding="utf-8") == file_text(schema), AGAIN


def test_every_document_of_the_program_has_a_schema_and_no_other_does() -> None:
    sources = (path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    written = {name for text in sources for name in re.findall(r"\bnvscope\.[a-z-]+/\d+", text)}
    assert written == set(map(title_of, [*SCHEMAS, *BINARY]))
    assert {*SCHEMAS, *BINARY} == {path.stem for path in FOLDER.glob("*.json")}


@pytest.mark.parametrize("command", COMMANDS)
def test_what_commands_print_is_valid(command: str) -> None:
    assert mistakes_in(asked(command)) == []


@pytest.mark.parametrize("command", ODD_COMMANDS)
def test_what_commands_print_about_an_odd_plant_is_valid(command: str) -> None:
    assert mistakes_in(asked(command, odd_plant())) == []


@pytest.mark.parametrize("command", WATCHED)
def test_each_line_of_what_is_watched_is_valid(command: str) -> None:
    lines = watched(command)
    assert len(lines) > 1
    assert [mistake for line in lines for mistake in mistakes_in(line)] == []


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith("report ")])
def test_what_reports_tell_agrees_with_itself(command: str) -> None:
    assert broken_laws(asked(command)) == []


@pytest.mark.parametrize("command", [command for command in ODD_COMMANDS if command.startswith("report ")])
def test_what_reports_tell_about_an_odd_plant_agrees_with_itself(command: str) -> None:
    assert broken_laws(asked(command, odd_plant())) == []


@pytest.mark.parametrize("path", SCENARIOS, ids=[path.stem for path in SCENARIOS])
def test_what_is_told_of_scenarios_is_valid(path: Path) -> None:
    truth, report = of_scenario(path)
    assert mistakes_in(truth) == mistakes_in(report) == []
    assert broken_laws(report) == []


@made_once
def of_parameters() -> tuple[dict[str, Any], ...]:
    return tuple(documents_of_parameters())


def test_what_is_told_of_parameters_is_valid() -> None:
    assert [mistakes_in(document) for document in of_parameters()] == [[]] * len(of_parameters())
    told = {document["outcome"] for document in of_parameters()}
    assert told == set(get_args(Verdict)) - {"cancelled", "busy"}


@made_once
def of_visu() -> tuple[dict[str, Any], ...]:
    return tuple(documents_of_visu())


def test_what_is_told_of_a_webvisu_is_valid() -> None:
    assert [mistakes_in(document) for document in of_visu()] == [[]] * len(of_visu())
    assert {document["outcome"] for document in of_visu()} == set(get_args(VisuVerdict)) - {"cancelled"}


@made_once
def corpus() -> tuple[dict[str, Any], ...]:
    """Return all documents; whoever changes one changes a copy."""
    printed = (asked(command) for command in COMMANDS)
    odd = (asked(command, odd_plant()) for command in ODD_COMMANDS)
    lines = (line for command in WATCHED for line in watched(command))
    others = of_nothing(), *of_parameters(), *of_visu()
    return (*printed, *odd, *lines, *others, *(document for path in SCENARIOS for document in of_scenario(path)))


def name_of(document: Mapping[str, Any]) -> str:
    return str(document["schema"]).removeprefix("nvscope.").partition("/")[0]


UNSEEN = {
    "check/capture.drops null": "what is captured where nobody counts drops",
    "check/capture.drops_by null": "the same",
    "check/capture.drops_by.queue integer": "what is captured live",
    "check/capture.drops_by.ring integer": "the same",
    "report/capture.drops null": "what is captured where nobody counts drops",
    "report/capture.drops_by null": "the same",
    "report/capture.drops_by.queue integer": "what is captured live",
    "report/capture.drops_by.ring integer": "the same",
    "report/capture.until_ns string": "the same",
    "report/logged_hops[].from.value null": "a list whose last value is no finite number",
    "report/evidence_left_out integer": "what has hundreds of thousands of events",
    "report/findings[].parts[].extent number": "many identifiers of one channel that are irregular",
    "report/findings[].parts[].subindex null": "many lists of one channel with incomplete cycles",
    "diff/only_a[].id null": "a list of many whose file does not tell it",
    "diff/only_b[].id null": "the same",
    "report/lists[].diag.tLastReceive null": "a list of which nothing was received but that it could not be delivered",
    "truth/lists[].diag.tLastReceive null": "the same",
    "watch/transactions[].writes null": "more than a thousand pairs",
    "watch/transactions[].last_write.variables[].value null": "more writes of parameters than are kept",
    "watch/at_ns null": "what is watched live before anything came",
    "watch/drops null": "what is captured where nobody counts drops",
    "watch/until_ns null": "a capture of less than a second",
    "watch/causes_new[].since_ns null": "a cause without a beginning, as of a list that never came",
    "watch/causes_ended[].since_ns null": "the same",
    "watch/causes_ended[].instead string": "a cause that what followed has shown to be another one",
    "watch/causes_ended[].until_ns null": "a cause that what followed has shown to be none",
    **{
        f"truth/buses[].designed.errors.{name} integer": "scenarios do not have all errors of the table"
        for name in ("lost-arbitration", "no-acknowledgement", "protocol", "transceiver", "tx-timeout")
    },
}
"""What may be written, and is nowhere in these documents."""
AS_IN_REPORTS = "captures-diff/a.", "captures-diff/b."
"""What is made by what makes it for reports."""

BY_CHANCE = {
    "doctor/places[].failure string": "where nobody may listen, or an interface of another test just went away"
}
"""What this machine decides at this moment."""


@pytest.mark.long
def test_schemas_allow_no_more_than_what_is_written() -> None:
    seen: dict[str, dict[str, set[str]]] = {name: {} for name in SCHEMAS}
    for document in corpus():
        for path, value in seen_in(document):
            seen[name_of(document)].setdefault(path, set()).add(type_of(value))
    never = {
        f"{name}/{path} {kind}"
        for name in SCHEMAS
        for path, told in paths_of(SCHEMAS[name]()).items()
        for kind in told.types
        if not seen[name].get(path, set()) & ({"integer", "number"} if kind == "number" else {kind})
        and not f"{name}/{path}".startswith(AS_IN_REPORTS)
    }
    assert never - set(BY_CHANCE) == set(UNSEEN)


WRONG = {"null": None, "boolean": True, "integer": 7, "number": 0.5, "string": "?", "array": [None], "object": {"?": 0}}
"""A value of each type that no place of a document has."""


def shortened(value: Any) -> Any:
    """Return a document with the first two of each of its lists; rows of three values are whole."""
    if isinstance(value, Mapping):
        return {key: shortened(item) for key, item in value.items()}
    return [shortened(item) for item in value[: 2 + (len(value) == 3)]] if isinstance(value, list) else value


def places_in(value: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield each place of a document: its path, and the object or list and the key or index where it is."""
    below = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    for key, item in list(below):
        deeper = f"{path}[]" if isinstance(value, list) else f"{path}.{key}" if path else key
        yield deeper, value, key
        yield from places_in(item, deeper)


def wrong_values(told: Told, value: Any) -> Iterator[Any]:
    for kind, wrong in WRONG.items():
        if kind not in told.types and not (kind == "integer" and "number" in told.types):
            yield wrong
    if told.words and isinstance(value, str):
        yield f"{value}?"


def still_valid(document: dict[str, Any], done: set[str]) -> Iterator[str]:
    """Change each place of a document that is not done yet, and yield the changes that no schema minds."""
    name = name_of(document)
    for key in document:
        # Beside what is changed, other lists are only there to be gone through again and again.
        alone = {other: [] if isinstance(value, list) and other != key else value for other, value in document.items()}
        around = alone if is_valid(alone, name) else document
        yield from _still_valid_in(around, key, paths_of(SCHEMAS[name]()), done)


def _still_valid_in(document: dict[str, Any], part: str, told: Mapping[str, Told], done: set[str]) -> Iterator[str]:
    name = name_of(document)
    for path, holder, key in places_in({part: document[part]}):
        if path in done:
            continue
        done.add(path)
        holder = document if path == part else holder  # noqa: PLW2901
        value = holder[key]
        for wrong in wrong_values(told[path], value):
            holder[key] = wrong
            if is_valid(document, name):
                yield f"{path} = {wrong!r}"
        holder[key] = value
        if isinstance(holder, dict) and not told[path].optional:
            kept = dict(holder)
            del holder[key]
            if is_valid(document, name):
                yield f"without {path}"
            holder.clear()
            holder.update(kept)
        if isinstance(value, dict):
            value["unknown key"] = 1
            if is_valid(document, name):
                yield f"{path} with a key that nobody knows"
            del value["unknown key"]


@pytest.mark.long
@EACH
def test_what_is_changed_is_not_valid(name: str) -> None:
    documents = [shortened(document) for document in corpus() if name_of(document) == name]
    chosen = sorted(documents, key=lambda document: -len({path for path, _ in seen_in(document)}))[:2]
    done = set[str]()
    for document in chosen:
        if in_full():  # what has the same path may be of another kind here
            done.clear()
        assert mistakes_in(document) == []
        before = deepcopy(document)
        assert list(still_valid(document, done)) == []
        assert document == before
        assert not is_valid({**document, "unknown key": 1}, name)
        assert not is_valid({**document, "schema": f"nvscope.{name}/0"}, name)


def test_what_was_promised_is_there() -> None:
    schemas = {name: make() for name, make in SCHEMAS.items()}
    now = told_of(schemas)
    for path, told in binding(promised(), schemas).items():
        assert path in now, f"{path} was promised"
        assert now[path].types <= told.types, f"{path} was promised to be {told.types}"
        assert now[path].words >= told.words, f"{path} was promised to have {told.words}"
        assert told.optional or not now[path].optional, f"{path} was promised to be there always"


def test_all_that_is_there_is_promised() -> None:
    now = {name: make() for name, make in SCHEMAS.items()}
    assert PROMISED.read_text(encoding="utf-8") == promised_with(promised(), now), AGAIN
