"""Parsers from grammars, by way of tables that are computed ahead.

Lark takes more than a tenth of a second to make a parser from a grammar. What it finds out is kept beside the grammar
(``declarations.lark``, ``declarations.tables.json``), and a parser is made from that in a few milliseconds. The tables
say which grammar, options and version of lark they are of; where one of these differs they are left aside and the
grammar is read, so that they make nothing wrong, only fast. ``python -m tests.grammar_tables`` writes them anew.
"""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path
from typing import Any

import lark
from lark import Lark
from lark.grammar import Rule
from lark.lexer import TerminalDef
from msgspec import Struct, field

_MOST_WIDTH = 1 << 31
_SHIFT = 0


class Grammar(Struct, frozen=True):
    """A grammar in a file, and the options with which lark makes a parser of it.

    ``options`` are plain values, part of what the tables are of; ``parts`` are classes and objects that the parser is
    given: lexer and transformer.
    """

    path: Path
    options: dict[str, Any]
    parts: dict[str, Any] = field(default_factory=dict)

    @property
    def tables_path(self) -> Path:
        """Where the tables are kept."""
        return self.path.with_suffix(".tables.json")

    def parser(self) -> Lark:
        """Return the parser: from the tables where they are of this grammar, else from the grammar itself."""
        text = self.path.read_text(encoding="utf-8")
        tables = self._tables(text)
        return self._made(text) if tables is None else self._loaded(tables)

    def tables(self) -> str:
        """Return the content of the tables' file, computed from the grammar; the same on every machine."""
        text = self.path.read_text(encoding="utf-8")
        data, memo = self._made(text).memo_serialize([TerminalDef, Rule])
        data["options"] = {
            name: value for name, value in data["options"].items() if name not in {*self.parts, "source_path"}
        }
        data["parser"]["parser"] = _numbered(data["parser"]["parser"])
        data["parser"]["lexer_conf"]["lexer_type"] = self.options.get("lexer")
        content = {"of": self.origin(text), "data": _stored(data), "memo": _stored(memo)}
        return json.dumps(content, separators=(",", ":"), ensure_ascii=True) + "\n"

    def _made(self, text: str) -> Lark:
        return Lark(text, parser="lalr", **self.options, **self.parts)

    def origin(self, text: str) -> dict[str, Any]:
        """Return what tables of a grammar's text are of, as they say it themselves."""
        return {"lark": lark.__version__, "grammar": sha256(text.encode()).hexdigest(), "options": self.options}

    def _tables(self, text: str) -> dict[str, Any] | None:
        try:
            stored = json.loads(self.tables_path.read_bytes(), object_hook=_restored)
        except (OSError, ValueError):
            return None
        return stored if isinstance(stored, dict) and stored.get("of") == self.origin(text) else None

    def _loaded(self, tables: dict[str, Any]) -> Lark:
        data = tables["data"]
        data["options"] |= {"source_path": str(self.path)} | self.parts
        if "lexer" in self.parts:
            data["parser"]["lexer_conf"]["lexer_type"] = self.parts["lexer"]
        callbacks = {name: part for name, part in self.parts.items() if name != "lexer"}
        # What lark's own generator of stand-alone parsers calls: no other way leads around pickled files.
        parser: Lark = Lark._load_from_dict(data, tables["memo"], **callbacks)  # type: ignore[no-untyped-call]
        return parser


def _numbered(table: dict[str, Any]) -> dict[str, Any]:
    """Return a parse table with its states numbered as they are reached; lark's numbers differ each time."""
    names: dict[int, str] = table["tokens"]
    symbols = {name: number for number, name in enumerate(sorted(names.values()))}
    reached = dict.fromkeys(state for _, state in sorted(table["start_states"].items()))
    states = {}
    for state in (waiting := list(reached)):
        actions = sorted((symbols[names[token]], action) for token, action in table["states"][state].items())
        for following in (argument for _, (kind, argument) in actions if kind == _SHIFT and argument not in reached):
            reached[following] = None
            waiting.append(following)
        states[state] = actions
    number = {state: place for place, state in enumerate(reached)}
    return {
        "tokens": {number: name for name, number in symbols.items()},
        "states": {
            number[state]: {
                token: (kind, number[argument] if kind == _SHIFT else argument) for token, (kind, argument) in actions
            }
            for state, actions in states.items()
        },
        "start_states": {start: number[state] for start, state in sorted(table["start_states"].items())},
        "end_states": {start: number[state] for start, state in sorted(table["end_states"].items())},
    }


def _stored(value: Any) -> Any:
    """Return a value as JSON can hold it: keys that are numbers become pairs, endless widths large numbers."""
    if isinstance(value, dict):
        if value and all(isinstance(key, int) for key in value):
            return {"#": [[key, _stored(item)] for key, item in value.items()]}
        return {key: _stored(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_stored(item) for item in value]
    # How wide an endless pattern is depends on the version of Python.
    return min(value, _MOST_WIDTH) if isinstance(value, int) and not isinstance(value, bool) else value


def _restored(value: dict[str, Any]) -> dict[Any, Any]:
    return dict(value["#"]) if "#" in value else value
