"""Draft: the configuration of a session, made of lists."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from msgspec.structs import replace

from dissectors.datalogger.tables import MOST_VARIABLES
from nvscope.datalogger.configuration import ATTRIBUTES, DEFAULTS, NotMeant, Session
from nvscope.datalogger.logged import declared_type
from nvscope.definition.layouts import Layouts
from nvscope.definition.position import Position
from nvscope.definition.selection import lists_named, names_of_lists, select
from nvscope.errors import UsageError
from nvscope.list_key import ListKey

_PUBLISH_NS, _LEAST_SETS = 1_000_000_000, 2
_MOST_NEAR, _LIKE, _LONGEST_NAME = 3, 0.6, 200


def chosen(layouts: Layouts, names: Sequence[str]) -> dict[tuple[ListKey, str], str]:
    """Return the variables that names mean, in the order of the lists, with the names of these.

    A name is that of a list, or of a variable as ``nvscope vars --history`` takes it; without any, all are meant. Left
    out is what no column holds. Raises UsageError, with near names, where there is nothing of a name.
    """
    lists = names_of_lists(layouts)
    called = {key: entry.name for key, entry in lists}
    found: dict[tuple[ListKey, str], str] = {}
    wanted: list[tuple[ListKey, frozenset[str] | None]] = [] if names else [(key, None) for key in called]
    for name in names:
        try:
            wanted += [(key, None) for key, _ in lists_named(lists, name, layouts.unplaced)]
        except UsageError as error:
            try:
                meant = select(layouts, name)
            except UsageError as none:
                raise _neither(name, none, error, called.values()) from None
            wanted += [(key, meant.names_in(key, subindex)) for key, subindex in meant.telegrams]
    for key, elements in wanted:
        for layout in layouts.telegrams_of(key) or ():
            for element in layout.elements:
                if (elements is None or element.name in elements) and declared_type(element.type):
                    found.setdefault((key, element.name), called[key])
    if not found:
        raise UsageError("nothing of that can be logged", next_step="`nvscope gvl layout` shows what the lists hold")
    if len(found) > MOST_VARIABLES:
        raise UsageError(
            f"{len(found)} variables are meant, and a session has {MOST_VARIABLES} at most",
            next_step="write several configurations: name lists, or variables such as 'stAxis.*'",
        )
    return found


def _neither(name: str, variables: UsageError, lists: UsageError, called: Collection[str]) -> UsageError:
    """Return the error that neither a variable nor a list has a name."""
    if ":" in name:
        return variables
    names = {one.lower(): one for one in called if one}
    near = [names[one] for one in get_close_matches(name.strip().lower()[:_LONGEST_NAME], names, _MOST_NEAR, _LIKE)]
    there = f"lists near it: {', '.join(near)}" if near else lists.next_step
    return UsageError(
        f"no list and no variable is named '{name.strip()[:80]}'",
        next_step=f"{there}; of variables, {variables.next_step}",
    )


def uris(variables: Mapping[tuple[ListKey, str], str], layouts: Layouts, prefix: str) -> list[str]:
    """Return names of variables by which they are found again; what several lists have, with the name of its list."""
    names = Counter(
        element.name.lower()
        for key in dict.fromkeys(key for key, _ in names_of_lists(layouts))
        for layout in layouts.telegrams_of(key) or ()
        for element in layout.elements
    )
    return [
        f"{prefix}{list_name}.{name}" if names[name.lower()] > 1 and list_name else f"{prefix}{name}"
        for (_, name), list_name in variables.items()
    ]


def session_of(
    variables: Mapping[tuple[ListKey, str], str], intervals_ns: Mapping[ListKey, int], settings: Iterable[str]
) -> Session:
    """Return a session for variables; ``settings`` are ATTRIBUTE=VALUE.

    It is called as its lists, is sampled as often as the fastest of them is sent, and has room for what is sampled
    between two publishings. Raises UsageError for what cannot be set.
    """
    values: dict[str, Any] = dict(DEFAULTS) | {"path": "", "task": "", "time_format": "Iso8601"}
    lists = list(dict.fromkeys(name or str(key).replace("/", "-") for (key, _), name in variables.items()))
    values["name"] = "-".join(lists[:3]) + ("-and-more" if len(lists) > 3 else "")
    cyclic = [told for key in {key for key, _ in variables} if (told := intervals_ns.get(key))]
    values["sampling_ns"] = min(cyclic, default=values["sampling_ns"])
    values["publish_ns"] = max(_PUBLISH_NS, values["sampling_ns"])
    given = dict(_read(setting) for setting in settings)
    session = Session(**{**values, **given}, position=Position("", 0, 0), places={}, variables=())
    if "capacity" not in given:
        session = replace(session, capacity=max(_LEAST_SETS, 2 * session.sets_a_publishing))
    return session if session.path or session.volatile else replace(session, path=f"{session.name}.db")


def _read(setting: str) -> tuple[str, Any]:
    name, equals, text = setting.partition("=")
    known = {one.name.lower(): one for one in ATTRIBUTES}
    attribute = known.get(name.strip().lower())
    if not equals or attribute is None:
        names = ", ".join(one.name for one in ATTRIBUTES)
        raise UsageError(f"--set {setting[:80]}: no attribute", next_step=f"write ATTRIBUTE=VALUE; there are {names}")
    try:
        return attribute.field, attribute.read(text)
    except NotMeant as error:
        raise UsageError(
            f"--set {attribute.name}: '{text[:60]}' {error}", next_step=f"{attribute.name}: {attribute.help}"
        ) from None
