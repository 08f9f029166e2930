"""Drafts of V3 ``.gvl`` files: declarations with what speaks for each, and the settings that were observed.

A draft is packed by ``nvscope.definition.packing``; where that does not give the telegrams on the wire, its head tells.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from nvscope.definition.gvl_file import gvl_file
from nvscope.definition.infer import Field, Layout, Proposal
from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.position import Position
from nvscope.definition.variables import Scalar, String, Variable
from nvscope.duration import format_duration
from nvscope.units import count_of

_MS_NS = 1_000_000
_NOWHERE = Position("draft", 1, 1)


class Draft(Struct, frozen=True):
    """A list as it is proposed; ``problem`` says why its telegrams would be others than those on the wire, if so.

    ``notes`` are sentences for the head of the file. ``interval_ns`` is None where the list is not sent in a cycle.
    """

    list_id: int
    port: int
    address: str
    pack: bool
    acknowledge: bool
    checksum: bool
    interval_ns: int | None
    layouts: tuple[Layout | None, ...]
    problem: str
    notes: tuple[str, ...] = ()


def drafted(
    list_id: int, port: int, address: str, telegrams: Sequence[tuple[int, Proposal]], *, acknowledge: bool,
    checksum: bool, interval_ns: int | None, notes: Sequence[str] = (),
) -> Draft:  # fmt: skip
    """Return the draft of a list from the proposals of its telegrams, by SubIndex, rising.

    Whether the list is packed follows from them: not where several telegrams have one item each.
    """
    alone = len(telegrams) > 1 and all(proposal.items == 1 for _, proposal in telegrams)
    layouts = tuple(proposal.layouts[0] if proposal.layouts else None for _, proposal in telegrams)
    draft = Draft(
        list_id, port, address, not alone, acknowledge, checksum, interval_ns, layouts, "", tuple(notes)
    )  # fmt: skip
    problem = _problem(draft, telegrams)
    return Draft(
        list_id, port, address, not alone, acknowledge, checksum, interval_ns, layouts, problem, tuple(notes)
    )  # fmt: skip


def _problem(draft: Draft, telegrams: Sequence[tuple[int, Proposal]]) -> str:
    """Say why a controller with this definition would not send these telegrams; empty where it would."""
    for place, (subindex, proposal) in enumerate(telegrams):
        if subindex != place:
            return f"SubIndex {place} was not captured, so that what follows cannot be placed"
        if not proposal.layouts:
            return f"SubIndex {subindex}: {proposal.reason}"
    variables = tuple(Variable(field.name, field.type, _NOWHERE) for field in _fields(draft))
    cut = pack(ListDefinition("draft", _NOWHERE, variables, list_id=draft.list_id, pack=draft.pack))
    for place, (subindex, proposal) in enumerate(telegrams):
        layout = cut[place] if place < len(cut) else None
        if layout is None or (layout.items, layout.length - 20) != (proposal.items, proposal.size_bytes):
            return f"packed by the rule, SubIndex {subindex} would be cut elsewhere than it is on the wire"
    return "" if len(cut) == len(telegrams) else "packed by the rule, there would be more telegrams than on the wire"


def _fields(draft: Draft) -> list[Field]:
    return [field for layout in draft.layouts if layout is not None for field in layout.fields]


def gvl_text(draft: Draft) -> str:
    """Return the file."""
    head = [
        "Drafted from captured telegrams: names are offsets and guesses, types are what the values speak for.",
        "Compare with the PLC project before you rely on it.",
        *draft.notes,
    ]
    if draft.problem:
        head.append(f"Does not give the telegrams on the wire: {draft.problem}.")
    lines = [f"// {_comment(sentence)}" for sentence in head]
    lines.append("VAR_GLOBAL")
    for subindex, layout in enumerate(draft.layouts):
        if len(draft.layouts) > 1:
            lines.append(f"\t// SubIndex {subindex}")
        if layout is None:
            lines.append("\t// nothing is known of it")
            continue
        for field in layout.fields:
            others = f"; or {', '.join(field.others)}" if field.others else ""
            told = _comment(f"{field.grade}: {field.evidence}{others}")
            lines.append(f"\t{field.name} : {type_name(field.type)};  // {told}")
    lines.append("END_VAR")
    cyclic = draft.interval_ns is not None
    interval = format_duration(round((draft.interval_ns or 50 * _MS_NS) / _MS_NS) * _MS_NS or _MS_NS)
    settings = {
        "ListIdentifier": str(draft.list_id),
        "Pack": str(draft.pack),
        "Checksum": str(draft.checksum),
        "Acknowledge": str(draft.acknowledge),
        "CyclicTransmission": str(cyclic),
        "TransmissionOnChange": str(not cyclic),
        "TransmissionOnEvent": "False",
        "Interval": f"T#{interval}",
        "MinGap": "T#20ms",
    }
    more = [
        "<EventVariable>",
        "</EventVariable>",
        "<ProtocolSettings>",
        f'  <ProtocolSetting Name="Broadcast Adr." Value="{draft.address}" />',
        f'  <ProtocolSetting Name="Port" Value="{draft.port}" />',
        "</ProtocolSettings>",
    ]
    return gvl_file("UDP", lines, settings, more)


def type_name(kind: Scalar | String) -> str:
    """Return a type as it is declared."""
    return kind.name


def sampled(telegrams: int, rows: int) -> str:
    """Return a sentence about how much was looked at."""
    whole = count_of(telegrams, "telegram")
    return f"Seen: {whole}." if rows >= telegrams else f"Seen: {whole}, of which {rows} were looked at."


def _comment(text: str) -> str:
    """Return a text that ends neither the comment nor the CDATA section it stands in."""
    plain = "".join(character if character.isascii() and character.isprintable() else "?" for character in text)
    for mark in ("]]>", "(*", "*)", "/*", "*/", "{", "}"):
        plain = plain.replace(mark, " ".join(mark) if len(mark) > 1 else f"\\x{ord(mark):02x}")
    return plain
