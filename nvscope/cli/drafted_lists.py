"""``nvscope vars --infer``: layouts of lists that nobody has defined, and drafts of their definition files."""

from __future__ import annotations

from pathlib import Path

from nvscope.cli.terminal import echo, width
from nvscope.cli.variables_asked import VariablesAsked, VariablesRead
from nvscope.errors import UsageError


def propose(asked: VariablesAsked, listed: str | None, write: str | None, *, force: bool) -> VariablesRead:
    """Propose layouts, and draft definition files of them."""
    from nvscope.analysis.inference import infer
    from nvscope.definition.gvl_text import gvl_text
    from nvscope.report import inference as face
    from nvscope.units import count_of
    from nvscope.view.documents.inference import drafts, inference_document, proposals
    from nvscope.whole_files import WholeFiles, is_stdout

    inferred = infer(asked.inquiry, expression=asked.wanted)
    samples, source = inferred.samples, inferred.source
    if inferred.some_on_can:
        echo(
            "nvscope: lists on CAN are not proposed: a frame does not tell how many variables it has.", err=True
        )  # fmt: skip
    found = proposals(samples, listed)
    made = drafts(found) if write is not None else []
    if write is None or not is_stdout(write):
        asked.tell(
            inference_document(found, samples),
            lambda document: face.render(document, colour=asked.colour, width=width(), wide=asked.wide),
        )
    elif len(made) > 1:
        raise UsageError(
            f"{count_of(len(made), 'draft')} cannot be written to stdout side by side",
            next_step="choose one with --list, or name a file: each list gets its own",
        )
    if write is None:
        return VariablesRead.of(source)
    if not made:
        echo(f"nvscope: nothing to draft, {write} was not written.", err=True)
    drafted = [*zip(made, _draft_paths(write, [(draft.port, draft.list_id) for draft in made]), strict=True)]
    files = WholeFiles([*(info.path for info in source.infos), *asked.inquiry.project.inputs], force=force)
    try:
        for draft, path in drafted:
            # Somebody may have worked on a draft: one that is there already stays, whatever its name.
            files.write(str(path), gvl_text(draft).encode())
        files.publish()
    except BaseException:
        files.discard()
        raise
    for draft, path in drafted:
        note = f"; it does not fit the wire: {draft.problem}" if draft.problem else ""
        echo(f"nvscope: {path}: draft of list {draft.list_id}, {_CHECK}{note}.", err=True)
    return VariablesRead.of(source)


_CHECK = "to be checked against the PLC project"


def _draft_paths(write: str, lists: list[tuple[int, int]]) -> list[Path]:
    """Return the file of each list: as named, or with identifier (and port, if need be) where there are several."""
    path = Path(write)
    if len(lists) == 1:
        return [path]
    if not path.name or path.name == "..":
        raise UsageError("no name of a file", where=write, next_step="name one, such as draft.gvl, with -w")
    identifiers = [index for _, index in lists]
    return [
        path.with_name(f"{path.stem}-{f'{port}-' if identifiers.count(index) > 1 else ''}{index}{path.suffix}")
        for port, index in lists
    ]
