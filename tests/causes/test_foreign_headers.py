"""Senders that write headers of their own, and what only looks so."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.causes.cause import Cause
from nvscope.definition.project import Project
from tests.causes.plants import causes_in
from tests.causes.told import causes_of
from tests.oracle.builders import IDENTITY, data_frame, telegram
from tests.oracle.frame import Frame

PEERS = Path(__file__).parents[2] / "captures" / "peers" / "peers.pcap"
MS = 1_000_000


def sent(*payloads: bytes) -> list[Frame]:
    return [data_frame(number * 100 * MS, "10.0.0.1", "255.255.255.255", one) for number, one in enumerate(payloads)]


def short_header(counter: int, data: bytes) -> bytes:
    """Return a telegram of the public npm sender, which writes SubIndex in one byte, and no Checksum."""
    return IDENTITY + struct.pack("<IHBHHHB", 0, 9, 1, 1, 20 + len(data), counter, 0) + data


def long_header(counter: int, data: bytes) -> bytes:
    """Return a telegram with four bytes more in front of the data, which its Length does not count."""
    whole = telegram(list_id=9, counter=counter, data=data)
    return whole[:20] + bytes(4) + whole[20:]


def without_header(counter: int, data: bytes) -> bytes:
    return telegram(list_id=9, counter=counter, data=data, length=len(data))


def big_endian(counter: int, data: bytes) -> bytes:
    return telegram(list_id=9, counter=counter, data=data, length=(20 + len(data)) << 8)


SIZES = (2, 2, 2, 6, 2, 2, 30, 2, 2, 2)


def only(causes: list[Cause]) -> Cause:
    (cause,) = causes
    return cause


@pytest.mark.parametrize(
    ("write", "title", "first"),
    [
        (short_header, "with headers of 18 bytes: no controller can read them",
         "a header of 18 bytes in place of 20 would fit, as that of a public npm sender"),
        (long_header, "with headers of 24 bytes: no controller can read them",
         "a header of 24 bytes in place of 20 would fit"),
        (without_header, "with headers that no controller can read",
         "Length counts the data alone, without the 20 bytes of the header"),
    ],
)  # fmt: skip
def test_the_header_that_would_fit_is_named(write: object, title: str, first: str, tmp_path: Path) -> None:
    assert callable(write)
    cause = only(causes_in(sent(*(write(250 + number, bytes(size)) for number, size in enumerate(SIZES))), tmp_path))
    assert cause.kind.name == "header-foreign"
    assert cause.title == f"Node 10.0.0.1 sends list 9 {title}"
    assert cause.checked[0].startswith(first)
    assert cause.checked[1] == "10 of 10 telegrams: Length is not that of the payload"
    assert [finding.code for finding in cause.findings] == ["NV102"]


def test_a_capture_of_the_public_sender(tmp_path: Path) -> None:
    summary, causes = causes_of(Inquiry([str(PEERS)], Project()))
    cause = next(one for one in causes if one.kind.name == "header-foreign")
    assert cause.title == "Node 10.77.0.2 sends list 9 with headers of 18 bytes: no controller can read them"
    assert [(finding.code, finding.count) for finding in cause.findings] == [("NV102", 49)]
    assert summary.addresses[cause.nodes[0]] == "10.77.0.2"


def test_a_header_that_is_big_endian_stays_one(tmp_path: Path) -> None:
    cause = only(causes_in(sent(*(big_endian(number, bytes(size)) for number, size in enumerate(SIZES))), tmp_path))
    assert cause.kind.name == "header-foreign"
    assert [finding.code for finding in cause.findings] == ["NV105"]


def test_some_malformed_telegrams_of_a_good_sender_are_no_foreign_header(tmp_path: Path) -> None:
    good = [telegram(list_id=9, counter=number, data=bytes([number, 0])) for number in range(1, 31)]
    good[10], good[20], good[22], good[24] = (without_header(number, b"\0\0") for number in (11, 21, 23, 25))
    causes = causes_in(sent(*good), tmp_path)
    assert "header-foreign" not in {cause.kind.name for cause in causes}
    assert "NV102" in {finding.code for cause in causes for finding in cause.findings}


def test_a_length_that_is_never_the_same_names_no_header(tmp_path: Path) -> None:
    cause = only(
        causes_in(sent(*(telegram(list_id=9, length=40 + 977 * n, data=bytes(9)) for n in range(9))), tmp_path)
    )
    assert cause.title == "Node 10.0.0.1 sends list 9 with headers that no controller can read"
    assert len(cause.checked) == 1
