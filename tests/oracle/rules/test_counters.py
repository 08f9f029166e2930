"""The table of steps, one line after the other."""

from __future__ import annotations

import pytest

from tests.oracle.rules.counters import CounterSequence


@pytest.mark.parametrize(
    ("h", "missing", "c", "regular_zero", "repeated", "kind", "lost", "h_after", "missing_after"),
    [
        # d = 1, also through zero
        (5, set(), 6, False, False, "regular", 0, 6, set()),
        (65535, set(), 0, False, False, "regular", 0, 0, set()),
        (0, set(), 1, False, False, "regular", 0, 1, set()),
        # d = 0 where regular
        (5, set(), 5, True, False, "regular", 0, 5, set()),
        # repeated: no step, whatever the counter is by now
        (5, set(), 5, True, True, "duplicate", 0, 5, set()),
        (6, {3}, 5, False, True, "duplicate", 0, 6, {3}),
        (9, {7}, 1, False, True, "duplicate", 0, 9, {7}),
        (9, {8}, 8, False, True, "duplicate", 0, 9, {8}),
        (4, set(), 5, False, True, "duplicate", 0, 4, set()),
        (500, set(), 5, False, True, "duplicate", 0, 500, set()),
        # senders that wrap early
        (255, set(), 0, False, False, "regular", 0, 0, set()),
        (65534, set(), 0, False, False, "regular", 0, 0, set()),
        # a counter that was missing stays so over an early wrap at 65534 (65530 is 6 behind), not over one at 255
        (65534, {65530}, 0, False, False, "regular", 0, 0, {65530}),
        (255, {250}, 0, False, False, "regular", 0, 0, set()),
        # d = 0
        (5, set(), 5, False, True, "duplicate", 0, 5, set()),
        (5, set(), 5, False, False, "nothing", 0, 5, set()),
        # missing before anything that follows
        (9, {7, 8}, 7, False, False, "overtaken", -1, 9, {8}),
        (3, {0, 1}, 1, False, False, "overtaken", -1, 3, {0}),
        # 0 and 1 where they are not missing
        (9, {7}, 0, False, False, "restart", 0, 0, set()),
        (9, {7}, 1, False, False, "restart", 0, 1, set()),
        (65533, set(), 1, False, False, "restart", 0, 1, set()),
        # ... and next to the end of the range
        (65534, set(), 1, False, False, "gap", 2, 1, {65535, 0}),
        (65535, set(), 1, False, False, "gap", 1, 1, {0}),
        # forward
        (5, set(), 7, False, False, "gap", 1, 7, {6}),
        (5, {3}, 9, False, False, "gap", 3, 9, {3, 6, 7, 8}),
        (5, set(), 5 + 32767, False, False, "gap", 32766, 32772, set(range(32772 - 64, 32772))),
        # a missing counter leaves the window when it is 65 behind
        (70, {6}, 71, False, False, "regular", 0, 71, set()),
        (69, {6}, 70, False, False, "regular", 0, 70, {6}),
        # backward
        (100, set(), 99, False, False, "duplicate", 0, 100, set()),
        (100, set(), 36, False, False, "duplicate", 0, 100, set()),
        (100, {99}, 35, False, False, "restart", 0, 35, set()),
        (5, {4}, 5 + 32768, False, False, "restart", 0, 32773, set()),
        # 65535 after 0 is one behind
        (0, set(), 65535, False, False, "duplicate", 0, 0, set()),
    ],
)
def test_step(
    h: int,
    missing: set[int],
    c: int,
    regular_zero: bool,
    repeated: bool,
    kind: str,
    lost: int,
    h_after: int,
    missing_after: set[int],
) -> None:
    sequence = CounterSequence(h=h, missing=set(missing))
    assert sequence.step(c, zero_is_regular=regular_zero, repeated=repeated) == (kind, lost)
    assert (sequence.h, sequence.missing) == (h_after, missing_after)
    assert (sequence.steps, sequence.regular) == (int(not repeated), int(kind == "regular"))


def test_first_telegram_only_sets_h() -> None:
    sequence = CounterSequence()
    assert sequence.step(7, zero_is_regular=True, repeated=False) == ("first", 0)
    assert (sequence.h, sequence.steps) == (7, 0)
