"""AskedPartners: who was asked for parameters on which port, what became of it, and how causes tell of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import PORT
from nvscope.causes.case import Case
from nvscope.engine.runs import distinct
from nvscope.enumeration import MOST_NAMED, first_few
from nvscope.findings.kind import FindingKind
from nvscope.tracker.parameter.events import Place, place_of

if TYPE_CHECKING:
    from nvscope.tracker.parameter.summary import PairSummary


class Served(NamedTuple):
    """Who is asked, on which port: a controller may serve on one and not on another."""

    partner: str
    port: int


class AskedPartners:
    """What a case knows of those that are asked for parameters, looked up once for all of them."""

    def __init__(self, case: Case) -> None:
        self._case = case

    @cached_property
    def of(self) -> Mapping[Served, Sequence[PairSummary]]:
        """What became of the requests to each partner and port, one row for each that asks."""
        found: dict[Served, list[PairSummary]] = defaultdict(list)
        for one in self._case.facts.summary.parameters:
            found[Served(one.partner, one.port)].append(one)
        return found

    @cached_property
    def asked_alone(self) -> Mapping[str, set[str]]:
        """The addresses of the partners that each address asked, each by itself."""
        found: dict[str, set[str]] = defaultdict(set)
        for one in self._case.facts.summary.parameters:
            if one.requests and not self.is_for_all(one.partner):
                found[one.requester].add(one.partner)
        return found

    @cached_property
    def _ports(self) -> Mapping[str, set[int]]:
        found: dict[str, set[int]] = defaultdict(set)
        for partner, port in self.of:
            found[partner].add(port)
        return found

    @cached_property
    def _spoke(self) -> set[str]:
        """The addresses of which anything of the Parameter Manager says that they are there."""
        found = set()
        for one in self._case.facts.summary.parameters:
            if one.replies or one.busy or one.unexpected or one.undeliverable:
                found.add(one.partner)
            if one.requests:
                found.add(one.requester)
        return found

    def by_served(self, kind: FindingKind) -> dict[Served, I64]:
        """Return the symptoms of a kind that nothing has explained, by who was asked on which port."""
        case, found = self._case, defaultdict[Served, list[int]](list)
        for row in np.flatnonzero(case.free(kind)).tolist():
            place = self.place(int(case.symptoms.finding[row]))
            found[Served(place.partner, place.port)].append(row)
        return {served: np.array(rows, np.int64) for served, rows in found.items()}

    def place(self, finding: int) -> Place:
        """Return what a finding, by its place among all, is about."""
        return place_of(self._case.findings[finding].variable)

    def is_for_all(self, address: str) -> bool:
        """Tell whether an address is no node's: what goes to one alone makes it one, dead or alive."""
        return self.number(address) is None

    def is_seen(self, partner: str) -> bool:
        """Tell whether anything that a node sends is in the capture, or anything of others says that it is there."""
        node = self.number(partner)
        return partner in self._spoke or (
            node is not None and (node in self._case.streams_of_node or self._case.life.is_heard(node))
        )

    def number(self, address: str) -> int | None:
        """Return the number of the node that has an address, None where none has it."""
        return self._case.facts.node_numbers.get(address)

    def name(self, address: str) -> str:
        """Return what who has an address is called."""
        node = self.number(address)
        return address if node is None else self._case.address(node)

    def on_port(self, served: Served) -> str:
        """Return on which port a partner was asked, "" where it is the usual one and no other was tried."""
        return "" if {served.port} | self._ports[served.partner] == {PORT} else f" on port {served.port}"

    def what(self, own: I64) -> str:
        """Return who asked for what: ``of press for 0x2000:1``."""
        findings = [self._case.findings[place] for place in distinct(self._case.symptoms.finding[own]).tolist()]
        nodes = list(dict.fromkeys(self._case.address(one.node) for one in findings if one.node is not None))
        asking = f"of {', '.join(nodes[:MOST_NAMED])} " if nodes else ""
        return f"{asking}for {self.parameters(own)}"

    def parameters(self, own: I64) -> str:
        """Return what was asked for, by name as far as the project has some: ``0x2000:1, 0x2000:2 and 7 more``."""
        known = self._case.facts.definition and self._case.facts.definition.parameters

        def called(place: Place) -> str:
            index, subindex = place.parameter.split(":")
            return known.name_of(place.partner, int(index, 16), int(subindex)) if known else place.parameter

        places = map(self.place, distinct(self._case.symptoms.finding[own]).tolist())
        return first_few(list(dict.fromkeys(map(called, places))))

    def nodes(self, own: I64, partners: Iterable[str]) -> list[int]:
        """Return the numbers of who was asked, and of who asked."""
        numbers = [node for node in map(self.number, partners) if node is not None]
        return list(dict.fromkeys([*numbers, *asking_nodes(self._case, own)]))


def asking_nodes(case: Case, own: I64 | Bool) -> list[int]:
    """Return the numbers of who asked, rising, as far as these are nodes."""
    return [node for node in distinct(case.symptoms.node[own]).tolist() if node >= 0]
