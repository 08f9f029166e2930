"""What was written, and what rules call it: parameters by Index and SubIndex or by name, variables of WebVisu."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from nvscope.check.parameters import Unfit
from nvscope.check.who_asks import PROTOCOLS, Pair
from nvscope.name_patterns import fits, is_pattern
from nvscope.toml_table import TEXT, Place, ValueKind, array
from nvscope.units import parameter

_MOST_PATTERNS = 100
_PARAMETER = re.compile(r"(0x[0-9a-f]{1,8}|[0-9]{1,10}):([0-9]{1,5})", re.IGNORECASE)
_ADDRESS = re.compile(r"[0-9*?]+(,[0-9*?]+){3}")
_PATH = re.compile(rf"({'|'.join(PROTOCOLS)})/([^/]+)/(.+)", re.IGNORECASE | re.DOTALL)


class Written(NamedTuple):
    """What was written: ``place`` says where it lies; ``name`` is its name, "" without one, None where nobody knows."""

    pair: Pair
    place: str
    name: str | None

    @property
    def called(self) -> str:
        """What people call it."""
        return self.name or self.place


def _usual(text: str) -> str:
    """Return Index and SubIndex as all others are written; other texts as they are."""
    told = _PARAMETER.fullmatch(text)
    return text if told is None else parameter(int(told[1], 0), int(told[2]))


class Places:
    """What a rule lets be written: parameters, variables, and patterns of these; with a protocol and node in front, of
    these alone: ``sdo/press/0x2000:1``.
    """

    def __init__(self, words: Sequence[str], node_names: Mapping[str, str]) -> None:
        self._node_names = node_names
        self._plain: list[str] = []
        self._of: list[tuple[str, str, str]] = []
        for word in words:
            path = _PATH.fullmatch(word)
            if path is None:
                self._plain.append(_usual(word))
            else:
                self._of.append((path[1].lower(), path[2], _usual(path[3])))

    def holds(self, written: Written) -> bool | None:
        """Tell whether something is one of these; None where nobody knows its name, by which it may be one."""
        called = [written.place, written.name] if written.name else [written.place]
        nodes = [one for one in (written.pair.server, self._node_names.get(written.pair.server)) if one]
        own = [
            rest for protocol, node, rest in self._of
            if protocol == written.pair.protocol and any(fits(node, one) for one in nodes)
        ]  # fmt: skip
        wanted = [*self._plain, *own]
        if any(fits(word, one) for word in wanted for one in called):
            return True
        return None if written.name is None and any(not _is_place(word) for word in wanted) else False


def _is_place(word: str) -> bool:
    """Tell whether a word says where something lies, and not what it is called."""
    return _PARAMETER.fullmatch(word.replace("*", "0").replace("?", "0")) is not None or bool(_ADDRESS.fullmatch(word))


_TEXTS = array(TEXT, single=True)


def _places(value: Any, place: Place) -> tuple[str, ...]:
    found: tuple[str, ...] = _TEXTS.read(value, place)
    if not found:
        raise place.error("nothing is in it", "Name parameters or variables, or leave the key out.")
    if sum(map(is_pattern, found)) > _MOST_PATTERNS:
        raise place.error(f"there are more than {_MOST_PATTERNS} patterns in it", "Name variables, or fewer patterns.")
    return found


PLACES = ValueKind(_TEXTS.name, _places, schema=_TEXTS.schema)
"""Parameters (``0x2000:1``) and variables by name, or patterns of these."""


def refuse_nothing(told: Mapping[str, Any]) -> None:
    """Raise Unfit where a rule says neither who may write nor what may be written."""
    if told["only_by"] is None and not told["only_to"]:
        raise Unfit("writes need only_by, only_to, or both", next_step='only_by = "hmi" says who may write')
