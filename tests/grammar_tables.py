"""``python -m tests.grammar_tables``: write the tables beside each grammar anew, after a change of it or of lark."""

from __future__ import annotations

from nvscope.definition import declarations
from nvscope.expression import syntax
from nvscope.grammar import Grammar


def grammars() -> list[Grammar]:
    """Return all grammars of the program."""
    return [declarations.grammar(), syntax.grammar()]


if __name__ == "__main__":
    for grammar in grammars():
        grammar.tables_path.write_text(grammar.tables(), encoding="utf-8")
        print(f"{grammar.tables_path.name}: {grammar.tables_path.stat().st_size} bytes")
