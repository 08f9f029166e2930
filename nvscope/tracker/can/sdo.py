"""SDOs that are answered: which answers fit the requests before them (CiA 301, version 4.2, section 7.2.4.3).

A request begins a transfer of an object, which its answer names again, or goes on with one: then both have the same
toggle bit. An abort may answer both. Frames between a block transfer's beginning and the next transfer's are its
segments, which nobody answers one by one.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of

_LONGEST_WAIT_NS = 2_000_000_000
"""A client gives up earlier: libraries wait for 0.3 to 1 s by default."""

_COMMAND = 0xFF
_OBJECT = 0xFFFF_FF00
"""The bytes of Index and sub-index in the first four, the first byte lowest."""

_TOGGLE = 0x10
_WRITE, _WRITTEN = 0x20, 0x60
_READ = 0x40
_WRITE_SEGMENT, _SEGMENT_WRITTEN = 0x00, 0x20
_READ_SEGMENT, _SEGMENT_READ = 0x60, 0x00
_ABORT = 0x80
_BLOCK_WRITE, _BLOCK_WRITE_ANSWER = 0xC0, 0xA0
_BLOCK_READ, _BLOCK_READ_ANSWER = 0xA0, 0xC0
_NO_SIZE_OR_CRC, _NO_CRC = 0xF9, 0xFB
"""All bits of a command but those that say whether there is a size and a CRC, or a CRC."""


class LastSdo(KeyedColumns):
    """One row a node: its SDO frame before, and whether a block transfer has begun.

    ``word`` are the first four bytes of a request, the first one lowest; -1 where there was none, and of an answer.
    """

    word: I64
    time_ns: I64
    is_stray: Bool
    in_block: Bool
    COLUMNS: ClassVar = {
        "word": (np.int64(-1), 1),
        "time_ns": (np.int64(0), 1),
        "is_stray": (np.False_, 1),
        "in_block": (np.False_, 1),
    }

    def forget(self, row: I64) -> None:
        """Let what comes next of some nodes follow nothing."""
        for name, (initial, _) in self.COLUMNS.items():
            getattr(self, name)[row] = initial


class Weights(NamedTuple):
    """What each SDO frame says: how many frames are known with it to be SDOs and not to be; ``shows`` evidence."""

    own: I64
    strays: I64
    shows: Bool


def weighed(last: LastSdo, number: I64, time_ns: I64, word: I64, asks: Bool, fits: Bool) -> Weights:
    """Look at SDO frames, those of each node together and as they came, and keep the last ones.

    ``word`` are their first four bytes, ``asks`` tells requests from answers, ``fits`` is not set where a frame has not
    eight bytes. A request is judged with the frame behind it; one that begins a transfer says nothing without answer.
    """
    start, stop = runs_of(number)
    run, length = number[start], stop - start
    word = np.where(asks & fits, word, np.where(asks, -2, word))
    before, before_ns = np.empty_like(word), np.empty_like(time_ns)
    before[1:], before_ns[1:] = np.where(asks, word, -1)[:-1], time_ns[:-1]
    before[start], before_ns[start] = last.word[run], last.time_ns[run]

    waited_ns = time_ns - before_ns
    in_time = (waited_ns >= 0) & (waited_ns <= _LONGEST_WAIT_NS)
    is_pair = ~asks & fits & (before >= 0) & in_time
    asked, answered = before & _COMMAND, word & _COMMAND
    same_object = (before & _OBJECT) == (word & _OBJECT)
    begins_block = ((asked & _NO_SIZE_OR_CRC) == _BLOCK_WRITE) & ((answered & _NO_CRC) == _BLOCK_WRITE_ANSWER)
    begins_block |= ((asked & _NO_CRC) == _BLOCK_READ) & ((answered & _NO_SIZE_OR_CRC) == _BLOCK_READ_ANSWER)
    begins = ((asked & ~0x0F) == _WRITE) & (answered == _WRITTEN)
    begins |= (asked == _READ) & ((answered & ~0x0F) == _READ)
    begins |= _is_beginning(asked) & (answered == _ABORT)
    toggle = asked & _TOGGLE
    goes_on = ((asked & ~0x1F) == _WRITE_SEGMENT) & (answered == (_SEGMENT_WRITTEN | toggle))
    goes_on |= ((asked & ~_TOGGLE) == _READ_SEGMENT) & ((answered & ~0x0F) == (_SEGMENT_READ | toggle))
    goes_on |= _is_segment(asked) & (answered == _ABORT)
    shows = is_pair & same_object & (begins | begins_block)
    matches = shows | (is_pair & goes_on)

    block = _filled(np.where(shows, begins_block, -1), last.in_block[run], start, length)
    lone = asks & ~fits | asks & ~_is_beginning(word & _COMMAND) & (word & _COMMAND != _ABORT)
    was_stray = np.empty_like(asks)
    was_stray[1:] = (lone & ~block)[:-1]
    was_stray[start] = last.is_stray[run]
    strays = (was_stray & ~matches).astype(np.int64)
    strays += ~asks & ~matches & ~block
    end = stop - 1
    last.word[run], last.time_ns[run] = np.where(asks, word, -1)[end], time_ns[end]
    last.is_stray[run], last.in_block[run] = (lone & ~block)[end], block[end]
    return Weights(2 * matches.astype(np.int64), strays, shows)


def _is_beginning(command: I64) -> Bool:
    """Tell which requests begin a transfer: then they name the object."""
    begins: Bool = ((command & ~0x0F) == _WRITE) | (command == _READ)
    begins |= ((command & _NO_SIZE_OR_CRC) == _BLOCK_WRITE) | ((command & _NO_CRC) == _BLOCK_READ)
    return begins


def _is_segment(command: I64) -> Bool:
    """Tell which requests go on with a transfer."""
    goes_on: Bool = ((command & ~0x1F) == _WRITE_SEGMENT) | ((command & ~_TOGGLE) == _READ_SEGMENT)
    return goes_on


def _filled(told: I64, before: Bool, start: I64, length: I64) -> Bool:
    """Return what was told last up to each place, in runs; -1 tells nothing, and ``before`` is told before them."""
    known = np.where(told >= 0, np.arange(len(told)), -1)
    first = np.repeat(start, length)
    place = np.maximum.accumulate(known)
    filled: Bool = np.where(place >= first, told[place] == 1, np.repeat(before, length))
    return filled
