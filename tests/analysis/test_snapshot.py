"""A snapshot is a value: whoever holds one can change nothing in it, and nothing that happens later does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from msgspec import Struct

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.snapshot import snapshot
from nvscope.definition.project import Project
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.list_key import ListKey
from nvscope.tracker.counted import Counted
from nvscope.tracker.state import TrackerState
from tests.packets import Batches, cut
from tests.simulate.simulation import simulated

CAPTURES = Path(__file__).parents[2] / "captures"
SCENARIOS = sorted((Path(__file__).parents[1] / "scenarios").glob("*.toml"))


def changeable(value: Any, path: str) -> Iterator[str]:
    """Yield the places in a value that somebody could change."""
    if isinstance(value, Counted):
        return  # a copy of the state's columns that nobody else has
    if is_dataclass(value):
        if not value.__dataclass_params__.frozen:  # type: ignore[attr-defined]
            yield path
        for field in fields(value):
            yield from changeable(getattr(value, field.name), f"{path}.{field.name}")
    elif isinstance(value, Struct):
        if not value.__struct_config__.frozen:
            yield path
        for name in value.__struct_fields__:
            yield from changeable(getattr(value, name), f"{path}.{name}")
    elif isinstance(value, MappingProxyType):
        for key, own in value.items():
            yield from changeable(own, f"{path}[{key!r}]")
    elif isinstance(value, tuple | frozenset):
        for place, own in enumerate(value):
            yield from changeable(own, f"{path}[{place}]")
    elif isinstance(value, np.ndarray):
        if value.flags.writeable:
            yield path
    elif not isinstance(value, int | float | str | bytes | Enum | ListKey | type(None)):
        yield f"{path}: {type(value).__name__}"


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_nothing_in_it_can_be_changed(path: Path) -> None:
    state, batches = TrackerState(), simulated(path).batches
    for _ in run(Batches(batches, simulated(path).channels), Reading(), [state]):
        pass
    assert list(changeable(snapshot(state, Batches([]), Project(), figures=True), "snapshot")) == []


@pytest.mark.parametrize("name", ["plant.pcapng.gz", "can/press.log"])
def test_what_happens_later_changes_nothing_in_it(name: str) -> None:
    """Looks at each of some moments are the same, made then or looked at in the end."""
    inquiry, state = Inquiry([str(CAPTURES / name)]), TrackerState()
    source = inquiry.open()
    batches = [part for batch in source for part in cut(batch, 100)]
    looks, texts = [], []
    for _ in run(Batches(batches, source.channels), inquiry.reading(), [state]):
        looks.append(snapshot(state, source, Project(), figures=True))
        texts.append((repr(looks[-1]), looks[-1].figures and repr(looks[-1].figures.summary())))
    assert len(looks) > 3
    assert [(repr(look), look.figures and repr(look.figures.summary())) for look in looks] == texts
