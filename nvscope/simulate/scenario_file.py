"""Scenario files: TOML to a scenario that was checked, and the keys that one may have."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

from nvscope.simulate.check import check_scenario
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.telegram_faults import Selection
from nvscope.toml_table import Place, check_keys, document_table, read_table

MAX_FILE_BYTES = 1_000_000


def load_scenario(path: str | Path) -> Scenario:
    """Return the scenario of a TOML file; ConfigurationError names file and key of whatever is wrong."""
    place = Place(str(path))
    try:
        with Path(path).open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise place.error(f"the scenario cannot be read: {error.strerror}", "Check the name of the file.") from None
    if len(content) > MAX_FILE_BYTES:
        raise place.error(f"the scenario is larger than {MAX_FILE_BYTES} bytes")
    try:
        return read_scenario(content.decode("utf-8"), str(path))
    except UnicodeDecodeError as error:
        raise place.error(f"byte {error.start} is not UTF-8", "TOML files are UTF-8.") from None


def read_scenario(text: str, path: str = "scenario") -> Scenario:
    """Return the scenario of a TOML text; ``path`` is what messages call it."""
    place = Place(path)
    check_keys(text, place)
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise place.error(f"no TOML: {error}") from None
    scenario = replace(read_table(Scenario, table, place), path=path)
    check_scenario(scenario, place)
    return scenario


def document() -> str:
    """Return all keys of a scenario with type, default and meaning, as Markdown."""
    return document_table(Scenario, "Scenario") + "\n" + document_table(Selection, "Selection")
