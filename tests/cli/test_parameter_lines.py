"""Lines of ``nvscope packets`` about parameters: names, and values by the types of the project, with and without -Y."""

from __future__ import annotations

from pathlib import Path

from tests.check.requests import WRITE, asked
from tests.oracle.pcap import write_pcap
from tests.program_here import run_text

PROJECT = (
    '[nodes]\n"10.0.0.2" = { name = "press" }\n[parameters]\n"press/0x2000:1" = { name = "nLimit", type = "INT" }\n'
)


def lines(folder: Path, *arguments: str) -> list[str]:
    capture = folder / "asked.pcap"
    frames = [*asked(0, counter=1), *asked(50, counter=2, service=WRITE, data=b"\x63\0")]
    write_pcap(frames, capture)
    done = run_text("packets", "asked.pcap", *arguments, cwd=folder, environment={"COLUMNS": "200"})
    assert done.returncode == 0, done
    return done.stdout.splitlines()


def test_parameters_have_their_names_and_values_with_and_without_a_filter(tmp_path: Path) -> None:
    (tmp_path / "nvscope.toml").write_text(PROJECT, encoding="utf-8")
    found = lines(tmp_path)
    assert found == lines(tmp_path, "-Y", "frame.number < 5")
    assert [line.split("#")[1].split("  ")[1:] for line in found] == [[], ["= 1"], ["= 99"], []]
    assert all("param nLimit" in line for line in found)


def test_a_value_of_which_nobody_knows_the_type_is_told_by_its_bytes(tmp_path: Path) -> None:
    found = lines(tmp_path)
    assert [line.endswith("= 63 00") for line in found] == [False, False, True, False]
    assert all("param 0x2000 sub 1" in line for line in found)
