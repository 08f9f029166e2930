"""A plant whose list is on a page, too: what the list carries, and what the page shows of it later."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from tests.analysis.transactions.talk import post, reply
from tests.definition.lists import telegram
from tests.oracle.builders import MILLISECOND, START
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line

GVL = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL nCount : INT; rLevel : REAL; tRun : TIME; sText : STRING(5); bOdd : BOOL;
    CurrentPassword : STRING(5); END_VAR]]></Declarations>
  <NetvarSettings Protocol="UDP"><ListIdentifier>9</ListIdentifier><Pack>True</Pack></NetvarSettings>
</GVL>"""
NAMES = (
    b'<v><variablelist><variable name=".ncount">4,0,2,1</variable><variable name="plant.rLevel">4,4,4,6</variable>'
    b'<variable name="TRUN">4,8,4,7</variable><variable name=".sText">4,12,6,8</variable>'
    b'<variable name="PRG.nCount">4,20,2,1</variable><variable name="bodd">1,160,0,0</variable>'
    b'<variable name=".CurrentPassword">4,30,6,8</variable></variablelist></v>'
)
READ = "|0|7|0|4|0|2|1|1|4|4|4|6|2|4|8|4|7|3|4|12|6|8|4|4|20|2|1|5|1|160|0|0|6|4|30|6|8|"


def level(number: int) -> float:
    """Return a REAL, as near as four bytes have it."""
    (found,) = struct.unpack("<f", struct.pack("<f", number * 0.37))
    return float(found)


def data(at: int) -> bytes:
    """Return what the list sends at a time in ms: it changes each 50 ms."""
    count, is_odd = at // 50, at // 50 % 2
    text, password = b"c" if is_odd else b"ab", b"pw%d" % is_odd
    return struct.pack("<hfI6sB6s", count, level(count), count, text, is_odd, password)


def plant(telegrams: Sequence[int], polls: Sequence[int], *, late: int = 0) -> list[Frame]:
    """Return a list that is sent at some times in ms, and the page that is answered at others, with its values then.

    The page shows what was sent ``late`` ms before.
    """
    frames = [
        telegram(
            data(at), 6, subindex=0, counter=number, ts_ns=START + at * MILLISECOND, list_id=9
        )
        for number, at in enumerate(telegrams)
    ]  # fmt: skip
    line = Line(("10.0.0.9", 50_000), ("10.0.0.5", 80), now=START - 5 * MILLISECOND).open()
    line.ask(b"GET /plc_visu.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    for at in polls:
        line.now = START + at * MILLISECOND
        sent = max((one for one in telegrams if one <= at - late), default=0)
        count, is_odd = sent // 50, sent // 50 % 2
        text = "c" if is_odd else "ab"
        line.ask(post(READ)).answer(reply(f"|{count}|{level(count):f}|{count}|{text}|{count}|{is_odd}|pw{is_odd}|"))
    return sorted([*frames, *line.frames], key=lambda frame: frame.ts_ns)
