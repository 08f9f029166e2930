"""The sentences about definition files: what was left out of them, and what lists need that no file declares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope.definition.model import AssumedBase, Definition, ListDefinition, Problem, UnknownName
from nvscope.enumeration import first_few
from nvscope.units import count
from nvscope.view.escape import visible

_MOST_TOLD = 10
_MOST_CHARACTERS = 60


def definition_flaws(definition: Definition, lists: Sequence[ListDefinition] | None = None) -> Iterator[str]:
    """Yield a sentence for each thing that is wrong with the files, or that ``lists`` (None: all) need and have not.

    Of many of a kind the first are told, and how many there are. The sentences are safe to print.
    """
    flaws = definition.flaws_of(definition.lists if lists is None else lists)
    yield from _problems("left out", definition.left_out)
    yield from _problems("of unknown size or values", [flaw for flaw in flaws if isinstance(flaw, Problem)])
    if names := [flaw for flaw in flaws if isinstance(flaw, UnknownName)]:
        yield _unknown_names(names)
    if bases := [flaw for flaw in flaws if isinstance(flaw, AssumedBase)]:
        told = first_few([visible(base.name[:_MOST_CHARACTERS]) for base in bases], _MOST_TOLD)
        yield f"base type not in this export, INT assumed: {told}."


def _problems(what: str, problems: Sequence[Problem]) -> Iterator[str]:
    for problem in problems[:_MOST_TOLD]:
        yield visible(f"{what}: {problem.position}: {problem.what}. {problem.next_step}".rstrip())
    if len(problems) > _MOST_TOLD:
        yield f"{what}: {count(len(problems) - _MOST_TOLD)} more"


def _unknown_names(names: Sequence[UnknownName]) -> str:
    told = [_one(name) for name in names[:_MOST_TOLD]]
    if len(names) > _MOST_TOLD:
        told.append(f"{count(len(names) - _MOST_TOLD)} more")
    kinds = {name.constant: "constants" if name.constant else "types" for name in names}
    what = " and ".join(kinds[constant] for constant in sorted(kinds))
    files = "a .TcDUT, a PLCopen XML export, ST text, or a list of constants"
    return f"{what} that no file declares: {', '.join(told)}. Name the files that do, too: {files}."


def _one(name: UnknownName) -> str:
    near = f"; perhaps {visible(name.nearest[:_MOST_CHARACTERS])}?" if name.nearest else ""
    return f"{visible(name.name[:_MOST_CHARACTERS])} ({visible(str(name.position))}{near})"
