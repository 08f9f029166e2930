"""Files that people take for definitions: what they are, and how the right one is made."""

from __future__ import annotations

import re

from msgspec import Struct

HEAD_BYTES = 512
"""So many bytes tell what a file is."""

_EXPORTS = (
    "In CODESYS V3, write a .gvl by 'Link to file' with 'Export before compile' in the list's properties, or take "
    "Project > Export PLCopenXML; in V2.3, take Project > Export (.exp)."
)
_KNOWN = "Definitions are .gvl, .exp, .TcGVL, .TcDUT, PLCopen XML, or text with TYPE or VAR_GLOBAL."
_PROLOG = rb"(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*"
_BINARY = re.compile(rb"[\x00-\x08]|PK\x03\x04")


class ForeignFile(Struct, frozen=True):
    """A kind of file that holds no definitions: ``begin`` matches its first bytes, behind a byte order mark and blanks.

    Where the first bytes are not public it is known by its ``suffixes``, if it is no text.
    """

    what: str
    next_step: str
    begin: bytes = b""
    suffixes: tuple[str, ...] = ()

    def is_kind_of(self, head: bytes, path: str) -> bool:
        """Return whether a file with these first bytes is of the kind."""
        if self.suffixes:
            return path.lower().endswith(self.suffixes) and _BINARY.search(head) is not None
        return re.match(rb"(?:\xef\xbb\xbf)?\s*(?:" + self.begin + rb")", head, re.IGNORECASE | re.DOTALL) is not None


FOREIGN_FILES = (
    ForeignFile("a Git LFS pointer, not the file itself", "Fetch the file: git lfs pull.", rb"version https://git-lfs"),
    ForeignFile(
        "an export of CODESYS objects (.export), which only CODESYS reads", _EXPORTS, _PROLOG + rb"<ExportFile\b"
    ),
    ForeignFile(
        "a project of TwinCAT or Visual Studio, which names files and does not hold them",
        "Name the directory of its .TcGVL and .TcDUT files.",
        _PROLOG + rb"<(?:Project\b[^>]*microsoft\.com|TcSmProject\b|TcSmItem\b)|Microsoft Visual Studio Solution",
    ),
    ForeignFile(
        "an HTML page, no definition file",
        "Download the file itself; GitHub and GitLab have the button Raw for it.",
        _PROLOG + rb"<(?:!doctype\s+html|html)\b",
    ),
    ForeignFile("a PDF, no definition file", _EXPORTS, rb"%PDF-"),
    ForeignFile("JSON, no definition file", _KNOWN, rb"\{\s*[\"}]|\[\s*[\[{\"\d\]]"),
    # In both byte orders with its version, and pcapng: a text may begin with their first four bytes. The rooms of
    # captures and of definitions do not know each other.
    ForeignFile(
        "a capture, no definition file",
        f"Name captures without an option. {_KNOWN}",
        rb"(?:\xa1\xb2\xc3\xd4|\xa1\xb2\x3c\x4d)\x00\x02|(?:\xd4\xc3\xb2\xa1|\x4d\x3c\xb2\xa1)\x02\x00"
        rb"|\r\r\n.{4}(?:\x1a\x2b\x3c\x4d|\x4d\x3c\x2b\x1a)",
    ),
    ForeignFile(
        "a project of CODESYS, which only CODESYS reads", _EXPORTS,
        suffixes=(".project", ".projectarchive", ".library", ".compiled-library", ".pro", ".lib"),
    ),
    ForeignFile("a packed archive", "Unpack it, and name the directory.", rb"PK\x03\x04|7z\xbc\xaf|\x1f\x8b\x08"),
)  # fmt: skip
"""The kinds; the first that fits is meant."""


def foreign_file(data: bytes, path: str) -> ForeignFile | None:
    """Return what the first bytes of a file say that it is, None where it may be a definition."""
    head = data[:HEAD_BYTES]
    return next((kind for kind in FOREIGN_FILES if kind.is_kind_of(head, path)), None)
