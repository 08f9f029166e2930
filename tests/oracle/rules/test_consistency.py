"""Shapes, checksums and flags that change."""

from __future__ import annotations

from tests.oracle.builders import telegram
from tests.oracle.wire import ALL, A, B, Wire


def test_checksum_is_measured_against_the_first_one_seen() -> None:
    wire = (
        Wire()
        .data(0, 1, checksum=9)  # bit1 clear: no reference, but NV404
        .data(1, 2, flags=2, checksum=7)
        .data(2, 1, flags=2, checksum=8, source=B)
        .data(3, 2, flags=2, checksum=7, source=B)
        .data(4, 1, flags=2, checksum=8, subindex=1)
    )
    assert wire.counters("checksum_mismatches") == (1,)
    assert wire.only_list["diag"]["nWriteCount"] == 4
    (changed,) = wire.findings("NV403")
    assert (changed["node"], changed["frames"]) == (B, [3])
    assert [finding["frames"] for finding in wire.findings("NV404")] == [[1]]
    assert [finding["frames"] for finding in wire.findings("NV401")] == [[3]]


def test_shape_changes_whoever_sends() -> None:
    wire = Wire().data(0, 1).data(1, 1, source=B, items=2).data(2, 2, items=2).data(3, 3, items=2, data=b"")
    wire.send(4, A, ALL, telegram(length=77)).data(5, 4, items=2, data=b"")
    assert [(finding["node"], finding["frames"]) for finding in wire.findings("NV402")] == [(A, [4]), (B, [2])]
    assert (wire.only_list["streams"][0]["items"], wire.only_list["streams"][0]["length"]) == (2, 20)


def test_flags_that_change_with_the_wrap() -> None:
    wire = Wire().data(0, 65534).data(1, 65535).data(2, 0, flags=1).data(3, 1, flags=1)
    (finding,) = wire.findings("NV404")
    assert (finding["count"], finding["frames"]) == (1, [3])


def test_stream_shows_the_last_checksum() -> None:
    assert Wire().data(0, 1, flags=2, checksum=5).stream["checksum"] == 5
    assert Wire().data(0, 1, flags=2, checksum=5).data(1, 2).stream["checksum"] is None
