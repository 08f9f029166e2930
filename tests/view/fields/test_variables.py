"""Variables as fields: what an expression sees of a telegram is what a decoder of one element after the other sees."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.model import Definition
from nvscope.definition.packing import pack
from nvscope.definition.scalars import SCALARS
from nvscope.definition.value import value_of
from nvscope.definition.variables import Array, Elementary, Member, ScalarKind, String, Structure, Type, scalar_of
from nvscope.errors import UsageError
from nvscope.expression.typed_columns import BytesColumn, TextColumn
from nvscope.report.fields import document, render
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields import variables as module
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import output_field
from nvscope.view.fields.variables import VariableFields
from nvscope.view.fields.vocabulary import vocabulary
from nvscope.view.rows.frames import FrameRows
from tests.definition.lists import BOOL, INT, REAL, STATE, TIME, VARIABLES, list_of, telegram
from tests.records import replace
from tests.tracker.variables.test_values import START_NS, telegrams_of
from tests.view.fields.test_frame import rows_of


def seen(field: TelegramField, rows: FrameRows) -> list[Any]:
    """Return a field's values as Python objects, None where it does not exist."""
    column, known = field.column(rows), field.exists(rows)
    found: list[Any]
    if isinstance(column, BytesColumn):
        found = [column.data[start:stop].tobytes() for start, stop in zip(column.start, column.stop, strict=True)]
    elif isinstance(column, TextColumn):
        found = [column.texts[code] for code in column.code]
    else:
        assert isinstance(column, np.ndarray)
        found = column.tolist()
    assert known is not None
    return [value if there else None for value, there in zip(found, known.tolist(), strict=True)]


@given(VARIABLES, st.booleans(), st.integers(0, 10_000), st.integers(1, 20))
@settings(deadline=None)
def test_fields_are_the_values_of_the_elements(types: list[Type], packed: bool, seed: int, count: int) -> None:
    definition = list_of(types, pack=packed)
    fields = VariableFields(Layouts(Definition((definition,))))
    sent = telegrams_of(definition, seed, count)
    (rows,) = rows_of([frame for frame, _, _ in sent])
    for layout in pack(definition):
        for place, element in enumerate(layout.elements):
            expected = []
            for _, subindex, parts in sent:
                value: Any = None
                if subindex == layout.subindex:
                    value = value_of(element.type, parts[place])
                    scalar = scalar_of(element.type)
                    if scalar and scalar.kind is ScalarKind.DURATION:
                        value *= scalar.unit_ns
                expected.append(value)
            found = seen(fields[f"var.{element.name.replace(' ', '')}"], rows)
            assert [*map(repr, found)] == [*map(repr, expected)]  # NaN is not equal to itself


def numbers(expression: str, rows: FrameRows, fields: Any) -> list[int]:
    return rows.frame_number[DisplayFilter(expression, fields)(rows)].tolist()


def drive(state: int, speed: float, ready: bool, time_ms: int) -> bytes:
    return (
        state.to_bytes(2, "little")
        + np.float32(speed).tobytes()
        + bytes([ready])
        + time_ms.to_bytes(4, "little")
        + (7).to_bytes(2, "little")
    )


def test_expressions_over_variables() -> None:
    definition = list_of([STATE, REAL, BOOL, TIME, INT])
    fields = vocabulary(Layouts(Definition((definition,))))
    sent = [drive(0, 1.5, True, 100), drive(1, -2.25, False, 2_500), drive(65535, 1e30, True, 90_000)]
    frames = [telegram(data, 5, subindex=0, counter=1 + at, ts_ns=START_NS + at) for at, data in enumerate(sent)]
    frames.append(telegram(sent[0], 4, subindex=0, counter=9, ts_ns=START_NS + 9))  # fits no more: has no variables
    (rows,) = rows_of(frames)
    for expression, expected in {
        "var.v0 == 1": [2],
        'var.v0 == "erun"': [2],
        'var.test.v0 in {"eOff", "eFault"}': [1, 3],
        "var.v1 > 1": [1, 3],
        "VAR.V1 < -2": [2],
        "var.v2": [1, 3],
        "!var.v2": [2, 4],
        "var.v3 > 2s && var.v3 < T#1m": [2],
        "var.v3 == 100ms": [1],
        "var.v4 == 7": [1, 2, 3],
        "var.v4 + var.v0 == 8": [2],
        "nv.items == 4 || var.v0 == -1": [3, 4],
    }.items():
        assert numbers(expression, rows, fields) == expected, expression
    with pytest.raises(UsageError, match="none of its values") as error:
        DisplayFilter('var.v0 == "eRunn"', fields)
    assert "eRun" in error.value.next_step


def test_names_that_several_lists_have(tmp_path: Any) -> None:
    lists = {
        "press.gvl": (7, "nSpeed : INT; sName : STRING(10); xAny : BOOL;"),
        "robot.gvl": (8, "xAny : REAL; nSpeed : DINT;"),
    }
    for name, (number, variables) in lists.items():
        (tmp_path / name).write_text(
            f"<GVL><Declarations><![CDATA[VAR_GLOBAL {variables} END_VAR]]></Declarations>"
            f"<NetvarSettings Protocol='UDP'><ListIdentifier>{number}</ListIdentifier></NetvarSettings></GVL>"
        )
    fields = vocabulary(Layouts(load_definitions([str(tmp_path / name) for name in lists])))
    press = telegram(b"\5\0Hans\0" + bytes(6) + b"\1", 3, subindex=0, counter=1, ts_ns=START_NS, list_id=7)
    robot = telegram(np.float32(2.5).tobytes() + b"\6\0\1\0", 2, subindex=0, counter=1, ts_ns=START_NS, list_id=8)
    (rows,) = rows_of([press, robot])
    assert numbers("var.nSpeed >= 5", rows, fields) == [1, 2]
    assert numbers("var.nspeed == 0x10006", rows, fields) == [2]
    assert numbers("var.Press.nSpeed", rows, fields) == [1]
    assert numbers('var.sName matches "^h.ns$"', rows, fields) == [1]
    assert numbers("var.robot.xAny > 2 || var.press.xAny", rows, fields) == [1, 2]
    for refused in (lambda: DisplayFilter("var.xany", fields), lambda: output_field("var.xAny", fields)):
        with pytest.raises(UsageError, match=r"var\.xAny: lists press and robot have it with") as error:
            refused()
        assert error.value.next_step == "write var.press.xAny or var.robot.xAny"
    with pytest.raises(UsageError, match="no field is called") as error:
        DisplayFilter("var.xAnny", fields)
    assert "var.press.xAny" in error.value.next_step
    assert "var.xAny" not in error.value.next_step.replace("var.press.xAny", "")
    listed = {entry["name"]: entry for entry in document(fields)["fields"]}
    assert "var.press.xAny" in listed
    assert "var.xAny" not in listed


def test_names_as_people_give_them() -> None:
    lists = [
        replace(list_of([INT, TIME], list_id=7), name="Druck-Liste 2"),
        replace(list_of([INT], list_id=8), name="Größen"),
        replace(list_of([INT], list_id=9), name="\x1b[31m"),
    ]
    fields = vocabulary(Layouts(Definition(tuple(lists))))
    data = b"\5\0" + (2500).to_bytes(4, "little")
    frames = [telegram(data, 2, subindex=0, counter=1, ts_ns=START_NS, list_id=7)]
    frames += [telegram(b"\6\0", 1, subindex=0, counter=1, ts_ns=START_NS, list_id=number) for number in (8, 9)]
    (rows,) = rows_of(frames)
    assert numbers("var.Druck_Liste_2.v0 == 5", rows, fields) == [1]
    assert numbers("VAR.größen.V0 == 6", rows, fields) == [2]
    assert numbers("var.__31m.v0 == 6", rows, fields) == [3]
    assert numbers("var.v1 > 2.4 && var.v1 < 2600ms", rows, fields) == [1]
    assert fields["var.v1"].help == "TIME of list Druck-Liste 2; a number is seconds"
    assert "var.Druck_Liste_2.v0" in render(fields)


def test_arrays_may_begin_below_zero() -> None:
    point = Structure("Point", (Member("x", INT),))
    of_points, of_numbers = Array(((-1, 0),), point), Array(((-2, -1), (0, 1)), INT)
    fields = vocabulary(Layouts(Definition((list_of([of_points, of_numbers]),))))
    data = np.arange(1, 7, dtype="<i2").tobytes()
    (rows,) = rows_of([telegram(data, 6, subindex=0, counter=1, ts_ns=START_NS)])
    for expression in (
        "var.v0[-1].x == 1", "var.v0[0].x == 2", "var.v1[-2,0] == 3", "var.v1[-1, 1] == 6", "var.v0[-1].x-1 == 0",
        "nv.data[-2:] == 06:00", "nv.data[-1] == 00",
    ):  # fmt: skip
        assert numbers(expression, rows, fields) == [1], expression


@pytest.mark.parametrize("kind", [String(8), String(7, wide=True), String(20)])
def test_equal_texts_are_decoded_once_whatever_stands_behind_them(
    kind: String, monkeypatch: pytest.MonkeyPatch
) -> None:
    fields = vocabulary(Layouts(Definition((list_of([kind], list_id=7),))))
    decoded: list[bytes] = []

    def value(kind: Elementary, raw: bytes) -> object:
        decoded.append(raw)
        return value_of(kind, raw)

    monkeypatch.setattr(module, "value_of", value)
    choice = random.Random(1)
    encoding = "utf-16-le" if kind.wide else "latin-1"
    texts = [choice.choice(["run", "stop", "", "full"]) for _ in range(60)]
    starts = [f"{text}\0".encode(encoding) for text in texts]
    sent = [start + choice.randbytes(kind.size_bytes - len(start)) for start in starts]
    (rows,) = rows_of([telegram(data, 1, subindex=0, counter=1, ts_ns=START_NS) for data in sent])
    assert seen(fields["var.v0"], rows) == texts
    assert len(decoded) == 4


def test_rows_that_have_the_same_bits_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_ODD", np.uint64(0))
    fields = vocabulary(Layouts(Definition((list_of([String(8)], list_id=7),))))
    texts = ["run", "stop", "run", "", "a"]
    (rows,) = rows_of([telegram(t.encode().ljust(9, b"\0"), 1, subindex=0, counter=1, ts_ns=START_NS) for t in texts])
    assert seen(fields["var.v0"], rows) == texts


def test_fields_of_other_telegrams_are_looked_for_anew() -> None:
    fields = VariableFields(Layouts(Definition((list_of([INT]),))))
    some = [telegram(bytes([n, 0]), 1, subindex=0, counter=n, ts_ns=START_NS, list_id=7 + n % 2) for n in range(6)]
    (first,), (second,) = rows_of(some), rows_of(some[1:])
    field = fields["var.v0"]
    for rows, expected in ((first, [0, 2, 4]), (second, [2, 4]), (first, [0, 2, 4]), (first.take(np.array([4])), [4])):
        assert [value for value in seen(field, rows) if value is not None] == expected


def test_equal_texts_are_one_text_whatever_stands_behind_them() -> None:
    definition = list_of([String(8)], list_id=7)
    fields = vocabulary(Layouts(Definition((definition,))))
    choice = random.Random(1)
    tails = [bytes(choice.randrange(256) for _ in range(5)) for _ in range(50)]
    frames = [telegram(b"run\0" + tail, 1, subindex=0, counter=1, ts_ns=START_NS) for tail in tails]
    (rows,) = rows_of(frames)
    assert len(numbers('var.v0 == "run"', rows, fields)) == len(frames)


def test_of_two_definitions_of_a_list_each_names_what_it_fits() -> None:
    """The sender's file and an older one of the reader, which lacks the first variable."""
    sender = replace(list_of([BOOL, INT]), name="sender")
    reader = replace(list_of([INT]), name="reader", variables=(replace(sender.variables[1], name="v1"),))
    fields = vocabulary(Layouts(Definition((reader, sender))))
    new = telegram(b"\1\7\0", 2, subindex=0, counter=1, ts_ns=START_NS)
    old = telegram(b"\x09\0", 1, subindex=0, counter=2, ts_ns=START_NS + 1)
    (rows,) = rows_of([new, old])
    assert numbers("var.v1 == 7", rows, fields) == [1]
    assert numbers("var.v1 == 9", rows, fields) == [2]
    assert numbers("var.sender.v1", rows, fields) == [1]
    assert numbers("var.v0", rows, fields) == [1]


def test_what_stands_in_front_of_a_pointer_can_be_asked_for() -> None:
    definition = list_of([INT, SCALARS["POINTER"], REAL])
    fields = vocabulary(Layouts(Definition((definition,))))
    frames = [
        telegram(
            b"\5\0" + bytes(size) + np.float32(1).tobytes(), 3, subindex=0, counter=1 + size, ts_ns=START_NS + size
        )
        for size in (4, 8)
    ]
    frames.append(telegram(b"\5\0", 1, subindex=0, counter=9, ts_ns=START_NS + 9))
    frames.append(telegram(b"\5", 1, subindex=0, counter=10, ts_ns=START_NS + 10))  # too short for it
    (rows,) = rows_of(frames)
    assert numbers("var.v0 == 5", rows, fields) == [1, 2, 3]
    assert "var.v2" not in fields


def test_of_many_variables_the_first_are_listed_and_all_can_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOST_PLACES", 300)
    lists = [replace(list_of([Array(((1, 5_000),), INT)], list_id=number), name=f"L{number}") for number in range(1, 9)]
    fields = vocabulary(Layouts(Definition(tuple(lists))))
    own = [name for name in fields if name.startswith("var.")]
    # Telegrams of 128 elements; each has a name of eight places, and one of a single place.
    assert own[:2] == ["var.v0[1]", "var.L1.v0[1]"]
    assert len(own) == 256
    told = document(fields)
    assert told["unlisted"] == 8 * 5_000 - 128
    assert {entry["name"] for entry in told["fields"]} >= set(own)
    assert "39 872 further elements of lists not listed" in " ".join(render(fields, width=200).split())
    assert output_field("VAR.l8.V0[5000]", fields).help == "INT of list L8"
    assert "var.v0[5000]" in fields
    assert "VAR.v0[5000]" not in fields
    with pytest.raises(UsageError, match="no field is called") as error:
        DisplayFilter("var.v0[5001] == 1", fields)
    assert "var.v0[" in error.value.next_step
    few = vocabulary(Layouts(Definition((list_of([INT, INT]), list_of([INT, INT])))))
    assert document(few)["unlisted"] == vocabulary().unlisted == 0
    assert "not listed" not in render(few)


def test_a_filter_makes_the_fields_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    real = module._field

    def field(name: str, *rest: Any) -> TelegramField:
        made.append(name)
        return real(name, *rest)

    monkeypatch.setattr(module, "_field", field)
    fields = vocabulary(Layouts(Definition((list_of([Array(((1, 50_000),), INT)] * 2),))))
    (rows,) = rows_of([telegram(bytes(256), 128, subindex=3, counter=1, ts_ns=START_NS)])
    assert numbers("nv.index == 7 && var.V0[400] == 0 && !var.v1[50000]", rows, fields) == [1]
    assert made == ["var.v0[400]", "var.v1[50000]"]
