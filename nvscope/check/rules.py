"""Rule files: all that stands in them, or all that is wrong with them, each mistake with its place."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nvscope.check.catalogue import CATALOGUE
from nvscope.check.check import Check
from nvscope.check.parameters import EXPRESSION, EXPRESSIONS, LISTS, NUMBER_OR_TIME, REQUIRED, RULE_FILE, Unfit
from nvscope.errors import ConfigurationError, UsageError
from nvscope.toml_table import FLAG, LENGTH, SPAN, TEXT, Place, ValueKind, array, choice, mapping, nearest, read_toml

SCHEMA = "nvscope.rules/1"
"""The schema of a rule file, for editors."""

SEVERITIES = ("error", "warning", "note")
MOST_RULES = 10_000
_MOST_FILES = 1_000

COMMON: Mapping[str, tuple[ValueKind, str, Any]] = {
    "id": (TEXT, "what it is called everywhere; no two rules are called alike", REQUIRED),
    "check": (choice(*CATALOGUE), "what is checked: one of the catalogue", REQUIRED),
    "list": (LISTS, "lists by name, identifier, key, or a pattern of these; else every list", ()),
    "severity": (choice(*SEVERITIES), "an error fails the build; the others are shown", None),
    "description": (TEXT, "why it is so", ""),
    "optional": (FLAG, "where it is for nothing that is there, it is kept", False),
    "when": (EXPRESSION, "it is judged only while this holds; not of checks that look at the whole capture", ""),
}
"""The keys that every rule has: what may stand there, what it says, and what it is where it is left out."""


def common_keys(check: Check) -> Mapping[str, tuple[ValueKind, str, Any]]:
    """Return the keys that rules of a check share with all others: a parameter of the same name is its own."""
    own = {one.name for one in check.parameters}
    return {name: told for name, told in COMMON.items() if name not in own}


DEFAULTS: Mapping[str, tuple[ValueKind, str, Any]] = {
    "warmup": (LENGTH, "nothing is judged before: starts of plants are noisy", 0),
    "severity": (choice(*SEVERITIES), "of rules that do not say theirs", "error"),
}
"""The keys of ``[defaults]``."""

TEST: Mapping[str, tuple[ValueKind, str, Any]] = {
    "rule": (TEXT, "the id of the rule that is tested", REQUIRED),
    "step": (SPAN, "how far apart the values of series are", REQUIRED),
    "series": (mapping(TEXT), "values of variables, one a step: 0*20 1*40 is 20 times 0, then 40 times 1", REQUIRED),
    "expect": (choice("pass", "fail", "inconclusive"), "the verdict", REQUIRED),
    "worst": (NUMBER_OR_TIME, "the worst value, in the unit of the check; a time with its unit", None),
    "margin": (NUMBER_OR_TIME, "the margin, likewise", None),
}
"""The keys of ``[[test]]``."""

_TABLES = ("defaults", "rule", "include", "test")
_VARIABLE = re.compile(r"\bvar\.", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: what it is called, its check with its parameters, the lists it is for, and where it stands."""

    id: str
    check: Check
    parameters: Mapping[str, Any]
    lists: Sequence[str]
    severity: str
    description: str
    optional: bool
    when: str
    place: Place = field(repr=False)
    inner: Sequence[Rule] = ()
    """Those of the file that it stands for."""
    warmup_ns: int = 0
    """So long behind the first frame nothing is judged."""

    @property
    def path(self) -> str:
        return self.place.path

    @property
    def line(self) -> int:
        """The line in which it begins, 0 where that is not known."""
        return self.place.position.line if self.place.position else 0

    @property
    def expressions(self) -> Mapping[str, str]:
        """All expressions in it, by where they stand below it."""
        found = {"when": self.when} if self.when else {}
        for one in self.check.parameters:
            value = self.parameters.get(one.name)
            if one.kind is EXPRESSION and value is not None:
                found[one.name] = value
            elif one.kind is EXPRESSIONS and value is not None:
                found |= {f"{one.name}[{number}]": text for number, text in enumerate(value)}
        return found

    @property
    def names_variables(self) -> bool:
        """Whether its expressions name variables."""
        return any(_VARIABLE.search(text) for text in self.expressions.values())

    def mistake(self, error: UsageError, key: str = "") -> ConfigurationError:
        """Return an error about a key of it, or about what its check makes of that, with its place."""
        if not key and isinstance(error, Unfit):
            key = error.key or next((one for one, text in self.expressions.items() if text == error.expression), "")
        where = Place(self.place.path, f"{self.place.keys}.{key}" if key else self.place.keys, self.place.text)
        told = where.error(error.what, error.next_step)
        return ConfigurationError(told.what, where=told.where, next_step=told.next_step, excerpt=error.excerpt)


@dataclass(frozen=True, slots=True)
class RuleTest:
    """A test of a rule: series of values, one a step, and what is to come of them; where it stands."""

    rule: Rule
    step_ns: int
    series: Mapping[str, str]
    expect: str
    worst: float | None
    margin: float | None
    place: Place = field(repr=False)

    @property
    def where(self) -> str:
        """The file and the line in which it begins."""
        return f"{self.place.path}, line {self.place.position.line if self.place.position else 0}"


@dataclass(slots=True)
class Rules:
    """All rules of files, in their order."""

    rules: list[Rule] = field(default_factory=list)
    halves: list[Rule] = field(default_factory=list)
    """Rules with mistakes, as far as they can be read: there may be more mistakes in them."""

    tests: list[RuleTest] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)
    """All files that were read, those that are included too."""


class Mistakes(UsageError):
    """All that is wrong with rule files, in the order of the files."""

    def __init__(self, mistakes: Sequence[ConfigurationError], readable: Rules | None = None) -> None:
        """``readable`` are the rules without a mistake, as far as reading them tells."""
        super().__init__(f"{len(mistakes)} mistakes in rules" if len(mistakes) > 1 else "a mistake in rules")
        self.mistakes = mistakes
        self.readable = readable or Rules()

    def __str__(self) -> str:
        return "\n".join(map(str, self.mistakes))


def read_rules(paths: Sequence[str]) -> Rules:
    """Return the rules of files; Mistakes with all that is wrong with them, and where none of them has a rule."""
    reader = _Reader()
    for path in paths:
        reader.read(path)
    if not reader.found.rules and not reader.mistakes:
        where = paths[0] if paths else ""
        reader.mistakes.append(
            ConfigurationError("there is no rule in it", where=where, next_step="a rule begins with [[rule]]")
        )
    if reader.mistakes:
        raise Mistakes(reader.mistakes, reader.found)
    return reader.found


def rules_of(tables: Sequence[Mapping[str, Any]], where: str, warmup_ns: int = 0) -> Rules:
    """Return rules that are given as tables, as of a file; Mistakes, each with ``where`` and the key."""
    reader = _Reader()
    reader.take({"rule": list(tables)}, Place(where), warmup_ns)
    if reader.mistakes:
        raise Mistakes(reader.mistakes)
    return reader.found


class _Reader:
    """Reads files one after the other, and keeps on where something is wrong."""

    def __init__(self, *, inner: bool = False) -> None:
        """``inner``: what it reads is what a rule of another file stands for."""
        self._inner = inner
        self._too_many = False
        self._known: dict[str, Sequence[Rule]] = {}
        self._rules = 0
        self.found = Rules()
        self.mistakes: list[ConfigurationError] = []
        self._places: dict[str, str] = {}
        self._read: set[str] = set()

    def read(self, path: str) -> None:
        real = os.path.realpath(path)
        if real in self._read:
            return
        if len(self._read) >= _MOST_FILES:
            if not self._too_many:
                self._too_many = True
                told = f"more than {_MOST_FILES} files of rules are named"
                self._note(ConfigurationError(told, where=path, next_step="put rules of several files into one"))
            return
        self._read.add(real)
        self.found.paths.append(path)
        read = self._tried(lambda: read_toml(path))
        if read is None:
            return
        self.take(*read)

    def take(self, document: Mapping[str, Any], place: Place, warmup_ns: int = 0) -> None:
        """Take what stands in a file; the defaults there are for its own rules, a warm-up is else as given."""
        for name in document:
            if name not in _TABLES:
                self._note(place.below(name).error(f"unknown key '{name}'", nearest(name, list(_TABLES))))
        for name in self._tried(lambda: _INCLUDE.read(document.get("include", []), place.below("include"))) or ():
            self.read(str(Path(place.path).parent / name))
        defaults = self._keys(document.get("defaults", {}), place.below("defaults"), DEFAULTS)
        defaults["warmup"] = defaults.get("warmup") or warmup_ns
        rules = document.get("rule", [])
        if not isinstance(rules, list):
            self._note(place.below("rule").error("rules are an array of tables", "begin each with [[rule]]"))
            return
        for number, table in enumerate(rules):
            if self._rules >= MOST_RULES:
                told = f"there are {MOST_RULES} rules at most in all files, those of files that rules name counted"
                self._note(place.below("rule").below(number).error(told))
                break
            self._rules += 1
            self._rule(table, place.below("rule").below(number), defaults)
        tests = document.get("test", [])
        if not isinstance(tests, list):
            self._note(place.below("test").error("tests are an array of tables", "begin each with [[test]]"))
            return
        for number, table in enumerate(tests[:MOST_RULES]):
            self._test(table, place.below("test").below(number))

    def _test(self, table: Any, place: Place) -> None:
        known = self._keys(table, place, TEST)
        if "rule" not in known:
            return
        rules = {one.id: one for one in self.found.rules}
        rule = rules.get(known["rule"])
        if rule is None:
            # One with mistakes is there, and is told already.
            if known["rule"] not in self._places:
                self._note(
                    place.below("rule").error(
                        f"no rule has the id '{known['rule']}'", nearest(known["rule"], list(rules))
                    )
                )
            return
        if not rule.check.by_moment:
            self._note(
                place.below("rule").error(f"'{rule.id}' is about telegrams, and a series has values of variables")
            )
        elif len(known) == len(TEST):
            series, worst, margin = known["series"], known["worst"], known["margin"]
            self.found.tests.append(RuleTest(rule, known["step"], series, known["expect"], worst, margin, place))

    def _rule(self, table: Any, place: Place, defaults: Mapping[str, Any]) -> None:
        if not isinstance(table, Mapping):
            self._note(place.error("a table is expected", "begin each rule with [[rule]]"))
            return
        before = len(self.mistakes)
        check = CATALOGUE.get(str(table.get("check", "")))
        # What a check calls its own is not said of the rule.
        common = COMMON if check is None else common_keys(check)
        known = self._keys({key: value for key, value in table.items() if key in common}, place, common)
        own: Mapping[str, Any] = {}
        if check is not None:
            others = {key: value for key, value in table.items() if key not in common}
            kinds = {one.name: (one.kind, one.help, one.default) for one in check.parameters}
            own = self._keys(others, place, kinds, [*kinds, *COMMON])
            if known.get("when") and not (check.by_moment or check.at_times):
                timed = ", ".join(name for name, one in CATALOGUE.items() if one.by_moment or one.at_times)
                self._note(
                    place.below("when").error(
                        f"{check.name} counts over all of the time, and is not judged only at times",
                        f"These are: {timed}.",
                    )
                )
        if known.get("id") == "":
            self._note(place.below("id").error("an id is a text that is not empty", "It names the rule everywhere."))
        elif (name := known.get("id")) is not None:
            first = self._places.setdefault(name, f"{place.path}, line {place.position.line if place.position else 0}")
            position = place.below("id").position
            if first != f"{place.path}, line {place.position.line if place.position else 0}" and position:
                self._note(
                    place.below("id").error(f"'{name}' is the id of another rule: {first}", "Give one another id.")
                )
        inner = () if check is None else self._rules_within(check, own, place)
        if inner and known.get("list"):
            self._note(place.below("list").error("the rules of its file say which lists they are for"))
        if check is None:
            return
        is_whole = len(self.mistakes) == before
        severity = known.get("severity") or defaults.get("severity", "error")
        (self.found.rules if is_whole else self.found.halves).append(
            Rule(
                known.get("id", ""), check, own, known.get("list", ()), severity, known.get("description", ""),
                known.get("optional", False), known.get("when", ""), place, inner, defaults["warmup"],
            )
        )  # fmt: skip

    def _rules_within(self, check: Check, own: Mapping[str, Any], place: Place) -> Sequence[Rule]:
        """Return the rules of the file that a rule names, where its check is about one."""
        for name in (one.name for one in check.parameters if one.kind is RULE_FILE and one.name in own):
            where = place.below(name)
            if self._inner:
                self._note(where.error("a file that a rule names has no rules that name files", "include takes some"))
                continue
            path = str(Path(place.path).parent / own[name])
            real = os.path.realpath(path)
            if real not in self._known:
                reader = _Reader(inner=True)
                reader.read(path)
                self._known[real] = reader.found.rules
                self.mistakes += reader.mistakes
                self.found.paths += reader.found.paths
                if not reader.found.rules and not reader.mistakes:
                    self._note(where.error("there is no rule in that file", "a rule begins with [[rule]]"))
            self._rules += len(self._known[real])
            return self._known[real]
        return ()

    def _keys(
        self, table: Any, place: Place, kinds: Mapping[str, tuple[ValueKind, str, Any]],
        names: Sequence[str] | None = None,
    ) -> dict[str, Any]:  # fmt: skip
        """Return what stands in a table, with defaults; what is wrong with it is noted, each key by itself."""
        if not isinstance(table, Mapping):
            self._note(place.error("a table is expected"))
            return {}
        found: dict[str, Any] = {}
        for name in table:
            if name not in kinds:
                self._note(place.below(name).error(f"unknown key '{name}'", nearest(name, list(names or kinds))))
        for name, (kind, text, default) in kinds.items():
            if name in table:
                value = self._tried(lambda name=name, kind=kind: kind.read(table[name], place.below(name)))  # type: ignore[misc]
                if value is not None:
                    found[name] = value
            elif default is REQUIRED:
                self._note(place.error(f"the key '{name}' is missing", f"{name}: {text}"))
            else:
                found[name] = default
        return found

    def _tried(self, read: Callable[[], Any]) -> Any:
        try:
            return read()
        except ConfigurationError as error:
            self._note(error)
            return None

    def _note(self, error: ConfigurationError) -> None:
        self.mistakes.append(error)


_INCLUDE = array(TEXT, single=True)
