"""Random requests and responses of a WebVisu, and of others that speak HTTP on its ports."""

from __future__ import annotations

import gzip
import random
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

NAMED = {
    "PLC_PRG.sString": (4, 146, 81, 8), "PLC_PRG.xToggle": (4, 144, 1, 0), "CurrentPasswords[0]": (4, 524, 21, 8),
    ".CurrentPassword": (4, 481, 41, 8), ".CurrentUserLevel": (4, 522, 2, 1),
}  # fmt: skip
ADDRESSES = [
    *NAMED.values(), (4, 0, 4, 6), (4, 4, 2, 3), (2, 48, 0, 0), (0, 6, 1, 2),
    (4, 481, 41, 9), (4, 542, 4, 5), (0, 481, 41, 9),
]  # fmt: skip
OTHER_DOWNLOADS = 9
"""One in so many lists has variables at the places of others."""

LIKE_AN_ENTRY = "a|1|4|0|4|6|9"
"""A text of which nobody can tell that it is not the end of one, and another entry."""

GARBAGE = (
    b"\x16\x03\x01\x02\x00\x01\x00",
    b"hello\r\n",
    b"\0\xff\n" * 9,
    b"SSH-2.0-x\r\nPOST / HTTP/1.1 \r\n",
    b"GET\n",
)


class Chance(random.Random):
    """What is drawn, and how far it may go."""

    wild = 0.0
    """How likely everything is that should not be, from 0 to 1."""
    plain = False
    """Whether only what tshark reads too is said: CRLF, lengths of requests, ASCII, no trailers, no HEAD, no resets."""


ENCODINGS = ("UTF-8", "'windows-1251'", '"UTF8"', "ISO8859_1", "UTF-16", "GBK")


@dataclass
class Exchange:
    """A request, what answers it, and whether one of them needs the end of its direction."""

    request: bytes
    response: bytes
    closes_request: bool = False
    closes_response: bool = False
    pause_ns: int = 2_000_000


def page(rng: Chance) -> bytes:
    names = rng.sample(sorted(NAMED), rng.randint(1, len(NAMED)))
    known = NAMED
    # Of another download, without drawing anything more.
    if zlib.crc32(" ".join(names).encode()) % OTHER_DOWNLOADS == 3:
        known = dict(zip(NAMED, [*list(NAMED.values())[1:], NAMED["PLC_PRG.sString"]], strict=True))
    rows = "".join(f'<variable name="{name}">{",".join(map(str, known[name]))}</variable>\n' for name in names)
    head = '<?xml version="1.0" encoding="ISO-8859-1"?>\n'
    text = f"{head}<visu-ini-file><variablelist>{rows}</variablelist></visu-ini-file>"
    return text.encode("latin-1")[: None if rng.random() > 0.05 else -9]


def odd_case(rng: Chance, name: str) -> str:
    return rng.choice((name, name, name.lower(), name.upper(), name.swapcase()))


def framed(
    rng: Chance, start: str, body: bytes, *, to_the_end: bool, coded: bool, no_body: bool = False
) -> tuple[bytes, bool]:
    """Return a message, and whether its end is that of its direction."""
    end = "\n" if rng.random() < 0.15 and not rng.plain else "\r\n"
    head = [start, odd_case(rng, "Host") + ": plc"]
    if coded and rng.random() < 0.15:
        coding = rng.choice(("gzip", "X-GZIP", "deflate", "deflate", "identity"))
        if coding.lower().endswith("gzip"):
            # Of several members, too, where tshark need not read it, which knows the first one alone.
            middle = len(body) // 2 if len(body) % 3 == 0 and not rng.plain else 0
            body = b"".join(gzip.compress(part, mtime=0) for part in (body[:middle], body[middle:])[not middle :])
        elif coding == "deflate":
            body = zlib.compress(body)[2:-4] if rng.random() < 0.5 else zlib.compress(body)
        if rng.random() < rng.wild / 8:
            coding = rng.choice(("br", "gzip"))
            body = rng.choice((body, b"broken", gzip.compress(bytes(2**20 + 1), mtime=0)))
        head.append(f"{odd_case(rng, 'Content-Encoding')}:{coding}")
    closes = False
    way = rng.random()
    if no_body:
        if rng.random() < 0.3:
            head.append("Content-Length: 77")
        body = b""
    elif way < 0.15:
        head.append(
            odd_case(rng, "Transfer-Encoding")
            + (": chunked" if rng.plain else rng.choice((": chunked", ":gzip, Chunked ")))
        )
        body = chunked(rng, body)
    elif way < 0.35 and to_the_end:
        closes = True
    else:
        length = str(len(body)) if rng.random() > rng.wild / 40 else rng.choice(("x", "-1", "5, 5", "99999999999"))
        head.append(f"{odd_case(rng, 'Content-Length')}:{' ' * rng.randrange(3)}{length}")
        if rng.random() < 0.05:
            head.append(f"content-length: {length}")
    before = rng.choice(("", "", "", "\r\n", "\n")) if rng.wild and not rng.plain else ""
    return (before + end.join(head) + end + end).encode("latin-1") + body, closes


def chunked(rng: Chance, body: bytes) -> bytes:
    end = b"\r\n" if rng.plain else rng.choice((b"\r\n", b"\r\n", b"\n"))
    found, at = b"", 0
    while at < len(body):
        part = body[at : at + rng.randint(1, 40)]
        size = b"%X" % len(part) if rng.random() > rng.wild / 20 else b"zz"
        found += size + rng.choice((b"", b"", b";a=b")) + end + part + end
        at += len(part)
    return found + b"0" + end + (b"" if rng.plain else rng.choice((b"", b"X-After: 1\r\n"))) + end


def version(rng: Chance) -> str:
    return rng.choice(("HTTP/1.0", "HTTP/1.1", "HTTP/1.1"))


def value(rng: Chance, address: tuple[int, ...]) -> str:
    """Return what a variable holds; a text with a `|` inside now and then."""
    if address[3] != 8:
        return str(rng.randrange(100))
    # Of what is compressed, tshark 4.0 tells ASCII only.
    return rng.choice(("abc", "", "geheim", "a|b", "|") if rng.random() < 0.4 else ("abc", "de" if rng.plain else "äö"))


def values(rng: Chance, addresses: Sequence[tuple[int, ...]]) -> list[str]:
    """Return what a controller says to these."""
    found = ["???" if rng.random() < 0.08 else value(rng, address) for address in addresses]
    if rng.random() < rng.wild / 10:
        found = found[:-1] if rng.random() < 0.6 else [*found, "9"]
    return found


def broken(rng: Chance, body: str) -> str:
    """Return a body with line ends where the field shows them, or without its last `|`."""
    if rng.random() < 0.1:
        at = rng.choice([place for place, letter in enumerate(body) if letter == "|"])
        body = rng.choice((body[:at] + "\r\n" + body[at:], body[: at + 1] + "\n" + body[at + 1 :]))
    if rng.random() < 0.1:
        body = body.removesuffix("|")
    return body + "\r\n" if rng.random() < 0.1 else body


def visu_exchange(rng: Chance, last: bool) -> Exchange:
    """Return a read or a write by POST."""
    # The same few reads again and again, as polls are.
    some = random.Random(rng.randrange(4)) if rng.random() < 0.7 else rng
    addresses = [some.choice(ADDRESSES) for _ in range(some.choice((1, 1, 2, 5, 9, 9 if rng.random() < 0.7 else 150)))]
    write = rng.random() < 0.35
    declared = len(addresses) if rng.random() > rng.wild / 10 else rng.choice((0, 1, 3, 100))
    body = f"|{int(write)}|{declared}"
    for index, address in enumerate(addresses):
        body += "".join(f"|{field}" for field in (index, *address))
        if write:
            text = value(rng, address)
            body += "|" + (LIKE_AN_ENTRY if text == "|" else text)
    if rng.random() < rng.wild / 20:
        body += "|x|1"
    body = broken(rng, body + "|")
    path = rng.choice(("/plc/webvisu.htm", "/PLC/webvisu.htm", "/webvisu/webvisu.htm", "/webvisu.htm"))
    request, closes_request = framed(
        rng,
        f"POST {path} {version(rng)}",
        body.encode("latin-1"),
        to_the_end=last and not rng.plain,
        coded=rng.random() < 0.3,
    )
    status = "200 OK" if rng.random() > rng.wild / 8 else rng.choice(("404 Not Found", "500", "204 No Content"))
    if write:
        answer = "|0|" if rng.random() > 0.15 else rng.choice(("|1|", "", "|0| x", "error"))
    else:
        answer = "".join(f"|{value}" for value in values(rng, addresses)) + "|"
    answer = broken(rng, answer) if "|" in answer else answer
    return answered(rng, request, closes_request, status, answer.encode("latin-1"), last)


def answered(
    rng: Chance, request: bytes, closes_request: bool, status: str, body: bytes, last: bool,
    to_head: bool = False,
) -> Exchange:  # fmt: skip
    no_body = to_head or status.startswith("204")
    response, closes = framed(
        rng, f"{version(rng)} {status}", body, to_the_end=last, coded=True, no_body=no_body
    )  # fmt: skip
    if rng.random() < 0.08:
        response = b"HTTP/1.1 100 Continue\r\n\r\n" + response
    return Exchange(request, response, closes_request, closes)


def query_exchange(rng: Chance, last: bool) -> Exchange:
    """Return a read or a write by the query of an older page."""
    write = rng.random() < 0.4
    name = odd_case(rng, "WRITEPI" if write else "READPI")
    count = rng.randint(1, 3)
    parts = [
        f"ADR{n or ''}=M{rng.choice('WB')}{rng.randrange(3)}%30" + (f"&VALUE{n or ''}=1%7C2" if write else "")
        for n in range(count)
    ]
    target = f"/{name}?" + "&".join([*parts, "FORMAT=%d"])
    request = f"GET {target} {version(rng)}\r\nHost: a\r\n\r\n".encode()
    status = "200 OK" if rng.random() > 0.1 + rng.wild / 8 else "403 Forbidden"
    return answered(rng, request, False, status, b"1;2;3", last)


def page_exchange(rng: Chance, last: bool) -> Exchange:
    """Return a GET, or a HEAD, of a page that names variables."""
    method = "GET" if rng.plain else rng.choice(("GET", "GET", "GET", "HEAD"))
    target = rng.choice(("/plc/visu_ini.xml", "/PLC_VISU.XML?x=1", "/plc/plc_visu.xml", "/plc/a.xml.zip"))
    request = f"{method} {target} {version(rng)}\r\n\r\n".encode()
    status = "200 OK" if rng.random() > 0.1 else "404 No"
    return answered(rng, request, False, status, page(rng), last, to_head=method == "HEAD")


def other_exchange(rng: Chance, last: bool) -> Exchange:
    """Return what others say by HTTP on such a port."""
    start = rng.choice(("POST /WebVisuV3.bin", "POST /TcAdsWebService.dll", "GET /index.htm", "OPTIONS *", "PUT /x"))
    body = rng.randbytes(rng.randrange(80)) if start[0] == "P" else b""
    request, closes = framed(
        rng, f"{start} {version(rng)}", body, to_the_end=last and start[0] == "P" and not rng.plain, coded=False
    )
    content = rng.randbytes(rng.randrange(200))
    if start.startswith("GET"):
        # The page of a visualization, of the same length, without drawing anything more.
        says = ENCODINGS[zlib.crc32(content) % len(ENCODINGS)]
        applet = f'<applet><PARAM NAME="EncodingString" value={says}></applet>'.encode()
        content = applet.ljust(len(content)) if len(applet) <= len(content) else content
    return answered(rng, request, closes, "200 OK", content, last)
