"""Definitions that fit a capture: drawn so that its telegrams have the shape that they give them."""

from __future__ import annotations

import random
from collections import defaultdict
from pathlib import Path

from nvscope.capture.capture_file import CaptureFile
from nvscope.errors import UnreadableInput
from tests.packets import tracked

_HEADER_BYTES = 20
_MOST_LISTS = 12
_SCALARS = {
    1: ("BOOL", "BYTE", "SINT", "USINT", "Colour"),
    2: ("INT", "UINT", "WORD", "Mode", "INT(-5..5)"),
    4: ("DINT", "UDINT", "DWORD", "REAL", "TIME", "TOD", "DATE", "DT"),
    8: ("LREAL", "LINT", "ULINT", "LWORD", "LTIME"),
}
TYPES = """TYPE Colour : (red, green := 5, blue, grey := 200) BYTE; END_TYPE
TYPE Mode : (idle, run, stop := 1, broken := -1); END_TYPE
"""
_NAMES = ("Index", "frame", "a", "Größe", "list", "number")


def matching(raw: bytes, folder: Path, rng: random.Random) -> dict[str, bytes]:
    """Return definition files, one a list and one of the types, by name; none where a capture cannot be read."""
    path = folder / "shapes"
    path.write_bytes(raw)
    try:
        state = tracked(CaptureFile(str(path)))
    except UnreadableInput:
        return {}
    shapes: dict[tuple[int, int], dict[int, tuple[int, int]]] = defaultdict(dict)
    from nvscope.tracker.summary import summarize  # noqa: PLC0415
    from nvscope.view.documents.report import report_document  # noqa: PLC0415

    for entry in report_document(summarize(state), [], [])["lists"]:
        for stream in entry["streams"]:
            if stream["items"] is not None:
                shapes[entry["port"], entry["id"]].setdefault(stream["subindex"], (stream["items"], stream["length"]))
    chosen = rng.sample(sorted(shapes), min(len(shapes), _MOST_LISTS))
    files = {f"list{port}_{index}.gvl": _gvl(rng, port, index, shapes[port, index]).encode() for port, index in chosen}
    return files | {"types.st": TYPES.encode()} if files else {}


def _gvl(rng: random.Random, port: int, index: int, shapes: dict[int, tuple[int, int]]) -> str:
    """Return a list whose first telegrams have these shapes, as far as there are types that make them."""
    unpacked = len(shapes) > 1 and all(items == 1 for items, _ in shapes.values())
    lines: list[str] = []
    for subindex in range(max(shapes) + 1 if max(shapes) < 300 else 1):
        items, length = shapes.get(subindex, (1, _HEADER_BYTES + 1))
        lines += _declared(rng, len(lines), items, length - _HEADER_BYTES)
    declarations = "\n".join(lines)
    return f"""<GVL><Declarations><![CDATA[VAR_GLOBAL
{declarations}
END_VAR]]></Declarations><NetvarSettings Protocol="UDP"><ListIdentifier>{index}</ListIdentifier>
<Pack>{not unpacked}</Pack><Interval>T#{rng.choice((1, 50, 100, 1000))}ms</Interval>
<ProtocolSettings><ProtocolSetting Name="Port" Value="{port}" /></ProtocolSettings></NetvarSettings></GVL>
"""


def _declared(rng: random.Random, first: int, items: int, size_bytes: int) -> list[str]:
    """Return declarations of that many elements with that many bytes in all, if that can be."""
    lines: list[str] = []
    for left in range(items, 0, -1):
        fitting = [size for size in _SCALARS if size_bytes - size >= left - 1]
        if left == 1 and size_bytes not in _SCALARS and size_bytes > 1:
            kind = f"WSTRING({size_bytes // 2 - 1})" if size_bytes % 2 == 0 and size_bytes > 2 and rng.random() < 0.3 \
                else f"STRING({size_bytes - 1})"  # fmt: skip
        elif left == 1 and size_bytes in _SCALARS:
            kind = rng.choice(_SCALARS[size_bytes])
        else:
            size = rng.choice(fitting or [1])
            kind = rng.choice(_SCALARS[size])
            size_bytes -= size
        name = rng.choice((f"v{first + len(lines)}", f"{rng.choice(_NAMES)}{first + len(lines)}"))
        lines.append(f"{name} : {kind};")
    return lines
