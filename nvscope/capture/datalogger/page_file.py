"""The pages of an SQLite database, read from its file; nothing is written, locked or mapped.

A file that shrinks while it is mapped ends the program that looks at it. Source:
https://www.sqlite.org/fileformat2.html, section 1.3.
"""

from __future__ import annotations

import os
import struct
from typing import Self

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool

MAGIC = b"SQLite format 3\0"
HEADER_BYTES = 100
MARGIN_BYTES = 4096

_ENCODINGS = {1: "utf-8", 2: "utf-16-le", 3: "utf-16-be"}
_LEAST_PAGE_BYTES, _MOST_PAGE_BYTES = 512, 1 << 16
_LEAST_USABLE_BYTES = 480
_NEWEST_VERSION, _NEWEST_SCHEMA = 2, 4
_FRACTIONS = bytes((64, 32, 32))


class NotADatabase(Exception):
    """A file that does not begin as SQLite databases do; says why, and whether it is something else."""

    def __init__(self, what: str, *, is_other: bool = False) -> None:
        super().__init__(what)
        self.is_other = is_other


class NoByte(NotADatabase):
    """A file without a byte: what SQLite makes before it writes to it."""


class Header(Struct, frozen=True):
    """What a database says of itself; ``pages`` is None where whoever wrote it last did not count them.

    ``flaw`` is why SQLite does not open it though its pages can be found, '' where it does.
    """

    page_bytes: int
    reserved_bytes: int
    encoding: str
    pages: int | None
    wal: bool
    flaw: str = ""

    @property
    def usable_bytes(self) -> int:
        """Bytes of a page that hold content."""
        return self.page_bytes - self.reserved_bytes

    @classmethod
    def of(cls, head: bytes) -> Self:
        """Return what the first bytes of a database say; NotADatabase where they are of none."""
        if len(head) < HEADER_BYTES or not head.startswith(MAGIC):
            raise NotADatabase("not an SQLite database", is_other=True) if head else NoByte("empty")
        (page_bytes,) = struct.unpack_from(">H", head, 16)
        page_bytes = _MOST_PAGE_BYTES if page_bytes == 1 else page_bytes
        reserved_bytes = head[20]
        if not _LEAST_PAGE_BYTES <= page_bytes <= _MOST_PAGE_BYTES or page_bytes & (page_bytes - 1):
            raise NotADatabase(f"damaged: its header says that pages have {page_bytes} bytes")
        if page_bytes - reserved_bytes < _LEAST_USABLE_BYTES:
            raise NotADatabase(f"damaged: its header leaves {page_bytes - reserved_bytes} bytes of a page to content")
        changes, pages = struct.unpack_from(">2L", head, 24)
        (encoding,) = struct.unpack_from(">L", head, 56)
        (counted_at,) = struct.unpack_from(">L", head, 92)
        known = pages if pages and changes == counted_at else None
        return cls(page_bytes, reserved_bytes, _ENCODINGS.get(encoding & 3, "utf-8"), known, head[18] == 2, _flaw(head))


def _flaw(head: bytes) -> str:
    """Return what of a header SQLite refuses, '' where it is one that a version of it can read."""
    if head[19] > _NEWEST_VERSION:
        return f"its header wants version {head[19]} of the format, and {_NEWEST_VERSION} is the newest one"
    if head[21:24] != _FRACTIONS:
        return f"its header has {head[21:24].hex(' ')} at offset 21, where each database has {_FRACTIONS.hex(' ')}"
    if head[47] > _NEWEST_SCHEMA:  # SQLite looks at the last of the four bytes alone
        return f"its header wants schema format {head[47]}, and {_NEWEST_SCHEMA} is the newest one"
    return ""


class PageFile:
    """An open database, as pages numbered from 1.

    Page 0 does not exist. ``pages`` are those that are whole in the file, ``pages_missing`` those that its header
    counts beyond them. OSError and ``NotADatabase`` where it cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._file = open(path, "rb", buffering=0)  # noqa: SIM115, closed with the object
        try:
            self.header = Header.of(self._file.read(HEADER_BYTES))
            size = os.fstat(self._file.fileno()).st_size
        except BaseException:
            self._file.close()
            raise
        self.page_bytes = self.header.page_bytes
        whole, counted = size // self.page_bytes, self.header.pages
        self.pages = whole if counted is None else min(whole, counted)
        self.pages_missing = max(0, counted - whole) if counted is not None else 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(self, pages: I64) -> tuple[U8, Bool]:
        """Return the bytes of pages one behind the other, and which of them were there; of others they are zeros.

        Numbers are those of pages that the file has, or had when it was opened. Behind the last page there are
        ``MARGIN_BYTES`` of zeros.
        """
        data = np.empty(len(pages) * self.page_bytes + MARGIN_BYTES, np.uint8)
        data[-MARGIN_BYTES:] = 0
        found = np.ones(len(pages), np.bool_)
        # What lies together is read at once.
        begins = np.flatnonzero(np.diff(pages, prepend=-1) != 1).tolist()
        view = data.data
        for first, behind in zip(begins, [*begins[1:], len(pages)], strict=True):
            part = view[first * self.page_bytes : behind * self.page_bytes]
            had = self._read_into(part, (int(pages[first]) - 1) * self.page_bytes)
            if had < len(part):
                whole = first + had // self.page_bytes
                found[whole:behind] = False
                data[whole * self.page_bytes : behind * self.page_bytes] = 0
        return data, found

    def page(self, number: int) -> bytes | None:
        """Return the bytes of a page, None where it is not there."""
        if not 0 < number <= self.pages:
            return None
        page = bytearray(self.page_bytes)
        had = self._read_into(memoryview(page), (number - 1) * self.page_bytes)
        return bytes(page) if had == self.page_bytes else None

    def kind(self, number: int) -> int | None:
        """Return the first byte of a page other than the first, None where it is not there."""
        if not 1 < number <= self.pages:
            return None
        first = bytearray(1)
        return first[0] if self._read_into(memoryview(first), (number - 1) * self.page_bytes) else None

    def _read_into(self, part: memoryview, at: int) -> int:
        done = 0
        while done < len(part):
            try:
                self._file.seek(at + done)
                count = self._file.readinto(part[done:])
            except OSError:
                break
            if not count:
                break
            done += count
        return done
