"""What is asked of ``nvscope audit`` beside databases: configurations, projects, and what is no file of a database."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from tests.datalogger.audit.built import Row, without, write
from tests.program_here import run_text

TASKS = '[datalogger.tasks]\nFast = "axis"\n'
NAME = "Arp.Plc.Eclr/Fast/a"


def configured(folder: Path, names: list[str], interval: str) -> Path:
    variables = "".join(f'<Variable name="{name}"/>' for name in names)
    path = folder / "session.xml"
    path.write_text(
        f'<DataLoggerConfigDocument><General name="s" samplingInterval="{interval}"/>'
        f'<Datasink type="db" dst="x.db"/><Variables>{variables}</Variables></DataLoggerConfigDocument>',
        "utf-8",
    )
    return path


@pytest.mark.parametrize("interval", ["50ms", "500ms"])
@pytest.mark.parametrize("named", [False, True])
def test_what_is_taken_in_cycles_of_a_list_is_not_judged_by_the_interval(
    interval: str, named: bool, tmp_path: Path
) -> None:  # fmt: skip
    rows = [Row(n * 100, {NAME: n}) for n in range(40)]
    path = write(tmp_path / "x.db", rows, {NAME: "INT", "Arp.Plc.Eclr/b": "INT"}, changes=False)
    configuration = configured(tmp_path, [NAME, "Arp.Plc.Eclr/b"], interval)
    judged = run_text("audit", path, "--config", configuration, cwd=tmp_path)
    # Rows each 100 ms: where 50 were asked for, each second one is missing; where 500 were, it is another session.
    assert "NV952" in judged.stdout if interval == "50ms" else "does not fit" in judged.stdout
    project = tmp_path / ("plant.toml" if named else "nvscope.toml")
    project.write_text(TASKS)
    words = ["--project", str(project)] if named else []
    good = run_text("audit", path, "--config", configuration, *words, cwd=tmp_path)
    assert good.stdout.splitlines()[0] == "● To be trusted: nothing is missing that is not told"
    assert "every 100.0 ms" in good.stdout
    write(path, without(rows, 20), {NAME: "INT", "Arp.Plc.Eclr/b": "INT"}, changes=False)
    bad = run_text("audit", path, "--config", configuration, *words, cwd=tmp_path)
    assert "Rows are missing once, and none says so: 200.0 ms passed" in bad.stdout


def test_a_project_says_nothing_without_a_configuration(tmp_path: Path) -> None:
    path = write(tmp_path / "x.db", [Row(n * 100, {"a": n}) for n in range(9)], {"a": "INT"}, changes=False)
    (tmp_path / "nvscope.toml").write_text("no table")
    assert run_text("audit", path, cwd=tmp_path).returncode == 0
    done = run_text("audit", path, "--project", "nvscope.toml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "name the configuration with --config" in done.stderr


@pytest.mark.parametrize("words", [["-"], ["x.db", "-"]])
def test_standard_input_is_told_to_be_none(words: list[str], tmp_path: Path) -> None:
    write(tmp_path / "x.db", [Row(0, {"a": 1})], {"a": "INT"}, changes=False)
    done = run_text("audit", *words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "- is the standard input" in done.stderr
    assert "save it to a file, and name that" in done.stderr


def test_what_is_compressed_is_told_to_be_so(tmp_path: Path) -> None:
    path = write(tmp_path / "x.db", [Row(0, {"a": 1})], {"a": "INT"}, changes=False)
    (tmp_path / "x.db.gz").write_bytes(gzip.compress(path.read_bytes()))
    done = run_text("audit", "x.db.gz", cwd=tmp_path)
    assert done.returncode == 4
    told = " ".join(done.stdout.split())
    assert "x.db.gz: compressed (gzip)" in told
    assert "Unpack it, and name the file that comes out of it." in told
    assert "a" in run_text("vars", "x.db.gz", cwd=tmp_path).stdout
