"""A recording of each version of the format is read as it was when it was written."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.capture.mcap.format_version import FORMAT_VERSION
from nvscope.capture.open import open_source
from tests.capture.mcap.recordings import read

GOLDEN = Path(__file__).with_name("golden")
ORIGINAL = Path(__file__).parents[3] / "captures" / "interfaces.pcapng"


@pytest.mark.parametrize("version", range(1, FORMAT_VERSION + 1))
def test_each_version_is_read(version: int) -> None:
    path = GOLDEN / f"version-{version}.mcap"
    found, expected = read(path), read(ORIGINAL)
    assert found.packets == expected.packets
    assert found.channels == expected.channels
    assert found.info.comments == ((2, "first telegram after the restart of the press"),)
    assert (found.info.drops, found.info.truncation) == (expected.info.drops, None)
    assert [one.name for one in open_source([str(path)]).attachments] == ["press.gvl"]


def test_there_is_one_for_each_version() -> None:
    assert sorted(path.name for path in GOLDEN.iterdir()) == [
        f"version-{version}.mcap" for version in range(1, FORMAT_VERSION + 1)
    ]
