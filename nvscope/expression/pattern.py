"""Regular expressions whose time grows with the text times the pattern, whatever both are.

``re`` tries alternatives one after the other, and a pattern such as ``(a+)+b`` makes it try longer than anybody waits.
Here all alternatives are followed at once (Thompson 1968), so a filter from a file can be run. The price is a subset:
no back references, no looking around, no ``\\b``. Letters match in either case and a dot matches line breaks too. A
pattern has at most 500 characters and, its repeats written out, 1 000 states; 4 096 characters of a text are looked at.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from msgspec import Struct, field

MAX_PATTERN_CHARACTERS = 500
_ANY_CASE = "(?i)"
MAX_STATES = 1_000
MAX_TEXT_CHARACTERS = 4_096
_MAX_NESTING = 40
_MAX_CACHED_STATES = 500_000

_BEGIN, _END, _SPLIT = "begin", "end", "split"
Atom = Callable[[str], bool]


class PatternError(ValueError):
    """A pattern that is none; ``position`` counts its characters from 0."""

    def __init__(self, what: str, position: int) -> None:
        super().__init__(what)
        self.position = position


class _State(Struct):
    """A place in the pattern: what may be read here (an atom), or that nothing need be (an anchor or a split)."""

    atom: Atom | str
    following: list[int] = field(default_factory=list)


class Pattern:
    """A compiled pattern; PatternError where it is none, too long, or too large once its repeats are written out.

    With ``of_bytes``, the characters of pattern and texts stand for bytes: only ASCII letters match in either case.
    """

    def __init__(self, text: str, *, of_bytes: bool = False) -> None:
        if len(text) > MAX_PATTERN_CHARACTERS:
            raise PatternError(f"a pattern has at most {MAX_PATTERN_CHARACTERS} characters", MAX_PATTERN_CHARACTERS)
        self._states: list[_State] = []
        # What "(?i)" asks for is done anyway.
        begin = len(_ANY_CASE) if text.startswith(_ANY_CASE) else 0
        tree, stop = _Reader(text, re.ASCII if of_bytes else re.NOFLAG).alternatives(begin, 0)
        if stop < len(text):
            raise PatternError("a ) that closes nothing", stop)
        self._accept = self._add(_SPLIT)
        self._start = self._build(tree, self._accept)
        self._entry = self._closure({self._start})
        self._steps: dict[tuple[frozenset[int], str], frozenset[int]] = {}
        self._cached_states = 0
        self._singles: dict[tuple[int, str], frozenset[int]] = {}

    def search(self, text: str) -> bool:
        """Tell whether the pattern is found anywhere in the first 4 096 characters of a text."""
        text = text[:MAX_TEXT_CHARACTERS]
        active = self.begun()
        for character in text:
            if self.is_found(active):
                return True
            active = self.after(active, character)
        return self.is_found_at_end(active, at_begin=not text)

    def begun(self) -> frozenset[int]:
        """Return the states in front of a text."""
        return self._closure({self._start}, at_begin=True)

    def after(self, active: frozenset[int], character: str) -> frozenset[int]:
        """Return the states behind a character; none where nothing can be found any more."""
        return self._step(active, character) | self._entry

    def is_found(self, active: frozenset[int]) -> bool:
        """Tell whether the pattern is found, whatever follows."""
        return self._accept in active

    def is_found_at_end(self, active: frozenset[int], *, at_begin: bool = False) -> bool:
        """Tell whether it is found where the text ends; ``at_begin``: where it has no characters."""
        return self._accept in self._closure(active, at_begin=at_begin, at_end=True)

    def _step(self, active: frozenset[int], character: str) -> frozenset[int]:
        found = self._steps.get((active, character))
        if found is None:
            found = frozenset().union(*(self._from(number, character) for number in active))
            if self._cached_states < _MAX_CACHED_STATES:
                self._steps[active, character] = found
                self._cached_states += len(found) + 1
        return found

    def _from(self, number: int, character: str) -> frozenset[int]:
        """Return the states behind a character that is read in one state."""
        found = self._singles.get((number, character))
        if found is None:
            atom = self._states[number].atom
            fits = not isinstance(atom, str) and atom(character)
            found = self._closure(set(self._states[number].following)) if fits else frozenset()
            if len(self._singles) < _MAX_CACHED_STATES:
                self._singles[number, character] = found
        return found

    def _closure(
        self, numbers: set[int] | frozenset[int], *, at_begin: bool = False, at_end: bool = False
    ) -> frozenset[int]:
        """Return the states and all that can be reached from them without reading.

        The end, which may come later, stays; a beginning that is not here is none anywhere behind.
        """
        reached = set(numbers)
        waiting = list(numbers)
        while waiting:
            state = self._states[waiting.pop()]
            if state.atom == _SPLIT or (state.atom == _BEGIN and at_begin) or (state.atom == _END and at_end):
                new = set(state.following) - reached
                reached |= new
                waiting += new
        return frozenset(number for number in reached if self._states[number].atom not in (_BEGIN, _SPLIT)) | (
            reached & {self._accept}
        )

    def _add(self, atom: Atom | str, *following: int) -> int:
        if len(self._states) >= MAX_STATES:
            raise PatternError("the pattern is too large once its repeats are written out", 0)
        self._states.append(_State(atom, list(following)))
        return len(self._states) - 1

    def _build(self, tree: _Tree, following: int) -> int:
        """Add the states of a tree in front of a state, and return the first of them."""
        if tree.kind == "atom":
            return self._add(tree.atom, following)
        if tree.kind == "sequence":
            for child in reversed(tree.children):
                following = self._build(child, following)
            return following
        if tree.kind == "choice":
            return self._add(_SPLIT, *(self._build(child, following) for child in tree.children))
        (child,) = tree.children
        if tree.most is None:
            loop = self._add(_SPLIT, following)
            self._states[loop].following.append(self._build(child, loop))
            following = loop
        else:
            last = following
            for _ in range(tree.most - tree.least):
                following = self._add(_SPLIT, last, self._build(child, following))
        for _ in range(tree.least):
            following = self._build(child, following)
        return following


class _Tree(Struct):
    kind: str
    children: list[_Tree] = field(default_factory=list)
    atom: Atom | str = _SPLIT
    least: int = 0
    most: int | None = None


_ATOM = re.compile(r"\[\^?\]?(?:\\.|[^\]\\])*\]|\\(?:x[0-9a-fA-F]{2}|[dDwWsSnrtfv]|[^A-Za-z0-9])|[^\\\[]", re.DOTALL)
_SET_SIGNS = re.compile(r"\\.|[\[&~|]|(?<=-)-", re.DOTALL)
_REPEAT = re.compile(r"(?:[*+?]|\{([0-9]{1,4})(?:(,)([0-9]{1,4})?)?\})\??")
_FIXED = {"*": (0, None), "+": (1, None), "?": (0, 1)}


class _Reader:
    """Reads a pattern from left to right; the methods return what they read and where it ends."""

    def __init__(self, text: str, flags: re.RegexFlag) -> None:
        self._text = text
        self._flags = flags

    def alternatives(self, start: int, depth: int) -> tuple[_Tree, int]:
        if depth > _MAX_NESTING:
            raise PatternError(f"groups are nested more than {_MAX_NESTING} deep", start)
        branches = []
        branch, at = self._sequence(start, depth)
        branches.append(branch)
        while self._text[at : at + 1] == "|":
            branch, at = self._sequence(at + 1, depth)
            branches.append(branch)
        return (branches[0] if len(branches) == 1 else _Tree("choice", branches)), at

    def _sequence(self, at: int, depth: int) -> tuple[_Tree, int]:
        items: list[_Tree] = []
        while at < len(self._text) and self._text[at] not in "|)":
            item, at = self._item(at, depth)
            if repeat := _REPEAT.match(self._text, at):
                item = self._repeated(item, repeat)
                at = repeat.end()
                if _REPEAT.match(self._text, at):
                    raise PatternError("a repeat of a repeat", at)
            items.append(item)
        return _Tree("sequence", items), at

    def _item(self, at: int, depth: int) -> tuple[_Tree, int]:
        character = self._text[at]
        if character == "(":
            inside = at + 1
            if self._text[inside : inside + 1] == "?":
                if self._text[inside : inside + 2] != "?:":
                    raise PatternError("groups with (? other than (?: are not understood here", at)
                inside += 2
            tree, stop = self.alternatives(inside, depth + 1)
            if self._text[stop : stop + 1] != ")":
                raise PatternError("a ( that is not closed", at)
            return tree, stop + 1
        if character in "^$":
            return _Tree("atom", atom=_BEGIN if character == "^" else _END), at + 1
        if _REPEAT.match(self._text, at):
            raise PatternError("nothing is in front of the repeat", at)
        match = _ATOM.match(self._text, at)
        if match is None:
            what = "a [ that is not closed" if character == "[" else "this escape is not understood here"
            raise PatternError(what, at)
        return _Tree("atom", atom=_atom(match[0], at, self._flags)), match.end()

    @staticmethod
    def _repeated(item: _Tree, repeat: re.Match[str]) -> _Tree:
        if repeat[0][0] in _FIXED:
            least, most = _FIXED[repeat[0][0]]
        else:
            least = int(repeat[1])
            most = (int(repeat[3]) if repeat[3] else None) if repeat[2] else least
        if most is not None and most < least:
            raise PatternError("the repeat ends below where it begins", repeat.start())
        if max(least, most or 0) > MAX_STATES:
            raise PatternError(f"a repeat is at most {MAX_STATES}", repeat.start())
        return _Tree("repeat", [item], least=least, most=most)


def _atom(text: str, at: int, flags: re.RegexFlag) -> Atom:
    if text[0] == "[":
        # What re may one day read as operations between sets stands for itself.
        text = "[" + _SET_SIGNS.sub(lambda match: match[0] if match[0][0] == "\\" else f"\\{match[0]}", text[1:])
    try:
        one = re.compile(text, re.IGNORECASE | re.DOTALL | flags)
    except (re.error, OverflowError):
        raise PatternError("this set of characters is not understood", at) from None
    return lambda character: one.fullmatch(character) is not None
