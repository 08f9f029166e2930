"""Every action of the screen: its name, its keys, and what it does; keys are replaced by the project file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import Enum

from msgspec import Struct

from nvscope.errors import ConfigurationError
from nvscope.toml_table import nearest

PROJECT_TABLE = "keys"


class Group(Enum):
    """What actions are about, in the order in which help tells them."""

    VIEW = "Views"
    MOVE = "Moving"
    TIME = "Time"
    REPLAY = "Replay"
    FIND = "Finding"
    SHOW = "Showing"
    PROGRAM = "Program"


class Action(Struct, frozen=True):
    """Something that a person can do: ``name`` is what the command line and the project file call it.

    ``keys`` are as people write them: ``q``, ``ctrl-d``, ``space``. ``takes`` is what may stand behind the name on the
    command line, "" where nothing may.
    """

    name: str
    keys: tuple[str, ...]
    group: Group
    help: str
    takes: str = ""


ACTIONS: Sequence[Action] = (
    Action("view.lists", ("1",), Group.VIEW, "lists: who sends what, how often, what is lost"),
    Action("view.causes", ("2",), Group.VIEW, "causes: what happened, what was checked, what to do"),
    Action("view.variables", ("3",), Group.VIEW, "variables: values, and when they changed"),
    Action("view.packets", ("4",), Group.VIEW, "packets: telegrams, their fields and bytes"),
    Action("view.nodes", ("5",), Group.VIEW, "nodes: who sends to whom"),
    Action("view.can", ("6",), Group.VIEW, "CAN: load, identifiers, errors, node states"),
    Action("view.source", ("7",), Group.VIEW, "source: drops, buffers, this program's own load"),
    Action("view.transactions", ("8",), Group.VIEW, "transactions: who asks whom for parameters and variables"),
    Action("move.down", ("j", "down"), Group.MOVE, "a row down"),
    Action("move.up", ("k", "up"), Group.MOVE, "a row up"),
    Action("move.half-page-down", ("ctrl-d",), Group.MOVE, "half a page down"),
    Action("move.half-page-up", ("ctrl-u",), Group.MOVE, "half a page up"),
    Action("move.page-down", ("pagedown",), Group.MOVE, "a page down"),
    Action("move.page-up", ("pageup",), Group.MOVE, "a page up"),
    Action("move.first", ("g", "home"), Group.MOVE, "to the first row"),
    Action("move.last", ("G", "end"), Group.MOVE, "to the last row"),
    Action("move.left", ("h", "left"), Group.MOVE, "to the left: a byte, a column"),
    Action("move.right", ("l", "right"), Group.MOVE, "to the right: a byte, a column"),
    Action("view.open", ("enter",), Group.MOVE, "drill in: what belongs to the row"),
    Action("view.pane", ("tab",), Group.MOVE, "the next pane of a view"),
    Action("view.maximise", ("z",), Group.MOVE, "this pane alone, and back"),
    Action(
        "time.freeze",
        ("space",),
        Group.TIME,
        "freeze what is shown, and go on; capturing goes on meanwhile, a replay stands",
    ),
    Action("time.follow", ("F",), Group.TIME, "follow: what is now, or the end of a capture"),
    Action("time.back", ("[",), Group.TIME, "back in time"),
    Action("time.forward", ("]",), Group.TIME, "forward in time"),
    Action("time.previous-finding", ("{",), Group.TIME, "to when the cause before began"),
    Action("time.next-finding", ("}",), Group.TIME, "to when the next cause began"),
    Action("time.go", (), Group.TIME, "to a time: 12:30:01, 5s, -2s", "TIME"),
    Action("replay.step", (".",), Group.REPLAY, "a frame further on, and stand there"),
    Action("replay.step-back", (",",), Group.REPLAY, "a frame back, and stand there"),
    Action("replay.faster", (">",), Group.REPLAY, "faster"),
    Action("replay.slower", ("<",), Group.REPLAY, "slower"),
    Action("replay.rate", ("=",), Group.REPLAY, "as fast as it was, or so many times as fast: 0.1 to 100", "FACTOR"),
    Action("replay.a-b", ("a",), Group.REPLAY, "repeat from here, then: to here, then: no more"),
    Action("replay.loop", ("L",), Group.REPLAY, "begin again at the end, and no more"),
    Action("find.filter", ("/",), Group.FIND, "a filter, as for -Y", "EXPR"),
    Action("find.suspend", ("\\",), Group.FIND, "suspend the filter, and use it again"),
    Action("find.next", ("n",), Group.FIND, "the next match of the filter"),
    Action("find.previous", ("N",), Group.FIND, "the match before"),
    Action("find.mark", ("m",), Group.FIND, "mark the row; the letter behind it names the mark"),
    Action("find.go-to-mark", ("'",), Group.FIND, "to the mark of a letter"),
    Action("show.sort", ("s",), Group.SHOW, "sort by the next column", "COLUMN"),
    Action("show.reverse", ("S",), Group.SHOW, "sort the other way round"),
    Action("show.hex", ("x",), Group.SHOW, "bytes, and back"),
    Action("show.notch", ("#",), Group.SHOW, "leave what changes now unmarked: what changes next stands out"),
    Action("show.plot", ("p",), Group.SHOW, "plot the variable over time, and back"),
    Action("show.explain", ("e",), Group.SHOW, "what a cause or finding means", "CODE"),
    Action("show.copy", ("y",), Group.SHOW, "copy the row"),
    Action("show.theme", ("t",), Group.SHOW, "the next theme", "NAME"),
    Action("record.toggle", ("R",), Group.PROGRAM, "record to a pcapng file from now on, and stop"),
    Action("record.save", (), Group.PROGRAM, "write the frames that are kept to a file", "FILE"),
    Action("program.reset", ("r",), Group.PROGRAM, "count from now on"),
    Action("program.command", (":",), Group.PROGRAM, "a command line: every action by its name"),
    Action("program.help", ("?",), Group.PROGRAM, "all keys"),
    Action("program.back", ("q",), Group.PROGRAM, "back; on the first view: end"),
    Action("program.close", ("escape",), Group.PROGRAM, "back, and on the first view nothing"),
    Action("program.suspend", ("ctrl-z",), Group.PROGRAM, "stop this program, as a shell does; fg goes on"),
    Action("program.quit", ("ctrl-q", "ctrl-c"), Group.PROGRAM, "end, from anywhere"),
)
BY_NAME: Mapping[str, Action] = {action.name: action for action in ACTIONS}

_NAMED = {
    " ": "space", "\r": "enter", "\n": "enter", "\t": "tab", "\x1b": "escape",
}  # fmt: skip
_KEY_NAMES = (
    "space", "enter", "tab", "escape", "up", "down", "left", "right", "home", "end", "pageup", "pagedown", "insert",
    "delete", "backspace", *(f"f{number}" for number in range(1, 13)),
)  # fmt: skip
_ENDS_ALWAYS = "program.quit"


class Keymap:
    """Which key does what; ``told`` are the keys that the project file gives actions, in place of their own.

    Raises ConfigurationError, with ``where`` that is, for an action that there is not, a key that there is not, and a
    key that would do two things.
    """

    def __init__(self, told: Mapping[str, str] | None = None, where: str = "") -> None:
        self._keys: dict[str, tuple[str, ...]] = {action.name: action.keys for action in ACTIONS}
        given = dict(told or {})
        for name, keys in given.items():
            place = f"{where}: {PROJECT_TABLE}.{name}" if where else f"{PROJECT_TABLE}.{name}"
            if name not in BY_NAME:
                raise ConfigurationError("no action has this name", where=place, next_step=nearest(name, list(BY_NAME)))
            wanted = tuple(keys.split())
            for key in wanted:
                if not _is_key(key):
                    raise ConfigurationError(
                        f"'{key}' is no key", where=place,
                        next_step=f"a character, ctrl- and a letter, or one of {', '.join(_KEY_NAMES[:12])} …",
                    )  # fmt: skip
            self._keys[name] = wanted
        own = {key: name for name in given for key in self._keys[name]}
        for name, keys_of in self._keys.items():
            if name not in given:
                # A key that was given away does nothing else.
                self._keys[name] = tuple(key for key in keys_of if key not in own)
        self.by_key: dict[str, str] = {}
        for name, keys_of in self._keys.items():
            for key in keys_of:
                if key in self.by_key:
                    raise ConfigurationError(
                        f"'{key}' would be {self.by_key[key]} and {name}",
                        where=f"{where}: {PROJECT_TABLE}.{name}" if where else PROJECT_TABLE,
                        next_step="give one of them another key",
                    )
                self.by_key[key] = name
        if not self._keys[_ENDS_ALWAYS]:
            raise ConfigurationError(
                "no key is left that ends the screen", where=where, next_step=f"give {_ENDS_ALWAYS} one"
            )

    def keys_of(self, name: str) -> tuple[str, ...]:
        """Return the keys of an action."""
        return self._keys[name]

    def key_of(self, name: str) -> str:
        """Return the first key of an action, "" where it has none."""
        keys = self._keys[name]
        return keys[0] if keys else ""

    def action_of(self, key: str, character: str | None) -> str | None:
        """Return what a key does that a terminal tells: ``ctrl+d``, or a character; None for nothing."""
        if character is not None and character.isprintable() and character != " ":
            return self.by_key.get(character)
        return self.by_key.get(_NAMED.get(character or "", key.replace("ctrl+", "ctrl-")))


def _is_key(key: str) -> bool:
    if len(key) == 1:
        return key.isprintable() and key != " "
    control, _, letter = key.partition("-")
    return key in _KEY_NAMES or (control == "ctrl" and len(letter) == 1 and letter.isalpha() and letter.islower())


def matching(text: str) -> Iterable[Action]:
    """Return the actions whose name begins as a command line does, or whose last part does."""
    word = text.split(" ", 1)[0]
    begun = [action for action in ACTIONS if action.name.startswith(word)]
    return begun or [action for action in ACTIONS if action.name.partition(".")[2].startswith(word)]
