"""The lists that rules are learnt of: what they are called, who sends them, and in which cycle."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from nvscope.check.learnt_limits import round_interval
from nvscope.check.lists import CalledLists
from nvscope.check.run import Checked
from nvscope.list_key import ListKey
from nvscope.tracker.figures import Of
from nvscope.tracker.measured import Measured
from nvscope.units import list_key

_LEAST_INTERVALS = 5
_NEAR_NOMINAL = 0.02


class LearntList(Struct, frozen=True):
    """What is known of a list before limits are learnt: what rules call it, and what was measured of it.

    ``interval_ns`` is that of a list whose streams, of which it has so many ``parts``, all come in the same cycle; None
    of others.
    """

    key: ListKey
    word: str | int
    title: str
    senders: Sequence[str]
    measured: Measured
    interval_ns: int | None
    parts: int

    def id(self, what: str) -> str:
        """Return what a rule of it is called."""
        name = "".join(one if one.isalnum() or one in "-_" else "-" for one in str(self.word).lower())
        return f"{name if isinstance(self.word, str) else f'list-{name}'}-{what}"

    @property
    def intervals(self) -> int:
        """How many intervals were measured of all its streams."""
        return self.measured.intervals.count if self.measured.intervals else 0


def learnt_lists(found: Checked) -> list[LearntList]:
    """Return all lists of which telegrams came, in their order."""
    summary = found.known.summary
    keys = found.known.keys
    called = CalledLists(keys.values(), found.names)
    measured = {one.list: one.measured for one in found.known.subjects if one.of is Of.LIST}
    streams: dict[int, list[Measured]] = {}
    for one in found.known.subjects:
        if one.of is Of.STREAM and one.list is not None:
            streams.setdefault(one.list, []).append(one.measured)
    senders = {one.key: [summary.addresses[node] for node in one.senders] for one in summary.lists}
    found_lists = []
    for number, key in sorted(keys.items(), key=lambda one: one[1]):
        if not measured[number].telegrams:
            continue
        name = found.names.get(key) or found.names.get(key.on_any_channel) or ""
        word: str | int = str(key)
        if list(called.chosen([str(key.identifier)])[0]) == [key]:
            word = key.identifier
        if name and _is_text(name) and list(called.chosen([name])[0]) == [key]:
            word = name
        short = list_key(str(key)).rpartition("/")[2]
        found_lists.append(
            LearntList(
                key, word, f"list {short}{f', {name}' if name else ''}",
                senders.get(key, ()), measured[number], _interval_ns(streams.get(number, ())),
                len(streams.get(number, ())),
            )
        )  # fmt: skip
    return found_lists


def _is_text(name: str) -> bool:
    """Tell whether a name can stand in a file: what was no UTF-8 in the name of a file cannot."""
    return not any("\ud800" <= one <= "\udfff" for one in name)


def _interval_ns(streams: Sequence[Measured]) -> int | None:
    """Return the interval of a list whose streams all come in the same cycle, None of others."""
    found: int | None = None
    for one in streams:
        own = one.intervals
        if own is None or own.count < _LEAST_INTERVALS or not own.p50 or not own.nominal:
            return None
        near = abs(own.p50 - own.nominal) <= _NEAR_NOMINAL * own.nominal
        interval_ns = own.nominal if near else own.p50
        if found is not None and abs(found - interval_ns) > _NEAR_NOMINAL * interval_ns:
            return None
        # What nobody has defined is the median: people would write a round number.
        found = found or (round_interval(own.p50) if own.nominal == own.p50 or not near else own.nominal)
    return found
