"""The option by which verbs are told what should be on the wire."""

from __future__ import annotations

from typing import Annotated

import typer

GvlOption = Annotated[
    list[str] | None,
    typer.Option(
        "--gvl",
        metavar="FILE",
        help="Definition file: .gvl, .exp, PLCopen XML, .TcGVL, .TcDUT or ST text with types. Give all that belong "
        "together.",
        show_default=False,
    ),
]
