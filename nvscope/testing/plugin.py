"""The plugin of pytest: the fixture ``nvcapture``, and files of rules as tests.

A file of rules is collected where pytest is told on which captures (``nvscope_captures`` in its configuration, or
``--nvcapture``): each rule is a test, marked ``nvrules``.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # every run of pytest loads this file, whether it tests a plant or not
    from nvscope.check.deciding import Decided
    from nvscope.check.rules import Rules
    from nvscope.check.run import Checked
    from nvscope.testing.assertions import UnderTest

_SUFFIX = ".rules.toml"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what tells on which captures rules are judged."""
    group = parser.getgroup("nvscope", "captures of network variables")
    group.addoption(
        "--nvcapture", action="append", default=[], metavar="FILE",
        help="capture on which *.rules.toml are judged, and which nvcapture() is without a name; also several",
    )  # fmt: skip
    group.addoption(
        "--nvdefinitions", action="append", default=[], metavar="FILE",
        help="definition of variables for them; also several",
    )  # fmt: skip
    parser.addini("nvscope_captures", "captures on which *.rules.toml are judged, as patterns of files", type="paths")
    parser.addini("nvscope_definitions", "definitions of variables for them, as patterns of files", type="paths")
    parser.addini("nvscope_project", "nvscope.toml for them", default="")


def pytest_configure(config: pytest.Config) -> None:
    """Tell of the marker."""
    config.addinivalue_line("markers", "nvrules: rules about captures of network variables, from *.rules.toml")


class NvCapture:
    """Opens captures for tests: ``nvcapture("press.pcapng", definitions="axis.gvl")``."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def __call__(self, captures: Any = None, definitions: Any = None, *, project: Any = None) -> UnderTest:
        """Return captures of which something can be asserted; without a name, those that pytest was told."""
        from nvscope.testing.assertions import under_test

        if captures is None:
            told = _captures(self._config)
            if not told:
                pytest.fail("nvcapture() needs a capture: name one, or run pytest with --nvcapture FILE", pytrace=False)
            return _told_under_test(self._config)
        return under_test(captures, definitions, project=project)

    def assert_list(self, name: str | int, /, **checks: Any) -> None:
        """Assert checks of one list on the captures that pytest was told."""
        __tracebackhide__ = True
        self().assert_list(name, **checks)


@pytest.fixture
def nvcapture(request: pytest.FixtureRequest) -> NvCapture:
    """Captures of network variables, of which a test asserts what it needs."""
    return NvCapture(request.config)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> RuleFile | None:
    """Collect a file of rules, where captures are told."""
    if file_path.name.endswith(_SUFFIX) and _captures(parent.config):
        collected: RuleFile = RuleFile.from_parent(parent, path=file_path)
        return collected
    return None


class RuleFile(pytest.File):
    """A file of rules, judged once on the captures."""

    _found: Checked | None = None
    _rules: Rules

    def collect(self) -> Iterator[RuleItem]:
        from nvscope.check.rules import Mistakes, read_rules

        try:
            self._rules = read_rules([str(self.path)])
        except Mistakes as error:
            raise self.CollectError("\n".join(map(str, error.mistakes))) from None
        from nvscope.view.escape import visible

        for number, rule in enumerate(self._rules.rules):
            item: RuleItem = RuleItem.from_parent(self, name=visible(rule.id))
            item.number = number
            item.add_marker(pytest.mark.nvrules)
            yield item

    def found(self) -> Checked:
        """Return the verdicts of all rules."""
        if self._found is None:
            self._found = _told_under_test(self.config).check(self._rules)
        return self._found


class RuleItem(pytest.Item):
    """One rule: it passes where it is kept; where nobody can decide that, it fails too."""

    number: int

    def runtest(self) -> None:
        from nvscope.check.verdict import Verdict

        decided = self._decided()
        if decided.verdict is Verdict.PASS:
            return
        if decided.rule.severity == "error":
            raise RuleBroken
        warnings.warn(pytest.PytestWarning(self._told()), stacklevel=1)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Say why it is broken, with its margin; what else went wrong is told as pytest does."""
        from nvscope.errors import NvscopeError

        if isinstance(excinfo.value, RuleBroken):
            return self._told()
        if isinstance(excinfo.value, NvscopeError):
            return f"nvscope: {excinfo.value}"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        line = self._file()._rules.rules[self.number].line
        return self.path, line - 1 if line else None, f"rule {self.name}"

    def _file(self) -> RuleFile:
        assert isinstance(self.parent, RuleFile)
        return self.parent

    def _decided(self) -> Decided:
        return self._file().found().decided[self.number]

    def _told(self) -> str:
        from nvscope.testing.assertions import told_of

        return told_of(self._file().found(), self._decided())


class RuleBroken(Exception):
    """A rule of severity error is broken, or cannot be decided."""


def _told_under_test(config: pytest.Config) -> UnderTest:
    from nvscope.testing.assertions import under_test

    definitions = config.getoption("--nvdefinitions") or list(_matching(config.getini("nvscope_definitions")))
    project = config.getini("nvscope_project")
    found = config.rootpath / project if project else None
    return under_test(_captures(config), definitions or None, project=found)


def _captures(config: pytest.Config) -> list[str]:
    given: list[str] = config.getoption("--nvcapture") or list(_matching(config.getini("nvscope_captures")))
    return given


def _matching(patterns: Iterable[Path]) -> Iterator[str]:
    """Yield the files of patterns; one that has no pattern in it is a file, there or not."""
    for one in patterns:
        text = str(one)
        if any(sign in text for sign in "*?["):
            try:
                found = sorted(str(path) for path in Path(one.anchor).glob(str(one.relative_to(one.anchor))))
            except ValueError as error:
                raise pytest.UsageError(f"{text}: {error}") from None
            yield from found
        else:
            yield text
