"""What a shell proposes behind ``nvscope sdo``: nodes, parameters and types."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.cli.completion import nodes, parameter_types, parameters

PROJECT = """
[nodes]
"192.168.1.20" = { name = "press" }
"192.168.1.21" = {}
[parameters]
"press/0x2000:1" = { name = "rSetpoint" }
"0x2000:1" = { name = "rSetpoint" }
"0x2001:1" = { name = "nMode" }
"0x2002:1" = {}
"""


def test_the_project_has_the_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "nvscope.toml").write_text(PROJECT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert nodes("") == ["press", "192.168.1.20", "192.168.1.21"]
    assert nodes("PR") == ["press"]
    assert parameters("") == ["rSetpoint", "nMode"]
    assert parameters("n") == ["nMode"]


def test_without_a_project_there_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert nodes("") == parameters("") == []
    (tmp_path / "nvscope.toml").write_text("[nodes", encoding="utf-8")
    assert nodes("") == parameters("") == []


def test_types_are_those_that_a_parameter_can_have() -> None:
    assert parameter_types("ui") == ["UINT"]
    assert parameter_types("ws") == ["WSTRING"]
    assert "POINTER" not in parameter_types("")
