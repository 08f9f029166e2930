"""Captures of lists with variables, for rules: who sends which values when."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from tests.capture.mcap.recordings import Packet, write
from tests.oracle.builders import data_frame, telegram
from tests.program_here import run_text
from tests.schemas.validation import mistakes_in

BEGIN_NS = 1_790_000_000 * 10**9

_GVL = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL
{variables}
END_VAR]]></Declarations>
  <NetvarSettings Protocol="UDP">
    <ListIdentifier>{index}</ListIdentifier>
    <Pack>True</Pack>
    <CyclicTransmission>True</CyclicTransmission>
    <Interval>T#100ms</Interval>
  </NetvarSettings>
</GVL>
"""

SAFETY = {"bStop": "BOOL", "nMode": "INT"}
"""List 7, called safety."""

VALVE = {"bClosed": "BOOL", "fPos": "LREAL", "nCount": "UINT", "sText": "STRING(7)", "tRun": "TIME"}
"""List 8, called valve."""

_PACKED = {"BOOL": "<?", "INT": "<h", "LREAL": "<d", "UINT": "<H", "STRING(7)": "8s", "TIME": "<I"}
_LISTS = {7: ("safety", SAFETY), 8: ("valve", VALVE)}

Sending = tuple[int, int, Sequence[Any]]
"""When in ms, the identifier of the list, and its values; those that are left out are 0."""


def definitions(folder: Path) -> list[Path]:
    """Write the definitions of both lists."""
    found = []
    for index, (name, variables) in _LISTS.items():
        path = folder / f"{name}.gvl"
        text = "\n".join(f"\t{one} : {kind};" for one, kind in variables.items())
        path.write_text(_GVL.format(variables=text, index=index))
        found.append(path)
    return found


def packed(index: int, values: Sequence[Any]) -> bytes:
    kinds = list(_LISTS[index][1].values())
    filled = [*values, *(b"" if kind.startswith("STRING") else 0 for kind in kinds[len(values) :])]
    return b"".join(struct.pack(_PACKED[kind], value) for kind, value in zip(kinds, filled, strict=True))


def captured(folder: Path, sendings: Iterable[Sending], name: str = "x.pcap") -> Path:
    """Write what was sent, in the order of its times."""
    found, counters = [], {7: 0, 8: 0}
    for at_ms, index, values in sorted(sendings, key=lambda one: one[0]):
        counters[index] += 1
        items = len(_LISTS[index][1])
        payload = telegram(list_id=index, counter=counters[index], data=packed(index, values), items=items)
        one = data_frame(BEGIN_NS + at_ms * 10**6, f"10.0.0.{index}", "10.0.0.255", payload)
        found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return write(folder / name, found)


def ruled(folder: Path, *rules: str, defaults: str = "") -> Path:
    path = folder / "x.rules.toml"
    texts = [f'[[rule]]\nid = "r{number}"\n{rule}\n' for number, rule in enumerate(rules)]
    path.write_text(f"[defaults]\n{defaults}\n" + "\n".join(texts))
    return path


def judged(capture: Path, rules: Path, *options: Any) -> dict[str, Any]:
    """Return what is told as data; it is valid."""
    done = run_text("check", capture, "--rules", rules, "--json", *options)
    assert done.returncode in (0, 1, 3), done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    assert mistakes_in(found) == []
    return found


def of_plant(folder: Path, sendings: Iterable[Sending], rule: str) -> tuple[str, dict[str, Any]]:
    """Return the verdict of one rule on what was sent, with the definitions, and its first subject."""
    options = [text for path in definitions(folder) for text in ("--gvl", path)]
    (one,) = judged(captured(folder, sendings), ruled(folder, rule), *options)["rules"]
    return one["verdict"], one["subjects"][0]
