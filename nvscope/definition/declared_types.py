"""Declarations of types by name, across all files."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator, Sequence

from nvscope.definition.named_constants import MOST_COMPARED
from nvscope.definition.nearest_files import nearest
from nvscope.definition.scalars import find_scalar
from nvscope.definition.syntax import TypeDeclaration


class DeclaredTypes:
    """The declarations of all files, in their order."""

    def __init__(self) -> None:
        self._named: dict[str, list[TypeDeclaration]] = {}
        self._meant: dict[tuple[str, str], Sequence[TypeDeclaration]] = {}

    def __iter__(self) -> Iterator[TypeDeclaration]:
        return (declaration for several in self._named.values() for declaration in several)

    def add(self, declaration: TypeDeclaration) -> None:
        """Add a declaration; DefinitionError where its name cannot be declared."""
        key = declaration.name.text.upper()
        if find_scalar(key) is not None or key in {"STRING", "WSTRING"}:
            what = f"{declaration.name.text} is an elementary type and cannot be declared"
            raise declaration.source.error(what, declaration.name.offset, "Give the type another name.")
        self._named.setdefault(key, []).append(declaration)

    def named(self, text: str, file: str) -> Sequence[TypeDeclaration]:
        """Return the declarations that a name in a file may stand for, none where no file declares it.

        A namespace before it does not matter. Of several files they are those of the nearest.
        """
        upper = text.upper()
        key = upper if upper in self._named else upper.rpartition(".")[2]
        found = self._named.get(key, ())
        if len(found) < 2:
            return found
        meant = self._meant.get((key, file))
        if meant is None:
            meant = self._meant[key, file] = nearest(found, file, lambda declaration: declaration.source.file)
        return meant

    def nearest_name(self, text: str, without: Collection[str]) -> str:
        """Return the name that was perhaps meant, or ""; ``without`` are names in capitals that it cannot be."""
        known = [key for key in self._named if key not in without][:MOST_COMPARED]
        near = difflib.get_close_matches(text.upper()[:60], known, n=1, cutoff=0.7)
        return self._named[near[0]][0].name.text if near else ""
