"""The frame of a V3 ``.gvl`` file, around declarations and settings.

As "Link to file" of CODESYS V3 writes it: no prolog, no namespace, the declarations in one CDATA section, and behind
them an element for each setting (``ListIdentifier``, ``Pack``, ``Interval`` …). No document describes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence


def gvl_file(
    protocol: str, declarations: Sequence[str], settings: Mapping[str, object], more: Sequence[str] = ()
) -> str:
    """Return the text of a file with lines of declarations and the settings by name; ``more`` are lines behind these.

    Nothing is escaped.
    """
    return "\n".join(
        [
            "<GVL>",
            "  <Declarations><![CDATA[{}]]></Declarations>".format("\n".join(declarations)),
            f'  <NetvarSettings Protocol="{protocol}">',
            *(f"    <{name}>{value}</{name}>" for name, value in settings.items()),
            *(f"    {line}" for line in more),
            "  </NetvarSettings>",
            "</GVL>",
            "",
        ]
    )
