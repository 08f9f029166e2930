"""Laws of rules about writes: who wrote what as the rules written frame by frame say, however a capture is cut."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.verdict import Judged, Verdict
from nvscope.name_patterns import fits
from tests.check.requests import decided, of_frames
from tests.laws import examples
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import parameter_traffic
from tests.oracle.rules.parameter import observed
from tests.oracle.rules.visu import Visu
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut

OPEN = Verdict.INCONCLUSIVE
NOBODY = "192.0.2.1"


def writes(**told: Any) -> dict[str, Any]:
    return {"check": "writes", **told}


def told_by_rules(frames: Sequence[Frame]) -> list[tuple[str, str, str, int]]:
    """Return all writes of a capture: protocol, who wrote, the parameter or variable, and how often."""
    found = [
        ("sdo", one.requester, f"sdo/{one.partner}/0x{one.index:04x}:{one.subindex}", 1)
        for one in observed(frames).writes
    ]
    visu = Visu()
    for frame in frames:
        visu.observe(frame)
    events = [one for one in visu.findings() if one["code"] == "NV801"]
    return [*found, *(("visu", one["client"], one["variable"], one["count"]) for one in events)]


ONLY_TO = st.sampled_from(["sdo/*/*", "sdo/10.0.0.2/0x2000:*", "sdo/*/0x0007:1", "visu/10.0.0.5/*", "visu/*/*,0"])


@examples(120)
@given(
    seed=st.integers(0, 10_000), visu=st.booleans(), by=st.sampled_from(["10.0.0.1", "10.0.0.*", NOBODY]), to=ONLY_TO
)
def test_who_writes_what_is_what_the_rules_say(seed: int, visu: bool, by: str, to: str) -> None:
    frames = visu_traffic(seed) if visu else parameter_traffic(seed)
    every = told_by_rules(frames)
    by_whom, to_what = of_frames(frames, writes(only_by=by), writes(only_to=to))
    wrong: Counter[tuple[str, str]] = Counter()
    for protocol, who, _, count in every:
        wrong[protocol, who] += 0 if fits(by, who) else count
    assert found_in(by_whom.subjects) == +wrong
    # A name may be what a pattern of places does not say: where one is not known, nobody knows.
    least: Counter[tuple[str, str]] = Counter()
    for protocol, who, what, count in every:
        least[protocol, who] += 0 if fits(to, what) or (protocol == "visu" and "*,0" in to) else count
    sure = found_in(to_what.subjects)
    if protocol_of(to) == "sdo" and visu:
        assert sure == +least
    if not visu:
        assert all(sure[one] <= least[one] for one in least)
        assert sure == +least or any(each.verdict is OPEN for each in to_what.subjects)


def protocol_of(pattern: str) -> str:
    return pattern.partition("/")[0]


def found_in(judged: Sequence[Judged]) -> Counter[tuple[str, str]]:
    found: Counter[tuple[str, str]] = Counter()
    for one in judged:
        if one.node is not None:
            assert one.protocol is not None
            found[one.protocol, one.node] += one.count
    return +found


RULES = [
    writes(only_by="10.0.0.1"), writes(only_by=NOBODY, when="frame.number > 20"), writes(only_to="0x2000:*"),
    writes(only_to="PLC_PRG.*", protocol="visu"),
]  # fmt: skip


@examples(60)
@given(seed=st.integers(0, 10_000), packets=st.integers(1, 90), visu=st.booleans(), warmup=st.integers(0, 3 * SECOND))
def test_any_cut_gives_the_same(seed: int, packets: int, visu: bool, warmup: int) -> None:
    whole = batch_of(visu_traffic(seed) if visu else parameter_traffic(seed))
    at_once, in_parts = (
        [(one.verdict, list(one.subjects)) for one in decided(batches, *RULES, warmup_ns=warmup)]
        for batches in ([whole], cut(whole, packets))
    )
    assert at_once == in_parts


@examples(60)
@given(seed=st.integers(0, 10_000), visu=st.booleans(), share=st.floats(0, 1))
def test_halves_make_a_whole(seed: int, visu: bool, share: float) -> None:
    frames = visu_traffic(seed) if visu else parameter_traffic(seed)
    at, rule = 1 + round(share * len(frames)), writes(only_by=NOBODY)
    whole, early, late = of_frames(
        frames, rule, rule | {"when": f"frame.number < {at}"}, rule | {"when": f"frame.number >= {at}"}
    )
    assert found_in(whole.subjects) == found_in(early.subjects) + found_in(late.subjects)
