"""Telegrams in a few words: what a service is called in a line, which flags are set, and what is wrong."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import (
    ACKNOWLEDGE_WANTED,
    CHECKSUM_INVALID,
    CHECKSUM_PRESENT,
    HEADER,
    IDENTITY,
    IS_PARAMETER,
    KNOWN_SERVICE,
    RESERVED_FLAGS,
    Fault,
    Service,
    TelegramBatch,
)
from nvscope.view.lines.table import Tone


class ServiceWord(NamedTuple):
    """How a service is called where there is little room, and what it means to the reader."""

    word: str
    tone: Tone


SERVICE_WORDS = {
    Service.ODStateFree: ServiceWord("data", Tone.PLAIN),
    Service.ODReadRequest: ServiceWord("read", Tone.NOTE),
    Service.ODReadRequestReply: ServiceWord("read-reply", Tone.NOTE),
    Service.ODWriteRequest: ServiceWord("write", Tone.NOTE),
    Service.ODWriteRequestReply: ServiceWord("write-reply", Tone.NOTE),
    Service.ODAcknowledgement: ServiceWord("ack", Tone.FAINT),
    Service.ODBootUpRequest: ServiceWord("boot-up", Tone.NOTE),
    Service.ODErrorReplyUnknown: ServiceWord("error-unknown", Tone.ERROR),
    Service.ODErrorReplyItems: ServiceWord("error-items", Tone.ERROR),
    Service.ODErrorReplyAccess: ServiceWord("error-access", Tone.ERROR),
    Service.ODErrorReplyIdx: ServiceWord("error-index", Tone.ERROR),
    Service.ODErrorReplySub: ServiceWord("error-subindex", Tone.ERROR),
    Service.ODErrorReplyLen: ServiceWord("error-length", Tone.ERROR),
    Service.ODErrorWrongService: ServiceWord("error-service", Tone.ERROR),
    Service.ODErrorTimeOut: ServiceWord("error-timeout", Tone.ERROR),
    Service.ODErrorReplyCPUStopped: ServiceWord("error-stopped", Tone.ERROR),
    Service.ODStateBusy: ServiceWord("busy", Tone.WARNING),
}
NEGATIVE = ServiceWord("ack!", Tone.ERROR)
UNKNOWN = ServiceWord("unknown", Tone.ERROR)

_UNKNOWN_CODE = len(KNOWN_SERVICE) - 1
_NEGATIVE_CODE = len(KNOWN_SERVICE)
WORD_OF_CODE = (
    *(SERVICE_WORDS[Service(code)] if KNOWN_SERVICE[code] else UNKNOWN for code in range(len(KNOWN_SERVICE))),
    NEGATIVE,
)
"""Words by the codes of ``word_codes``."""

PARAMETER_CODES = frozenset(np.flatnonzero(IS_PARAMETER).tolist())
"""Codes of services whose Index is not a list but one of the Parameter Manager."""

_FLAGS_END = HEADER.offset_of("flags") + HEADER["flags"].size_bytes
_CHECKSUM_END = HEADER.offset_of("checksum") + HEADER["checksum"].size_bytes


def word_codes(telegrams: TelegramBatch) -> I64:
    """Return, for each telegram, the place of its service in ``WORD_OF_CODE``."""
    header = telegrams.header
    code: I64 = np.minimum(header["id"], _UNKNOWN_CODE).astype(np.int64)
    negative = (code == Service.ODAcknowledgement) & ((header["flags"] & CHECKSUM_INVALID.mask) != 0)
    code[negative & (telegrams.datagram.captured_bytes >= _FLAGS_END)] = _NEGATIVE_CODE
    return code


def flag_words(telegrams: TelegramBatch) -> list[str]:
    """Return which flags are set, in a word each: ``ack-wanted cks=3c``; empty where there are none."""
    header = telegrams.header
    is_acknowledgement = header["id"] == Service.ODAcknowledgement
    key = header["flags"].astype(np.int64) << 9 | header["checksum"].astype(np.int64) << 1 | is_acknowledgement
    key[telegrams.datagram.captured_bytes < _CHECKSUM_END] = 0
    told = {number: _flags(number >> 9, number >> 1 & 0xFF, bool(number & 1)) for number in set(key.tolist())}
    return [told[number] for number in key.tolist()]


def _flags(flags: int, checksum: int, is_acknowledgement: bool) -> str:
    words = []
    if flags & ACKNOWLEDGE_WANTED.mask:
        words.append("ack-wanted")
    if flags & CHECKSUM_PRESENT.mask:
        words.append(f"cks={checksum:02x}")
    if flags & CHECKSUM_INVALID.mask:
        words.append("negative" if is_acknowledgement else "cks-invalid")
    if flags & RESERVED_FLAGS:
        words.append(f"flags=0x{flags:02x}")
    return " ".join(words)


def remarks(telegrams: TelegramBatch) -> dict[int, tuple[str, Tone]]:
    """Return, by position, what is wrong with a telegram or remarkable about it; nothing for most of them."""
    datagram, header, fault = telegrams.datagram, telegrams.header, telegrams.fault
    truncated, other_identity = telegrams.truncated, header["identity"] != IDENTITY
    found = {}
    for row in np.flatnonzero((fault != Fault.NONE) | truncated | other_identity).tolist():
        head = header[row]
        payload_bytes, captured_bytes = int(datagram.payload_bytes[row]), int(datagram.captured_bytes[row])
        texts, tone = [], Tone.WARNING
        if fault[row] not in (Fault.NONE, Fault.HEADER_CUT):
            texts.append(fault_sentence(Fault(int(fault[row])), int(head["id"]), int(head["length"]), payload_bytes))
            tone = Tone.ERROR
        if truncated[row]:
            texts.append(f"cut: {captured_bytes} of {payload_bytes} bytes")
        if other_identity[row]:
            texts.append(f"identity {head['identity'].tobytes().hex(' ')}")
        found[row] = ", ".join(texts), tone
    return found


def fault_sentence(fault: Fault, service: int, length: int, payload_bytes: int) -> str:
    """Return what a fault is, with its figures."""
    if fault is Fault.SHORT:
        return f"short: {payload_bytes} of {HEADER.size_bytes} bytes"
    if fault is Fault.LENGTH:
        return f"Length {length}, payload {payload_bytes}"
    if fault is Fault.BYTE_SWAPPED:
        return f"Length {length}, swapped {payload_bytes}"
    if fault is Fault.SERVICE:
        return f"unknown service {service}"
    return ""
