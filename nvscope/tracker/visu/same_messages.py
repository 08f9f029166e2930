"""Same messages: pages poll with the same request again and again, and what is the same need not be read anew."""

from __future__ import annotations

_AT_A_TIME = 16


def count_same(data: bytes, begin: int, behind: int, end: int) -> int:
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
