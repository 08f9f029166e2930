"""The tree of a telegram: every field with its place, its bytes and its words."""

from __future__ import annotations

from dissectors.netvar import HEADER
from nvscope.report.packets.text import Text
from tests.oracle.builders import data_frame, telegram
from tests.packets import Batches, batch_of
from tests.report.packets.written import READER, SENDER, written


def test_a_tree_shows_every_field_at_its_place() -> None:
    payload = telegram(5, list_id=7, subindex=2, items=3, counter=4660, flags=0x8D, checksum=0x5A, length=99)
    frame = data_frame(0, SENDER, READER, payload)
    tree = written(Text(trees=True), Batches([batch_of([frame])])).splitlines()
    for entry in HEADER:
        at = 42 + HEADER.offset_of(entry.name)
        content = payload[at - 42 : at - 42 + entry.size_bytes]
        (line,) = [line for line in tree if line.startswith(f"  {at:04x}  ") and entry.label in line]
        assert line.startswith(f"  {at:04x}  {content.hex(' ')}  ")
        value = int.from_bytes(content, "little")
        shown = f"0x{value:0{2 * entry.size_bytes}x}" if entry.base == "hex" else str(value)
        assert f"{entry.label} " in line
        assert f" {shown}" in line
    text = "\n".join(tree)
    assert "ODAcknowledgement" in text
    assert "99  ✗ the UDP payload has 22" in text
    assert ".... ...1 = acknowledgement wanted (set)" in text
    assert ".... ..0. = checksum present (not set)" in text
    assert ".... .1.. = invalid checksum: negative acknowledgement (set)" in text
    assert "1000 1... = bits 3 to 7 are undocumented" in text
    assert "Length                  20  ✓ as the UDP payload" in written(
        Text(trees=True), Batches([batch_of([data_frame(0, SENDER, READER, telegram(data=b""))])])
    )
