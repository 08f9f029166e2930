"""What ``nvscope vars`` says of telegrams that it could not decode."""

from __future__ import annotations

from nvscope.cli.terminal import echo


def tell_of_truncated(count: int) -> None:
    """Say how many telegrams were not captured whole."""
    from nvscope import units
    from nvscope.findings.header import TRUNCATED_BY_CAPTURE

    told = units.count_of(count, "telegram")
    echo(f"nvscope: {told} of defined lists not captured whole, not decoded ({TRUNCATED_BY_CAPTURE.code}).", err=True)


def tell_of_unfitting(count: int, unlike_known_part: int) -> None:
    """Say how many telegrams differ from their definition, or from what is known of it; nothing of none."""
    from nvscope import units
    from nvscope.findings.can import DLC_MISMATCH
    from nvscope.findings.definition import DEFINITION_MISMATCH

    if count:
        told = units.count_of(count, "telegram")
        echo(
            f"nvscope: {told} of another shape than the definition has, not decoded; "
            "`nvscope report` with the same definitions tells where they differ "
            f"({DEFINITION_MISMATCH.code}, on CAN {DLC_MISMATCH.code}).",
            err=True,
        )
    if unlike_known_part:
        told = units.count_of(unlike_known_part, "telegram")
        echo(
            f"nvscope: {told} not even of the shape that the known part of the definition has, not decoded: SubIndex, "
            "Items or Length differ.",
            err=True,
        )
