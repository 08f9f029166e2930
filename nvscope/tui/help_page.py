"""All keys on one page, as they are on this screen."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.tui.actions import ACTIONS, Group, Keymap
from nvscope.view.lines.table import Cell, Line, Tone, wrap

_KEYS_WIDTH, _NAME_WIDTH = 14, 22


def key_lines(keymap: Keymap, width: int) -> Iterator[Line]:
    """Yield the actions by group: keys, name, and what each does."""
    for number, group in enumerate(Group):
        if number:
            yield []
        yield [Cell(group.value, Tone.STRONG)]
        for action in ACTIONS:
            if action.group is not group:
                continue
            keys = " ".join(keymap.keys_of(action.name)) or "-"
            name = f"{action.name} {action.takes}".strip()
            head = [Cell(f"  {keys:<{_KEYS_WIDTH}}", Tone.STRONG), Cell(f"{name:<{_NAME_WIDTH}}  ", Tone.FAINT)]
            indent = 2 + _KEYS_WIDTH + _NAME_WIDTH + 2
            if width < 2 * indent:
                yield from wrap([head[0], Cell(action.help)], width, hanging=2 + _KEYS_WIDTH)
            else:
                body = wrap([Cell(action.help)], width - indent)
                yield [*head, *body[0]]
                for line in body[1:]:
                    yield [Cell(" " * indent), *line]
