"""Refusals: ICMP messages of hosts that say of a datagram that it went nowhere."""

from __future__ import annotations

import numpy as np

from dissectors.netvar import HEADER
from nvscope.simulate.draft import Draft
from nvscope.simulate.frames import Host
from nvscope.simulate.template import Role, Template

QUOTED_BYTES = 548
QUOTED_AFTER_NS = 300_000
"""How much a host quotes of a packet, and when its refusal follows."""


def refuse(draft: Draft, host: Host, template: int, frame: bytes, ts_ns: int, quoted_bytes: int = QUOTED_BYTES) -> None:
    """Add the message of a host that a frame with the datagram of a template is not for anybody."""
    quoted = draft.templates[template]
    message = draft.wire.unreachable(host, quoted.source, frame[quoted.frame.ip :][:quoted_bytes])
    index_end = HEADER.offset_of("index") + HEADER["index"].size_bytes + quoted.frame.payload - quoted.frame.ip
    head = len(message.data) - min(quoted_bytes, len(frame) - quoted.frame.ip)
    number = draft.new_template(
        Template(
            message,
            Role.UNREACHABLE,
            host.address,
            quoted.source,
            False,
            quoted.key,
            quoted.subindex,
            index_end=head + index_end if quoted.key and index_end <= quoted_bytes else 0,
        )
    )
    draft.add(number, np.array([ts_ns], np.int64))
