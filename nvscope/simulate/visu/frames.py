"""The frames of pages: the segments of what they say, in a draft."""

from __future__ import annotations

import numpy as np

from nvscope.simulate.draft import Draft
from nvscope.simulate.template import Role, Template
from nvscope.simulate.visu.talk import talk_of


def add_pages(draft: Draft) -> None:
    """Add what pages ask of controllers, and what these answer."""
    numbers = draft.scenario.node_numbers
    for position, page in enumerate(draft.scenario.page):
        client, server = numbers[page.node], numbers[page.to]
        segments = talk_of(draft.scenario, position).segments
        draft.check_room(len(segments))
        templates = []
        for one in segments:
            ends = (client, server) if one.from_client else (server, client)
            source, target = (draft.hosts[number] for number in ends)
            ports = (one.client_port, page.port) if one.from_client else (page.port, one.client_port)
            setup = draft.scenario.node[ends[0]]
            frame = draft.wire.segment(
                source, target.address, ports, (one.seq, one.ack), one.flags, one.data, vlan=setup.vlan,
                options=setup.ip_options,
            )  # fmt: skip
            templates.append(draft.new_template(Template(frame, Role.OTHER, source.address, target.address, False)))
        at_ns = np.array([one.at_ns for one in segments], np.int64)
        draft.add(np.array(templates, np.int32), at_ns)
