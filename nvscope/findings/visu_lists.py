"""What is said of lists and pages that controllers send: what lists contradict, or why something cannot be used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.tracker.visu.names import OtherNames, TwoControllers, UnreadList, UnusableEncoding


def contradicted(server: str, times: int, other: OtherNames | TwoControllers) -> str:
    """Return what a list says otherwise than those known before."""
    from nvscope.tracker.visu.names import TwoControllers, is_older

    if isinstance(other, TwoControllers):
        begin = f"{server} sent"
        if times > 1:
            begin = f"{server} sent {count(times)} lists of variables that contradict what was known; the first one is"
        return (
            f"{begin} another list of variables over port {other.port} than over port {other.other}: they are taken "
            f"for two controllers, and variables of port {other.port} stand under {other.list}."
        )
    begin = f"{server} has"
    if times > 1:
        begin = f"{server} sent {count(times)} lists of variables that contradict what was known; the first one has"
    if other.place is None or other.place_before is None:
        stamps = (text.partition(",")[0].strip() for text in (other.stamp, other.stamp_before))
        told = f"{begin} a newer list of variables than" if times == 1 else f"{begin.removesuffix('has')}is newer than"
        return f"{told} {other.file}: their time-stamps are {' and '.join(stamps)}."
    older = ", which is older" if is_older(other.stamp_before, other.stamp) else ""
    than = f"{other.file} says{older}" if other.file else "it said before"
    variables = count_of(other.differing, "variable")
    example = f"{other.name} is {other.place.text} and not {other.place_before.text}"
    return f"{begin} {variables} at other places than {than}: {example}."


def unread(server: str, times: int, flaw: UnreadList) -> str:
    """Return why lists cannot be used, and what nobody knows then."""
    lists = "a list" if times == 1 else f"{count(times)} lists"
    first = "" if times == 1 else "; the first one"
    return (
        f"{server} sent {lists} of variables that cannot be used{first}: {flaw.why.rstrip('.')}. Names are missing, "
        "and nobody knows what is a password."
    )


def unusable(server: str, times: int, flaw: UnusableEncoding) -> str:
    """Return why texts cannot be read as pages say."""
    pages = "a page that says" if times == 1 else f"{count(times)} pages that say"
    first = "" if times == 1 else "; the first one"
    return f"{server} sent {pages} an encoding of texts that cannot be used{first}: {flaw.why}."
