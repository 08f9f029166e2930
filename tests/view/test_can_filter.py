"""Display filters on CAN against a plain filter over the same frames, also among telegrams on Ethernet."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.open import open_source
from nvscope.errors import UsageError
from nvscope.expression.typed_columns import TextColumn
from nvscope.view.display_filter import DisplayFilter
from nvscope.view.fields.vocabulary import FIELDS, vocabulary
from nvscope.view.rows.frames import FrameRows
from tests.definition.lists import telegram
from tests.export.given import written
from tests.laws import examples
from tests.packets import Shown

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
CANOPEN = (
    ("NMT", 0, 0), ("SYNC", 0x80, 0x80), ("EMCY", 0x81, 0xFF), ("TIME", 0x100, 0x100), ("TPDO1", 0x181, 0x1FF),
    ("RPDO1", 0x201, 0x27F), ("TPDO2", 0x281, 0x2FF), ("RPDO2", 0x301, 0x37F), ("TPDO3", 0x381, 0x3FF),
    ("RPDO3", 0x401, 0x47F), ("TPDO4", 0x481, 0x4FF), ("RPDO4", 0x501, 0x57F), ("SDO answer", 0x581, 0x5FF),
    ("SDO request", 0x601, 0x67F), ("heartbeat", 0x701, 0x77F),
)  # fmt: skip

Value = Any
Fields = dict[str, Value]
Test = Callable[[Fields], bool]


@dataclass(frozen=True)
class Mixture:
    """What each row has, by name of the field, and the rows as the product reads them, in pieces."""

    fields: list[Fields]
    pieces: list[FrameRows]


def canopen_of(identifier: int) -> Fields:
    for name, first, last in CANOPEN:
        if first <= identifier <= last:
            node = {"canopen.node": identifier & 0x7F} if first < last else {}
            return {"canopen.function": name, **node}
    return {}


def drawn_frame(chance: random.Random) -> tuple[str, Fields]:
    """Return what follows the time in a line, and the fields of the frame."""
    channel = chance.choice(["can0", "can1", "vcan-9"])
    kind = chance.choices(["data", "extended", "remote", "error", "fd"], [8, 3, 1, 1, 2])[0]
    extended = kind == "extended" or (kind in ("remote", "fd") and chance.random() < 0.3)
    identifier = chance.choice([0x181, 0x182, 0x80, 0x705, 0x585, chance.randrange(0x7E0)])
    if extended:
        identifier = chance.choice([0x181, 0x18FF0010, chance.randrange(1 << 29)])
    length = chance.choice(FD_LENGTHS) if kind == "fd" else chance.choice([0, 1, 2, 4, 8, 8])
    data = bytes(chance.choice([0, 1, 2, 0xFF, chance.randrange(256)]) for _ in range(length))
    fields: Fields = {
        "can.channel": channel, "can.id": identifier, "can.flags.xtd": extended, "can.flags.rtr": kind == "remote",
        "can.flags.err": kind == "error", "can.len": length, "can.dlc": length, "can.data": data,
        "can.fd": kind == "fd",
    }  # fmt: skip
    text, body = f"{identifier:0{8 if extended else 3}X}", data.hex().upper()
    if kind == "remote":
        fields["can.data"], body = b"", f"R{length or ''}"
    elif kind == "error":
        identifier, data = chance.choice([4, 8, 0x40, 0]), chance.choice([data[:8], b""]).ljust(8, b"\0")
        text, body = f"{0x20000000 | identifier:08X}", data.hex().upper()
        # Its classes are no identifier: no filter of a COB-ID meets them.
        del fields["can.id"]
        classes = {4: "controller problem", 8: "protocol violation", 0x40: "bus off", 0: "error frame, class not"}
        fields |= {"can.data": data, "can.len": 8, "can.dlc": 8, "class": classes[identifier]}
        if not identifier and not any(data):
            del fields["can.data"]
    elif kind == "fd":
        flags = chance.randrange(4)
        body = f"#{flags:X}{body}"
        fields |= {
            "canfd.flags.brs": bool(flags & 1), "canfd.flags.esi": bool(flags & 2), "can.dlc": FD_LENGTHS.index(length),
        }  # fmt: skip
    if kind != "error" and not extended:
        fields |= canopen_of(identifier)
    fields |= {"list.id": identifier} if kind in ("data", "extended", "fd") else {}
    way = chance.choice(["", "Rx", "Tx"])
    fields |= {"can.direction": way} if way else {}
    return f"{channel} {text}#{body}{way and ' ' + way[0]}", fields


@cache
def mixture(seed: int) -> Mixture:
    """Return the frames of a log among telegrams of another capture, some of which lie between them."""
    chance = random.Random(seed)
    fields: list[Fields] = []
    lines, frames = [], []
    for number in range(120):
        if chance.random() < 0.3:
            index, counter = chance.choice([7, 0x181]), chance.randrange(100)
            data = bytes([counter, 0])
            frames.append(telegram(data, 1, subindex=0, counter=counter, ts_ns=number * 1_000_000, list_id=index))
            fields.append(
                {"nv.index": index, "nv.counter": counter, "nv.data": data, "udp.port": 1202, "list.id": index}
            )
        else:
            line, told = drawn_frame(chance)
            lines.append(f"(0000000000.{number:03d}000) {line}\n")
            fields.append(told)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "a.log"
        log.write_text("".join(lines))
        source = open_source([str(log), str(Path(folder) / written(Path(folder), frames))])
        pieces = list(Shown(source))
    for number, told in enumerate(fields):
        told["frame.number"] = number + 1
    assert sum(map(len, pieces)) == len(fields)
    return Mixture(fields, pieces)


COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "==": lambda a, b: a == b, "!=": lambda a, b: a != b, "<": lambda a, b: a < b, "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b, ">=": lambda a, b: a >= b,
}  # fmt: skip
NUMBERS = (
    "can.id",
    "can.len",
    "can.dlc",
    "canopen.node",
    "nv.index",
    "nv.counter",
    "udp.port",
    "list.id",
    "frame.number",
)
FLAGS = ("can.flags.xtd", "can.flags.rtr", "can.flags.err", "can.fd", "canfd.flags.brs", "canfd.flags.esi")


def drawn(chance: random.Random, some: list[Fields], depth: int = 2) -> tuple[str, Test]:
    """Return an expression, and the test that it stands for; values are those of frames more often than not."""
    if depth and chance.random() < 0.6:
        one, first = drawn(chance, some, depth - 1)
        if chance.random() < 0.3:
            return f"!({one})", lambda fields: not first(fields)
        other, second = drawn(chance, some, depth - 1)
        if chance.random() < 0.5:
            return f"({one}) && ({other})", lambda fields: first(fields) and second(fields)
        return f"({one}) || ({other})", lambda fields: first(fields) or second(fields)
    return drawn_atom(chance, chance.choice(some))


def drawn_atom(chance: random.Random, model: Fields) -> tuple[str, Test]:
    kind = chance.choice(["number", "number", "set", "flag", "byte", "slice", "contains", "text", "protocol"])
    if kind in ("number", "set"):
        name = chance.choice(NUMBERS)
        value = model.get(name, chance.choice([0, 8, 0x181]))
        if kind == "set":
            others = [value, value + 3]
            return (
                f"{name} in {{{value}, {value + 2:#x}..{value + 3}}}",
                lambda fields: (
                    name in fields and (fields[name] == others[0] or others[1] - 1 <= fields[name] <= others[1])
                ),
            )
        return compared(chance, name, lambda fields: fields.get(name), value, f"{value:#x}")
    if kind == "flag":
        name = chance.choice(FLAGS)
        wanted = chance.random() < 0.5
        return f"{name} == {wanted:d}", lambda fields: name in fields and fields[name] == wanted
    name = chance.choice(["can.data", "can.data", "nv.data"])
    data = model.get(name, b"\1\2")
    if kind == "byte":
        place = chance.randrange(9)
        value = data[place] if place < len(data) else 1
        return compared(
            chance, f"{name}[{place}]", lambda fields: part(fields.get(name), place, place + 1), bytes([value]),
            f"{value:02x}",
        )  # fmt: skip
    if kind == "slice":
        start = chance.randrange(4)
        stop = start + chance.randint(1, 4)
        value = (data[start:stop] or b"\0").ljust(stop - start, b"\0")
        return compared(
            chance, f"{name}[{start}-{stop - 1}]", lambda fields: part(fields.get(name), start, stop), value,
            value.hex(":"),
        )  # fmt: skip
    if kind == "contains":
        value = data[:2] or b"\1"
        return f"{name} contains {value.hex(':')}", lambda fields: name in fields and value in fields[name]
    if kind == "text":
        name = chance.choice(["can.channel", "canopen.function"])
        value = model.get(name, "can0" if name == "can.channel" else "SYNC")
        return f'{name} == "{value}"', lambda fields: name in fields and fields[name] == value
    name, field = chance.choice(
        [
            ("can", "can.len"),
            ("nv", "nv.index"),
            ("udp", "udp.port"),
            ("canopen", "canopen.function"),
            ("ip", "udp.port"),
        ]
    )
    return name, lambda fields: field in fields


def compared(
    chance: random.Random, text: str, read: Callable[[Fields], Value], value: Value, value_text: str
) -> tuple[str, Test]:  # fmt: skip
    sign = chance.choice(list(COMPARE))
    return (
        f"{text} {sign} {value_text}",
        lambda fields: (found := read(fields)) is not None and COMPARE[sign](found, value),
    )


def part(data: bytes | None, start: int, stop: int) -> bytes | None:
    """Return a slice where all of it is there."""
    return data[start:stop] if data is not None and len(data) >= stop else None


@examples(400)
@given(st.integers(0, 9), st.integers(0, 10**9))
def test_a_filter_chooses_the_frames_that_a_plain_one_does(seed: int, draw: int) -> None:
    captured = mixture(seed)
    expression, test = drawn(random.Random(draw), captured.fields)
    ask = DisplayFilter(expression, vocabulary())
    chosen = [number for rows in captured.pieces for number in rows.frame_number[ask(rows)].tolist()]
    expected = [number for number, fields in enumerate(captured.fields, 1) if test(fields)]
    assert chosen == expected, expression


@pytest.mark.parametrize(
    ("expression", "what"),
    [
        ("can.id == can0", "can0"),
        ("can.data[0] == 256", "256 is no sequence of bytes"),
        ("can.data == 1.5", "1.5 is no sequence of bytes"),
        ("can.flags.xtd > 5", "neither below nor above"),
        ("can.channel == 0", "0 is no text"),
        ("can.foo", "no field is called can.foo"),
    ],
)
def test_what_cannot_be_meant_is_told(expression: str, what: str) -> None:
    with pytest.raises(UsageError, match=what):
        DisplayFilter(expression, vocabulary())


def test_an_error_frame_has_no_identifier_as_in_tshark_and_tells_what_it_is() -> None:
    for seed in range(8):
        drawn, number = mixture(seed), 0
        for rows in drawn.pieces:
            known = {name: FIELDS[name].exists(rows) for name in ("can.id", "can.data", "can.error")}
            errors = FIELDS["can.error"].column(rows)
            assert isinstance(errors, TextColumn)
            for row in range(len(rows)):
                fields, number = drawn.fields[number], number + 1
                there = {name: bool(found is None or found[row]) for name, found in known.items()}
                told = "class" in fields
                assert there == {"can.id": "can.id" in fields, "can.data": "can.data" in fields, "can.error": told}
                if told:
                    assert errors.texts[errors.code[row]].startswith(fields["class"])
