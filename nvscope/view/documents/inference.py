"""Proposed layouts of lists as data (schema ``nvscope.infer/1``), and the drafts of their definition files.

``behind_bits`` tells how much less plausible a layout is than the first one of its telegram: 10 bits are a factor of
1000. Durations are numbers in ns.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

from msgspec import Struct

from dissectors.netvar import HEADER
from nvscope.definition.gvl_text import Draft, drafted, sampled, type_name
from nvscope.definition.infer import Layout, Proposal, infer, least_first_bytes
from nvscope.errors import UsageError
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.variables.samples import Sample, Samples
from nvscope.version import head

SCHEMA = "nvscope.infer/1"
_MOST_TOLD = 8


class ListProposal(Struct, frozen=True):
    """What is proposed for a list of one sender: its telegrams' samples with how many other shapes each had."""

    list: ListKey
    sender: str
    samples: tuple[tuple[Sample, int], ...]
    proposals: tuple[Proposal, ...]
    draft: Draft

    @property
    def telegrams(self) -> int:
        return sum(sample.telegrams for sample, _ in self.samples)


def proposals(samples: Samples, listed: str | None = None) -> list[ListProposal]:
    """Return what is proposed for all lists, or the ``listed`` one (identifier or key), by list and sender.

    UsageError where nothing was captured of it.
    """
    usual = samples.usual()
    if listed is not None:
        usual = _of_list(usual, listed)

    def sender(entry: tuple[Sample, int]) -> tuple[ListKey, str]:
        stream = entry[0].stream
        return stream.list, stream.sender

    return [_propose(tuple(members)) for _, members in groupby(usual, sender)]


def _of_list(usual: list[tuple[Sample, int]], listed: str) -> list[tuple[Sample, int]]:
    wanted = listed.strip().lower().removeprefix("udp/")
    keys = [entry.stream.list for entry, _ in usual]
    found = [
        entry
        for entry, key in zip(usual, keys, strict=True)
        if wanted in (str(key.identifier), f"{key.port}/{key.identifier}")
    ]
    if not found:
        told = ", ".join([str(key) for key in dict.fromkeys(keys)][:_MOST_TOLD]) or "none"
        raise UsageError(f"--list {listed[:80]}: no data telegram of it was captured", next_step=f"there are: {told}")
    return found


def _propose(members: tuple[tuple[Sample, int], ...]) -> ListProposal:
    alone = len(members) > 1 and all(sample.items == 1 for sample, _ in members)
    found: list[Proposal] = []
    sizes: list[int] = []
    for place, (sample, _) in enumerate(members):
        follows = sample.stream.subindex == place and not alone
        least = least_first_bytes(sizes) if follows else 0
        prefix = f"t{sample.stream.subindex}_" if len(members) > 1 else ""
        data, first, first_ns = sample.data, sample.first, sample.first_ns
        told = infer(sample.items, data, first, first_ns, least_first_bytes=least, prefix=prefix)
        found.append(told)
        sizes.append(sample.size_bytes)
    head = members[0][0]
    rows = min(len(sample.data) for sample, _ in members)
    others = sum(count for _, count in members)
    notes = [f"Sender {head.stream.sender}. {sampled(min(sample.telegrams for sample, _ in members), rows)}"]
    if others:
        notes.append("Some telegrams had another shape (Items, Length); the commonest one is drafted.")
    key = head.stream.list
    draft = drafted(
        key.identifier, int(key.port), head.destination,
        [(sample.stream.subindex, told) for (sample, _), told in zip(members, found, strict=True)],
        acknowledge=any(sample.acknowledge for sample, _ in members),
        checksum=any(sample.checksum for sample, _ in members), interval_ns=head.nominal_ns, notes=notes,
    )  # fmt: skip
    return ListProposal(key, head.stream.sender, members, tuple(found), draft)


def drafts(found: Sequence[ListProposal]) -> list[Draft]:
    """Return a draft a list: of several senders, that of the one with most telegrams."""
    best: dict[ListKey, ListProposal] = {}
    for entry in found:
        known = best.get(entry.list)
        if known is None or entry.telegrams > known.telegrams:
            best[entry.list] = entry
    return [entry.draft for entry in best.values()]


def inference_document(found: Sequence[ListProposal], samples: Samples) -> dict[str, Any]:
    """Return proposals as data; ``on_can`` counts COB-IDs, of which nothing tells how many variables they carry."""
    return {
        **head(SCHEMA),
        "lists": [_list(entry) for entry in found],
        "frames": samples.read.frames,
        "left_out": samples.left_out,
        "on_can": sum(key.transport is Transport.CAN for key in samples.read.lists),
    }


def _list(entry: ListProposal) -> dict[str, Any]:
    return {
        "list": str(entry.list),
        "port": entry.list.port,
        "id": entry.list.identifier,
        "sender": entry.sender,
        "pack": entry.draft.pack,
        "interval_ns": entry.draft.interval_ns,
        "reproducible": not entry.draft.problem,
        "problem": entry.draft.problem or None,
        "telegrams": [
            {
                "subindex": sample.stream.subindex,
                "items": sample.items,
                "length": HEADER.size_bytes + sample.size_bytes,
                "telegrams": sample.telegrams,
                "looked_at": len(sample.data),
                "other_shapes": others,
                "reason": told.reason or None,
                "layouts": [_layout(layout) for layout in told.layouts],
            }
            for (sample, others), told in zip(entry.samples, entry.proposals, strict=True)
        ],
    }


def _layout(layout: Layout) -> dict[str, Any]:
    return {
        "behind_bits": round(layout.behind_bits, 2),
        "fields": [
            {
                "offset": field.offset,
                "bytes": field.size_bytes,
                "name": field.name,
                "type": type_name(field.type),
                "grade": field.grade,
                "probability": round(field.probability, 4),
                "evidence": field.evidence,
                "others": list(field.others),
            }
            for field in layout.fields
        ],
    }
