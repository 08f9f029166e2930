"""``report --compare``: one variable on Ethernet and on CAN."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path

import pytest

from nvscope.capture.open import open_sink
from tests.cli.test_vars import nvscope
from tests.definition.lists import telegram
from tests.packets import batch_of

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000
DEFINITION = """<GVL>
  <Declarations><![CDATA[VAR_GLOBAL nCount : INT; fLevel : LREAL; END_VAR]]></Declarations>
  <NetvarSettings Protocol="{protocol}"><ListIdentifier>{identifier}</ListIdentifier><Pack>True</Pack></NetvarSettings>
</GVL>"""


@pytest.fixture
def plant(tmp_path: Path) -> list[str]:
    """Return the arguments for a plant whose gateway sends list 9 on CAN 2 ms later, and misses one value."""
    sent = [struct.pack("<hd", number, number / 2) for number in range(50)]
    frames = [
        telegram(data, 2, subindex=0, counter=number, ts_ns=START_NS + number * 10 * MS, list_id=9)
        for number, data in enumerate(sent)
    ]
    sink = open_sink(str(tmp_path / "eth.pcap"))
    sink.write(batch_of(frames))
    sink.close()
    lines = []
    for number, data in enumerate(sent):
        at = f"({(START_NS + (number * 10 + 2) * MS) / 1e9:.6f})"
        if number != 20:
            lines += [f"{at} can0 190#{data[:2].hex().upper()}\n", f"{at} can0 191#{data[2:].hex().upper()}\n"]
    (tmp_path / "can.log").write_text("".join(lines))
    for name, protocol, identifier in (("eth.gvl", "UDP", 9), ("can.gvl", "CAN", 0x190)):
        variables = (
            "nCount : INT; fLevel : LREAL; bOnly : BOOL;" if protocol == "none" else "nCount : INT; fLevel : LREAL;"
        )
        text = DEFINITION.format(variables=variables, protocol=protocol, identifier=identifier)
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in ("eth.pcap", "can.log")]
    return [*files, "--gvl", str(tmp_path / "eth.gvl"), "--gvl", str(tmp_path / "can.gvl")]


def test_delay_and_disagreement_between_ethernet_and_can(plant: list[str]) -> None:
    done = nvscope("report", *plant, "--compare")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    begin = lines.index("Hops: the same variable in several lists")
    table = [re.split(r"\s{2,}", line.strip()) for line in lines[begin + 1 : begin + 4]]
    # 104 of 490 ms: in the last 2 ms nobody listens to the Ethernet, though the last change is seen to be followed.
    way = ["udp/1202/9", "can/can0/0x190", "48 of 48", "2.0 ms", "2.0 ms", "2.0 ms", "21 %", "equal"]
    assert table == [
        ["variable", "from", "to", "followed", "delay p50", "p99", "max", "differed", "at the end"],
        ["fLevel", *way],
        ["nCount", *way],
    ]


def test_the_table_as_data_and_as_markdown(plant: list[str]) -> None:
    document = json.loads(nvscope("report", *plant, "--compare", "--json").stdout)
    level, count = document["hops"]
    assert (level["variable"], count["variable"]) == ("fLevel", "nCount")
    assert (count["changes"], count["followed"], count["delay_ns"]["p50"], count["equal"]) == (48, 48, 2 * MS, True)
    assert count["from"]["list"] == "udp/1202/9"
    assert "hops" not in json.loads(nvscope("report", *plant, "--json").stdout)
    markdown = nvscope("report", *plant, "--compare", "--md").stdout
    assert "### Hops: the same variable in several lists" in markdown
    assert "| `fLevel` | `udp/1202/9` | `can/can0/0x190` | 48 of 48 |" in markdown


def test_nothing_to_compare_is_said(plant: list[str], tmp_path: Path) -> None:
    done = nvscope("report", *plant[:2], "--compare")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--gvl" in done.stderr
    one = nvscope("report", plant[0], "--gvl", plant[3], "--compare")
    assert "No variable was seen in two lists" in one.stdout


def test_what_changes_while_only_one_end_is_captured_is_not_compared(plant: list[str], tmp_path: Path) -> None:
    log = tmp_path / "can.log"
    lines = [line.split(" ", 1) for line in log.read_text().splitlines()]
    later = []
    for seconds in (10, 4_000):  # while the first log goes on, and an hour behind all captures
        for number, (at, frame) in enumerate(lines[:40]):
            later.append(f"({float(at[1:-1]) + seconds:.6f}) {frame.replace('#', f'#{number + 100:02X}', 1)[:17]}")
    (tmp_path / "can.log").write_text("".join(f"{line}\n" for line in [" ".join(line) for line in lines] + later[:40]))
    (tmp_path / "behind.log").write_text("".join(f"{line}\n" for line in later[40:]))
    document = json.loads(nvscope("report", *plant, str(tmp_path / "behind.log"), "--compare", "--json").stdout)
    count = next(hop for hop in document["hops"] if hop["variable"] == "nCount")
    assert (count["changes"], count["followed"], count["delay_ns"]["max"]) == (48, 48, 2 * MS)
    assert count["observed_ns"] == 488 * MS
