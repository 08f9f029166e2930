"""Checks of variables: their values, how they change, and how one follows another."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from msgspec.structs import replace

from nvscope.check.check import Check, Evidence, Setting
from nvscope.check.doubt import doubt, doubt_of_clock, parts
from nvscope.check.parameters import NUMBER_OR_TIME, REQUIRED, VALUE, Parameter, Unfit
from nvscope.check.read_variables import BothWatcher, ReadPlace, ReadWatcher, RefusedWatch, is_read
from nvscope.check.variable_places import VariablePlace, variable_places
from nvscope.check.variables import (
    NUMBERS,
    EnumWatch,
    FrozenWatch,
    HopWatcher,
    MonotonicWatch,
    RangeWatch,
    RateWatch,
    VariableWatcher,
    Watch,
)
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.while_so import TOO_SHORT_SO
from nvscope.expression.typed_columns import FieldType
from nvscope.list_key import ListKey
from nvscope.toml_table import FLAG, LENGTH, SPAN, TEXT, array, choice, number
from nvscope.units import count_of

_SECOND_NS = 1_000_000_000
_LONGEST_NS = 2**63
_NEVER_CAME = "no telegram with its value came"
_NEVER_JUDGED = "at no moment it was to be judged"

_TRUTHS = {"true": True, "false": False}

Place = VariablePlace | ReadPlace
Watcher = VariableWatcher | ReadWatcher | BothWatcher
AnyPlace = TypeVar("AnyPlace", bound=VariablePlace | ReadPlace)
Make = Callable[[Any, Mapping[str, Any]], Watch]


def _scale(place: Place) -> int:
    """Return what a value of one in a rule is in the column of a variable."""
    return _SECOND_NS if place.field.type is FieldType.DURATION else 1


def _unit(place: Place) -> str:
    return "s" if place.field.type is FieldType.DURATION else ""


def _limit(place: Place, value: float | None, key: str) -> float | None:
    if value is None:
        return None
    found = value * _scale(place)
    if _scale(place) > 1 and abs(found) > _LONGEST_NS:
        raise Unfit("no time is so long", key)
    return found


def _numbers(places: Iterable[AnyPlace], key: str = "variable") -> list[AnyPlace]:
    found = list(places)
    for one in found:
        if one.field.type not in NUMBERS:
            raise Unfit(
                f"'{one.name}' is no number: {one.field.help}",
                key,
                next_step="enum and frozen are for values of any type",
            )
    return found


def _watching(make: Make, *, numbers: bool = True, in_order: bool = False, lasting: bool = False) -> Any:
    def make_one(place: Place, told: Mapping[str, Any]) -> Watch:
        if numbers:
            _numbers([place])
        return make(place, told)

    def watch(setting: Setting, told: Mapping[str, Any]) -> Watcher:
        named = told["variable"]
        read = [one for one in named if is_read(one)]
        one_by_one = None
        if read:
            one_by_one = ReadWatcher(setting, read, lambda place: make_one(place, told), lasting=lasting)
            if len(read) == len(named):
                return one_by_one
        places = variable_places(setting, [one for one in named if not is_read(one)])
        watcher = VariableWatcher(setting, [make_one(one, told) for one in places], in_order=in_order)
        return watcher if one_by_one is None else BothWatcher(watcher, one_by_one)

    return watch


def _each(known: Evidence, watcher: Watcher) -> Iterator[tuple[Any, Judged | None]]:
    """Yield what is known of each variable, and the verdict where there is nothing to judge."""
    for one in watcher.watches:
        missing = None
        if isinstance(one, RefusedWatch):
            missing = Judged(Verdict.INCONCLUSIVE, reason=one.why, variable=one.place.name, vacuous=one.vacuous)
        elif not one.judged:
            reason = _NEVER_JUDGED if watcher.is_conditional else _NEVER_CAME
            missing = Judged(
                Verdict.INCONCLUSIVE, _key(known, one.place), reason=reason, variable=one.place.name, vacuous=True
            )
        yield one, missing


def _key(known: Evidence, place: Place) -> ListKey | None:
    """Return the key of the list that a variable was sent in: on CAN, that of its channel, where there is one."""
    if place.list is None:
        return None
    own = [key for key in known.keys.values() if place.list in (key, key.on_any_channel)]
    return min(own, default=place.list)


def _judged(
    known: Evidence, one: Watch, *, worst: float | None, limit: float | None, above: bool = True, unit: str = "",
    reason: str = "", fails: bool | None = None,
) -> Judged:  # fmt: skip
    fails = one.broken > 0 if fails is None else fails
    scale = _scale(one.place) if unit.startswith("s") else 1
    return Judged(
        Verdict.FAIL if fails else Verdict.PASS, _key(known, one.place), reason=reason, variable=one.place.name,
        worst=None if worst is None else worst / scale, limit=None if limit is None else limit / scale, above=above,
        unit=unit, count=one.broken, first_ns=one.first_ns, frames=tuple(one.frames),
    )  # fmt: skip


def _range(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    for one, missing in _each(known, told["watched"]):
        if missing:
            yield missing
            continue
        rooms = []
        if one.least is not None and one.lowest is not None:
            rooms.append((one.lowest - one.least, one.lowest, one.least, False))
        if one.most is not None and one.highest is not None:
            rooms.append((one.most - one.highest, one.highest, one.most, True))
        _, worst, limit, above = min(rooms, default=(0, None, None, True))
        are = "is" if one.nan == 1 else "are"
        reason = f"{count_of(one.nan, 'value')} {are} no number (NaN)" if one.nan else ""
        if one.broken and one.broken == one.nan:
            worst = None
        yield _judged(known, one, worst=worst, limit=limit, above=above, unit=_unit(one.place), reason=reason)


def _make_range(place: Any, told: Mapping[str, Any]) -> Watch:
    if told["min"] is None and told["max"] is None:
        raise Unfit("a range needs min, max, or both")
    if told["min"] is not None and told["max"] is not None and told["min"] > told["max"]:
        raise Unfit("min is more than max", "min")
    return RangeWatch(place, least=_limit(place, told["min"], "min"), most=_limit(place, told["max"], "max"))


def _make_enum(place: Any, told: Mapping[str, Any]) -> Watch:
    names = {name.lower(): value for name, value in place.field.values.items()}
    wanted = told["values"] or tuple(place.field.values.values())
    if not wanted:
        raise Unfit(
            f"'{place.name}' has no names for its values", "variable", next_step="tell which may be: values = [1, 2]"
        )
    allowed: set[int | float | str] = set()
    for one in wanted:
        is_text = place.field.type is FieldType.TEXT
        if place.field.type is FieldType.BOOL and str(one).lower() in _TRUTHS:
            allowed.add(_TRUTHS[str(one).lower()])
            continue
        if isinstance(one, str) != is_text and (not isinstance(one, str) or one.lower() not in names):
            raise Unfit(f"'{one}' is no value of '{place.name}', which is {place.field.help}", "values")
        allowed.add(names[one.lower()] if isinstance(one, str) and not is_text else one)
    if place.field.type not in (*NUMBERS, FieldType.TEXT):
        raise Unfit(f"'{place.name}' is neither a number nor a text: {place.field.help}", "variable")
    return EnumWatch(
        place, allowed=frozenset(one * _scale(place) if not isinstance(one, str) else one for one in allowed)
    )


def _enum(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    for one, missing in _each(known, told["watched"]):
        reason = f"the first other value is {one.other}" if one.broken else ""
        worst = one.worst if one.broken else None
        yield missing or _judged(known, one, worst=worst, limit=None, unit=_unit(one.place), reason=reason)


def _once(known: Evidence, one: Watch) -> Judged:
    key = _key(known, one.place)
    return Judged(Verdict.INCONCLUSIVE, key, reason="it came only once", variable=one.place.name)


def _monotonic(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    for one, missing in _each(known, told["watched"]):
        once = _once(known, one) if one.judged < 2 else None
        reason = "it stayed as it was" if one.broken and not one.worst else ""
        yield (
            missing or once or _judged(known, one, worst=one.worst or 0, limit=0, unit=_unit(one.place), reason=reason)
        )


def _rate(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    for one, missing in _each(known, told["watched"]):
        once = _once(known, one) if one.worst is None else None
        unit = "s per second" if _unit(one.place) else "per second"
        judged = missing or once or _judged(known, one, worst=one.worst, limit=one.most, unit=unit)
        if judged.verdict is Verdict.FAIL and judged.count == 1 and (why := doubt_of_clock(known, judged.first_ns)):
            judged = replace(judged, verdict=Verdict.INCONCLUSIVE, reason=why)
        yield judged


def _frozen(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    for one, missing in _each(known, told["watched"]):
        judged = missing or Judged(
            Verdict.FAIL if one.broken else Verdict.PASS, _key(known, one.place), variable=one.place.name,
            worst=one.longest_ns / _SECOND_NS, limit=one.most_ns / _SECOND_NS, unit="s", count=one.broken,
            first_ns=one.first_ns, frames=tuple(one.frames),
        )  # fmt: skip
        if judged.verdict is Verdict.PASS and _is_too_short(known, one.most_ns, told["watched"]):
            is_conditional = told["watched"].is_conditional
            reason = TOO_SHORT_SO if is_conditional else "the capture is shorter than the rule needs"
            judged = Judged(
                Verdict.INCONCLUSIVE, judged.list, reason=reason,
                variable=judged.variable, worst=judged.worst, limit=judged.limit, unit="s",
            )  # fmt: skip
        yield judged


def _is_too_short(known: Evidence, needed_ns: int, watcher: Watcher) -> bool:
    """Tell whether it was nowhere to be judged for so long."""
    if known.since_ns is None or known.until_ns is None:
        return True
    return watcher.longest_judged_ns(known.since_ns, known.until_ns) < needed_ns


def _watch_hops(setting: Setting, told: Mapping[str, Any]) -> HopWatcher:
    ends = []
    for key in ("from", "to"):
        places = _numbers(variable_places(setting, [told[key]], key), key)
        if len(places) > 1:
            raise Unfit(
                f"'{told[key]}' stands for {len(places)} variables, and {key} is one",
                key,
                next_step="write its list in front, as in axis:fPos",
            )
        ends.append(places[0])
    return HopWatcher(
        setting, ends[0], ends[1], _limit(ends[0], told["tolerance"], "tolerance") or 0.0, told["max_delay"]
    )


def _hops(known: Evidence, lists: Collection[ListKey], told: Mapping[str, Any]) -> Iterator[Judged]:
    watcher: HopWatcher = told["watched"]
    if known.until_ns is None:
        return
    watcher = watcher.up_to(known.until_ns)
    apart = watcher.apart
    name, limit = f"{told['from']} → {told['to']}", told["max_delay"] / _SECOND_NS
    if not watcher.known or not (watcher.changes or apart.count):
        reason = "not both of them came" if not watcher.known else f"{told['from']} never changed"
        yield Judged(Verdict.INCONCLUSIVE, reason=reason, variable=name, limit=limit, unit="s", vacuous=True)
        return
    verdict = Verdict.FAIL if apart.count else Verdict.PASS
    reason = f"they differ by up to {watcher.largest:g}" if watcher.largest else ""
    if apart.count and (why := doubt(known, apart.first_ns, parts(apart.longest_ns or 0, told["max_delay"]))):
        verdict, reason = Verdict.INCONCLUSIVE, why
    yield Judged(
        verdict, reason=reason, variable=name, worst=(apart.longest_ns or 0) / _SECOND_NS, limit=limit, unit="s",
        count=apart.count, first_ns=apart.first_ns, frames=tuple(apart.frames),
    )  # fmt: skip


_VARIABLE = Parameter(
    "variable", array(TEXT, single=True),
    "variables by name, with their list in front or without; a structure stands for all it has, * for any text; "
    "db/FILE/NAME and visu/ADDRESS/NAME are those of databases and pages",
    REQUIRED,
)  # fmt: skip

CHECKS = (
    Check(
        "range", "variable", "Values lie between two limits.", "the value farthest outside, else nearest to a limit",
        "one lies outside, or is no number", 'check = "range"\nvariable = "axis.fPos"\nmin = 0\nmax = 1200.5', _range,
        (
            _VARIABLE,
            Parameter("min", NUMBER_OR_TIME, "the lowest value; of a time, in seconds or with a unit", None),
            Parameter("max", NUMBER_OR_TIME, "the highest value", None),
        ),
        _watching(_make_range), by_moment=True, needs_definitions=True,
    ),
    Check(
        "enum", "variable", "A variable has no other values.", "the first other value", "there is one",
        'check = "enum"\nvariable = "eMode"\nvalues = [1, 2, 3]', _enum,
        (
            _VARIABLE,
            Parameter(
                "values", array(VALUE, single=True),
                "numbers, texts, or names of an enumeration; else all of its names", (),
            ),
        ),
        _watching(_make_enum, numbers=False), by_moment=True, needs_definitions=True,
    ),
    Check(
        "monotonic", "variable", "A value goes one way only.", "the largest step back", "there is one",
        'check = "monotonic"\nvariable = "nPieces"', _monotonic,
        (
            _VARIABLE,
            Parameter("direction", choice("up", "down"), "which way", "up"),
            Parameter("strict", FLAG, "whether it may not stay as it is either", False),
            Parameter("wrap", number(0, 2.0**64), "behind so many it begins anew; else never", 0.0),
        ),
        _watching(
            lambda place, told: MonotonicWatch(
                place, up=told["direction"] == "up", strict=told["strict"], wrap=told["wrap"] * _scale(place)
            ),
            in_order=True,
        ),
        by_moment=True, needs_definitions=True,
    ),
    Check(
        "rate_of_change", "variable", "A value does not change faster than it can.", "the steepest change",
        "it is more than max a second", 'check = "rate_of_change"\nvariable = "fTemperature"\nmax = 5', _rate,
        (_VARIABLE, Parameter("max", number(0, 1e308), "by so much it may change in a second", REQUIRED)),
        _watching(lambda place, told: RateWatch(place, most=told["max"] * _scale(place)), in_order=True),
        by_moment=True, needs_definitions=True,
    ),
    Check(
        "frozen", "variable", "A value goes on changing.", "the longest time without a change while its list was sent",
        "it is longer than max", 'check = "frozen"\nvariable = "nHeartbeat"\nmax = "1s"', _frozen,
        (_VARIABLE, Parameter("max", SPAN, "so long it may stay as it is", REQUIRED)),
        _watching(
            lambda place, told: FrozenWatch(place, most_ns=told["max"]), numbers=False, in_order=True, lasting=True
        ),
        by_moment=True, needs_definitions=True,
    ),
    Check(
        "hops", "pair", "A variable follows another one.",
        "the longest time in which they differed, since either changed; and by how much they did",
        "it is longer than max_delay",
        'check = "hops"\nfrom = "plc1:fSetpoint"\nto = "plc2:fSetpoint"\nmax_delay = "100ms"', _hops,
        (
            Parameter("from", TEXT, "the variable that leads, with its list in front where several have it", REQUIRED),
            Parameter("to", TEXT, "the variable that follows", REQUIRED),
            Parameter("max_delay", LENGTH, "so long they may differ", REQUIRED),
            Parameter("tolerance", number(0, 1e308), "by so much they may differ at any time", 0.0),
        ),
        _watch_hops, by_moment=True, needs_definitions=True,
    ),
)  # fmt: skip
