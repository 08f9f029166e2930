"""Same messages: pages poll with the same request again and again, and what is the same need not be read anew."""

from __future__ import annotations

from nvscope.tracker.visu.answering import Answering
from nvscope.tracker.visu.http_forms import Forms

DIFFERING = 4
"""So many messages that differ from those before them, and more, are followed by others that differ, too."""

_AT_A_TIME = 16


def take_same(data: bytes, begin: int, behind: int, end: int, found: Forms) -> int:
    """Take the messages, up to ``end``, that follow the last one found and are the same; return how many these are.

    That one lies from ``begin`` to ``behind``.
    """
    count = _count_same(data, begin, behind, end)
    if count:
        found.repeat(behind - begin, count)
    return count


def take_known(data: bytes, begin: int, end: int, head_bytes: int, by: Answering, found: Forms) -> int:
    """Take messages from ``begin`` on that have known heads of so many bytes, as far as they are whole up to ``end``.

    ``by`` is who reads them. Return where the first other one begins, or one of which a look has to tell whether it has
    a body (``Answering.may_answer_head``): bodies of pages begin with a bar.
    """
    known, body_bytes, looks = found.known[by.side].get, found.body_bytes, by.may_answer_head
    tell_at, tell_form = found.at.append, found.form.append
    while True:
        head_end = begin + head_bytes
        number = known(data[begin:head_end])
        if number is None or (behind := head_end + body_bytes[number]) > end:
            return begin
        if looks and data[head_end : head_end + 1] != b"|":
            return begin
        tell_at(head_end)
        tell_form(number)
        begin = behind


def _count_same(data: bytes, begin: int, behind: int, end: int) -> int:
    """Return how many messages follow one, up to ``end``, that are the same; it lies from ``begin`` to ``behind``."""
    length = behind - begin
    most = (end - behind) // length
    message = data[begin:behind]
    if not most or not data.startswith(message, behind):
        return 0
    count, several = 1, message * _AT_A_TIME
    while count + _AT_A_TIME <= most and data.startswith(several, behind + count * length):
        count += _AT_A_TIME
    while count < most and data.startswith(message, behind + count * length):
        count += 1
    return count
