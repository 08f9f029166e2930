"""What is said of requests that a web server refuses: HTTP statuses, what was asked for, and what to do about it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from nvscope.enumeration import first_few
from nvscope.tracker.visu.events import OK, OTHER_STATUS
from nvscope.units import count, count_of

NEXT_OF_THE_LIST = "Load the controller's current variable list (its XML files) and reload the page."
NEXT_OF_THE_PATH = "Check the path of the page: the server has none of that name (404)."
NEXT_OF_THE_LOGIN = "The server asks for a login, which WebVisu has none of: ask whoever looks after it."
NEXT_OF_THE_WAY = (
    "The server leads elsewhere: open the page at the URL that its replies name, if it is the controller's."
)
NEXT_OF_THE_SERVER = "Look at the server's own log: an HTTP status alone does not say what is wrong."

_MOST_STATUSES, _MOST_NAMED = 8, 3

Statuses = Sequence[tuple[int, int]]
"""HTTP statuses, and how often each came."""


def refused_reads(client: str, server: str, statuses: Statuses) -> str:
    """Return that a server answered reads with other statuses than 200: with which."""
    times = sum(number for _, number in statuses)
    return f"{server} answered {count_of(times, 'read')} of {client} with HTTP status {_listed(statuses)}"


def refused_unread(client: str, server: str, statuses: Statuses, *, of_writes: bool, alone: bool) -> str:
    """Return that a server refused requests that it did not wait for, beside others where these are not ``alone``.

    ``of_writes``: some of them are known to write; of others nobody knows what they ask for.
    """
    times = sum(number for _, number in statuses)
    if alone:
        what = count_of(times, "write" if of_writes else "request")
        what += f" that {'was' if times == 1 else 'were'} never sent whole"
    else:
        what = f"{count_of(times, 'request')}, {'writes' if of_writes else 'reads'} among them,"
    return f"{server} refused {what} by {client}: HTTP status {_listed(statuses)}"


def refused_writes(client: str, server: str, variables: Sequence[str], statuses: Statuses) -> str:
    """Return that a server refused writes of some variables, and with which statuses, if another one than 200."""
    times = sum(number for _, number in statuses)
    names = first_few(variables, _MOST_NAMED, between="; ")
    why = [one for one in statuses if one[0] != OK]
    told = f": HTTP status {_listed(why, of=times)}" if why else ""
    return f"{server} refused {count_of(times, 'write')} of {names} by {client}{told}"


def next_step(statuses: Statuses) -> str:
    """Return what to do about most of the replies."""
    times: Counter[str] = Counter()
    for status, number in statuses:
        times[_step_of(status)] += number
    return times.most_common(1)[0][0]


def _step_of(status: int) -> str:
    if status in (404, 410):
        return NEXT_OF_THE_PATH
    if status in (401, 403, 407):
        return NEXT_OF_THE_LOGIN
    if 300 <= status < 400:
        return NEXT_OF_THE_WAY
    return NEXT_OF_THE_LIST if status == OK else NEXT_OF_THE_SERVER


def together(several: Sequence[Statuses]) -> tuple[tuple[int, int], ...]:
    """Return the statuses of several findings as those of one, the lowest first."""
    found: dict[int, int] = {}
    for statuses in several:
        for status, times in statuses:
            found[status] = found.get(status, 0) + times
    return tuple(sorted(found.items()))


def _listed(statuses: Statuses, of: int | None = None) -> str:
    """Return ``503``, or ``404 (2), 503 (7)``, the most frequent ones; how often where it is not all ``of`` so many."""
    if len(statuses) == 1 and of in (None, statuses[0][1]):
        return _called(statuses[0][0])
    most = sorted(statuses, key=lambda one: (-one[1], one[0]))
    told = [f"{_called(status)} ({count(times)})" for status, times in most[:_MOST_STATUSES]]
    if rest := sum(times for _, times in most[_MOST_STATUSES:]):
        told.append(f"others ({count(rest)})")
    return ", ".join(told)


def _called(status: int) -> str:
    return "one of many others" if status == OTHER_STATUS else str(status)
