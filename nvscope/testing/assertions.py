"""Assertions on captures: the checks of rules, called from test programs.

::

    plant = under_test("press.pcapng", definitions=["axis.gvl"])
    plant.assert_list("axis", cycle={"interval": "50ms"}, loss="0.1%", silence="1s")
    plant.assert_that("implies", **{"if": "rose(var.bStop)", "then": "var.bClosed", "within": "200ms"})
    plant.assert_rules("press.rules.toml")
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from nvscope.analysis.attached_project import with_attached
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.attaching import that_may_attach
from nvscope.check.catalogue import CATALOGUE
from nvscope.check.deciding import Decided
from nvscope.check.parameters import REQUIRED, Parameter
from nvscope.check.rules import Mistakes, Rules, read_rules, rules_of
from nvscope.check.run import Checked, checked
from nvscope.check.verdict import Verdict
from nvscope.check.words import command, sentence, shown
from nvscope.definition.project import find_project
from nvscope.definition.project_file import read_project
from nvscope.errors import UsageError
from nvscope.toml_table import nearest
from nvscope.view.escape import visible

AnyPath = str | os.PathLike[str]
_MOST_SUBJECTS = 10
_IN_TEST = "the test"


def under_test(
    captures: AnyPath | Sequence[AnyPath], definitions: AnyPath | Sequence[AnyPath] | None = None, *,
    project: AnyPath | bool | None = None,
) -> UnderTest:  # fmt: skip
    """Return capture files as one timeline, of which something can be asserted; as ``nvscope.open`` takes them.

    UsageError for none; UnreadableInput, where they are read, for what is no capture.
    """
    paths = _paths(captures)
    if not paths:
        raise UsageError("no capture is given", next_step="name a file, or a directory of them")
    files = None if definitions is None else _paths(definitions)
    found = find_project(Path.cwd()) if project is True else Path(project) if project else None
    return UnderTest(Inquiry(paths, with_attached(read_project(found, files), that_may_attach(paths)).project))


def _paths(given: AnyPath | Sequence[AnyPath]) -> list[str]:
    return [os.fspath(one) for one in ([given] if isinstance(given, str | os.PathLike) else given)]


class UnderTest:
    """Captures of which rules are asserted: what breaks one, or cannot be decided, is told by AssertionError."""

    def __init__(self, inquiry: Inquiry) -> None:
        self._inquiry = inquiry

    def __repr__(self) -> str:
        return f"under_test({list(self._inquiry.paths)!r})"

    def assert_list(self, name: str | int, /, **checks: Any) -> None:
        """Assert checks of one list, each by its name: with its only parameter, or a table of them; True for none.

        UsageError where a check or a parameter is called otherwise.
        """
        tables = [_table(check, told) | {"list": name} for check, told in checks.items() if told is not False]
        self.assert_all(tables)

    def assert_that(self, check: str, /, **parameters: Any) -> None:
        """Assert one check with its parameters, as a rule has them."""
        self.assert_all([{"check": check, **parameters}])

    def assert_all(self, rules: Iterable[Mapping[str, Any]]) -> None:
        """Assert rules that are given as tables; one without an id is called as its check."""
        tables = [dict(one) for one in rules]
        for number, table in enumerate(tables):
            again = sum(one.get("check") == table.get("check") for one in tables[:number])
            table.setdefault("id", f"{table.get('check')}{f'-{again + 1}' if again else ''}")
        tables = [
            {key: list(value) if isinstance(value, tuple) else value for key, value in table.items()}
            for table in tables
        ]
        self._assert(rules_of(tables, _IN_TEST))

    def assert_rules(self, *files: AnyPath) -> None:
        """Assert all rules of files; those of severity warning and note may be broken."""
        self._assert(read_rules([os.fspath(one) for one in files]))

    def check(self, rules: Rules) -> Checked:
        """Return the verdicts of rules; UsageError with all that is wrong with them."""
        try:
            return checked(self._inquiry, rules)
        except Mistakes as error:
            raise UsageError("\n".join(map(str, error.mistakes))) from None

    def _assert(self, rules: Rules) -> None:
        found = self.check(rules)
        broken = [one for one in found.decided if one.rule.severity == "error" and one.verdict is not Verdict.PASS]
        if broken:
            raise AssertionError("\n\n".join(told_of(found, one) for one in broken))


def told_of(found: Checked, decided: Decided) -> str:
    """Return why a rule is broken, or cannot be decided: each subject with its margin, and what shows it."""
    rule = decided.rule
    what = "is broken" if decided.verdict is Verdict.FAIL else "could not be decided"
    lines = [f"{visible(rule.id)} ({rule.check.name}) {what}"]
    subjects = shown(decided)
    for judged in subjects[:_MOST_SUBJECTS]:
        lines.append(f"  {sentence(found, judged)}")
        lines += [f"    {one}" for one in (command(found, judged),) if one]
    if len(subjects) > _MOST_SUBJECTS:
        lines.append(f"  and {len(subjects) - _MOST_SUBJECTS} more")
    if rule.description:
        lines.append(f"  {visible(rule.description)}")
    return "\n".join(lines)


def _table(check: str, told: Any) -> dict[str, Any]:
    """Return the table of a check that is given by its name and one value."""
    known = CATALOGUE.get(check)
    if known is None:
        raise UsageError(f"no check is called '{check}'", next_step=nearest(check, list(CATALOGUE)))
    if told is True:
        return {"check": check}
    if isinstance(told, Mapping):
        return {"check": check, **told}
    main = _main_of(known.parameters)
    if main is None:
        raise UsageError(
            f"{check} has several parameters", next_step=f"name them: {check}={{{_example(known.parameters)}}}"
        )
    return {"check": check, main.name: told}


def _main_of(parameters: Sequence[Parameter]) -> Parameter | None:
    """Return the parameter that a value alone is for: the only one that has to be told, or the first one."""
    required = [one for one in parameters if one.default is REQUIRED]
    if len(required) == 1:
        return required[0]
    return parameters[0] if parameters and not required else None


def _example(parameters: Sequence[Parameter]) -> str:
    return ", ".join(f'"{one.name}": …' for one in parameters)
