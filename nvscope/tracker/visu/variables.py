"""The variables of controllers that WebVisu pages read and write: one for each place of each controller.

A variable is what lies at one place of one controller, whoever asks for it. It is called as it was called when it was
asked for last; before a list says a name, by its place.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.webvisu import Place, Request
from nvscope.definition.variables import Elementary, String, type_text
from nvscope.definition.visu_encoding import Encoding
from nvscope.definition.visu_values import type_at
from nvscope.tracker.readings.readings import LEFT_OUT, in_order
from nvscope.tracker.visu.controllers import Controller
from nvscope.tracker.visu.names import Naming, is_secret, name_of
from nvscope.tracker.visu.number_texts import Kinds, form_of

Where = Place | str

_MOST_REMEMBERED = 1 << 12


class PageVariable(Struct):
    """A variable; ``is_secret``: it is a password, or may be one. ``kind`` is None where only texts are known.

    ``encoding`` is that of its page, None where nobody says it.
    """

    controller: Controller
    where: Where
    kind: Elementary | None
    name: str
    is_secret: bool
    encoding: Encoding | None = None

    @property
    def list(self) -> str:
        """What stands in the place of the key of a list: ``visu/10.0.0.5``."""
        return self.controller.list

    @property
    def lasts(self) -> bool:
        """Nobody knows what it was between two replies."""
        return False

    @property
    def identity(self) -> Hashable:
        """What tells it from all others: its place, whatever it is called."""
        return self.controller, self.where

    @property
    def sender(self) -> str:
        """The address of the controller."""
        return self.controller.address

    @property
    def place(self) -> str:
        """Where it lies, as text."""
        return self.where.text if isinstance(self.where, Place) else self.where

    @property
    def type(self) -> str:
        """What its type is called: as the request calls it, of a STRING with its length; '' where it says nothing."""
        own = self.where.type_name if isinstance(self.where, Place) else ""
        return type_text(self.kind) if isinstance(self.kind, String) else own

    @property
    def is_text(self) -> bool:
        """Whether it is asked for as STRING, whose texts have the encoding of the page."""
        return isinstance(self.kind, String)

    @property
    def order(self) -> tuple[Any, ...]:
        """What variables are sorted by: controller, those with a name first, its numbers as numbers, and place."""
        return self.controller.order, self.name == self.place, in_order(self.name), self.place

    @property
    def usual_form(self) -> int:
        """The form of its values: as its type has them."""
        return form_of(self.kind)

    def kind_of(self, form: int, bits: int) -> Elementary | None:
        """Return its type, which all values have that are more than a text."""
        return self.kind

    def as_shown(self, text: str) -> str:
        """Return a text, whose characters are bytes, in the encoding of the page."""
        return text if self.encoding is None else self.encoding.decoded(text)


class PageVariables:
    """The variables seen so far, by number; ``kinds`` are their types. ``left_out``: there was no room for some."""

    def __init__(self) -> None:
        self.known: list[PageVariable] = []
        self.kinds = Kinds()
        self.left_out = False
        self._numbers: dict[tuple[Controller, Where], int] = {}
        self._of_requests: dict[tuple[Controller, Request, int], I64] = {}

    def __len__(self) -> int:
        return len(self.known)

    def of(
        self, controller: Controller, request: Request, naming: int, names: Naming, most: int
    ) -> I64:  # fmt: skip
        """Return the numbers of the entries of a request, ``LEFT_OUT`` of those beyond ``most`` variables.

        ``naming`` is the number of ``names``, by which they are called from now on.
        """
        key = controller, request, naming
        found = self._of_requests.get(key)
        if found is not None:
            return found
        numbers = []
        for entry in request.entries:
            number = self._numbers.get((controller, entry.place))
            if number is None:
                if len(self.known) >= most:
                    self.left_out = True
                    numbers.append(LEFT_OUT)
                    continue
                number = self._numbers[controller, entry.place] = len(self.known)
                kind = type_at(entry.place)
                self.known.append(PageVariable(controller, entry.place, kind, "", False))
                self.kinds.add(kind)
            known = self.known[number]
            known.name, known.is_secret, known.encoding = name_of(entry, names), is_secret(entry, names), names.encoding
            numbers.append(number)
        found = np.array(numbers, np.int64)
        if not request.writes:
            if len(self._of_requests) >= _MOST_REMEMBERED:
                self._of_requests.clear()
            self._of_requests[key] = found
        return found
