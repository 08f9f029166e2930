"""Three views of the screen: who sends to whom, CAN, and where packets come from."""

from __future__ import annotations

from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.tui.own_load import OwnLoadMeter
from nvscope.view.lines.plant.bus_load import NO_CAN
from tests.simulate.simulation import simulated
from tests.tui.screen import Screen, on_screen

ROOT = Path(__file__).parents[2]
PLANT = str(ROOT / "captures" / "plant.pcapng.gz")
PRESS = str(ROOT / "captures" / "can" / "press.log")
SCENARIOS = ROOT / "tests" / "scenarios"


def test_the_matrix_of_a_capture() -> None:
    async def look_at(shown: Screen) -> None:
        assert shown.lines[2:11] == [
            "   list  to  […10]…11 …12 …20 …99",
            "               ✗   !   ✗   !   ✗",
            "192.168.1.10",
            "!  3     …20  [▲]  ·   ·   !   ·",
            "✗  7     all   ╪   ◐   ·   ·   ╪",
            "192.168.1.11",
            "!  9     all   ·   ▲   ·   ·   ·",
            "192.168.1.12",
            "✗  12    all   ·   ·   △   ·   ·",
        ]
        assert "✗" not in "".join(shown.lines[12:])
        await shown.press("l", "l", "l", "enter")
        # What is told of a reader is what the report counts.
        assert "List 3  sent by 192.168.1.10 to …20, 60 telegrams" in shown.text
        assert "  !  192.168.1.20       54" in shown.text
        assert "Node 192.168.1.20  reads 3; hardware" in shown.text
        await shown.press("j")
        assert "List 7  sent by 192.168.1.10, 192.168.1.99 to all, 700 telegrams" in shown.text
        await shown.press("q")
        assert "List 7" not in shown.text
        assert shown.app.front is not None
        assert shown.app.front.title == "Nodes"
        assert shown.app.front.copied().splitlines()[0] == "List 7 to all"
        await shown.press("m", "a", "k", "h", "'", "a")
        assert shown.app.front.place() == ("udp/1202/7", "192.168.1.20")

    on_screen(Inquiry([PLANT]), look_at, keys=["5"])


def test_the_matrix_at_a_moment_of_the_past(tmp_path: Path) -> None:
    async def look_at(shown: Screen) -> None:
        assert "✗  6     …20" not in shown.text
        shown.app.act("time.go", "18s")
        await shown.until(lambda: shown.app.look is not None and shown.app.look.at_ns is not None)
        assert "✗  6     …20  ▲   ·   ·    ✗" in shown.text
        await shown.press("F")
        # What is now is drawn a tenth of a second behind the last drawing.
        await shown.until(lambda: "!  6     …20  ▲   ·   ·    !" in shown.text)

    on_screen(simulated(SCENARIOS / "causes/reader-silent.toml").inquiry(tmp_path), look_at, keys=["5", "j"])


def test_on_can_nobody_knows_senders() -> None:
    async def look_at(shown: Screen) -> None:
        assert shown.lines[2].startswith("On CAN nobody knows who sends to whom")
        assert "  node 5   operational  00:00:00.000" in shown.text

    on_screen(Inquiry([PRESS]), look_at, keys=["5"])


def test_a_bus() -> None:
    async def look_at(shown: Screen) -> None:
        lines = shown.lines
        assert lines[3].split()[:6] == ["▸", "can0", "250", "kbit/s", "found", "4.1"]
        assert lines[5] == "load, the last 9 seconds, █ 5 %"
        assert lines[6].strip() == "▇▇▆▆▆▆▆▆▆"
        assert [line.split()[0] for line in lines[9:15]] == ["0x080", "0x110", "0x111", "0x112", "0x120", "0x705"]
        await shown.press("s", "s")
        assert [line.split()[0] for line in shown.lines[9:11]] == ["0x080", "0x110"]
        shown.app.act("show.sort", "jitter")
        await shown.press("S", "S")
        assert shown.lines[9].split()[0] == "0x111"

    on_screen(Inquiry([PRESS]), look_at, keys=["6"])


def test_several_buses(tmp_path: Path) -> None:
    async def look_at(shown: Screen) -> None:
        assert [line.split()[0] for line in shown.lines[3:5]] == ["▸", "can1"]
        await shown.press("tab")
        assert [line.split()[0] for line in shown.lines[3:5]] == ["can0", "▸"]
        await shown.press("z")
        assert shown.lines[2].startswith("identifier")

    on_screen(simulated(SCENARIOS / "can-two-channels.toml").inquiry(tmp_path), look_at, size=(160, 50), keys=["6"])


def test_without_can_it_says_how_to_add_one() -> None:
    async def look_at(shown: Screen) -> None:
        assert " ".join(line.strip() for line in shown.lines[2:5]).strip() == NO_CAN

    on_screen(Inquiry([PLANT]), look_at, keys=["6"])


def test_the_source() -> None:
    async def look_at(shown: Screen) -> None:
        await shown.until(lambda: "of a processor" in shown.text)
        lines = shown.lines
        assert lines[2] == f"{PLANT}   pcapng, file"
        assert "  frames    1 212 frames" in lines[4]
        assert lines[5] == "  dropped   none"
        assert any(line.startswith("  frames    1 212 frames in ") for line in lines)
        assert shown.app.look is not None
        streams = sum(len(entry["streams"]) for entry in shown.app.look.report["lists"])
        assert any(line.startswith(f"  streams   {streams} of 50 000 at most") for line in lines)
        assert any(line.startswith("  last look took ") for line in lines)

    on_screen(Inquiry([PLANT]), look_at, size=(120, 40), keys=["7"])


def test_what_the_program_takes() -> None:
    meter = OwnLoadMeter()
    assert meter.measure(0).cpu_percent is None
    sum(range(300_000))
    load = meter.measure(3)
    assert load.cpu_percent is not None
    assert load.cpu_percent > 0
    assert load.memory_bytes is not None
    assert load.memory_bytes > 10_000_000
    assert load.threads >= 1
