"""A plant on CAN drawn at random: definitions, a candump log, and what every frame of it must say.

Packing and values are computed here once more, with ``struct`` alone: elements in the order of their declaration while
they fit into the 8 bytes of a frame, none split, nothing padded, little-endian; the next frame has the next COB-ID.
Nothing of the product is used but the words of a definition file.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

FRAME_BYTES = 8
START_NS = 1_700_000_000_000_000_000
LONG_TIMES = {"LTIME", "LTOD", "LDATE", "LDT"}
DATES = {"DATE": 10**9, "DT": 10**9, "LDATE": 1, "LDT": 1}
DURATIONS = {"TIME": 10**6, "TOD": 10**6, "LTIME": 1, "LTOD": 1}
MOST_NS = 2**63 - 1

_FORMATS = {
    "BOOL": "B", "BYTE": "B", "USINT": "B", "SINT": "b", "WORD": "<H", "UINT": "<H", "INT": "<h", "DWORD": "<I",
    "UDINT": "<I", "DINT": "<i", "LWORD": "<Q", "ULINT": "<Q", "LINT": "<q", "REAL": "<f", "LREAL": "<d", "TIME": "<I",
    "TOD": "<I", "DATE": "<I", "DT": "<I", "LTIME": "<Q", "LTOD": "<Q", "LDATE": "<Q", "LDT": "<Q",
}  # fmt: skip


class Element(NamedTuple):
    """One item: name, type, and for strings how many characters it holds."""

    name: str
    type: str
    characters: int = 0

    @property
    def size(self) -> int:
        if self.type in _FORMATS:
            return struct.calcsize(_FORMATS[self.type])
        return (self.characters + 1) * (2 if self.type == "WSTRING" else 1)

    @property
    def declared(self) -> str:
        return self.type if self.type in _FORMATS else f"{self.type}({self.characters})"

    def value(self, raw: bytes) -> Any:
        """Return what the bytes say: times in nanoseconds."""
        if self.type == "STRING":
            return raw.split(b"\0")[0].decode("latin-1")
        if self.type == "WSTRING":
            return raw.decode("utf-16-le", "replace").split("\0")[0]
        (number,) = struct.unpack(_FORMATS[self.type], raw)
        if self.type == "BOOL":
            return number != 0
        return number * {**DATES, **DURATIONS}.get(self.type, 1)


@dataclass(frozen=True)
class List:
    """A list as one file defines it."""

    name: str
    cob_id: int
    packed: bool
    declarations: tuple[tuple[str, tuple[Element, ...]], ...]
    """Declarations, with the elements that each gives."""

    @property
    def elements(self) -> list[Element]:
        return [element for _, elements in self.declarations for element in elements]

    def frames(self) -> list[list[Element]]:
        """Return the elements of each frame."""
        found: list[list[Element]] = []
        for element in self.elements:
            last = sum(one.size for one in found[-1]) if found else FRAME_BYTES
            if not self.packed or last + element.size > FRAME_BYTES:
                found.append([])
            found[-1].append(element)
        return found

    def gvl(self) -> str:
        declared = "\n".join(text for text, _ in self.declarations)
        return (
            f"<GVL><Declarations><![CDATA[VAR_GLOBAL\n{declared}\nEND_VAR]]></Declarations>"
            f'<NetvarSettings Protocol="CAN"><ListIdentifier>{self.cob_id}</ListIdentifier>'
            f"<Pack>{self.packed}</Pack><Interval>T#50ms</Interval></NetvarSettings></GVL>"
        )


class Sent(NamedTuple):
    """What one frame of the log is: values by name of the variable where it has those of a list, else none."""

    frame: int
    ts_ns: int
    channel: str
    cob_id: int
    data: bytes
    list: List | None = None
    values: dict[str, Any] = {}  # noqa: RUF012  # a tuple, never changed


@dataclass
class CanPlant:
    """Definitions, of which several may be of one list, in the order in which they are given; and the log."""

    lists: list[List] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)

    def write(self, folder: Path) -> tuple[str, list[str]]:
        """Write log and definition files; return the name of the log, and the options that name the files."""
        (folder / "plant.log").write_text("".join(f"{line}\n" for line in self.lines))
        options = []
        for number, entry in enumerate(self.lists):
            path = folder / f"d{number}" / f"{entry.name}.gvl"
            path.parent.mkdir(exist_ok=True)
            path.write_text(entry.gvl())
            options += ["--gvl", str(path)]
        return str(folder / "plant.log"), options

    def told(self) -> list[Sent]:
        """Return the frames that carry variables."""
        return [one for one in self.sent if one.list is not None]


def drawn_plant(seed: int, frames: int = 60) -> CanPlant:
    """Return the plant of a seed."""
    chance = random.Random(seed)
    plant = CanPlant()
    cob_id = chance.randrange(0x110, 0x180)
    for number in range(chance.randint(1, 3)):
        first = _drawn_list(chance, f"list{number}", cob_id)
        plant.lists.append(first)
        count = len(first.frames())
        if chance.random() < 0.4:
            # The reader's file: another layout under the same name or another.
            other = _drawn_list(chance, chance.choice([f"list{number}", f"other{number}"]), cob_id)
            plant.lists.append(other)
            count = max(count, len(other.frames()))
        cob_id += count + chance.randint(0, 3)
    if chance.random() < 0.5:
        chance.shuffle(plant.lists)
    ts_ns = START_NS
    for number in range(1, frames + 1):
        ts_ns += chance.choice([0, 1000, 250_000, 10_000_000])
        _add(plant, chance, number, ts_ns, cob_id)
    return plant


def _drawn_list(chance: random.Random, name: str, cob_id: int) -> List:
    declarations = []
    for number in range(chance.randint(1, 7)):
        kind = chance.choice([*_FORMATS, "STRING", "WSTRING"])
        characters = chance.randint(1, 7 if kind == "STRING" else 3) if kind.endswith("STRING") else 0
        # The same names in several lists: what -e var.NAME shows has to be told apart.
        variable = chance.choice(["a", "nSpeed", "x"]) + str(number)
        element = Element(variable, kind, characters)
        if chance.random() < 0.2:
            low, high = chance.choice([(0, 1), (-1, 1), (1, 3)])
            elements = tuple(element._replace(name=f"{variable}[{index}]") for index in range(low, high + 1))
            declarations.append((f"{variable} : ARRAY [{low}..{high}] OF {element.declared};", elements))
        else:
            declarations.append((f"{variable} : {element.declared};", (element,)))
    return List(name, cob_id, chance.random() < 0.7, tuple(declarations))


def _add(plant: CanPlant, chance: random.Random, number: int, ts_ns: int, free: int) -> None:
    """Add a frame: mostly one of a list, else something that carries no variables."""
    channel = chance.choice(["can0", "can0", "can1"])
    entry = chance.choice(plant.lists)
    frames = entry.frames()
    subindex = chance.randrange(len(frames))
    cob_id, data = entry.cob_id + subindex, b"".join(_raw(chance, element) for element in frames[subindex])
    kind = chance.choices(["list", "size", "fd", "extended", "remote", "error", "other"], [20, 2, 1, 1, 1, 1, 2])[0]
    identifier, body, values, told = f"{cob_id:03X}", data.hex().upper(), {}, None
    if kind == "size":
        data = chance.randbytes(chance.randint(0, 8))
        body = data.hex().upper()
    if kind in ("list", "size"):
        told, values = _fitting(plant.lists, entry.cob_id, subindex, data)
    elif kind == "fd":
        # Frames of CAN FD with the identifier of a list carry it where they have its size.
        told, values = _fitting(plant.lists, entry.cob_id, subindex, data)
        body = f"#{chance.randrange(4)}{body}"
    elif kind == "extended":
        identifier = f"{cob_id:08X}"
    elif kind == "remote":
        body = "R"
    elif kind == "error":
        identifier, body = "20000004", "0004000000000000"
    else:
        identifier = f"{chance.randrange(free, 0x7FF):03X}"
    seconds, fraction = divmod(ts_ns, 10**9)
    plant.lines.append(f"({seconds}.{fraction:09d}) {channel} {identifier}#{body}")
    plant.sent.append(Sent(number, ts_ns, channel, cob_id, data, told, values))


def _fitting(lists: Sequence[List], cob_id: int, subindex: int, data: bytes) -> tuple[List | None, dict[str, Any]]:
    """Return the first definition of a list whose frame has the size of the data, and its values."""
    for entry in lists:
        frames = entry.frames()
        if entry.cob_id == cob_id and subindex < len(frames):
            elements = frames[subindex]
            if sum(element.size for element in elements) == len(data):
                return entry, dict(_values(elements, data))
    return None, {}


def _values(elements: Sequence[Element], data: bytes) -> Iterator[tuple[str, Any]]:
    at = 0
    for element in elements:
        yield element.name, element.value(data[at : at + element.size])
        at += element.size


def _raw(chance: random.Random, element: Element) -> bytes:
    """Return some bytes of an element: usual values, ends of ranges, and any bytes."""
    if element.type == "STRING":
        text = "".join(chance.choices("abcXYZ 09äß=", k=chance.randint(0, element.characters)))
        return text.encode("latin-1").ljust(element.size, chance.choice([b"\0", b"\0", b"\xff"]))
    if element.type == "WSTRING":
        text = "".join(chance.choices("abcXYZ 09äß€", k=chance.randint(0, element.characters)))
        return (text + "\0").encode("utf-16-le").ljust(element.size, b"\0")[: element.size]
    if element.type in LONG_TIMES and chance.random() < 0.7:
        return struct.pack("<Q", chance.randrange(MOST_NS))
    pick = chance.random()
    if pick < 0.2:
        return bytes(element.size)
    if pick < 0.3:
        return b"\xff" * element.size
    return chance.randbytes(element.size)
