"""Claims: the UDP and TCP ports that somebody asks for, so that their frames are not passed over as idle ones."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from msgspec import Struct

from dissectors.batch import U16, Bool


class Claims(Struct, frozen=True):
    """Ports, of either side, of which the datagrams or segments are wanted."""

    udp: tuple[int, ...] = ()
    tcp: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.udp or self.tcp)

    @staticmethod
    def of(claims: Iterable[Claims]) -> Claims:
        """Return what several ask for together."""
        several = list(claims)
        return Claims(
            tuple(sorted({port for one in several for port in one.udp})),
            tuple(sorted({port for one in several for port in one.tcp})),
        )

    def claim_udp(self, source: U16, destination: U16) -> Bool:
        """Tell which datagrams between two columns of ports are wanted."""
        return _either(self.udp, source, destination)

    def claim_tcp(self, source: U16, destination: U16) -> Bool:
        """Tell which segments between two columns of ports are wanted."""
        return _either(self.tcp, source, destination)


NO_CLAIMS = Claims()


def _either(ports: tuple[int, ...], source: U16, destination: U16) -> Bool:
    claimed = np.zeros(len(source), np.bool_)
    # Not by np.isin, which imports numpy.ma where a column is short.
    for port in ports:
        claimed |= source == port
        claimed |= destination == port
    return claimed
