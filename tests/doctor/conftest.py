"""Two hosts with a cable between them, for all tests of a file that leave them as they are."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.capture.live.network import Host
from tests.doctor.hosts import settled


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[Host, Host]]:
    """Two hosts that tests leave as they are."""
    with settled() as hosts:
        yield hosts
