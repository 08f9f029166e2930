"""How the texts of WebVisu pages are encoded: by the name of a charset, as Java writes it.

Source: ``webvisu.md`` section 1: a STRING is ISO-8859-1 unless the page's ENCODINGSTRING says otherwise. No document
says where that stands. Pages are an applet with parameters, so that it is taken to be one of them.
"""

from __future__ import annotations

import codecs
import re
from typing import NamedTuple

USUAL = "iso8859-1"
"""What Python calls the encoding of pages that say nothing."""

MOST_SHOWN = 40
"""So many characters of a name are told."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._:+-]{0,39}", re.ASCII)
_OF_JAVA = {
    "ms874": "cp874", "x_windows_874": "cp874", "x_windows_949": "cp949", "x_windows_950": "cp950", "ms950": "cp950",
    "ms936": "gbk", "x_mswin_936": "gbk", "x_sjis": "shift_jis", "x_euc_jp": "euc_jp", "cp943": "cp932",
    "cp943c": "cp932", "x_ibm943": "cp932", "x_ibm943c": "cp932", "x_johab": "johab", "x_ibm874": "cp874",
    "x_macroman": "mac_roman", "windows_31j": "cp932",
}  # fmt: skip
"""What Java calls charsets that Python does not know by that name."""

_ASCII = bytes(range(0x80))
_SHIFTS = b"\x1b$B0l\x1b(B\x0e0l\x0f+AGEAYg-~{VPND~}\\u0041\\x41.xn--nxasmq6b."
"""What means something else in encodings that shift, or have escapes."""


class Encoding(NamedTuple):
    """An encoding that has ASCII as it is, one byte a character: ``name`` is what Python calls it."""

    name: str

    def decoded(self, text: str) -> str:
        """Return a text whose characters are bytes; those that are none of the encoding are escapes: ``\\xe4``."""
        if text.isascii():
            return text
        return text.encode("latin-1", "replace").decode(self.name, "backslashreplace")

    def encoded(self, text: str) -> bytes:
        """Return the bytes of a text; ValueError where the encoding lacks a character."""
        try:
            return text.encode(self.name)
        except UnicodeEncodeError as error:
            called = "ISO-8859-1 (Western Europe)" if self.name == USUAL else self.name
            raise ValueError(f"'{text[error.start]}' is no character of {called}") from None


LATIN = Encoding(USUAL)


def encoding_of(name: str) -> Encoding:
    """Return the encoding that a name means; ValueError, with why, where none of that name can be used."""
    name = name.strip()
    shown = name[:MOST_SHOWN]
    found = None
    if _NAME.fullmatch(name):
        plain = re.sub(r"[^a-z0-9]", "_", name.lower())
        try:
            found = codecs.lookup(_OF_JAVA.get(plain, plain if plain in _OF_JAVA.values() else name))
        except (LookupError, ValueError):
            found = None
    if found is None or not _is_of_text(found):
        raise ValueError(f"no encoding is known that is called '{shown}'")
    if not _has_ascii(found.name):
        raise ValueError(f"in {shown}, ASCII is not one byte a character: '|' would part no values")
    return Encoding(found.name)


def _is_of_text(found: codecs.CodecInfo) -> bool:
    return bool(getattr(found, "_is_text_encoding", True))


def _has_ascii(name: str) -> bool:
    probe = _ASCII + _SHIFTS
    try:
        return probe.decode(name) == probe.decode("ascii") and "|0".encode(name) == b"|0"
    except (UnicodeError, LookupError):
        return False
