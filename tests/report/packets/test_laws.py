"""What holds for every face, whatever is captured and however it is cut."""

from __future__ import annotations

import re
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from nvscope.report.packets.records import Csv, Face, JsonArray, JsonLines, SeparatedFields, separation
from nvscope.report.packets.text import Text
from nvscope.view.fields.frame import DEFAULT_FIELDS, FIELDS
from nvscope.view.lines.text_width import display_width
from tests.laws import examples
from tests.oracle.builders import LINKS
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of
from tests.report.packets.written import MOMENTS, traffic, written


def faces(width: int | None = None) -> list[Face]:
    return [
        SeparatedFields(list(FIELDS.values()), separation(["header=y"])),
        Csv(list(FIELDS.values())),
        JsonArray(list(FIELDS.values())),
        JsonLines(DEFAULT_FIELDS),
        *(Text(moment=moment, width=width) for moment in MOMENTS),
        Text(trees=True, width=width),
        Text(dumps=True, width=width),
        Text(trees=True, dumps=True, width=width, colour=True),
    ]


@given(st.integers(0, 10_000), st.lists(st.integers(0, 150), max_size=8))
@examples(25)
def test_any_cut_into_batches_gives_the_same_records(seed: int, cuts: list[int]) -> None:
    whole = batch_of(traffic(seed))
    edges = sorted({0, len(whole), *(min(cut, len(whole)) for cut in cuts)})
    pieces = [whole[start:stop] for start, stop in pairwise(edges)]
    every = list(FIELDS.values())
    for make in (lambda: SeparatedFields(every, separation([])), lambda: JsonArray(every), lambda: Csv(every)):
        assert written(make(), Batches(pieces)) == written(make(), Batches([whole]))
    assert written(Text(trees=True), Batches(pieces)) == written(Text(trees=True), Batches([whole]))


def any_frame(content: bytes, link: int, cut: int, ts_ns: int) -> Frame:
    return Frame(ts_ns, link, content, len(content) + cut)


HEADS = [
    bytes.fromhex("ffffffffffff020000000001080045000040000000004011000001020304ffffffff04b204b2002c0000002d5333"),
    bytes.fromhex("45000040000000004011000001020304ffffffff04b204b2002c0000302d5333"),
    bytes.fromhex("ffffffffffff02000000000181000007080046000044000000004011000001020304ffffffff9404000004b204b2"),
]
FRAMES = st.builds(
    any_frame,
    st.builds(lambda head, rest: head + rest, st.sampled_from([b"", *HEADS]), st.binary(max_size=60)),
    st.sampled_from([*LINKS, 227, 65535]),
    st.integers(0, 5),
    st.integers(-(2**62) + 1, 2**62 - 1),
)


@given(st.lists(FRAMES, max_size=30), st.sampled_from([None, 40, 80]))
@examples(60)
def test_any_bytes_can_be_shown(frames: list[Frame], width: int | None) -> None:
    for face in faces(width):
        text = written(face, Batches([batch_of(frames)] if frames else []))
        assert re.sub(r"\x1b\[[0-9;]+m|\n|\t", "", text).isprintable()


@given(st.integers(0, 10_000), st.integers(40, 130))
@examples(40)
def test_no_line_is_wider_than_the_terminal_and_colour_changes_no_character(seed: int, width: int) -> None:
    source = Batches([batch_of(traffic(seed))])
    for options in ({}, {"moment": "ud"}, {"trees": True}):
        plain = written(Text(width=width, **options), source)  # type: ignore[arg-type]  # keywords of several types
        assert max(map(display_width, plain.splitlines()), default=0) <= width
        assert "trees" in options or all(line == line.rstrip() for line in plain.splitlines())
        coloured = written(Text(width=width, colour=True, **options), source)  # type: ignore[arg-type]  # the same
        assert re.sub(r"\x1b\[[0-9;]+m", "", coloured) == plain
