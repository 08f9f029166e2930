"""A capture that is played on the screen: what is shown is what was known then, wherever somebody goes."""

from __future__ import annotations

from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import scene_at
from nvscope.capture.player import MOST_RATE, Player
from nvscope.definition.project import Project
from nvscope.view.documents.drawn import plain
from tests.tui.screen import Screen, on_replay

ROOT = Path(__file__).parents[2]
PLANT = Inquiry([str(ROOT / "captures" / "plant.pcapng.gz")], Project())
START_NS = 1_704_067_200 * 10**9
FRAMES = 1212
S_NS = 10**9


def standing() -> Player:
    player = Player()
    player.pause(True)
    return player


def shown_frames(screen: Screen) -> int:
    """Return how many frames what is shown is made of."""
    look = screen.app.look
    assert look is not None
    return look.scene.snapshot.summary.capture.frames


async def stands_at(screen: Screen, frames: int) -> None:
    await screen.until(lambda: shown_frames(screen) == frames)


def test_what_is_shown_is_what_was_known_then() -> None:
    """At any time: also after going on, back, and on again; without the silence that has not ended yet."""
    player = standing()

    async def look(screen: Screen) -> None:
        for time_s in (5, 25, 12, 29, 7.05, 29.9):
            time_ns = START_NS + int(time_s * S_NS)
            player.go(time_ns)
            expected = scene_at(PLANT, time_ns)
            assert expected is not None
            await stands_at(screen, expected.snapshot.summary.capture.frames)
            shown = screen.app.look
            assert shown is not None
            for key in ("counters", "diag", "intervals", "status"):
                counted = [entry.get(key) for entry in plain(shown.scene.document["lists"])]
                assert counted == [entry.get(key) for entry in plain(expected.document["lists"])], (time_s, key)

    on_replay(PLANT, player, look)


def test_at_the_end_it_is_the_report() -> None:
    async def look(screen: Screen) -> None:
        await screen.until(lambda: "end" in screen.lines[-2])
        await stands_at(screen, FRAMES)
        whole = scene_at(PLANT, None)
        assert whole is not None
        assert screen.app.look is not None
        assert plain(screen.app.look.scene.document) == plain(whole.document)
        assert "✗ 2 now" in screen.lines[0]

    on_replay(PLANT, Player(MOST_RATE), look)


def test_frames_one_by_one_there_and_back() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("4", ".")
        await stands_at(screen, 1)
        await screen.press(*"...,.")
        await stands_at(screen, 4)
        await screen.press(",", ",")
        await stands_at(screen, 2)
        assert "paused 1×" in screen.lines[-2]
        await screen.press(",", ",", ",", ",")
        await stands_at(screen, 1)  # there is nothing before the first one

    on_replay(PLANT, standing(), look)


def test_space_stands_and_goes_on() -> None:
    async def look(screen: Screen) -> None:
        await screen.until(lambda: "▶ 1×" in screen.lines[-2])
        await screen.press("space")
        await screen.until(lambda: "paused" in screen.lines[-2])
        place = screen.app.feed.player
        assert place is not None
        before = place.place.frames
        await screen.pause(0.3)
        assert place.place.frames == before
        await screen.press("space")
        await screen.until(lambda: place.place.frames > before)

    on_replay(PLANT, Player(), look)


def test_to_causes_that_are_to_come_and_back() -> None:
    """They are known though they have not happened yet: a burst of keys goes from one to the next."""

    async def look(screen: Screen) -> None:
        whole = screen.app.feed.whole
        assert whole is not None
        assert whole.snapshot.happened is not None
        begun = sorted({one.since_ns for one in whole.snapshot.happened.causes if one.since_ns is not None})
        assert len(begun) > 3
        player = screen.app.feed.player
        assert player is not None
        await screen.press("}")
        await screen.until(lambda: player.place.at_ns == begun[0])
        await screen.press("}", "}")
        await screen.until(lambda: player.place.at_ns == begun[2] and not player.place.is_going)
        await screen.press("{")
        await screen.until(lambda: player.place.at_ns == begun[1] and not player.place.is_going)

    on_replay(PLANT, standing(), look)


def test_a_part_is_repeated_until_nobody_wants_that() -> None:
    async def look(screen: Screen) -> None:
        player = screen.app.feed.player
        assert player is not None
        player.go(START_NS + 5 * S_NS)
        await screen.until(lambda: not player.place.is_going)
        await screen.press("a")
        player.go(START_NS + 7 * S_NS)
        await screen.until(lambda: not player.place.is_going)
        turns = player.turns
        await screen.press("a")
        await screen.until(lambda: "B" in screen.lines[-2])
        await screen.press("space")
        await screen.until(lambda: player.turns > turns + 2)
        place = player.place
        assert place.b_ns is not None
        assert place.at_ns is None or place.at_ns <= place.b_ns
        await screen.press("a")
        await screen.until(lambda: player.place.at_end)

    on_replay(PLANT, _standing_fast(), look)


def _standing_fast() -> Player:
    player = Player(MOST_RATE)
    player.pause(True)
    return player


def test_rates_by_keys_and_by_the_command_line() -> None:
    async def look(screen: Screen) -> None:
        player = screen.app.feed.player
        assert player is not None
        await screen.press(">", ">")
        await screen.until(lambda: "5×" in screen.lines[-2])
        await screen.press("<", "<", "<", "<", "<", "<", "<", "<")
        await screen.until(lambda: "0.1×" in screen.lines[-2])
        await screen.press(":", *"replay.rate 3.5", "enter")
        await screen.until(lambda: "3.5×" in screen.lines[-2])
        await screen.press(":", *"replay.rate 1000", "enter")
        assert player.place.rate == 3.5
        await screen.press("=")
        await screen.until(lambda: " 1×" in screen.lines[-2])

    on_replay(PLANT, standing(), look)


def test_going_on_at_the_end_begins_again() -> None:
    async def look(screen: Screen) -> None:
        player = screen.app.feed.player
        assert player is not None
        await screen.until(lambda: player.place.at_end)
        await screen.press(".")  # there is nothing behind the end
        await screen.press("space")
        await screen.until(lambda: player.turns == 1)
        await screen.until(lambda: player.place.at_end)

    on_replay(PLANT, Player(MOST_RATE), look)


def test_a_replay_is_a_recording_already() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("R")
        assert screen.app.recording is None

    on_replay(PLANT, standing(), look)
