"""In which order a summary has lists and streams, whatever came first."""

from __future__ import annotations

from nvscope.tracker.summary import summarize
from tests.oracle.builders import data_frame, telegram
from tests.packets import batch_of, tracked


def test_lists_stand_by_port_and_index_and_streams_by_address_and_subindex() -> None:
    sent = [
        (1300, 2, "10.0.0.9", 0), (1202, 9, "10.0.0.9", 1), (1202, 10, "10.0.0.9", 0), (1202, 9, "10.0.0.9", 0),
        (1202, 9, "10.0.0.10", 0), (1202, 9, "2001:db8::1", 0), (1202, 9, "9.0.0.1", 0),
    ]  # fmt: skip
    frames = [
        data_frame(time, source, "2001:db8::2" if ":" in source else "10.0.0.2", telegram(0, index, sub), port=port)
        for time, (port, index, source, sub) in enumerate(sent)
    ]
    summary = summarize(tracked([batch_of(frames)]))
    assert [str(entry.key) for entry in summary.lists] == ["udp/1202/9", "udp/1202/10", "udp/1300/2"]
    assert [(summary.addresses[one.node], one.subindex) for one in summary.lists[0].streams] == [
        ("9.0.0.1", 0), ("10.0.0.9", 0), ("10.0.0.9", 1), ("10.0.0.10", 0), ("2001:db8::1", 0),
    ]  # fmt: skip
