"""Telegrams to everybody that their only reader does not answer, and single ones."""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import ip_address
from pathlib import Path

from nvscope.causes.cause import Cause
from tests.causes.drawn.by_hand import list_of, node_of, plant_of, told_of
from tests.causes.drawn.plant import START_NS, Away, List, Node, Plant
from tests.causes.drawn.truth import SECOND
from tests.causes.plants import causes_in
from tests.oracle.builders import data_frame, link_frame, telegram, unreachable, whole
from tests.oracle.frame import ETHERNET


def press_and_reader(*, chatter_s: float | None = None) -> tuple[Plant, List, Node]:
    """Return a plant in which a node reads a broadcast list and acknowledges it, and sends one of its own."""
    plant = plant_of(60)
    press, reader = node_of(plant, 1), node_of(plant, 2, chatter_s=chatter_s)
    read = list_of(press, 1, 100, readers=(reader,))
    list_of(reader, 2, 100)
    return plant, read, reader


def away(since_s: int, until_s: int, mode: str, *, chatter: bool = False) -> Away:
    return Away(START_NS + since_s * SECOND, START_NS + until_s * SECOND, mode, chatter)


def test_who_is_silent_answers_no_broadcast_either(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader()
    reader.away.append(away(30, 70, "cable"))
    ((kind, _, until_s),) = told_of(plant, tmp_path)
    assert (kind, until_s) == ("node-silent", None)


def test_who_starts_anew_does_not_answer_meanwhile(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader()
    reader.away.append(away(30, 34, "off"))
    assert [kind for kind, _, _ in told_of(plant, tmp_path)] == ["node-restart"]


def test_who_was_hardly_heard_before_is_there_if_it_is_heard_afterwards(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader(chatter_s=7)
    reader.away.append(away(8, 70, "frozen", chatter=True))
    assert [kind for kind, _, _ in told_of(plant, tmp_path)] == ["program-stopped"]


def test_single_telegrams_without_an_answer_are_told_as_such_and_go_on(tmp_path: Path) -> None:
    plant, read, _ = press_and_reader()
    for at_ns in range(START_NS + 10 * SECOND, START_NS + 60 * SECOND, 5 * SECOND):
        read.silent_readers.append((at_ns, at_ns + SECOND // 10, "nothing"))
    ((kind, since_s, until_s),) = told_of(plant, tmp_path)
    assert (kind, round(since_s), until_s) == ("reader-silent", 10, None)


def test_a_list_that_nobody_acknowledges_stays_so_while_its_addressee_is_away(tmp_path: Path) -> None:
    plant, _, reader = press_and_reader()
    other = list_of(plant.nodes[0], 7, 200)
    other.acknowledged, other.to = True, reader.ip
    reader.away.append(away(30, 70, "cable"))
    assert told_of(plant, tmp_path)[0] == ("acknowledgement-impossible", 0.0, None)


PRESS, HMI, MS = "10.0.0.1", "10.0.0.2", 1_000_000


def asked_and_answered(sent_ms: Sequence[float], answered_ms: Sequence[float], tmp_path: Path) -> Cause:
    """Return the one cause of telegrams that want an acknowledgement, and of what came back."""
    frames = [
        data_frame(int(at_ms * MS), PRESS, HMI, telegram(list_id=7, counter=number, flags=1))
        for number, at_ms in enumerate(sent_ms)
    ]
    frames += [data_frame(int(at_ms * MS), HMI, PRESS, telegram(service=5, list_id=7)) for at_ms in answered_ms]
    (cause,) = causes_in(frames, tmp_path)
    assert cause.kind.name == "reader-silent"
    return cause


def test_who_answers_each_telegram_late_is_slow_and_not_silent(tmp_path: Path) -> None:
    sent = [5000.0 * number for number in range(8)]
    cause = asked_and_answered(sent, [at_ms + 1500 for at_ms in sent], tmp_path)
    assert cause.title == "Node 10.0.0.2 answered too late for list 7 since 0.0 s"
    assert cause.checked == ("8 acknowledgements came when nobody waited any more, 1.5 s behind their telegrams",)
    assert cause.next.startswith("The load of the reader")
    assert {finding.code for finding in cause.findings} == {"NV301", "NV303"}


def test_of_telegrams_that_follow_each_other_at_once_all_answers_come(tmp_path: Path) -> None:
    """As when several wait for the address of the reader: those in front count as missing at the sender."""
    sent = [0, 0.01, 0.02, *(1000.0 * number for number in range(1, 20))]
    cause = asked_and_answered(sent, [at_ms + 3 for at_ms in sent], tmp_path)
    assert cause.title == "Node 10.0.0.2 answered too late for 2 telegrams of list 7"
    assert cause.checked[0].startswith("it sent as many acknowledgements as there were telegrams")
    assert cause.next.startswith("Why the sender sends one telegram so soon behind another")


def test_who_leaves_some_out_did_not_answer_these(tmp_path: Path) -> None:
    sent = [1000.0 * number for number in range(20)]
    cause = asked_and_answered(sent, [at_ms + 3 for at_ms in sent if at_ms not in {5000, 9000}], tmp_path)
    assert cause.title == "Node 10.0.0.2 did not answer for 2 telegrams of list 7"
    assert cause.checked[0] == "it answered the 18 others, in 3.0 ms"


def test_where_the_capture_lacks_telegrams_nobody_knows_whether_all_were_answered(tmp_path: Path) -> None:
    sent = [0, 0.01, *(1000.0 * number for number in range(1, 20))]
    frames = [
        data_frame(int(at_ms * MS), PRESS, HMI, telegram(list_id=7, counter=number, flags=1))
        for number, at_ms in enumerate(sent) if number != 9
    ]  # fmt: skip
    frames += [data_frame(int((at_ms + 3) * MS), HMI, PRESS, telegram(service=5, list_id=7)) for at_ms in sent]
    titles = {cause.kind.name: cause.title for cause in causes_in(frames, tmp_path)}
    assert titles["reader-silent"] == "Node 10.0.0.2 did not answer for 1 telegram of list 7"


def with_messages(at_ms: Sequence[int], end_ms: int, tmp_path: Path) -> Cause:
    """Return the one cause of telegrams every 100 ms, of which some came back since nobody listens."""
    frames = [data_frame(at * MS, PRESS, HMI, telegram(list_id=7, counter=at // 100)) for at in range(0, end_ms, 100)]
    quoted = frames[0].data[14:]
    for at in at_ms:
        frames.append(whole((at + 2) * MS, ETHERNET, link_frame(unreachable(ip_address(HMI), quoted))))
    (cause,) = causes_in(frames, tmp_path)
    assert cause.kind.name == "reader-without-program"
    return cause


def test_a_port_without_a_program_is_so_between_two_messages_of_a_host_that_sends_few(tmp_path: Path) -> None:
    few = [1000 * second for second in range(10)]
    assert with_messages(few, 11_900, tmp_path).until_ns is None
    over = with_messages(few, 15_000, tmp_path)
    assert over.until_ns is not None
    assert over.until_ns >= 9000 * MS


def test_where_each_telegram_came_back_one_that_did_not_shows_that_it_is_over(tmp_path: Path) -> None:
    assert with_messages(range(0, 9000, 100), 10_500, tmp_path).until_ns is not None


def test_behind_the_first_message_nobody_knows_how_many_follow(tmp_path: Path) -> None:
    assert with_messages([3000], 4500, tmp_path).until_ns is None


def test_who_answers_nothing_any_more_may_have_no_power(tmp_path: Path) -> None:
    sent = [100.0 * number for number in range(200)]
    cause = asked_and_answered(sent, [at_ms + 3 for at_ms in sent if at_ms < 10_000], tmp_path)
    assert cause.checked[-1] == "it sent nothing else in that time"
    assert cause.next.startswith("Its power, its cable and switch port")


def test_of_a_list_that_nobody_acknowledges_the_capture_may_see_one_direction(tmp_path: Path) -> None:
    frames = [data_frame(at * 100 * MS, PRESS, HMI, telegram(list_id=7, counter=at, flags=1)) for at in range(50)]
    (cause,) = causes_in(frames, tmp_path)
    assert cause.kind.name == "acknowledgement-impossible"
    assert cause.next.startswith("Whether this capture sees what 10.0.0.2 sends to one node alone")
