"""Controllers: which one a client asks, by the address and the port of its web server.

Behind one address there may be several, each on a port that a gateway passes on to it. On the ports that web servers
usually have (80 and 8080), it is one, unless the lists of variables that came over both are of two.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from dissectors import address

if TYPE_CHECKING:
    from dissectors.batch import U64

USUAL_PORTS = (80, 8080)
"""The TCP ports of controllers' web servers."""

USUAL = 0
"""What stands for these in ``Controller.port``."""


class Controller(NamedTuple):
    """A controller: halves of its address, and its port where that is none of ``USUAL_PORTS``, ``USUAL`` else.

    Of two controllers on the usual ports of one address, one has its port all the same.
    """

    high: int
    low: int
    port: int

    @property
    def address(self) -> str:
        """Its address, as text."""
        return address.text(self.high, self.low)

    @property
    def list(self) -> str:
        """What stands in the place of the key of a list: ``visu/10.0.0.5``; with the port of one that is set apart."""
        if self.port not in USUAL_PORTS:
            return f"visu/{self.address}"
        return f"visu/{f'[{self.address}]' if ':' in self.address else self.address}:{self.port}"

    @property
    def order(self) -> tuple[tuple[bool, int], int]:
        """What sorts controllers by address, and by port."""
        return address.order(self.high, self.low), self.port


def own_port(port: int) -> int:
    """Return ``Controller.port`` of the one whose web server has a port."""
    return USUAL if port in USUAL_PORTS else port


def controller_at(high: int, low: int, port: int, apart: int = USUAL) -> Controller:
    """Return whose web server has an address and a port; ``apart`` is as in ``nvscope.tracker.visu.names.Naming``."""
    return Controller(high, low, apart or own_port(port))


def controller_of(pairs: Sequence[U64], number: int, apart: int = USUAL) -> Controller:
    """Return the controller of a pair of ``VisuBatch.pairs``, by how its variables are named: that may set it apart."""
    return controller_at(int(pairs[2][number]), int(pairs[3][number]), int(pairs[4][number]), apart)


def server_of(pairs: Sequence[U64], number: int) -> Controller:
    """Return address and port of the server of a pair, whichever controller that is."""
    return Controller(int(pairs[2][number]), int(pairs[3][number]), int(pairs[4][number]))
