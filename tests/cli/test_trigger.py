"""``nvscope record --trigger``: each event is a file with what was before and behind it, and nothing else."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest
from mcap.reader import SeekingReader

from tests.capture.mcap.recordings import Packet, read, write
from tests.oracle.builders import data_frame, telegram
from tests.program_here import run_text
from tests.simulate.simulation import simulated

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "captures" / "plant.pcapng.gz"
PEERS = ROOT / "captures" / "peers"
SECOND_NS = 10**9
BEGIN_NS = 1_790_000_000 * SECOND_NS


def flown(source: Path, folder: Path, *options: str, code: int = 0) -> tuple[list[Path], str]:
    """Return the files of events, by name, and what is told."""
    folder.mkdir(exist_ok=True)
    done = run_text("record", source, "-w", folder, "--min-free", "0", *options)
    assert (done.returncode, done.stdout) == (code, ""), done.stderr
    return sorted(folder.iterdir()), done.stderr


def metadata_of(path: Path) -> dict[str, str]:
    with path.open("rb") as file:
        return [one.metadata for one in SeekingReader(file).iter_metadata() if one.name == "nvscope"][-1]


def steps(*sent: tuple[float, int, int], source: str = "10.0.0.1") -> list[Packet]:
    """Return telegrams: at which second, of which list, and its only byte."""
    found = []
    for number, (second, index, value) in enumerate(sent):
        payload = telegram(list_id=index, counter=number, data=bytes([value]))
        one = data_frame(BEGIN_NS + round(second * SECOND_NS), source, "10.0.0.255", payload)
        found.append(Packet(one.data, one.original, one.ts_ns, one.link))
    return found


def seconds_in(path: Path) -> list[float]:
    return [(packet.ts_ns - BEGIN_NS) / SECOND_NS for packet in read(path).packets]


def clock(second: int) -> str:
    """Return a time as names of files have it."""
    return datetime.fromtimestamp(BEGIN_NS // SECOND_NS + second, UTC).strftime("%Y%m%dT%H%M%SZ")


HIGH = "nv.index == 1 && nv.data[0] > 5"


def test_a_file_holds_what_is_near_the_frame_where_it_becomes_true(tmp_path: Path) -> None:
    sent = steps(*((tick / 2, 1, 9 if 20 <= tick < 24 else 0) for tick in range(60)))
    files, told = flown(
        write(tmp_path / "x.pcap", sent), tmp_path / "e", "--trigger", HIGH, "--pre", "3s", "--post", "2s"
    )
    (path,) = files
    assert path.name == f"{clock(10)}-trigger-list1.mcap"
    assert seconds_in(path) == [tick / 2 for tick in range(14, 25)]
    assert told == f"nvscope: 1 event in 1 file.\nnvscope: {path}\n"
    said = metadata_of(path)
    assert (int(said["event_ns"]) - BEGIN_NS, said["trigger"]) == (10 * SECOND_NS, HIGH)


def test_what_others_send_meanwhile_makes_no_event(tmp_path: Path) -> None:
    both = [(tick / 4, 1, 9 if tick >= 40 else 0) for tick in range(80)] + [
        (tick / 4 + 0.1, 2, 0) for tick in range(80)
    ]
    files, _ = flown(
        write(tmp_path / "x.pcap", steps(*sorted(both))),
        tmp_path / "e",
        "--trigger",
        HIGH,
        "--pre",
        "1s",
        "--post",
        "1s",
    )
    (path,) = files
    assert (seconds_in(path)[0], seconds_in(path)[-1]) == (9.0, 11.0)


def test_an_event_within_the_time_of_a_file_makes_it_longer(tmp_path: Path) -> None:
    high = {10, 11, 14, 30}
    sent = steps(*((tick, 1, 9 if tick in high else 0) for tick in range(60)))
    files, told = flown(
        write(tmp_path / "x.pcap", sent), tmp_path / "e", "--trigger", HIGH, "--pre", "2s", "--post", "4s"
    )
    assert [seconds_in(path) for path in files] == [list(range(8, 19)), list(range(28, 35))]
    assert told.startswith("nvscope: 3 events in 2 files.\n")


def test_events_that_follow_each_other_both_have_what_was_before(tmp_path: Path) -> None:
    sent = steps(*((tick, 1, 9 if tick in (10, 13) else 0) for tick in range(20)))
    files, _ = flown(write(tmp_path / "x.pcap", sent), tmp_path / "e", "--trigger", HIGH, "--pre", "5s", "--post", "1s")
    assert [seconds_in(path) for path in files] == [list(range(5, 12)), list(range(8, 15))]


def test_too_many_events_are_counted(tmp_path: Path) -> None:
    sent = steps(*((tick, 1, 9 if tick % 10 == 5 else 0) for tick in range(120)))
    files, told = flown(
        write(tmp_path / "x.pcap", sent), tmp_path / "e", "--trigger", HIGH, "--pre", "1s", "--post", "1s",
        "--max-rate", "2",
    )  # fmt: skip
    assert [seconds_in(path)[1] for path in files] == [5, 15, 65, 75]
    assert "8 events beyond 2 a minute (--max-rate): in no file." in told


def test_a_disk_with_little_room_is_left_alone(tmp_path: Path) -> None:
    sent = steps(*((tick, 1, 9 if tick == 5 else 0) for tick in range(10)))
    folder = tmp_path / "e"
    folder.mkdir()
    done = run_text("record", write(tmp_path / "x.pcap", sent), "-w", folder, "--trigger", HIGH, "--min-free", "1e9")
    assert (done.returncode, list(folder.iterdir())) == (3, [])
    assert "1 event with less than" in done.stderr


def test_causes_are_in_names_and_what_is_told_late_still_makes_files_longer(tmp_path: Path) -> None:
    trigger = 'cause.kind in {"node-silent", "second-sender"}'
    files, told = flown(PLANT, tmp_path / "e", "--trigger", trigger, "--pre", "3s", "--post", "2s")
    (path,) = files
    assert path.name == "20240101T000023Z-node-silent-list12.mcap"
    assert told.startswith("nvscope: 2 events in 1 file.\n")
    causes = {one["kind"]: one for one in json.loads(run_text("report", "--json", PLANT).stdout)["causes"]}
    since = [int(causes[kind]["since_ns"]) for kind in ("node-silent", "second-sender")]
    whole = [packet.ts_ns for packet in read(PLANT).packets]
    expected = [time for time in whole if since[0] - 3 * SECOND_NS <= time <= since[1] + 2 * SECOND_NS]
    assert [packet.ts_ns for packet in read(path).packets] == expected
    said = metadata_of(path)
    assert int(said["event_ns"]) == since[0]
    assert "192.168.1.12" in said["event"]


def test_a_request_for_a_parameter_is_of_no_list(tmp_path: Path) -> None:
    simulated(ROOT / "tests" / "scenarios" / "parameter-writes.toml").write(tmp_path / "x.pcap")
    files, _ = flown(tmp_path / "x.pcap", tmp_path / "e", "--trigger", "sdo.index == 0x2001", "--post", "1s")
    assert [path.name for path in files] == ["20240101T000012Z-trigger.mcap"]


def test_findings_are_events(tmp_path: Path) -> None:
    files, _ = flown(PLANT, tmp_path / "e", "--trigger", 'finding.code == "NV204"', "--pre", "1s", "--post", "1s")
    (path,) = files
    assert path.name == "20240101T000017Z-nv204-sender-restart.mcap"


def events_of(told: str) -> int:
    return int(told.split("nvscope: ")[1].split(" event", maxsplit=1)[0])


def test_figures_count_the_step_of_each_frame(tmp_path: Path) -> None:
    """List 7 of the plant loses its telegrams at 7 s and at 14 s, and nobody else loses any."""
    files, told = flown(PLANT, tmp_path / "e", "--trigger", "list.lost > 0", "--pre", "1s", "--post", "500ms")
    assert [path.name for path in files] == [
        "20240101T000007Z-trigger-list7.mcap", "20240101T000014Z-trigger-list7.mcap",
    ]  # fmt: skip
    assert events_of(told) == 2
    lost = json.loads(run_text("report", "--json", PLANT).stdout)["findings"]
    frames = next(finding["frames"] for finding in lost if finding["code"] == "NV201")
    whole = read(PLANT).packets
    assert [int(metadata_of(path)["event_ns"]) for path in files] == [whole[frame - 1].ts_ns for frame in frames]
    assert metadata_of(files[0])["event"] == "list.lost > 0 became true"
    assert events_of(flown(PLANT, tmp_path / "f", "--trigger", "list.lost > 1")[1]) == 0
    assert events_of(flown(PLANT, tmp_path / "g", "--trigger", "node.restarts > 0 && nv.index == 9")[1]) == 1


def test_who_waited_in_vain_is_asked_when_the_wait_is_over(tmp_path: Path) -> None:
    found = json.loads(run_text("report", "--json", PLANT).stdout)["findings"]
    expected = next(finding for finding in found if finding["code"] == "NV301")
    for trigger, count in (
        ("list.missing_acknowledgements > 0", 6),
        ("nv.index == 3 && ip.dst == 192.168.1.20 && list.missing_acknowledgements > 0", 6),
        ("nv.index == 7 && list.missing_acknowledgements > 0", 0),
    ):
        files, told = flown(
            PLANT, tmp_path / str(len(trigger)), "--trigger", trigger, "--pre", "1s", "--post", "600ms"
        )  # fmt: skip
        assert events_of(told) == count
        assert [int(metadata_of(path)["event_ns"]) for path in files] == [int(expected["first_ns"])][: len(files)]
        assert [path.name for path in files] == ["20240101T000010Z-trigger-list3.mcap"][: bool(count)]


def test_error_frames_of_a_bus(tmp_path: Path) -> None:
    """Each one behind frames that are none: also where it is the same error as an hour ago."""
    lines = []
    for second in (0, 3600, 7200):
        lines += [f"({1000 + second}.000000) can0 181#01", f"({1001 + second}.000000) can0 20000004#0001000000000000"]
        lines += [f"({1002 + second}.000000) can0 181#02"]
    log = tmp_path / "errors.log"
    log.write_text("\n".join(lines) + "\n")
    for number, trigger in enumerate(("bus.error_frames > 0", "bus.error_frames", "can.flags.err")):
        files, told = flown(log, tmp_path / f"e{number}", "--trigger", trigger, "--pre", "100ms", "--post", "100ms")
        assert (events_of(told), len(files)) == (3, 3), trigger
    _, told = flown(log, tmp_path / "held", "--trigger", "held(bus.error_frames > 0, 30m)")
    assert events_of(told) == 0


def test_names_of_lists_on_can_are_those_that_people_use(tmp_path: Path) -> None:
    press = ROOT / "captures" / "can" / "press.log"
    definitions = ("--gvl", str(press.with_name("press.gvl")))
    for number, trigger in enumerate(('cause.kind == "loss-of-list"', "can.id == 0x110")):
        files, _ = flown(press, tmp_path / str(number), *definitions, "--trigger", trigger)
        assert all("-list0x1" in path.name for path in files), files


def test_a_figure_alone_asks_whether_it_counted_something(tmp_path: Path) -> None:
    assert events_of(flown(PLANT, tmp_path / "e", "--trigger", "list.lost")[1]) == 2


def test_functions_of_time_over_variables_of_two_lists(tmp_path: Path) -> None:
    """A valve that is open while the press has been down for a second: neither list says so alone."""
    (tmp_path / "plant.gvl").write_text(
        "\n".join(
            f"""<GVL><Declarations><![CDATA[VAR_GLOBAL
                {name} : BYTE;
            END_VAR]]></Declarations><NetvarSettings Protocol="UDP"><ListIdentifier>{number}</ListIdentifier>
            </NetvarSettings></GVL>"""
            for name, number in (("byDown", 1),)
        )
    )
    (tmp_path / "valve.gvl").write_text((tmp_path / "plant.gvl").read_text().replace("byDown", "byOpen").replace(
        "<ListIdentifier>1<", "<ListIdentifier>2<"
    ))  # fmt: skip
    down = dict.fromkeys(range(20, 60), 1)
    opened = dict.fromkeys(range(30, 34), 1) | dict.fromkeys(range(70, 74), 1)
    sent = sorted(
        [(tick / 10, 1, down.get(tick, 0)) for tick in range(80)]
        + [(tick / 10 + 0.05, 2, opened.get(tick, 0)) for tick in range(80)]
    )
    capture = write(tmp_path / "x.pcap", steps(*sent))
    definitions = ("--gvl", str(tmp_path / "plant.gvl"), "--gvl", str(tmp_path / "valve.gvl"))
    for trigger, seconds in (
        ("var.byDown == 1 && var.byOpen == 1", [3.05]),
        ("held(var.byDown == 1, 1s) && var.byOpen == 1", [3.05]),
        ("held(var.byDown == 1, 2s)", [4.0]),
        ("rose(var.byDown == 1)", [2.0]),
        ("fell(var.byOpen == 1)", [3.45, 7.45]),
        ("changed(var.byDown)", [2.0, 6.0]),
        ("var.byDown - last(var.byDown) < 0", [6.0]),
    ):
        files, _ = flown(
            capture, tmp_path / f"e{len(trigger)}{trigger[0]}", *definitions, "--trigger", trigger, "--pre", "20ms",
            "--post", "20ms",
        )  # fmt: skip
        found = [(int(metadata_of(path)["event_ns"]) - BEGIN_NS) / SECOND_NS for path in files]
        assert found == seconds, trigger


def test_a_folder_that_is_named_as_one_is_made(tmp_path: Path) -> None:
    done = run_text("record", PLANT, "-w", f"{tmp_path}/events/", "--trigger", "list.lost > 0", "--min-free", "0")
    assert (done.returncode, len(list((tmp_path / "events").iterdir()))) == (0, 2), done.stderr


def test_a_healthy_plant_has_no_event(tmp_path: Path) -> None:
    scenario = ROOT / "tests/scenarios/causes/healthy.toml"
    assert run_text("simulate", scenario, "-w", tmp_path / "x.pcap").returncode == 0
    files, told = flown(tmp_path / "x.pcap", tmp_path / "e", "--trigger", 'cause.severity == "error"')
    assert (files, told) == ([], "nvscope: 0 events in 0 files.\n")


def test_variables_are_waited_for_by_name_and_are_in_the_file(tmp_path: Path) -> None:
    files, _ = flown(
        PEERS / "peers.pcap", tmp_path / "e", "--gvl", str(PEERS), "--trigger", "var.fTemp > 98", "--pre", "1s",
        "--post", "500ms",
    )  # fmt: skip
    assert files
    for path in files:
        told = run_text("vars", path, "--history", "axis.fTemp", "-T", "json", cwd=tmp_path).stdout
        assert "fTemp" in run_text("vars", path, cwd=tmp_path).stdout, told
        with path.open("rb") as file:
            topics = {channel.topic for _, channel, _ in SeekingReader(file).iter_messages()}
        assert "/nv/udp/1202/42" in topics


def test_names_begin_and_end_as_is_said(tmp_path: Path) -> None:
    sent = steps(*((tick, 1, 9 if tick == 5 else 0) for tick in range(10)))
    capture = write(tmp_path / "x.pcap", sent)
    done = run_text("record", capture, "-w", tmp_path / "press.pcapng", "--trigger", HIGH, "--min-free", "0")
    assert done.returncode == 0, done.stderr
    (path,) = tmp_path.glob("press-*.pcapng")
    assert path.name == f"press-{clock(5)}-trigger-list1.pcapng"
    assert len(read(path).packets) == 10


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--trigger", "list.jitter > 20"), "list.jitter: known of a whole capture, and not of a single frame"),
        (("--trigger", 'rose(finding.code == "NV201")'), "causes and findings begin by themselves"),
        (("--trigger", "rose(nv.flags.ack) && list.bootup_unanswered > 0"), "told when a wait is over"),
        (("--trigger", "held(nv.flags.ack, 0s)"), "for more than 0 s"),
        (("--trigger", 'cause.kind == "second-sender" && nv.index == 7'), "a trigger waits for one of both"),
        (("--trigger", "nv.idex == 7"), "nv.index"),
        (("--trigger", HIGH, "-b", "packets:3"), "exclude each other"),
    ],
)
def test_what_cannot_be_waited_for_is_told(options: tuple[str, ...], told: str, tmp_path: Path) -> None:
    done = run_text("record", PLANT, "-w", tmp_path, *options)
    assert (done.returncode, told in done.stderr) == (2, True), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_where_nothing_can_be_written_is_told_at_the_start(tmp_path: Path) -> None:
    for target, code in ((tmp_path / "none" / "x.mcap", 5), (tmp_path / "x.docx", 2)):
        done = run_text("record", PLANT, "-w", target, "--trigger", HIGH)
        assert (done.returncode, "event" in done.stderr) == (code, False), done.stderr
    assert list(tmp_path.iterdir()) == []
