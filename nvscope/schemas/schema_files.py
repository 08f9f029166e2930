"""The JSON Schemas that come with the program: of which documents there are some, and what they say."""

from __future__ import annotations

import json
from pathlib import Path

from nvscope.errors import UsageError

_FOLDER = Path(__file__).parent
_SUFFIX = ".json"
_MOST_NEAR, _NEAR_ENOUGH = 3, 0.5
_MOST_COMPARED = 80


def schema_names() -> list[str]:
    """Return the names of all documents, such as ``report``."""
    return sorted(path.stem for path in _FOLDER.glob(f"*{_SUFFIX}"))


def schema_text(name: str) -> str:
    """Return the schema of a document as JSON, ending with a line break.

    The name may be the one that documents have themselves: ``nvscope.report/2``. UsageError, with names that come near,
    where there is none.
    """
    return _path_of(name).read_text(encoding="utf-8")


def schema_subject(name: str) -> str:
    """Return in a line which command writes a document, and what it tells."""
    return str(json.loads(schema_text(name))["description"])


def _path_of(name: str) -> Path:
    known = {path.stem: path for path in _FOLDER.glob(f"*{_SUFFIX}")}
    wanted = name.strip().lower()
    path = known.get(wanted.removeprefix("nvscope.").partition("/")[0])
    if path is None or wanted not in (path.stem, json.loads(path.read_text(encoding="utf-8"))["title"]):
        raise UsageError(f"no document is called '{name[:80]}'", next_step=_near(wanted))
    return path


def _near(wanted: str) -> str:
    from difflib import get_close_matches  # noqa: PLC0415  # only where something is wrong

    names = schema_names()
    plain = wanted[:_MOST_COMPARED].removeprefix("nvscope.").partition("/")[0]
    near = get_close_matches(plain, names, _MOST_NEAR, _NEAR_ENOUGH)
    return f"perhaps {', '.join(near)}" if near else f"there are: {', '.join(names)}"
