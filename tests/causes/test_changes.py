"""Lists that change while they are sent: a download, and what is none."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from nvscope.definition.model import Definition
from nvscope.definition.project import Project
from tests.causes.plants import causes_in
from tests.definition.lists import INT, list_of
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.records import replace

MS = 1_000_000
OLD, NEW = (4, None), (5, None)  # items, checksum
SPEED = replace(list_of([INT, INT, INT, INT]), name="Speed")


def sent(*looks: tuple[int, int | None]) -> list[Frame]:
    """Return telegrams every 100 ms, of so many INTs and with such a checksum."""
    return [
        data_frame(
            number * 100 * MS, "10.0.0.1", "255.255.255.255",
            telegram(
                list_id=7, counter=number + 1, items=items, data=bytes([number % 256, *bytes(2 * items - 1)]),
                flags=0 if checksum is None else 2, checksum=checksum or 0,
            ),
        )
        for number, (items, checksum) in enumerate(looks)
    ]  # fmt: skip


def told(looks: Sequence[tuple[int, int | None]], directory: Path, *, defined: bool = False) -> list[tuple[str, ...]]:
    project = Project(definition=Definition((SPEED,))) if defined else None
    return [(cause.kind.name, cause.title, *cause.checked) for cause in causes_in(sent(*looks), directory, project)]


def test_another_shape_to_the_end(tmp_path: Path) -> None:
    assert told([OLD] * 50 + [NEW] * 60, tmp_path) == [
        ("definition-differs", "List 7 is another one since 5.0 s",
         "4 items in 28 bytes until 5.0 s, 5 items in 30 bytes since", "it held for 60 telegrams, 50 came before"),
    ]  # fmt: skip


@pytest.mark.parametrize("held", [1, 4])
def test_a_change_just_before_the_end_is_one(held: int, tmp_path: Path) -> None:
    ((kind, *_),) = told([OLD] * 50 + [NEW] * held, tmp_path)
    assert kind == "definition-differs"


def test_what_comes_once_between_is_none(tmp_path: Path) -> None:
    ((kind, *_),) = told([OLD] * 50 + [NEW] + [OLD] * 50, tmp_path)
    assert kind == "other"


def test_a_change_that_is_taken_back_is_over(tmp_path: Path) -> None:
    (cause,) = causes_in(sent(*[OLD] * 50, *[NEW] * 20, *[OLD] * 50), tmp_path)
    assert cause.until_ns == cause.since_ns + 2_000 * MS if cause.since_ns else False


def test_strings_at_their_actual_length_are_no_download(tmp_path: Path) -> None:
    looks = [(4 + number * 7 % 5, None) for number in range(90)]
    assert [kind for kind, *_ in told(looks, tmp_path)] == ["other"]


def test_another_checksum_tells_both(tmp_path: Path) -> None:
    ((kind, _, first, *_),) = told([(4, 0x31)] * 50 + [(4, 0x5A)] * 60, tmp_path)
    assert (kind, first) == ("definition-differs", "checksum 16#31 until 5.0 s, checksum 16#5A since")


def test_the_definition_is_of_one_of_both_sides(tmp_path: Path) -> None:
    ((*_, older),) = told([OLD] * 50 + [NEW] * 60, tmp_path, defined=True)
    assert older == "the definition is the older side: it fits what came until 5.0 s"
    ((*_, newer),) = told([NEW] * 50 + [OLD] * 60, tmp_path, defined=True)
    assert newer == "the definition is the newer side: it fits what comes since 5.0 s"
