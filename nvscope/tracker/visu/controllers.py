"""Controllers: which one a client asks, by the address and the port of its web server.

Behind one address there may be several, each on a port that a gateway passes on to it. On the ports that web servers
usually have (80 and 8080), it is one.
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
    """A controller: halves of its address, and its port where that is none of ``USUAL_PORTS``, ``USUAL`` else."""

    high: int
    low: int
    port: int

    @property
    def address(self) -> str:
        """Its address, as text."""
        return address.text(self.high, self.low)

    @property
    def list(self) -> str:
        """What stands in the place of the key of a list: ``visu/10.0.0.5``."""
        return f"visu/{self.address}"

    @property
    def order(self) -> tuple[tuple[bool, int], int]:
        """What sorts controllers by address, and by port."""
        return address.order(self.high, self.low), self.port


def own_port(port: int) -> int:
    """Return ``Controller.port`` of the one whose web server has a port."""
    return USUAL if port in USUAL_PORTS else port


def controller_at(high: int, low: int, port: int) -> Controller:
    """Return whose web server has an address and a port."""
    return Controller(high, low, own_port(port))


def controller_of(pairs: Sequence[U64], number: int) -> Controller:
    """Return the controller of a pair of ``VisuBatch.pairs``."""
    return controller_at(int(pairs[2][number]), int(pairs[3][number]), int(pairs[4][number]))
