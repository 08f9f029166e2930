"""Lists of variables that pages load: what they name, and where that is not to be had.

Readings, where the rules leave a choice:

- a list that is cut, not whole at the end of the connection, or not read is NV807 where its first tag tells that it is
  one, among its first 256 bytes; without one, where its name does, or requests before it
- of those known before, the lists are believed that have no variable at none of the places of the new one
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from tests.oracle.rules import visu_body, visu_pages

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Message
    from tests.oracle.rules.visu import Visu
    from tests.oracle.rules.visu_talk import Talk

MARK = "\ufeff".encode()
ROOTS = (b"visualisation", b"visu-ini-file", b"variablelist", b"SymbolVarList")
FILES = (b"plc_visu.xml", b"visu_ini.xml")


def take(rules: Visu, talk: Talk, request: Message, page: Message) -> None:
    """Take a page that may name variables: all of it, or what there is of it. Or one that may say their encoding."""
    visu_pages.take(rules, talk, request, page)
    if not visu_body.is_page(request.method, request.target) or page.status != 200:
        return
    if page.body is not None:
        learn(rules, talk, visu_body.listed_in(page.body), request.target.split(b"?")[0].lower().split(b"/")[-1])
    elif may_list(page.seen, request.target, had_request=talk.had_request):
        rules.happened["list that is not whole, or not read"] += 1
        rules.find("NV807", talk)


def may_list(seen: bytes, target: bytes, *, had_request: bool) -> bool:
    """Whether a page of which only the begin is seen names variables: by its first tag, or by what it is called.

    What neither tells is one where requests went before it.
    """
    text = seen[:256].removeprefix(MARK).lstrip()
    tag = re.search(rb"<([A-Za-z_][^\s/>]*)[\s/>]", re.sub(rb"(?s)<!--.*?(-->|\Z)", b"", text))
    if text.startswith(b"<") and tag is not None:
        return tag[1] in ROOTS
    file = target.split(b"?")[0].lower().split(b"/")[-1]
    return had_request or file in FILES


def learn(rules: Visu, talk: Talk, listed: visu_body.Listed | None, file: bytes) -> None:
    """Take what a list names."""
    if listed is None:
        return rules.find("NV807", talk)
    rules.happened["names"] += len(listed)
    if not listed:
        return
    new = visu_pages.Source(listed, file, {talk.pair[2]})
    parted = len(rules.pages.apart)
    visu_pages.part(rules, talk, new)
    names = {address: name for name, address in listed}
    known, sources = rules.names[talk.home], rules.pages.sources[talk.home]
    believed = [one for one in sources if not visu_body.contradict(one.listed, listed)]
    for one in believed:
        if {name.casefold() for name, _ in one.listed} & {name.casefold() for name, _ in listed}:
            one.ports.add(talk.pair[2])
    if not visu_body.adds_password(listed, rules.lists[talk.home]) and names.items() <= known.items():
        return
    if len(believed) < len(sources) and parted == len(rules.pages.apart):
        rules.happened["other names"] += 1
        rules.find("NV806", talk)
    visu_pages.keep(rules, talk.home, [*believed, new])
