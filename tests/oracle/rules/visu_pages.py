"""How the texts of a WebVisu are encoded, as its pages say it; and which of two ports are of one controller.

Readings, where the rules leave a choice:

- ENCODINGSTRING is a <param> of the page; what counts is a whole page (.htm, .html) of status 200, the first of
  several in it, and from then on the last page that can be used. Comments are none of a page
- an encoding can be used that Python knows by the name, and that has ASCII as it is. Another one is NV809
- a page of one of the ports 80 and 8080 counts for the other one, which has none of its own
- ports 80 and 8080 of an address are of one controller until a list comes over one of them, and another list came over
  the other alone that contradicts it: a name begins elsewhere, a place has no name in common, or the file is called the
  same and has other variables. From then on each has the lists that came over it; that is NV806
"""

from __future__ import annotations

from collections import defaultdict
from html.parser import HTMLParser
from typing import TYPE_CHECKING, NamedTuple

from tests.oracle.frame import Address as Node
from tests.oracle.rules import visu_body

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Message
    from tests.oracle.rules.visu import Visu
    from tests.oracle.rules.visu_talk import Talk

USUAL = {80: 8080, 8080: 80}


class Source(NamedTuple):
    """A list, what its file is called, and over which ports it came."""

    listed: visu_body.Listed
    file: bytes
    ports: set[int]


class Pages:
    """What pages and lists said so far."""

    def __init__(self) -> None:
        self.sources: dict[tuple[Node, int], list[Source]] = defaultdict(list)
        self.apart: set[tuple[Node, int]] = set()
        """Ports of controllers that are set apart."""
        self.encodings: dict[tuple[Node, int], str] = {}


class Parameters(HTMLParser):
    """Finds what the first parameter of that name says."""

    found: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        told = {name: (text or "").strip() for name, text in reversed(attrs)}
        if tag == "param" and told.get("name", "").upper() == "ENCODINGSTRING" and self.found is None:
            self.found = told.get("value") or None


def said(page: bytes) -> str | None:
    parser = Parameters(convert_charrefs=False)
    parser.feed(page.decode("latin-1"))
    parser.close()
    return parser.found


def usable(name: str) -> bool:
    letters = bytes(range(32, 127))
    try:
        return letters.decode(name) == letters.decode("ascii")
    except (LookupError, UnicodeError, ValueError):
        return False


def take(rules: Visu, talk: Talk, request: Message, page: Message) -> None:
    """Take a page that may say how texts are encoded."""
    file = request.target.split(b"?")[0].lower()
    if (
        page.cut
        or request.method != b"GET"
        or not file.endswith((b".htm", b".html"))
        or page.status != 200
        or page.body is None
    ):
        return
    name = said(page.body)
    if name is None:
        return
    if not usable(name):
        rules.happened["encoding that cannot be used"] += 1
        return rules.find("NV809", talk)
    rules.happened["encoding"] += 1
    _, server, port = talk.pair
    rules.pages.encodings[server, port] = name


def encoding_of(rules: Visu, server: Node, port: int) -> str:
    """Return how the texts of a controller are encoded."""
    found = rules.pages.encodings.get((server, port))
    other = USUAL.get(port)
    if found is None and other is not None and not {(server, port), (server, other)} & rules.pages.apart:
        found = rules.pages.encodings.get((server, other))
    return found or "latin-1"


def text_of(rules: Visu, talk: Talk, address: visu_body.Address, text: str | None) -> str | None:
    """Return a text, of which each character is a byte, as its page has it: those of STRINGs alone are encoded."""
    if text is None or isinstance(address, str) or address[3] != visu_body.STRING:
        return text
    _, server, port = talk.pair
    return text.encode("latin-1").decode(encoding_of(rules, server, port), "backslashreplace")


def texts_of(rules: Visu, talk: Talk, address: visu_body.Address, new: str | None) -> list[str | None]:
    """Return the texts of a write: what was there before, and what is there then."""
    return [text_of(rules, talk, address, text) for text in (rules.values.known(talk.home, address), new)]


def part(rules: Visu, talk: Talk, new: Source) -> None:
    """Set a port apart, if its list is another controller's than those that came over the other port alone."""
    _, server, port = talk.pair
    other = USUAL.get(port)
    if other is None or {(server, port), (server, other)} & rules.pages.apart:
        return
    sources = rules.pages.sources[talk.home]
    if not any(other in one.ports and port not in one.ports and differ(one, new) for one in sources):
        return
    rules.happened["two controllers of one address"] += 1
    rules.find("NV806", talk)
    rules.pages.apart.add((server, port))
    keep(rules, talk.home, [one for one in sources if other in one.ports])
    for one in rules.talks.values():
        placed(rules, one)
    keep(rules, talk.home, [one for one in sources if port in one.ports])


def placed(rules: Visu, talk: Talk) -> Talk:
    """Return a connection that leads to the controller of its port."""
    _, server, port = talk.pair
    if (server, port) in rules.pages.apart:
        talk.home = (server, port)
    return talk


def called(server: Node, port: int) -> str:
    """Return what stands in front of the variables of a controller; with its port where it was set apart."""
    host = f"[{server}]" if ":" in str(server) else server
    return f"visu/{host}:{port}" if port in USUAL else f"visu/{server}"


def keep(rules: Visu, home: tuple[Node, int], sources: list[Source]) -> None:
    """Note which lists there are of a controller."""
    rules.pages.sources[home] = sources
    rules.lists[home] = [one.listed for one in sources]
    rules.names[home] = {address: name for one in sources for name, address in one.listed}


def differ(before: Source, now: Source) -> bool:
    if visu_body.contradict(before.listed, now.listed):
        return True
    if before.file == now.file and begins(before.listed) != begins(now.listed):
        return True
    names = [{(name.casefold(), address) for name, address in one.listed} for one in (before, now)]
    addresses = [{address for _, address in one} for one in names]
    return bool(addresses[0] & addresses[1] - {address for _, address in names[0] & names[1]})


def begins(listed: visu_body.Listed) -> set[tuple[object, ...]]:
    """Return where variables begin, by their names in any case."""
    return {(name.casefold(), ref, offset, size == 0) for name, (ref, offset, size, _) in listed}  # type: ignore[misc]
