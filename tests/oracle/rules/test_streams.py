"""TCP put together: each rule by a few segments; what is heard was worked out by hand.

``heard`` says it as a person would: `>` is from the client, then what was delivered, `[n]` for a hole, `.` for an end
in order, `!` for one by a reset; and the number of the frame that did it.
"""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import replace

import pytest

from tests.oracle.capture_faults import Faults, captured
from tests.oracle.frame import Frame
from tests.oracle.rules.streams import MOST_KEPT, SECOND, Delivery, Others, Streams
from tests.oracle.tcp import ACK, FIN, RST, SYN
from tests.oracle.tcp_line import CLIENT, SERVER, Line, tcp_frame


def heard(frames: Iterable[Frame], ports: tuple[int, ...] = (80, 8080)) -> list[tuple[int, str]]:
    streams = Streams(ports)
    found = []
    for number, frame in enumerate(frames, 1):
        for event in streams.observe(number, frame):
            said = ">" if event.from_client else "<"
            if isinstance(event, Delivery):
                said += f"[{event.missing}]" if event.missing else event.data.decode()
            elif isinstance(event, Others):
                said += f"/{event.size}/"
            else:
                said += "!" if event.reset else "."
            found.append((number, said))
    return found


def said(frames: Iterable[Frame]) -> str:
    return " ".join(what for _, what in heard(frames))


def test_both_directions_from_the_first_byte_to_the_end() -> None:
    line = Line().open().ask(b"ab").answer(b"xy").ask(b"c").close(False).close(True)
    assert heard(line.frames) == [(4, ">ab"), (5, "<xy"), (6, ">c"), (7, "<."), (8, ">.")]


def test_other_ports_and_other_frames_are_nothing() -> None:
    assert heard(Line(server=("10.0.0.5", 81)).open().ask(b"a").frames) == []
    assert heard(Line(server=("10.0.0.5", 81)).open().ask(b"a").frames, (81,)) == [(4, ">a")]


def test_where_both_ports_are_claimed_the_first_segment_says_who_serves() -> None:
    both = Line(("10.0.0.1", 8080), ("10.0.0.5", 80)).open().ask(b"a")
    assert said(both.frames) == ">a"
    # A SYN+ACK is a server's; and where nothing says it, whom the first data is for.
    assert said(both.frames[1:]) == ">a"
    assert said(Line(("10.0.0.1", 8080), ("10.0.0.5", 80)).answer(b"x").frames) == ">x"


def test_a_connection_begins_with_data_or_fin_too() -> None:
    assert heard(Line().ask(b"a").frames) == [(1, ">a")]
    assert heard(Line().close(False).frames) == [(1, "<.")]
    assert heard(Line().segment(True).segment(False, flags=RST).frames) == []


def test_a_syn_seen_again_begins_nothing_and_another_one_does() -> None:
    line = Line().open().ask(b"a")
    again = line.frames[0]
    assert heard([*line.frames, again]) == [(4, ">a")]
    other = tcp_frame(9, CLIENT, SERVER, seq=77, flags=SYN)
    assert heard([*line.frames, other]) == [(4, ">a"), (5, ">!"), (5, "<!")]
    answer = tcp_frame(9, SERVER, CLIENT, seq=77, flags=SYN | ACK)
    assert heard([*line.frames, line.frames[1], answer]) == [(4, ">a"), (6, ">!"), (6, "<!")]


def test_a_syn_seen_again_begins_another_where_the_first_was_reset_before_anything_came() -> None:
    refused = Line().segment(True, flags=SYN, seq=1000, ack=0).segment(False, flags=RST | ACK, seq=0, ack=1001)
    assert heard(refused.open().ask(b"a").frames) == [(2, ">!"), (2, "<!"), (3, ">!"), (3, "<!"), (6, ">a")]
    # The server remembers an older connection between the same ends, and the client takes that away.
    stale = Line().segment(True, flags=SYN, seq=1000, ack=0).segment(False, seq=77, ack=2**31)
    stale.segment(True, flags=RST, seq=2**31, ack=0)
    assert heard(stale.open().ask(b"a").frames)[-1] == (7, ">a")


def test_what_was_said_before_a_reset_or_a_fin_is_not_said_again() -> None:
    line = Line().open().ask(b"a").reset(False)
    assert heard([*line.frames, *line.frames[:4]]) == heard(line.frames)
    closed = Line().open().close(True).reset(False)
    assert heard([*closed.frames, *closed.frames[:3]]) == heard(closed.frames)
    half = Line().open().reset(False)
    assert heard([*half.frames, half.frames[1]]) == heard(half.frames)


def test_a_syn_that_its_data_overtook_begins_nothing() -> None:
    line = Line().open().ask(b"a")
    assert heard([line.frames[3], line.frames[0]]) == [(1, ">a")]


def test_data_in_a_syn_is_data() -> None:
    line = Line().segment(True, b"ab", SYN, seq=1000).lose(True, 2).ask(b"c")
    assert heard([*line.frames, line.frames[0]]) == [(1, ">ab"), (2, ">c")]


def test_sequence_numbers_wrap() -> None:
    line = Line(isn=(2**32 - 3, 2**32 - 1)).open().ask(b"abcd").answer(b"x").ask(b"e")
    assert said(line.frames) == ">abcd <x >e"


def test_old_bytes_are_ignored_and_new_ones_behind_them_delivered() -> None:
    line = Line().open().ask(b"abc").segment(True, b"ABC", seq=1001).segment(True, b"BCde", seq=1002)
    assert heard(line.frames) == [(4, ">abc"), (5, ">/3/"), (6, ">/2/"), (6, ">de")]


def test_what_came_first_counts() -> None:
    """The bytes 3 to 5 come before the hole is filled; what fills it covers them with others."""
    line = Line().open().segment(True, b"def", seq=1004).segment(True, b"DEFG", seq=1004)
    line.segment(True, b"abcXYZ", seq=1001)
    assert heard(line.frames) == [(5, ">/3/"), (6, ">/3/"), (6, ">abc"), (6, ">def"), (6, ">G")]


def test_what_is_too_far_away_is_ignored() -> None:
    line = Line().open()
    for seq in (1001 + 2**30 + 1, 1001 - 2**30 - 1):
        line.segment(True, b"far", seq=seq)
    line.segment(True, b"near", seq=1001 + 2**30).segment(False, ack=1001 + 2**30)
    assert heard(line.frames) == [(7, f">[{2**30}]"), (7, ">near")]


def test_what_the_snap_length_cut_is_missing_at_once() -> None:
    line = Line().open().say(True, b"abcde", captured=2).ask(b"f").segment(True, b"abcde", seq=1001)
    assert heard(line.frames) == [(4, ">ab"), (4, ">[3]"), (5, ">f")]
    # Where it is kept, a whole copy behind it comes late.
    kept = Line().open().segment(True, b"cde", seq=1003, captured=1).segment(True, b"cde", seq=1003)
    assert said(kept.segment(True, b"ab", seq=1001).frames) == ">ab >c >[2]"


def test_a_hole_is_final_with_an_acknowledgement_of_what_is_missing() -> None:
    line = Line().open().segment(True, b"de", seq=1004)
    assert heard(line.segment(False, ack=1003).frames) == []
    assert heard(line.segment(False, ack=1004).frames) == [(6, ">[3]"), (6, ">de")]


def test_an_acknowledgement_seen_before_counts_too() -> None:
    line = Line().open().segment(False, ack=1010).segment(True, b"de", seq=1004).segment(True, b"z", seq=1012)
    assert heard(line.frames) == [(5, ">[3]"), (5, ">de")]


def test_one_acknowledgement_may_make_several_holes_final() -> None:
    line = Line().open().segment(True, b"b", seq=1002).segment(True, b"d", seq=1004).segment(True, b"f", seq=1006)
    assert said(line.segment(False, ack=1005).frames) == ">[1] >b >[1] >d"


def test_in_one_frame_the_acknowledgement_comes_first() -> None:
    line = Line().open().segment(True, b"b", seq=1002).segment(False, b"x", ack=1003)
    assert heard(line.frames) == [(5, ">[1]"), (5, ">b"), (5, "<x")]


def test_a_hole_is_final_where_too_much_is_kept() -> None:
    line = Line().open()
    for place in range(0, MOST_KEPT, 32_768):
        line.segment(True, b"a" * 32_768, seq=1002 + place)
    assert heard(line.frames) == []
    line.segment(True, b"b", seq=1002 + MOST_KEPT)
    assert [(number, what[:4]) for number, what in heard(line.frames)][:2] == [(12, ">[1]"), (12, ">aaa")]


def test_a_hole_is_final_with_what_comes_ten_seconds_later() -> None:
    line = Line().open().segment(True, b"b", seq=1002, ack=0)
    begin = line.frames[-1].ts_ns
    line.now = begin + 10 * SECOND
    line.segment(False, ack=0)
    assert heard(line.frames) == []
    line.now = begin + 10 * SECOND + 1
    line.segment(False, ack=0)
    assert heard(line.frames) == [(6, ">[1]"), (6, ">b")]


def test_ten_seconds_run_from_what_is_kept_now() -> None:
    """The first hole is filled; behind it is another, and what is kept there came 6 s later."""
    line = Line().open().segment(True, b"b", seq=1002).wait(6 * SECOND).segment(True, b"d", seq=1004)
    line.segment(True, b"a", seq=1001).wait(6 * SECOND)
    assert said(line.segment(True).frames) == ">a >b"
    assert said(line.wait(5 * SECOND).segment(True).frames) == ">a >b >[1] >d"


def test_a_reset_delivers_what_is_kept_and_ends_both_directions() -> None:
    line = Line().open().segment(False, b"y", seq=5002, ack=0).segment(True, b"b", seq=1002, ack=0)
    line.segment(False, flags=RST)
    assert heard(line.frames) == [(6, what) for what in (">[1]", ">b", "<[1]", "<y", ">!", "<!")]


def test_a_fin_has_its_place() -> None:
    line = Line().open().lose(True, 1)
    line.segment(True, b"b", FIN | ACK)
    assert heard(line.frames) == []
    line.segment(True, b"a", seq=1001).segment(True, b"later", seq=1003)
    assert heard(line.frames) == [(5, ">a"), (5, ">b"), (5, ">.")]


def test_a_fin_alone_is_kept_behind_a_hole() -> None:
    line = Line().open().lose(True, 3).close(True).segment(False, ack=1005)
    assert heard(line.frames) == [(5, ">[3]"), (5, ">.")]


def test_what_is_known_to_be_missing_behind_all_is_a_hole_when_a_connection_is_reset() -> None:
    line = Line().open().ask(b"ab").lose(False, 3).reset(True)
    assert said(line.frames) == ">ab <[3] >! <!"
    assert said(Line().open().ask(b"ab").lose(True, 4).reset(True).frames) == ">ab >[4] >! <!"
    # A single place may be that of a FIN, and what lies far ahead is garbage.
    assert said(Line().open().ask(b"ab").lose(False, 1).reset(True).frames) == ">ab >! <!"
    assert said(Line().open().ask(b"ab").lose(False, 2**21).reset(True).frames) == ">ab >! <!"


def test_what_has_ended_stays_so() -> None:
    line = Line().open().close(True).close(False)
    assert said(line.frames) == ">. <."
    # What comes again is nothing new, until there is a SYN.
    assert said([*line.frames, line.frames[3]]) == ">. <."


@pytest.mark.parametrize("seed", range(60))
def test_what_is_delivered_is_what_was_sent_with_holes(seed: int) -> None:
    """Whatever is lost, late, twice there or cut: each byte is in its place, and missing ones are counted."""
    rng = random.Random(seed)
    said = {True: rng.randbytes(3000), False: rng.randbytes(3000)}
    line = Line(isn=(2**32 - 1000, rng.randrange(2**32))).open()
    at = {True: 0, False: 0}
    while any(at[who] < len(said[who]) for who in at):
        who = rng.random() < 0.5
        back, size = min(at[who], rng.choice((0, 0, 0, 30))), rng.randint(0, 200)
        data = said[who][at[who] - back : at[who] + size]
        seq = line.begin[who] + at[who] - back
        line.segment(who, data, seq=seq, ack=line.begin[not who] + at[not who])
        at[who] = min(at[who] + size, len(said[who]))
        line.sent[who] = line.begin[who] + at[who]
    line.close(True).close(False)
    frames, line.frames = line.frames[:3], line.frames[3:]
    frames += captured(rng, replace(Faults.drawn(rng), begun_before=0), line)
    frames.append(tcp_frame(line.now, CLIENT, SERVER, flags=RST))
    heard_of = {True: 0, False: 0}
    streams = Streams((80,))
    only = None
    for number, frame in enumerate(frames, 1):
        for event in streams.observe(number, frame):
            only = only or event.connection
            # What comes late, behind both ends, is another connection.
            if isinstance(event, Delivery) and event.connection is only:
                place = heard_of[event.from_client]
                assert event.data == said[event.from_client][place : place + len(event.data)]
                heard_of[event.from_client] += len(event.data) + event.missing
    # Of what was acknowledged behind all that is there, the last place may be that of a FIN.
    assert all(heard_of[who] <= len(said[who]) + 1 for who in said)
    if {frame.data for frame in line.frames} <= {frame.data for frame in frames}:
        assert heard_of == {True: 3000, False: 3000}


@pytest.mark.parametrize("link", [1, 113, 101])
def test_bytes_are_told_by_the_last_frame_of_those_that_brought_them(link: int) -> None:
    line = Line(link=link).open().segment(True, b"b", seq=1002).segment(True, b"a", seq=1001)
    streams = Streams((80,))
    events = [event for number, frame in enumerate(line.frames, 1) for event in streams.observe(number, frame)]
    times = [event.time for event in events if not isinstance(event, Others)]
    assert times == [line.frames[4].ts_ns] * 2


def test_bytes_that_come_again_as_others_are_told() -> None:
    line = Line().open().ask(b"abcdef").segment(True, b"abXdef", seq=1001).segment(True, b"efgh", seq=1005)
    assert said(line.frames) == ">abcdef >/1/ >gh"
    assert said(line.segment(True, b"?", seq=1008).frames) == ">abcdef >/1/ >gh"
    kept = Line().open().segment(True, b"cd", seq=1003).segment(True, b"bcx", seq=1002).segment(True, b"a", seq=1001)
    assert said(kept.frames).startswith(">/1/ ")
