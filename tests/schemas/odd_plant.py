"""A plant that has what the captures of the repository do not: values of all kinds, two definitions of one list, a
variable that goes over Ethernet and CAN, and lists and buses of which little is known.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from nvscope.capture.open import open_sink
from tests.analysis.transactions.talk import post, reply
from tests.definition.lists import telegram
from tests.oracle.builders import data_frame
from tests.oracle.builders import telegram as parameter_telegram
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of
from tests.simulate.simulation import simulated
from tests.tracker.visu.shown_and_carried import GVL, plant

_START_NS = 1_700_000_000_000_000_000
_MS = 1_000_000
_SENT = 12
_TWO_READERS = Path(__file__).parents[1] / "scenarios" / "acknowledgement-two-readers.toml"
_NOT_A_NUMBER = (_SENT // 2 - 1, _SENT - 1)
_VALUES = struct.Struct("<hBIfI4s")
_GVL = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL {declared} END_VAR]]></Declarations>
  <NetvarSettings Protocol="{protocol}">{identifier}<Pack>True</Pack></NetvarSettings>
</GVL>"""
_SHARED = "nCount : INT; bRun : BOOL; tRun : TIME; rLevel : REAL; {odd} : DATE; sName : STRING(3);"

DEFINITIONS = {
    "eth.gvl": ("UDP", 9, _SHARED.format(odd="dDay")),
    "can.gvl": ("CAN", 0x190, _SHARED.format(odd="dOther")),
    "overlapping.gvl": ("CAN", 0x191, "nOther : LINT; nFurther : LINT;"),
    "other_type.gvl": ("UDP", 12, "nCount : DINT;"),
    "elsewhere.gvl": ("UDP", 21, _SHARED.format(odd="dDay")),
    "before.gvl": ("UDP", 10, _SHARED.format(odd="dDay")),
    "after.gvl": ("UDP", 10, "nCount : INT;"),
    "long.gvl": ("CAN", 0x1A0, "sLong : STRING(20); nBehind : INT;"),
    "unknown.gvl": ("UDP", 9, "nCount : INT; pNext : POINTER TO INT; nBehind : INT;"),
    "nameless.gvl": ("UDP", None, "nCount : INT;"),
}  # fmt: skip

_ONE_BY_ONE = (
    ("BOOL", b"\1"),
    ("REAL", b"\0\0\xc0\x7f"),
    ("STRING(2)", b"a\0b"),
    ("INT", b"\1\0"),
    ("BYTE", bytes(300)),
)
_TYPED = tuple((kind, items, items * data) for kind, data in _ONE_BY_ONE for items in (1, 2))
_PARAMETERS = "".join(
    f'"0x{0x2100 + index:x}:0" = {{ name = "p{index}", type = "{kind}" }}\n' for index, (kind, *_) in enumerate(_TYPED)
)


def make_odd_plant(folder: Path) -> None:
    """Write it to a folder: captures, logs and definitions."""
    for name, (protocol, identifier, declared) in DEFINITIONS.items():
        told = "" if identifier is None else f"<ListIdentifier>{identifier}</ListIdentifier>"
        (folder / name).write_text(_GVL.format(declared=declared, protocol=protocol, identifier=told))
    (folder / "named.toml").write_text(
        'definitions = ["eth.gvl"]\n[nodes]\n"10.0.0.1" = { name = "press" }\n"10.0.0.2" = { name = "saw" }\n'
        f"[parameters]\n{_PARAMETERS}"
    )
    (folder / "empty.toml").write_text(_EMPTY_SCENARIO)
    (folder / "odd.rules.toml").write_text('[[rule]]\nid = "gaps"\ncheck = "gap"\n')
    (folder / "variables.rules.toml").write_text(
        '[[rule]]\nid = "still"\ncheck = "frozen"\nvariable = "*"\nmax = "1s"\n'
        '[[rule]]\nid = "load"\ncheck = "bus_load"\nmax = "50%"\n'
    )
    (folder / "requests.rules.toml").write_text(
        '[[rule]]\nid = "answered"\ncheck = "transaction"\nmax_errors = "10%"\n'
        '[[rule]]\nid = "few"\ncheck = "transaction"\nmax_errors = 1\n'
        '[[rule]]\nid = "who"\ncheck = "writes"\nonly_by = "saw"\n'
    )
    values = [_values(number) for number in range(_SENT)]
    frames = []
    for number, data in enumerate(values):
        at_ns = _START_NS + number * 10 * _MS
        frames.append(telegram(data, 6, subindex=0, counter=number, ts_ns=at_ns, list_id=9))
        shape = (data, 6) if number < _SENT // 2 else (data[:2], 1)
        frames.append(telegram(*shape, subindex=0, counter=number, ts_ns=at_ns + _MS, list_id=10))
        frames.append(telegram(b"\0", 3, subindex=0, counter=number, ts_ns=at_ns + 2 * _MS, list_id=11))
    _write(folder / "eth.pcap", frames)
    _write(folder / "one.pcap", frames[:1])
    split = [telegram(b"\0\0", 1, subindex=part, counter=1, ts_ns=_START_NS + part, list_id=9) for part in (0, 1)]
    _write(folder / "split.pcap", split)
    (folder / "cut.pcap").write_bytes((folder / "one.pcap").read_bytes()[:40])
    simulated(_TWO_READERS).write(folder / "two_readers.pcap")
    unasked = data_frame(_START_NS, "10.0.0.3", "10.0.0.1", parameter_telegram(2))
    refused = [frame for service in range(20, 29) for frame in _refused(service)]
    _write(folder / "refusing.pcap", [unasked, *refused, *_written()])
    _write(folder / "pages.pcap", _pages())
    _write(folder / "timed_pages.pcap", _timed_pages())
    _write(folder / "shown.pcap", plant(range(0, 500, 10), range(25, 500, 60)))
    _write(folder / "shown_once.pcap", plant([10], [100]))
    (folder / "shown.gvl").write_text(GVL)
    lines = []
    for number, data in enumerate(values):
        at_s = (_START_NS + (number * 10 + 2) * _MS) / 1e9
        parts = [data[:7], data[7:15], data[15:]]
        lines += [f"({at_s:.6f}) can0 {0x190 + place:X}#{part.hex().upper()}\n" for place, part in enumerate(parts)]
    (folder / "can.log").write_text("".join(lines))
    (folder / "one.log").write_text(lines[0])
    (folder / "bus_off.log").write_text(_BUS_OFF)
    (folder / "dropped.log").write_text(_DROPPED)
    (folder / "alike.log").write_text("".join(_alike()))


def _refused(service: int) -> list[Frame]:
    """Return a request of the Parameter Manager, and a reply that refuses it."""
    at_ns, key = _START_NS + service * 10 * _MS, {"list_id": 0x2000, "counter": service, "data": b""}
    return [
        data_frame(at_ns, "10.0.0.1", "10.0.0.2", parameter_telegram(3, **key)),
        data_frame(at_ns + _MS, "10.0.0.2", "10.0.0.1", parameter_telegram(service, **key)),
    ]


def _written() -> Iterator[Frame]:
    """Yield writes of all kinds of values; of each parameter a confirmed one, and another one over that value.

    Of those, the first is not answered, the second busy, and the last open.
    """
    at_ns = _START_NS + 1_000 * _MS
    for index, (_, items, data) in enumerate(_TYPED):
        for counter, old in enumerate((data, bytes(len(data)))):
            key = {"list_id": 0x2100 + index, "counter": counter}
            at_ns += _MS
            request = parameter_telegram(3, **key, items=items, data=old)
            yield data_frame(at_ns, "10.0.0.1", "10.0.0.2", request)
            if not counter or index:
                reply = parameter_telegram(100 if counter and index == 1 else 4, **key, data=b"")
                yield data_frame(at_ns + 1, "10.0.0.2", "10.0.0.1", reply)
    yield data_frame(at_ns + 1_000 * _MS, "10.0.0.1", "10.0.0.2", parameter_telegram(3, 0x2200))


def _pages() -> list[Frame]:
    """Return writes by web visualization: of an address, and of what may be a password; without a reply."""
    line = Line(("10.0.0.1", 40_000), ("10.0.0.2", 80), now=_START_NS).open()
    line.ask(b"GET /WRITEPI?ADR=MW230&VALUE=12 HTTP/1.1\r\n\r\n")
    body = b"|1|1|0|4|0|21|8|secret|"
    line.ask(b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
    # What else is spoken on these ports.
    for other in (b"/WebVisuV3.bin", b"/TcAdsWebService/TcAdsWebService.dll"):
        line.ask(b"POST %s HTTP/1.1\r\nContent-Length: 1\r\n\r\nx" % other)
    begins = (b"\x16\x03\x01" + bytes(3000), b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"?\n")
    others = [Line(("10.0.0.9", port), now=line.now).open().ask(begin) for port, begin in enumerate(begins, 50_001)]
    return [*line.frames, *(frame for other in others for frame in other.frames)]


def _timed_pages() -> list[Frame]:
    """Return reads of times and dates, and a write by an older page."""
    line = Line(("10.0.0.1", 40_000), ("10.0.0.2", 80), now=_START_NS).open()
    for number in range(3):
        line.wait(10 * _MS).ask(post("|0|2|0|4|0|4|7|1|4|4|4|20|")).answer(reply(f"|{1_500 + number}|{1_700_000_000}|"))
    return line.ask(b"GET /WRITEPI?ADR=MW230&VALUE=12 HTTP/1.1\r\n\r\n").answer(reply("")).frames


def _values(number: int) -> bytes:
    level = float("nan") if number in _NOT_A_NUMBER else number / 2
    day = 1_700_006_400 + number * 86_400
    return _VALUES.pack(number, number % 2, number * 1_000, level, day - day % 86_400, f"{number}".encode())


def _write(path: Path, frames: list) -> None:  # type: ignore[type-arg]
    sink = open_sink(str(path))
    sink.write(batch_of(frames))
    sink.close()


def _alike() -> Iterator[str]:
    """Yield the lines of a log whose identifiers have a finding alike."""
    for number, size in enumerate((8, 8, 4)):
        for identifier in range(0x301, 0x307):
            yield f"(1700000000.{number}{identifier:05d}) can0 {identifier:X}#{'11' * size}\n"


# Node 5 answers an SDO and has an emergency, and nothing tells its state; the controller leaves the bus for good.
_BUS_OFF = """(1700000000.000000) can0 605#4000100000000000
(1700000000.001000) can0 585#4300100000000000
(1700000000.002000) can0 085#0010010000000000
(1700000000.003000) can0 20000040#0000000000000000
"""
_DROPPED = """ (001.000000)  can0  123   [1]  11
DROPCOUNT: dropped 7 CAN frames on 'can0' socket (total drops 7)
 (002.000000)  can0  123   [1]  12
"""
_EMPTY_SCENARIO = """title = "Nobody sends"
duration = "1s"

[[node]]
name = "press"
address = "192.168.1.10"
"""
