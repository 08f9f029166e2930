"""Elements by name: what is looked up is what one finds by going through all elements, at the price of one."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nvscope.definition import element_names, packing, sent_elements
from nvscope.definition.element_names import ElementNames, folded
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import TelegramLayout, known_fronts
from nvscope.definition.scalars import SCALARS
from nvscope.definition.sent_elements import SentElement, SentElements, typed
from nvscope.definition.variables import Array, Member, Structure, Type, Variable, elements
from tests.definition.lists import HERE, INT, REAL, TYPES, VARIABLES, list_of
from tests.records import replace

NAMES = st.sampled_from(["a", "A", "b", "a.b", "b[0]", "Größe", "ΤΕΛΟΣ", "a b", "test"])


def renamed(kind: Type, names: list[str]) -> Type:
    """Return a type whose members have other names."""
    if isinstance(kind, Array):
        return Array(kind.bounds, renamed(kind.element, names))
    if isinstance(kind, Structure):
        own = enumerate(kind.members)
        return Structure(kind.name, tuple(Member(names[at % len(names)], renamed(one.type, names)) for at, one in own))
    return kind


@given(st.lists(st.tuples(NAMES, TYPES), min_size=1, max_size=6), st.lists(NAMES, min_size=1, max_size=4))
@settings(deadline=None)
def test_a_name_is_of_the_elements_that_have_it(declared: list[tuple[str, Type]], members: list[str]) -> None:
    variables = [Variable(name, renamed(kind, members), HERE) for name, kind in declared]
    told = [folded(element.name) for variable in variables for element in elements(variable)]
    names = ElementNames(variables)
    for name in told:
        assert names.places_of(name) == [place for place, other in enumerate(told) if other == name]
        for other in (
            name + "[0]",
            name + ".",
            name[:-1],
            f"{name}.a",
            name.replace("[", "[0"),
            name.replace("-", "+"),
        ):
            assert names.places_of(other) == [place for place, one in enumerate(told) if one == other]


def test_a_letter_is_the_same_wherever_in_a_name_it_stands() -> None:
    """A sigma at the end is written in its own way in lower case; a dot behind it, and it is at the end no more."""
    part = Structure("S", (Member("ΘΕΣΗΣ", INT),))
    names = ElementNames([Variable("ΤΕΛΟΣ", part, HERE), Variable("ΑΞΟΝΑΣ", Array(((0, 1),), part), HERE)])
    for place, name in enumerate(["ΤΕΛΟΣ.ΘΕΣΗΣ", "ΑΞΟΝΑΣ[0].ΘΕΣΗΣ", "ΑΞΟΝΑΣ[1].ΘΕΣΗΣ"]):
        assert names.places_of(folded(name)) == [place]


def test_a_list_may_be_called_what_a_variable_is() -> None:
    part = Structure("S", (Member("v1", INT),))
    layouts = Layouts(Definition((
        replace(list_of([INT, REAL], list_id=7), name="v0"), replace(list_of([part], list_id=8), name="other"),
        replace(list_of([part], list_id=9), name="V0"),
    )))  # fmt: skip
    found = SentElements(layouts).named("v0.v1")
    assert [(sent.key.identifier, sent.element.name, of_list) for sent, of_list in found] == [
        (7, "v1", True), (8, "v0.v1", False), (9, "v0.v1", False),
    ]  # fmt: skip


def all_elements(layouts: Layouts) -> Iterator[tuple[str, SentElement]]:
    """Yield all elements of all lists, one after the other, with each of their folded names."""
    for key, _ in layouts.lists():
        shapes = set()
        found: list[tuple[TelegramLayout, bool]] = []
        for layout in (layout for telegrams in layouts.candidates_of(key) for layout in telegrams):
            if (layout.subindex, *layout.shape) not in shapes:
                shapes.add((layout.subindex, *layout.shape))
                found.append((layout, False))
        if partly := layouts.partly_of(key):
            found += [(layout, cause is not None) for layout, cause in known_fronts(partly).by_subindex]
        for layout, is_front in found:
            for offset, element in layout.spans():
                sent = SentElement(key, layout, offset, element, is_front)
                yield folded(element.name), sent
                yield folded(f"{typed(layout.list.name)}.{element.name}"), sent


LISTS = st.lists(
    st.tuples(
        VARIABLES, st.booleans(), st.integers(1, 2), st.sampled_from(["v0", "Test", "v-1"]),
        st.sampled_from([None, 0, 1]),
    ),
    min_size=1, max_size=5,
)  # fmt: skip


def drawn(lists: list[tuple[list[Type], bool, int, str, int | None]]) -> Iterator[ListDefinition]:
    for types, pack, number, name, unknown in lists:
        own = types if unknown is None else [*types[:unknown], SCALARS["POINTER"], *types[unknown:]]
        entry = list_of(own, pack=pack, list_id=number)
        first = replace(entry.variables[0], name="m0" if name == "v0" else "v0")
        yield replace(entry, name=name, variables=(first, *entry.variables[1:]))


@given(LISTS, st.booleans())
@settings(deadline=None)
def test_in_many_lists_too(lists: list[tuple[list[Type], bool, int, str, int | None]], on_can: bool) -> None:
    definitions = [
        replace(one, protocol="CAN", channel="can0" if number % 2 else "") if on_can else one
        for number, one in enumerate(drawn(lists))
    ]
    layouts = Layouts(Definition(tuple(definitions)))
    sent = SentElements(layouts)
    expected: dict[str, list[SentElement]] = {}
    for name, one in all_elements(layouts):
        expected.setdefault(name, []).append(one)
    for name, places in expected.items():
        assert [one for one, _ in sent.named(name)] == places
    listed = [one for telegram, _ in sent.telegrams() for one in telegram]
    assert listed == [one for _, one in all_elements(layouts)][::2]
    assert len(sent) == sum(count for _, count in sent.telegrams())
    assert sent.named("v99") == []


def test_one_element_of_many_is_looked_up_without_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight lists of 100 000 elements: what is made for a name are the telegrams that have it."""
    lists = [list_of([Array(((1, 50_000), (0, 1)), INT)], list_id=number) for number in range(1, 9)]
    layouts = Layouts(Definition(tuple(replace(one, name=f"L{one.list_id}") for one in lists)))
    made: list[str] = []

    def layout(name: str, *rest: object) -> object:
        made.append(name)
        return real(name, *rest)  # type: ignore[arg-type]

    real = packing.Layout
    monkeypatch.setattr(packing, "Layout", layout)
    sent = SentElements(layouts)
    assert [one.element.name for one, _ in sent.named("v0[49999,1]")] == ["v0[49999, 1]"] * 8
    assert [(one.key.identifier, one.offset) for one, _ in sent.named("l3.v0[65,0]")] == [(3, 0)]
    assert sent.named("v0[50001,0]") == []
    assert sorted(set(made)) == sorted(made)
    assert len(made) == 9


def test_names_that_hold_dots_make_no_more_ways_than_there_are_questions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name of an XML file may be anything: each step of ``a.a.a`` may be one member or two."""
    below: Type = INT
    kind: Type = INT
    for depth in range(22):
        below, kind = kind, Structure(f"S{depth}", (Member("a", kind), Member("a.a", below)))
    asked = 0
    real = ElementNames._looked_up

    def looked_up(*arguments: object) -> list[int]:
        nonlocal asked
        asked += 1
        return real(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(element_names.ElementNames, "_looked_up", looked_up)
    variable = Variable("v", kind, HERE)
    told = [element.name for element in elements(variable)]
    assert len(told) > 20_000
    names = ElementNames([variable])
    assert names.places_of("v" + ".a" * 21 + ".b") == []
    assert asked < 1000
    assert names.places_of(told[-1]) == [place for place, name in enumerate(told) if name == told[-1]]


def test_a_list_with_elements_of_unknown_size_is_gone_through_once(monkeypatch: pytest.MonkeyPatch) -> None:
    layouts = Layouts(Definition((list_of([*[INT] * 300, SCALARS["POINTER"]]),)))
    asked: list[int] = []
    monkeypatch.setattr(
        sent_elements,
        "first_open",
        lambda telegrams: asked.append(len(telegrams)) or packing.first_open(telegrams),
    )
    sent = SentElements(layouts)
    assert [len(sent.named(f"v{number}")) for number in range(301)] == [1] * 300 + [0]
    assert len(asked) == 1
