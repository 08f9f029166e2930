"""How the tests are run: by all processors, what takes long first, and laws with some of their examples or with all.

``python -m pytest`` runs everything in parallel. ``--full`` tries laws with all their examples, and with others each
time. Files and tests that are named are run in one process.
"""

from __future__ import annotations

import gc
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from itertools import count
from pathlib import Path
from uuid import uuid4

import pytest
from hypothesis import HealthCheck, settings

from nvscope.cli.memory import look_for_cycles_seldom
from tests import once
from tests.laws import FULL_EXAMPLES

QUICK_EXAMPLES = 8
_FOLDERS = count()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--full", action="store_true", help="try laws with all their examples and seeds, not with some")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "long: takes seconds in one piece, and is begun before what takes less")
    # How long anything takes depends on who else works here, and is no law.
    untimed = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
    # The same examples wherever they are tried: what fails on a build server fails here.
    quick = settings(untimed, max_examples=QUICK_EXAMPLES, derandomize=True, database=None, print_blob=True)
    settings.register_profile("quick", quick)
    settings.register_profile("full", untimed, max_examples=FULL_EXAMPLES, derandomize=False, print_blob=True)
    settings.load_profile("full" if config.getoption("full") else "quick")
    if not hasattr(config, "workerinput") and config.getoption("testrunuid", None) is None:
        config.option.testrunuid = uuid4().hex


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        once.forget(config.getoption("testrunuid"))


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """Run single files here: whoever names them waits for no worker to start, and may stop in a debugger."""
    named = [Path(argument.split("::")[0]) for argument in config.args]
    if config.option.keyword or not any(path.is_dir() for path in named):
        return 0
    # Much of the time, tests wait: for what comes on a cable, for a screen, for the end of what was asked for.
    return (os.cpu_count() or 1) * 2


def pytest_sessionstart(session: pytest.Session) -> None:
    """Let each of several processes import another part of the tests first, which the others then find compiled."""
    number, several = (os.environ.get(name, "") for name in ("PYTEST_XDIST_WORKER", "PYTEST_XDIST_WORKER_COUNT"))
    if not several:
        return
    files = sorted(session.config.rootpath.glob("tests/**/test_*.py"))
    for path in files[int(number.removeprefix("gw")) :: int(several)]:
        name = ".".join(path.relative_to(session.config.rootpath).with_suffix("").parts)
        with suppress(Exception, pytest.skip.Exception):  # to be told when its turn comes
            import_module(name)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


def pytest_collection_finish() -> None:
    # Thousands of tests live as long as the run does: no look for garbage need go through them again.
    gc.collect()
    gc.freeze()
    look_for_cycles_seldom()


@pytest.fixture
def tmp_path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of a test's own, as pytest does, which looks for a name among those of all tests before."""
    name = re.sub(r"\W", "_", request.node.name)[:25]
    folder = tmp_path_factory.getbasetemp() / f"{name}-{next(_FOLDERS)}"
    folder.mkdir(mode=0o700)
    return folder


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Yield the folder of a file system of 64 kB; only root can mount one."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("mounts a small file system")
    folder = tmp_path / "small"
    folder.mkdir()
    if os.system(f"mount -t tmpfs -o size=64k tmpfs {folder} 2>/dev/null"):
        pytest.skip("no file system can be mounted here")
    try:
        yield folder
    finally:
        os.system(f"umount {folder}")
