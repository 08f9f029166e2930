"""Inference: proposes what lies where in telegrams for which there is no definition file.

A proposal is never certain: bytes that do not change say little, and a DINT looks like a UDINT while it is positive.
Each field therefore has its probability, a grade made of it, and what speaks for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8
from nvscope.definition.field_evidence import Candidate, candidates, opaque_candidates
from nvscope.definition.packing import PACKED_DATA_BYTES
from nvscope.definition.scalars import SCALARS
from nvscope.definition.segmentation import probabilities, segmentations
from nvscope.definition.variables import Scalar, String

LAYOUTS = 3
"""Layouts that are proposed, the most plausible first."""

SURE, LIKELY, GUESS = "sure", "likely", "guess"
_SURE_FROM, _LIKELY_FROM = 0.95, 0.65
_FEW_TELEGRAMS = 8
_MOST_BYTES = 1_500
_MOST_ITEMS = 400
_DECLARED = {"DT": "DT", "LDT": "LDT", "BYTE": "BYTE"}
_WORDS = {
    "BOOL": "xFlag", "BYTE": "byValue", "SINT": "siValue", "UINT": "uiValue", "INT": "iValue", "UDINT": "udiValue",
    "DINT": "diValue", "ULINT": "uliValue", "LINT": "liValue", "REAL": "rValue", "LREAL": "lrValue", "TIME": "tTime",
    "DT": "dtTime", "LDT": "ldtTime", "STRING": "sText", "UNKNOWN": "sUnknown",
}  # fmt: skip
_S_NS = 1_000_000_000


class Field(Struct, frozen=True):
    """One proposed field of a telegram's data.

    ``probability`` is that of its place and size, together with that of the type; ``others`` are further types of the
    same size that are about as plausible. ``evidence`` says in words what was seen, plain ASCII text without controls.
    """

    offset: int
    size_bytes: int
    type: Scalar | String
    name: str
    probability: float
    grade: str
    evidence: str
    others: tuple[str, ...]


class Layout(Struct, frozen=True):
    """Fields of a telegram in order; ``behind_bits`` is how much less plausible it is than the best, as bits."""

    fields: tuple[Field, ...]
    behind_bits: float


class Proposal(Struct, frozen=True):
    """What lies in the data of a telegram: layouts, the most plausible first.

    None is there where Items and Length leave no room for any; ``reason`` then says why.
    """

    items: int
    size_bytes: int
    layouts: tuple[Layout, ...]
    reason: str = ""


def infer(items: int, data: U8, first: U8, first_ns: I64, *, least_first_bytes: int = 0, prefix: str = "") -> Proposal:
    """Return the layouts of telegrams of ``items`` fields.

    ``data`` (n, bytes) are telegrams, ``first`` those of them that follow each other, ``first_ns`` their times.
    ``least_first_bytes`` is what the first field has at least: since it did not fit into the telegram before. Names of
    fields begin with ``prefix``.
    """
    size = data.shape[1]
    if not items or items > size:
        return Proposal(items, size, (), f"{items} items cannot lie in {size} bytes")
    if size > _MOST_BYTES or items > _MOST_ITEMS:
        if items > 1:
            return Proposal(items, size, (), "too large to be looked at")
        whole = Candidate(0, size, (("STRING" if _is_text(data) else "UNKNOWN", 0.0),))
        told = _field(whole, data, first, 0.5, prefix)
        return Proposal(items, size, (Layout((told,), 0.0),))
    # What is longer than a packed telegram travels alone.
    most = size if items == 1 else min(size, PACKED_DATA_BYTES)
    found = _usable(candidates(data, first, first_ns, most), size, items, least_first_bytes)
    best = segmentations(found, size, items, LAYOUTS)
    if not best and size <= most:
        found = _usable([*found, *opaque_candidates(size, items)], size, items, 0)
        found.sort(key=lambda entry: (entry.offset, entry.size_bytes))
        best = segmentations(found, size, items, LAYOUTS)
    if not best:
        return Proposal(items, size, (), f"no fields of known sizes make {items} items of {size} bytes")
    share = dict(zip(map(id, found), probabilities(found, size, items).tolist(), strict=True))
    return Proposal(
        items,
        size,
        tuple(
            Layout(
                tuple(_field(entry, data, first, share[id(entry)], prefix) for entry in layout.fields),
                layout.price - best[0].price,
            )
            for layout in best
        ),
    )


def _usable(found: Iterable[Candidate], size: int, items: int, least_first: int) -> list[Candidate]:
    """Return the candidates beside which there is room for the other items, and only for these."""
    return [
        entry
        for entry in found
        if (entry.offset > 0) + (entry.end < size) < items <= size - entry.size_bytes + 1
        and (entry.offset or entry.size_bytes >= least_first)
    ]


def least_first_bytes(before: Sequence[int]) -> int:
    """Return how large the first element of a packed telegram is at least, from the data bytes of that before it."""
    return PACKED_DATA_BYTES - before[-1] + 1 if before and before[-1] <= PACKED_DATA_BYTES else 0


def _field(candidate: Candidate, data: U8, first: U8, place_probability: float, prefix: str) -> Field:
    name, price = candidate.prices[0]
    weights = [2.0 ** -min(other - price, 60.0) for _, other in candidate.prices]
    # Of a number the sign often cannot be told: that is no doubt about the field, but its type is a guess then.
    alike = {"UINT": "INT", "UDINT": "DINT", "ULINT": "LINT", "BYTE": "SINT"}
    alike |= {signed: unsigned for unsigned, signed in alike.items()}
    same = sum(
        weight for weight, (other, _) in zip(weights, candidate.prices, strict=True) if other in (name, alike.get(name))
    )
    probability = place_probability * same / sum(weights)
    span = slice(candidate.offset, candidate.end)
    raw, ahead = data[:, span], first[:, span]
    constant = bool((raw == raw[0]).all())
    evidence, word = _evidence(name, raw, ahead, constant)
    twin = sum(weight for weight, (other, _) in zip(weights, candidate.prices, strict=True) if other == alike.get(name))
    guessed_sign = twin > (1 - _SURE_FROM) * same
    if guessed_sign and not (constant and not raw.any()):
        evidence += "; the sign is a guess"
    kind: Scalar | String = (
        String(candidate.size_bytes - 1) if name in ("STRING", "UNKNOWN") else SCALARS[_DECLARED.get(name, name)]
    )
    others = tuple(other for weight, (other, _) in zip(weights[1:], candidate.prices[1:], strict=True) if weight > 0.1)
    return Field(
        candidate.offset, candidate.size_bytes, kind, f"{prefix}b{candidate.offset}_{word}", probability,
        _grade(name, probability, constant, bool(raw.any()), len(data), guessed_sign=guessed_sign), evidence, others,
    )  # fmt: skip


def _grade(
    name: str, probability: float, constant: bool, any_set: bool, telegrams: int, *, guessed_sign: bool
) -> str:  # fmt: skip
    if name == "UNKNOWN" or telegrams < _FEW_TELEGRAMS or (constant and not any_set):
        return GUESS
    if probability >= _SURE_FROM and (not constant or name == "STRING") and not guessed_sign:
        return SURE
    return LIKELY if probability >= _LIKELY_FROM else GUESS


def _is_text(data: U8) -> bool:
    printable = (data >= 0x20) & (data < 0x7F)
    before_end = np.logical_and.accumulate(data != 0, axis=1)
    return bool((printable | ~before_end).all() and before_end[:, 0].any())


def _evidence(name: str, raw: U8, first: U8, constant: bool) -> tuple[str, str]:
    """Return what was seen of a field in words, and the second part of its name."""
    word = _WORDS[name]
    if name == "UNKNOWN":
        return "not determined", word
    if name == "STRING":
        texts = {bytes(row).partition(b"\0")[0] for row in raw[:: max(1, len(raw) // 64)]}
        shown = max(texts, key=lambda text: (len(text), text))
        told = _plain(shown)
        return (f"text {told}" if len(texts) == 1 else f"texts such as {told}") if shown else "always empty", word
    if constant and not raw.any():
        return "always 0", word
    dtype = SCALARS[name].dtype
    values = np.ascontiguousarray(raw).view(dtype)[:, 0]
    if name == "BOOL":
        return ("always TRUE" if constant else "FALSE and TRUE only"), word
    if name in ("DT", "LDT"):
        return ("a date of these years" if constant else "seconds since 1970, running"), word
    if name == "TIME":
        return "milliseconds, running with the clock", word
    if constant:
        return f"always {_number(values[0])}", word
    least, most = _number(values.min()), _number(values.max())
    if name in ("REAL", "LREAL"):
        return f"{name} {least} to {most}{_smoothness(first, dtype)}", word
    ahead = np.ascontiguousarray(first).view(dtype)[:, 0]
    steps = ahead[1:] - ahead[:-1]
    if len(steps):
        usual, count = np.unique(steps, return_counts=True)
        step = int(usual[np.argmax(count)])
        size = 8 * SCALARS[name].size_bytes
        step = step - (1 << size) if step >= 1 << (size - 1) else step
        if step and count.max() >= 0.9 * len(steps):
            return f"counts by {step}, {least} to {most}", word.replace("Value", "Counter")
    return f"{least} to {most}", word


def _smoothness(first: U8, dtype: str) -> str:
    values = np.ascontiguousarray(first).view(dtype)[:, 0].astype(np.float64)
    whole = float(values.max() - values.min())
    if len(values) < _FEW_TELEGRAMS or not np.isfinite(whole) or whole == 0:
        return ""
    return ", smooth" if float(np.abs(np.diff(values)).mean()) < 0.1 * whole else ""


def _number(value: np.generic) -> str:
    return f"{value:.6g}" if value.dtype.kind == "f" else str(int(value))


def _plain(text: bytes) -> str:
    shown = text[:32].decode("iso-8859-1").encode("ascii", "backslashreplace").decode("ascii")
    plain = "".join(character if character.isprintable() else f"\\x{ord(character):02x}" for character in shown)
    return f"'{plain}{'...' if len(text) > 32 else ''}'"
