"""Datagrams that came back: what ICMP messages quote, who sent them, and why."""

from __future__ import annotations

from ipaddress import ip_address

from hypothesis import given
from hypothesis import strategies as st

from dissectors import address
from dissectors.link import peel
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.evidence import Evidence
from nvscope.tracker.state import TrackerState
from tests.laws import examples
from tests.oracle.builders import LINKS, internet_packet, link_frame, telegram, udp, unreachable
from tests.oracle.frame import ETHERNET, Frame, Unreachable
from tests.oracle.frame import peel as peeled_singly
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of, observed

SENDER, READER, ROUTER = (ip_address(text) for text in ("10.0.0.1", "10.0.9.2", "10.0.0.254"))


@given(st.integers(0, 10_000), st.sampled_from([*LINKS, None]))
@examples(60)
def test_quotes_are_those_of_a_reading_frame_by_frame(seed: int, link: int | None) -> None:
    frames = mutate(seed, generate(seed, frames=150, link=link)) if seed % 2 else generate(seed, frames=150, link=link)
    expected = [
        (row, str(found.sender), found.code, str(found.quoted.source), str(found.quoted.destination), found.quoted.port)
        for row, frame in enumerate(frames)
        if isinstance(found := peeled_singly(frame), Unreachable)
    ]
    quoted = peel(batch_of(frames).with_margin()).quoted
    told = [
        (
            int(quoted.row[place]),
            *(
                address.text(int(high[place]), int(low[place])) if code is None else code
                for high, low, code in (
                    (quoted.by_hi, quoted.by_lo, None), (quoted.code, quoted.code, int(quoted.code[place])),
                    (quoted.source_hi, quoted.source_lo, None), (quoted.destination_hi, quoted.destination_lo, None),
                )
            ),
            int(quoted.destination_port[place]),
        )
        for place in range(len(quoted))
    ]  # fmt: skip
    assert told == expected


def test_who_says_that_it_did_not_arrive_is_told() -> None:
    sent = internet_packet(SENDER, READER, 17, udp(telegram(list_id=7, counter=1)))
    frames = [Frame(0, ETHERNET, data := link_frame(sent), len(data))]
    for by, code in ((READER, 3), (ROUTER, 1)):
        data = link_frame(unreachable(by, sent, code))
        frames.append(Frame(len(frames), ETHERNET, data, len(data)))
    evidence = Evidence()
    state = observed(TrackerState(listeners=[evidence]), [batch_of(frames)])
    table = evidence.columns["waits"].table()
    rejected = table.kind == EventKind.SEND_REJECTED
    nodes = [address.text(int(high), int(low)) for high, low in zip(*state.keys.nodes.words, strict=True)]
    columns = (column[rejected].tolist() for column in (table.peer, table.detail, table.amount))
    told = [(nodes[peer], nodes[by], code) for peer, by, code in zip(*columns, strict=True)]
    assert told == [(str(READER), str(READER), 3), (str(READER), str(ROUTER), 1)]
