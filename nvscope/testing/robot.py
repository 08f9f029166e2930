"""The library of Robot Framework: keywords with the words of rules.

::

    *** Settings ***
    Library    nvscope.testing.robot.Nvscope

    *** Test Cases ***
    The axis keeps its pace
        Open Capture          press.pcapng    definitions=axis.gvl
        List Should Keep      axis    cycle    interval=50ms    tolerance=20%
        Rules Should Be Kept  press.rules.toml
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nvscope.testing.assertions import UnderTest


class Nvscope:
    """Asserts what lists, variables and the whole plant do in captures of network variables."""

    ROBOT_LIBRARY_SCOPE = "SUITE"

    def __init__(self) -> None:
        self._under_test: UnderTest | None = None

    def open_capture(self, *captures: str, definitions: Any = None, project: str | None = None) -> None:
        """Open capture files, of which the following keywords assert something.

        ``definitions`` are files that the PLC project exports: one, or a list of them.
        """
        from nvscope.testing.assertions import under_test

        self._under_test = under_test(captures, definitions, project=project)

    def list_should_keep(self, name: str, check: str, **parameters: Any) -> None:
        """Assert a check of one list, with its parameters: cycle, loss, silence, single_sender …"""
        self._opened().assert_that(check, list=name, **_typed(parameters))

    def capture_should_keep(self, check: str, **parameters: Any) -> None:
        """Assert a check of variables, expressions, or all of a capture, with its parameters."""
        self._opened().assert_that(check, **_typed(parameters))

    def rules_should_be_kept(self, *files: str) -> None:
        """Assert all rules of files."""
        self._opened().assert_rules(*files)

    def _opened(self) -> UnderTest:
        if self._under_test is None:
            raise AssertionError("no capture is open: use Open Capture first")
        return self._under_test


def _typed(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return parameters as a file of rules has them: Robot hands numbers over as texts."""
    return {name: _of(value) for name, value in parameters.items()}


def _of(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(value.lower(), value)
