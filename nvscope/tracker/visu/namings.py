"""Namings: what is known of variables at each message, as lists and pages among these say it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U64, Bool
from dissectors.webvisu_page import encoding_said
from nvscope.engine.runs import distinct
from nvscope.tracker.visu.asking import Ask
from nvscope.tracker.visu.controllers import Controller, server_of
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.names import ListFlaw, Names, UnreadList
from nvscope.tracker.visu.plain_exchanges import Said
from nvscope.tracker.visu.unread_requests import why_unread


class Contents(NamedTuple):
    """What is said, the pair of each, and where its content lies in ``data``."""

    said: Said
    pair: I64
    data: bytes
    start: I64
    stop: I64


def namings(
    names: Names, words: Sequence[U64], contents: Contents, http: HttpMessages, asks: Sequence[Ask]
) -> tuple[I64, Mapping[int, ListFlaw]]:
    """Return what was known of variables at each message, with the lists and pages that are among them.

    And what there is to say of these: lists that contradict what was known before, or what nobody can read. ``words``
    are those of pairs, by number.
    """
    said, pair, data, start, stop = contents
    list_flaws: dict[int, ListFlaw] = {}
    spoken = distinct(pair)
    servers = [server_of(words, number) for number in spoken.tolist()]
    versions = np.array(list(map(names.version_of, servers)), np.int64)
    own = np.searchsorted(spoken, pair)
    naming: I64 = versions[own]
    for place in np.flatnonzero((said.kind == Kind.NAMES) | (said.kind == Kind.PAGE)).tolist():
        form = http.forms[int(http.form[said.message[place]])]
        if form.head is None or form.head.status != OK:
            continue
        if form.lacks_content:
            list_flaws[place] = UnreadList(why_unread(form), is_whole=False)
            continue
        content = data[int(start[place]) : int(stop[place])]
        flaw = _learn(names, servers[int(own[place])], asks[int(said.asked[place])], content)
        if flaw is not None:
            list_flaws[place] = flaw
        known = np.array(list(map(names.version_of, servers)), np.int64)
        if (known != versions).any():
            versions = known
            naming[place:] = versions[own[place:]]
    return naming, list_flaws


def _learn(names: Names, server: Controller, ask: Ask, content: bytes) -> ListFlaw | None:
    """Take a list, or a page; return what there is to say of it."""
    if ask.is_page:
        return names.learn_encoding(server, encoding_said(content) or "")
    return names.learn(server, content, ask.target.partition("?")[0].rpartition("/")[2].lower())


def without_silent_pages(said: Said, http: HttpMessages) -> Bool:
    """Tell what stays where pages go that say nothing of their texts."""
    stays = np.ones(len(said), np.bool_)
    for place in np.flatnonzero(said.kind == Kind.PAGE).tolist():
        row = int(said.message[place])
        head = http.forms[int(http.form[row])].head
        content = http.content(row) if head is not None and head.status == OK else None
        stays[place] = content is not None and encoding_said(content) is not None
    return stays
