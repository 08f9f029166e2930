"""Writes by hosts and at times that the project does not allow, against the rules written a second time."""

from __future__ import annotations

from collections import defaultdict
from datetime import datetime
from ipaddress import ip_address, ip_network
from pathlib import Path

import pytest

from nvscope.tracker.parameter import writes as writes_of_parameters
from nvscope.tracker.visu import state as visu_state
from tests.findings.security_plants import analysed, found_in, told_in
from tests.laws import some
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import conversations
from tests.oracle.rules.parameter import READ, READ_REPLY, WRITE, WRITE_REPLY, observed
from tests.oracle.rules.visu import Visu
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic

HOUR = 3600 * 10**9
MORNING = int(datetime(2024, 1, 1, 5, 30).timestamp()) * 10**9
"""Half past five on a Monday, wherever the tests run."""

PANEL, PRESS, OTHER = "10.0.0.1", "10.0.0.2", "10.0.0.3"


def sdo(ts_ns: int, writer: str, index: int = 0x2000, service: int = WRITE, counter: int = 1) -> list[Frame]:
    data = b"\1\0" if service == WRITE else b""
    asked = data_frame(ts_ns, writer, PRESS, telegram(service, index, counter=counter, data=data))
    reply = telegram(WRITE_REPLY if service == WRITE else READ_REPLY, index, counter=counter, data=b"")
    return [asked, data_frame(ts_ns + 10**6, PRESS, writer, reply)]


def visu(ts_ns: int, client: str, body: str = "|1|1|0|4|0|4|6|1.5|", answer: str = "|0|") -> list[Frame]:
    line = Line((client, 50_000 + ts_ns // HOUR % 1000), (PRESS, 8080), now=ts_ns).open()
    head = f"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: {len(body)}\r\n\r\n"
    line.ask((head + body).encode()).answer(
        f"HTTP/1.1 200 OK\r\nContent-Length: {len(answer)}\r\n\r\n{answer}".encode()
    )
    return line.close(True).close(False).frames


def writes() -> list[Frame]:
    """Return an hourly write of the panel by each protocol from half past five on, and a few of another host."""
    frames = []
    for hour in range(4):
        frames += sdo(MORNING + hour * HOUR, PANEL, counter=hour + 1) + visu(MORNING + hour * HOUR + 10**9, PANEL)
    frames += sdo(MORNING + HOUR, OTHER, 0x2001, counter=9) + sdo(MORNING + 2 * HOUR, OTHER, 0x2000, counter=10)
    return frames + visu(MORNING + HOUR // 2, OTHER)


NOBODY_SAYS = [
    "", "[security]\nonly_nodes = false\n", '[security]\nsubnets = ["10.0.0.0/8"]\n',
    '[security]\nwriters = ["10.0.0.0/24"]\n', '[security]\nwriters = ["10.0.0.1", "spare"]\nhours = "05:30-08:31"\n'
    '[nodes]\n"10.0.0.3" = { name = "spare" }\n', '[security]\nhours = ["mon 05:00-07:00", "07:00-24:00"]\n',
]  # fmt: skip


@pytest.mark.parametrize("project", NOBODY_SAYS)
def test_what_is_allowed_or_nobody_speaks_of_is_not_told(project: str, tmp_path: Path) -> None:
    assert not told_in(writes(), tmp_path, project)


def test_a_host_that_may_not_write_is_told_with_what_it_wrote(tmp_path: Path) -> None:
    sdo_finding, visu_finding = found_in(writes(), tmp_path, f'[security]\nwriters = ["{PANEL}", "192.168.0.0/16"]')
    allowed = f"the project lets only {PANEL}, 192.168.0.0/16 write."
    assert sdo_finding.message == f"{OTHER} wrote 2 times to {PRESS} by SDO (0x2001:0, 0x2000:0): {allowed}"
    assert (sdo_finding.variable, sdo_finding.count) == (f"sdo/{PRESS}", 2)
    assert (sdo_finding.first_ns, sdo_finding.last_ns) == (MORNING + HOUR, MORNING + 2 * HOUR)
    assert visu_finding.message == f"{OTHER} wrote 1 time to {PRESS} by WebVisu (4,0,4,6): {allowed}"
    assert visu_finding.variable == f"visu/{PRESS}"
    assert (sdo_finding.hint, "WebVisu writes" in visu_finding.hint) == ("", True)


def test_a_write_outside_the_hours_is_told_with_when(tmp_path: Path) -> None:
    found = told_in(writes(), tmp_path, '[security]\nhours = ["06:00-08:00", "sun 00:00-24:00"]')
    of_panel = [message for _, message, _ in found if message.startswith(PANEL)]
    why = "outside the hours 06:00-08:00, sun 00:00-24:00, first at 2024-01-01 05:30:0"
    assert of_panel == [
        f"{PANEL} wrote 2 times to {PRESS} by SDO (0x2000:0): {why}0 local time.",
        f"{PANEL} wrote 2 times to {PRESS} by WebVisu (4,0,4,6): {why}1 local time.",
    ]
    assert len(found) == 2  # the other host wrote within


def test_of_very_many_hosts_that_wrote_one_finding_tells(tmp_path: Path) -> None:
    frames = [frame for one in range(40) for frame in sdo(MORNING + one * 10**9, f"10.1.0.{one}", counter=one)]
    (finding,) = found_in(frames, tmp_path, f'[security]\nwriters = ["{PANEL}"]')
    who = "40 hosts (10.1.0.0, 10.1.0.1, 10.1.0.10 and 37 more)"
    assert finding.message == f"{who} wrote 40 times to {PRESS} by SDO (0x2000:0): the project lets only {PANEL} write."
    assert (finding.count, finding.node, finding.variable) == (40, None, f"sdo/{PRESS}")
    assert (finding.first_ns, finding.last_ns) == (MORNING, MORNING + 39 * 10**9)
    assert len(finding.frames) == 10
    late = found_in(frames, tmp_path, '[security]\nhours = "05:31-06:00"')
    assert [one.message.rpartition("first at ")[2] for one in late] == ["2024-01-01 05:30:00 local time."]
    assert len(found_in(frames[:16], tmp_path, "[security]\nwriters = []")) == 8


def test_who_writes_behind_those_that_are_kept_is_told_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a gateway writes in cycles: it must not hide who else does."""
    frames = [frame for one in range(20) for frame in sdo(MORNING + one * HOUR // 60, PANEL, counter=one)]
    frames += sdo(MORNING + HOUR, OTHER, 0x2001, counter=99) + sdo(MORNING + HOUR + 10**9, OTHER, 0x2001, counter=100)
    told = told_in(frames, tmp_path, f'[security]\nwriters = "{PANEL}"\nhours = "05:30-05:50"')
    monkeypatch.setattr(writes_of_parameters, "MOST_WRITES", 19)
    (with_less,) = told_in(frames, tmp_path, f'[security]\nwriters = "{PANEL}"\nhours = "05:30-05:50"')
    assert told == [(with_less[0], with_less[1].replace("by SDO", "by SDO (0x2001:0)"), 2)]
    late = '[security]\nhours = "05:30-05:49"'
    assert {message.partition(" wrote ")[0] for _, message, _ in told_in(frames, tmp_path, late)} == {PANEL, OTHER}
    monkeypatch.setattr(writes_of_parameters, "MOST_WRITES", 1)
    (some,) = told_in(frames, tmp_path, '[security]\nhours = "12:00-13:00"')
    assert some[1].startswith(f"{PANEL} wrote at least 2 times to {PRESS} by SDO (0x2000:0): ")
    # What nobody compares with the hours is told by its number.
    assert "NV906" in {one.code for one in analysed(frames, tmp_path, late).findings}


def test_reads_are_no_writes_and_a_refused_write_is_one(tmp_path: Path) -> None:
    reads = sdo(MORNING, OTHER, service=READ) + visu(MORNING, OTHER, "|0|1|0|4|0|4|6|", "|1.5|")
    assert not told_in(reads, tmp_path, "[security]\nwriters = []")
    refused = visu(MORNING, OTHER, answer="|1|")
    (finding,) = found_in(refused, tmp_path, "[security]\nwriters = []")
    assert finding.message.endswith("the project lets nobody write.")


def test_a_write_is_told_of_which_nothing_but_the_reply_was_captured(tmp_path: Path) -> None:
    """As at a mirror port of one direction: who is told that it has written has asked for it."""
    replies = [one for at in range(3) for one in sdo(MORNING + at * 10**9, OTHER, counter=at)[1:]]
    (finding,) = found_in(replies, tmp_path, f'[security]\nwriters = "{PANEL}"')
    assert finding.message == (
        f"{OTHER} wrote 3 times to {PRESS} by SDO (0x2000:0): the project lets only {PANEL} write. "
        "Of them, nothing but the reply was captured."
    )
    assert (finding.count, finding.frames) == (3, (1, 2, 3))
    assert not told_in(replies, tmp_path, f'[security]\nwriters = "{OTHER}"')
    # A minute before, it was allowed, and the request may have been sent then.
    assert not told_in(replies, tmp_path, '[security]\nhours = "05:00-05:30"')
    assert told_in(replies, tmp_path, '[security]\nhours = "05:00-05:29"')
    both = replies + sdo(MORNING + 5 * 10**9, OTHER, 0x2001, counter=9)
    (finding,) = found_in(both, tmp_path, f'[security]\nwriters = "{PANEL}"')
    assert finding.message.endswith(" Of 3 of them, nothing but the reply was captured.")
    assert finding.count == 4


def test_who_was_refused_has_not_written(tmp_path: Path) -> None:
    frames = []
    for at in range(3):
        asked, _ = sdo(MORNING + at * 10**9, OTHER, counter=at)
        refused = telegram(22, 0x2000, counter=at, data=b"")
        frames += [asked, data_frame(asked.ts_ns + 10**6, PRESS, OTHER, refused)]
    (finding,) = found_in(frames, tmp_path, f'[security]\nwriters = "{PANEL}"')
    told = f"times to {PRESS} by SDO (0x2000:0): the project lets only {PANEL} write."
    assert finding.message == f"{OTHER} tried to write 3 {told} All of it was refused."
    (finding,) = found_in(frames + sdo(MORNING + 9 * 10**9, OTHER), tmp_path, f'[security]\nwriters = "{PANEL}"')
    assert finding.message == f"{OTHER} wrote 4 {told} 3 were refused."


def test_a_controller_that_answers_with_another_counter_confirms_what_was_asked(tmp_path: Path) -> None:
    frames = [sdo(MORNING, OTHER, counter=5)[0], sdo(MORNING, OTHER, counter=0)[1]]
    (finding,) = found_in(frames, tmp_path, f'[security]\nwriters = "{PANEL}"')
    assert (finding.count, finding.frames) == (1, (1,))


def test_a_write_that_nobody_may_is_a_cause_of_its_own(tmp_path: Path) -> None:
    found = analysed(writes(), tmp_path, f'[security]\nwriters = "{PANEL}"')
    assert found.happened is not None
    told = [cause.title for cause in found.happened.causes if any(one.code == "NV962" for one in cause.findings)]
    assert len(told) == 2
    assert all(title.startswith(f"{OTHER} wrote ") for title in told)


@pytest.mark.parametrize("seed", some(range(20)))
def test_parameters_that_were_written_are_those_of_the_rules(seed: int, tmp_path: Path) -> None:
    frames = conversations(seed)
    base = min(one.ts_ns for one in frames)
    moved = [one._replace(ts_ns=one.ts_ns - base + MORNING + 50 * 10**9) for one in frames]
    project = '[security]\nwriters = ["10.0.0.1", "192.168.0.0/16"]\nhours = "00:00-05:31"\n'
    expected: dict[tuple[str, str], int] = defaultdict(int)
    known = observed(sorted(moved, key=lambda one: one.ts_ns))
    asked = {(one.requester, one.partner, one.index, one.subindex) for one in known.writes}
    seen = [(one.requester, one.partner, one.time) for one in known.writes] + [
        # When that was asked for is not known: perhaps in the minute before.
        (str(requester), str(partner), time - 60 * 10**9)
        for ((requester, partner, _), index, subindex, _), time in known.unseen
        if (str(requester), str(partner), index, subindex) not in asked
    ]
    for writer, partner, time in seen:
        own = ip_address(writer)
        stranger = str(own) != "10.0.0.1" and not (own.version == 4 and own in ip_network("192.168.0.0/16"))
        local = datetime.fromtimestamp(time // 10**9)
        if stranger or (local.hour, local.minute) >= (5, 31):
            expected[writer, f"sdo/{partner}"] += 1
    analysis = analysed(moved, tmp_path, project)
    addresses = analysis.summary.addresses
    found = {
        ("" if one.node is None else addresses[one.node], one.variable): one.count
        for one in analysis.findings if one.code == "NV962"
    }  # fmt: skip
    assert found == dict(expected)


@pytest.mark.parametrize("seed", some(range(40)))
def test_variables_that_were_written_are_those_of_the_rules(seed: int, tmp_path: Path) -> None:
    frames = [one for one in visu_traffic(seed) if one.link == 1]
    if not frames:
        pytest.skip("nothing on Ethernet")
    project = '[security]\nwriters = ["10.0.0.1", "fd00::/16"]\nhours = "00:00-00:01"\n'
    rules = Visu()
    for frame in sorted(frames, key=lambda one: one.ts_ns):
        rules.observe(frame)
    expected: dict[tuple[str, str], int] = defaultdict(int)
    for (code, client, variable), events in rules.found.items():
        if code == "NV801":
            for time_ns, _ in events:
                local = datetime.fromtimestamp(time_ns // 10**9)
                stranger = str(client) == "10.0.0.2"
                expected[str(client), variable.rpartition("/")[0]] += stranger or local.hour + local.minute > 0
    analysis = analysed(frames, tmp_path, project)
    addresses = analysis.summary.addresses
    found = {
        ("" if one.node is None else addresses[one.node], one.variable): one.count
        for one in analysis.findings if one.code == "NV962"
    }  # fmt: skip
    assert found == {place: count for place, count in expected.items() if count}


def test_of_more_minutes_than_are_kept_it_is_said_that_there_are_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(visu_state, "MOST_WRITE_MINUTES", 3)
    (finding,) = [
        one for one in found_in(writes(), tmp_path, '[security]\nhours = "12:00-13:00"')
        if one.variable.startswith("visu/") and one.message.startswith(PANEL)
    ]  # fmt: skip
    assert f"{PANEL} wrote at least 2 times to {PRESS} by WebVisu" in finding.message
    told = [one.message for one in analysed(writes(), tmp_path, '[security]\nhours = "12:00-13:00"').findings]
    what = "2 writes of web visualization, whose time is not compared with the hours"
    assert any(f"Left out: {what}." in message for message in told)
    # Where nobody asks for hours, nothing is left out.
    assert "NV906" not in {one.code for one in analysed(writes(), tmp_path).findings}
