"""Which variables a rule is for, each with the field that reads it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from nvscope.check.check import Setting
from nvscope.check.lists import names_of
from nvscope.check.parameters import Unfit
from nvscope.check.patterns import fits
from nvscope.definition.sent_elements import typed
from nvscope.list_key import ListKey
from nvscope.view.fields.field import TelegramField

MOST_VARIABLES = 10_000
_PREFIX = "var."


@dataclass(frozen=True, slots=True)
class VariablePlace:
    """A variable of a list, what it is called, and the field that reads it."""

    list: ListKey
    name: str
    field: TelegramField


def variable_places(setting: Setting, wanted: Sequence[str], key: str = "variable") -> list[VariablePlace]:
    """Return the variables that are called so behind a key, in the order of their lists; Unfit where nothing is.

    A name may have its list in front, and the prefix that it has in expressions; one of a structure or an array stands
    for all that it has; ``*`` and ``?`` stand for what they do everywhere.
    """
    found: dict[tuple[ListKey, str], VariablePlace] = {}
    for pattern in wanted:
        own = list(_places(setting, pattern))
        if not own:
            raise Unfit(
                f"no variable is called '{pattern}'", key,
                next_step="`nvscope gvl layout` shows all names of the definitions",
            )  # fmt: skip
        found |= {(one.list, one.name): one for one in own}
        if len(found) > MOST_VARIABLES:
            raise Unfit(f"these are more than {MOST_VARIABLES} variables", key, next_step="name fewer of them")
    return list(found.values())


def _places(setting: Setting, pattern: str) -> Iterator[VariablePlace]:
    layouts = setting.layouts
    plain = "".join(pattern.split()).removeprefix(_PREFIX)
    patterns = [plain, f"{plain}.*", f"{plain}[*"]
    for name, of_series in setting.series.items():
        called = [own := name.removeprefix(_PREFIX), own.replace(".", ":", 1), own.partition(".")[2]]
        if any(fits(one, text) for one in patterns for text in called if text):
            yield VariablePlace(ListKey.udp(0, 0), own, of_series)
    if layouts is None or setting.series:
        return
    for key, known in layouts.lists():
        if setting.lists and not any(fits(one, name) for one in setting.lists for name in names_of(key, setting.names)):
            continue
        names = typed(known.name), known.name
        for layout in (layout for candidate in layouts.candidates_of(key) for layout in candidate):
            for element in layout.elements:
                name = element.name.replace(" ", "")
                called = [name, *(f"{one}{sign}{name}" for one in names for sign in ".:")]
                if not any(fits(one, text) for one in patterns for text in called):
                    continue
                field = _field(setting, f"{_PREFIX}{names[0]}.{name}")
                if field is not None:
                    yield VariablePlace(key, element.name, field)


def _field(setting: Setting, name: str) -> TelegramField | None:
    spelled = setting.fields.spelled(name)
    field = None if spelled is None else setting.fields[spelled]
    return None if field is None or field.refused else field
