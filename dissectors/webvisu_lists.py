"""Lists of variables as WebVisu pages load them: how one tells them by their begin, or by what their files are called.

Source: ``webvisu.md`` section 4, and the files of a controller.
"""

from __future__ import annotations

import re

from dissectors.webvisu import Likeness

LIST_BEGIN_BYTES = 256
"""So many bytes of a file tell what it is."""

_ROOTS = (b"visualisation", b"visu-ini-file", b"variablelist", b"SymbolVarList")
_FILES = ("plc_visu.xml", "visu_ini.xml")
_SYMBOLS = ".sym_xml"
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_COMMENT = re.compile(rb"<!--.*?(?:-->|\Z)", re.DOTALL)
_TAG = re.compile(rb"<([A-Za-z_][^\s/>]*)[\s/>]")


def is_list(target: str) -> bool:
    """Tell whether a URL is one of a file that may list variables."""
    return _path(target).endswith((".xml", _SYMBOLS))


def list_likeness(begin: bytes, target: str) -> Likeness:
    """Tell whether a file lists variables of whose content ``begin`` is there; by its name where that does not tell."""
    path = _path(target)
    if path.endswith(_SYMBOLS):
        return Likeness.YES
    text = begin[:LIST_BEGIN_BYTES].removeprefix(_BYTE_ORDER_MARK).lstrip()
    root = _TAG.search(_COMMENT.sub(b"", text)) if text.startswith(b"<") else None
    if root is not None:
        return Likeness.YES if root[1] in _ROOTS else Likeness.NO
    return Likeness.YES if path.rpartition("/")[2] in _FILES else Likeness.PERHAPS


def _path(target: str) -> str:
    return target.partition("?")[0].lower()
