"""Who asks whom: pairs of nodes that speak by requests and replies, and which of them a rule is for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from typing import Any, NamedTuple

from dissectors import address
from nvscope.check.check import Evidence
from nvscope.check.parameters import Parameter, Unfit
from nvscope.name_patterns import fits, is_pattern
from nvscope.toml_table import TEXT, Place, ValueKind, array, choice
from nvscope.units import endpoint

SDO, VISU = "sdo", "visu"
PROTOCOLS = (SDO, VISU)
"""The Parameter Manager, and WebVisu: as parameters of rules and fields have them."""

_MOST_PATTERNS = 100
_NETWORK = re.compile(r"[0-9a-fA-F.:]+/[0-9]+")


class Pair(NamedTuple):
    """Who asks whom on which port, by which protocol; addresses are texts."""

    protocol: str
    client: str
    server: str
    port: int

    @property
    def order(self) -> tuple[object, ...]:
        """A key that sorts pairs as tables have them."""
        ends = (address.order(*address.halves(one)) for one in (self.client, self.server))
        return PROTOCOLS.index(self.protocol), *ends, self.port

    @property
    def asked(self) -> str:
        """Whom it asks, in words."""
        return endpoint(self.server, self.port)


def _node(value: Any, place: Place) -> str:
    text = str(TEXT.read(value, place))
    if _NETWORK.fullmatch(text):
        try:
            ip_network(text, strict=False)
        except ValueError:
            raise place.error(f"'{text[:60]}' is no network", 'Write "192.168.1.0/24".') from None
    return text


_NODES = array(ValueKind("node", _node, schema={"type": "string"}), single=True)


def _nodes(value: Any, place: Place) -> tuple[str, ...]:
    found = _nodes_or_none(value, place)
    if not found:
        raise place.error("no node is in it", "Name one, or leave the key out.")
    return found


def _nodes_or_none(value: Any, place: Place) -> tuple[str, ...]:
    found: tuple[str, ...] = _NODES.read(value, place)
    if sum(map(is_pattern, found)) > _MOST_PATTERNS:
        raise place.error(f"there are more than {_MOST_PATTERNS} patterns in it", "Name networks: 192.168.1.0/24.")
    return found


NODES = ValueKind(_NODES.name, _nodes, schema=_NODES.schema)
"""Addresses, names of the project, patterns of both, and networks."""

NODES_OR_NONE = ValueKind(_NODES.name, _nodes_or_none, schema=_NODES.schema)
"""The same, where an empty array stands for nobody."""

WHO = (
    Parameter("protocol", choice(*PROTOCOLS), "of the Parameter Manager (sdo) or of WebVisu (visu) only", None),
    Parameter("requester", NODES, "of these only: who asks, by address, name, pattern or network", ()),
    Parameter("client", NODES, "the same, as WebVisu has it", ()),
    Parameter("partner", NODES, "to these only: who is asked, likewise", ()),
    Parameter("server", NODES, "the same, as WebVisu has it", ()),
)
"""The parameters by which rules say which pairs they are for."""


class Nodes:
    """Nodes as rules name them: by address, by the name that the project gives, by a pattern of either, by network."""

    def __init__(self, words: Sequence[str], names: Mapping[str, str]) -> None:
        self._names, self.words = names, words
        self._networks: list[IPv4Network | IPv6Network] = []
        self._plain: set[str] = set()
        self._patterns: list[str] = []
        for word in words:
            if is_pattern(word):
                self._patterns.append(word)
            elif _NETWORK.fullmatch(word):
                self._networks.append(ip_network(word, strict=False))
            else:
                self._plain.add(_usual(word))
        self._known: dict[str, bool] = {}

    def __bool__(self) -> bool:
        return bool(self.words)

    def __contains__(self, node: str) -> bool:
        """Tell whether a node is one of them, by its address."""
        if node not in self._known:
            called = [node, self._names[node]] if node in self._names else [node]
            self._known[node] = (
                not self._plain.isdisjoint(one.lower() for one in called)
                or any(fits(pattern, one) for pattern in self._patterns for one in called)
                or any(ip_address(node) in network for network in self._networks)
            )
        return self._known[node]

    @property
    def unknown(self) -> list[str]:
        """The words that are names which nobody has given."""
        given = {name.lower() for name in self._names.values()}
        return [word for word in self.words if is_name(word) and word.lower() not in given]


def is_name(word: str) -> bool:
    """Tell whether a word for a node can be nothing but its name."""
    return not (is_pattern(word) or _NETWORK.fullmatch(word) or is_address(word))


def is_address(word: str) -> bool:
    """Tell whether a word is an address."""
    try:
        ip_address(word)
    except ValueError:
        return False
    return True


def _usual(word: str) -> str:
    """Return an address as all others are written, and a name in lower case."""
    return str(ip_address(word)) if is_address(word) else word.lower()


class Asking:
    """The pairs that a rule is for, as its parameters say it."""

    def __init__(self, known: Evidence, told: Mapping[str, Any]) -> None:
        names = known.project.node_names
        self._protocol = told["protocol"]
        self._clients = Nodes((*told["requester"], *told["client"]), names)
        self._servers = Nodes((*told["partner"], *told["server"]), names)

    @property
    def named(self) -> bool:
        """Whether nodes are named: then it is wrong if there are none."""
        return bool(self._clients or self._servers)

    @property
    def unknown(self) -> list[str]:
        """The names among them that nobody has given."""
        return [*self._clients.unknown, *self._servers.unknown]

    def __contains__(self, pair: Pair) -> bool:
        """Tell whether a rule is for a pair."""
        return (
            self._protocol in (None, pair.protocol)
            and (not self._clients or pair.client in self._clients)
            and (not self._servers or pair.server in self._servers)
        )


def refuse_lists(lists: Sequence[str]) -> None:
    """Raise Unfit where a rule about requests names lists."""
    if lists:
        raise Unfit("requests are about no list", "list", next_step="name the nodes: requester, partner")
