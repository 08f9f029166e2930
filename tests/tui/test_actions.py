"""Keys and what they do: each action by its name, keys of the project in place of its own, mistakes told."""

from __future__ import annotations

import pytest

from nvscope.errors import ConfigurationError
from nvscope.tui.actions import ACTIONS, Keymap, matching


def test_no_two_actions_share_a_key_or_a_name() -> None:
    assert len({action.name for action in ACTIONS}) == len(ACTIONS)
    keys = [key for action in ACTIONS for key in action.keys]
    assert len(keys) == len(set(keys))


def test_keys_are_those_that_are_promised() -> None:
    keymap = Keymap()
    promised = {
        "q": "program.back", "?": "program.help", ":": "program.command", "/": "find.filter", "\\": "find.suspend",
        "n": "find.next", "N": "find.previous", "j": "move.down", "k": "move.up", "g": "move.first", "G": "move.last",
        "x": "show.hex", "y": "show.copy", "F": "time.follow", "[": "time.back", "]": "time.forward",
        "{": "time.previous-finding", "}": "time.next-finding", "s": "show.sort", "S": "show.reverse",
        "#": "show.notch", "m": "find.mark", "'": "find.go-to-mark", "R": "record.toggle", "r": "program.reset",
        "z": "view.maximise",
    }  # fmt: skip
    assert {key: keymap.action_of(key, key) for key in promised} == promised
    views = [keymap.action_of(str(number), str(number)) for number in range(1, 8)]
    assert views == [
        "view.lists", "view.causes", "view.variables", "view.packets", "view.nodes", "view.can", "view.source",
    ]  # fmt: skip
    named = {("ctrl+d", "\x04"): "move.half-page-down", ("space", " "): "time.freeze", ("enter", "\r"): "view.open",
             ("tab", "\t"): "view.pane", ("up", None): "move.up", ("ctrl+c", "\x03"): "program.quit"}  # fmt: skip
    assert {key: keymap.action_of(*key) for key in named} == named


def test_a_project_gives_an_action_other_keys() -> None:
    keymap = Keymap({"view.causes": "c ctrl-e", "find.filter": "f"})
    assert keymap.keys_of("view.causes") == ("c", "ctrl-e")
    assert keymap.action_of("c", "c") == keymap.action_of("ctrl+e", "\x05") == "view.causes"
    assert keymap.action_of("2", "2") is None
    assert keymap.action_of("/", "/") is None


def test_a_key_that_was_given_away_does_nothing_else() -> None:
    keymap = Keymap({"view.causes": "j"})
    assert keymap.action_of("j", "j") == "view.causes"
    assert keymap.keys_of("move.down") == ("down",)


@pytest.mark.parametrize(
    ("told", "what"),
    [
        ({"view.cause": "c"}, "no action has this name"),
        ({"view.causes": "hyper-x"}, "'hyper-x' is no key"),
        ({"view.causes": "c", "view.lists": "c"}, "'c' would be"),
        ({"program.quit": ""}, "no key is left that ends the screen"),
    ],
)
def test_mistakes_are_told_with_their_place(told: dict[str, str], what: str) -> None:
    with pytest.raises(ConfigurationError, match=what) as caught:
        Keymap(told, "nvscope.toml")
    assert caught.value.where.startswith("nvscope.toml")
    assert caught.value.next_step


def test_the_command_line_finds_actions_by_their_beginning_or_their_last_part() -> None:
    assert [action.name for action in matching("time.fr")] == ["time.freeze"]
    assert [action.name for action in matching("freeze")] == ["time.freeze"]
    assert [action.name for action in matching("show.t mono")] == ["show.theme"]
    assert list(matching("nothing")) == []
