import sys
from collections.abc import Callable
from io import StringIO
from types import FrameType
from typing import Any, TypeVar

import msgspec
import pytest
from msgspec.structs import replace
from rich.console import Console

from engage_hri.schemas.blocks import (
    BlockProgress,
    Held,
    Hold,
    WarningFeedback,
)
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.services.console import view
from engage_hri.services.console.terminal import tally
from engage_hri.services.console.terminal.log import Telling, line
from engage_hri.services.console.terminal.render import render
from engage_hri.services.console.web.picture import Picture
from tests.console.scenes import SCENE, at, event, fed


@pytest.fixture
def scene() -> view.Scene:
    return fed(view.feed, view.empty("robot", 10.0))


def drawn(scene: view.Scene, width: int = 120, height: int | None = None) -> str:
    console = Console(width=width, record=True, file=StringIO())
    console.print(render(scene, width, height))
    return console.export_text()


def test_words_come_one_by_one() -> None:
    texts = []
    scene = view.empty("robot", 10.0)
    for message, time in SCENE:
        scene = view.feed(scene, message, time)
        if scene.said and (not texts or texts[-1] != scene.said[-1].text):
            texts.append(scene.said[-1].text)

    assert texts == ["", "a", "a rectangle"]


def test_an_utterance_closes_when_the_voice_stops(scene: view.Scene) -> None:
    assert [(u.actor, u.text, u.open) for u in scene.said] == [("robot", "a rectangle", False)]


def test_a_new_look_ends_the_last_one(scene: view.Scene) -> None:
    scene = view.feed(scene, ActionBegan(actor="human", action="look", at=at(12.0), targets=("table",)), 12.0)

    assert scene.actor("human").doing == (view.Doing("look", ("table",), 12.0),)


def test_two_arms_may_point_at_two_things() -> None:
    scene = view.empty("robot", 0.0)
    for target in ("red", "blue"):
        scene = view.feed(scene, ActionBegan(actor="human", action="point", at=at(1.0), targets=(target,)), 1.0)
    scene = view.feed(scene, ActionEnded(actor="human", action="point", at=at(2.0), targets=("red",)), 2.0)

    assert [doing.targets for doing in scene.actor("human").doing] == [("blue",)]


def test_who_is_lost_does_nothing(scene: view.Scene) -> None:
    scene = view.feed(scene, ActorLost(actor="human", at=at(13.0)), 13.0)

    assert not scene.actor("human").present
    assert scene.actor("human").doing == ()


def test_a_warning_in_the_same_words_for_another_behavior_of_a_block_is_no_news(scene: view.Scene) -> None:
    def warning(behavior: str, block: str = "b") -> WarningFeedback:
        text = "'human' has gone"
        return WarningFeedback(block=block, behavior=behavior, kind="CANNOT_CREATE_BEHAVIOR", message=text)

    lines, picture = [], Picture("robot", 10.0)
    start = BlockProgress(block="b", progress="start", at=at(14.0))
    for message in (warning("e1"), warning("e2"), warning("turn"), warning("e", "c"), start, warning("e1")):
        before, scene = scene, view.feed(scene, message, 13.0)
        lines.append(line(message, before, scene, 13.0, Telling()))
        picture.feed(message, 13.0, 13.0)

    places = ["b:e1", "c:e", "b:e1"]
    assert [text.split()[3] for text in lines if text] == [f"{place}:" for place in places]
    assert [note.text.split()[1] for note in picture._notes] == [f"{place}:" for place in places]


def test_a_completed_event_keeps_its_decision(scene: view.Scene) -> None:
    scene = fed(view.feed, scene, [event("e1", "completed", 13.0, started=at(11.0), duration=1.1)])

    assert [(row.event.state, row.event.delay) for row in scene.events] == [("succeeded", 0.9)]


def test_the_view_says_who_speaks_who_looks_where_and_who_owns_the_head(scene: view.Scene) -> None:
    text = drawn(scene)

    for expected in (
        "robot: a rectangle", "looks at rectangle", "looks at the robot", "fragment: rectangle", "one every 4.20 s",
        "directed gaze", "robot→human", "succeeded 0.90 s",
    ):  # fmt: skip
        assert expected in text


SIZES = [(60, 15), (80, 24), (100, 32), (120, 40), (200, 60), (40, 10)]


@pytest.mark.parametrize("empty", [True, False])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_view_is_exactly_as_large_as_the_terminal(
    scene: view.Scene, width: int, height: int, empty: bool
) -> None:
    lines = drawn(view.empty("robot", 0.0) if empty else scene, width, height).splitlines()

    assert max(map(len, lines)) <= width
    assert len(lines) == height


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_events_fill_the_height_there_is(width: int, height: int) -> None:
    scene = view.empty("robot", 0.0)
    for number in range(99):
        scene = view.feed(
            scene, *event(f"e{number}", "succeeded", float(number), objects=(f"p{number}",), delay=0.25)
        )

    shown = [line for line in drawn(scene, width, height).splitlines() if "✓" in line]

    assert "1:38.0" in shown[-1]
    assert width < 60 or "p98" in shown[-1]
    assert width < 60 or "succeeded" in shown[-1]
    assert len(shown) >= height // 2, "half of the picture at least"


def test_a_small_view_has_who_does_what_the_words_and_the_newest_event(scene: view.Scene) -> None:
    text = drawn(scene, 60, 15)

    for expected in ("robot looks at rectangle", "human looks at the robot", "robot: a rectangle", "✓", "succeeded"):
        assert expected in text


def test_what_somebody_does_beside_looking_is_told_after_it(scene: view.Scene) -> None:
    for action in ("point", "nod"):
        scene = view.feed(scene, ActionBegan(actor="human", action=action, at=at(12.0), targets=("cup",)), 12.0)
    scene = view.feed(scene, ActionBegan(actor="human", action="look", at=at(12.0)), 12.0)

    assert "human looks away, points at cup, nods to cup" in drawn(scene, 200)


@pytest.mark.parametrize("evil", ["a\nb", "\x1b[2J", "\x9b31m", "\u202eabc", "a\rb"])
@pytest.mark.parametrize(("width", "height"), [(60, 15), (120, 40)])
def test_what_a_terminal_would_obey_is_spelled_out(evil: str, width: int, height: int) -> None:
    scene = view.empty("robot", 0.0)
    scene = view.feed(scene, ActionBegan(actor=evil, action="look", at=at(1.0), targets=(evil,)), 1.0)
    scene = view.feed(scene, BlockProgress(block=evil, progress="start", at=at(1.0)), 1.0)
    scene = fed(view.feed, scene, [event("e1", "started", 2.0, responder=evil, objects=(evil,))])
    said = (view.UtteranceInView(actor=evil, began=0.0, text=evil),)
    scene = replace(scene, owner=Claim(kind="face", priority=6, target=evil), notes=(evil,), said=said)

    lines = drawn(scene, width, height).split("\n")

    assert len(lines) == height + 1
    assert all(line.isprintable() for line in lines)


@pytest.mark.parametrize(("width", "height"), [(5, 3), (10, 5), (1, 1)])
def test_a_tiny_terminal_gets_no_more_lines_for_it(scene: view.Scene, width: int, height: int) -> None:
    scene = replace(
        scene, said=tuple(view.UtteranceInView(actor="a", began=0.0, text="word " * 50) for _ in range(40))
    )

    assert len(drawn(scene, width, height).splitlines()) <= height + 2


def test_the_newest_warning_is_the_one_a_small_view_has(scene: view.Scene) -> None:
    text = drawn(replace(scene, notes=("older", "newer")), 60, 15)

    assert "newer" in text
    assert "older" not in text


def test_the_view_has_no_word_that_a_visitor_must_look_up(scene: view.Scene) -> None:
    assert not [word for word in ("MTBCE", "slip", "sync point") if word in drawn(scene)]


def test_an_empty_scene_can_be_drawn() -> None:
    assert drawn(view.empty("robot", 0.0)).startswith("engage 0:00.0")


def test_brackets_in_ids_are_not_markup() -> None:
    scene = view.feed(
        view.empty("robot", 0.0), ActionBegan(actor="[red]", action="look", at=at(1.0), targets=("[/]",)), 1.0
    )
    scene = view.feed(scene, BlockProgress(block="[/b]", progress="start", at=at(1.0)), 1.0)
    scene = fed(view.feed, scene, [event("e1", "started", 2.0, responder="[/x]", objects=("[/y]",))])
    scene = msgspec.structs.replace(scene, owner=Claim(kind="face", priority=6, target="[bold]"), notes=("[/x]",))

    assert "[red]" in drawn(scene)


def test_the_newest_event_and_words_are_there_on_a_small_terminal() -> None:
    scene = view.empty("robot", 0.0)
    for number in range(30):
        scene = view.feed(scene, *event(f"e{number}", "started", float(number), objects=(f"piece-{number}",)))
    said = tuple(view.UtteranceInView(actor="robot", began=0.0, text="so many words " * 6 + str(n)) for n in range(5))
    scene = msgspec.structs.replace(scene, said=said, notes=("beware",))

    text = drawn(scene, width=80, height=24)

    assert len(text.rstrip("\n").splitlines()) == 24
    assert "piece-29" in text
    assert "words 4" in text
    assert "! beware" in text
    assert "piece-9" not in text


def test_people_look_at_things_away_or_around(scene: view.Scene) -> None:
    looks = []
    for action in (ActionBegan(actor="human", action="look", at=at(12.0), targets=("table",)),
                   ActionBegan(actor="human", action="look", at=at(13.0)),
                   ActionEnded(actor="human", action="look", at=at(14.0))):  # fmt: skip
        scene = view.feed(scene, action, 14.0)
        looks.append(next(line for line in drawn(scene).splitlines() if "human" in line)[:40])

    assert [("looks at table" in looks[0]), ("looks away" in looks[1]), ("looks around" in looks[2])] == [True] * 3


Fed = TypeVar("Fed", view.Scene, tally.Tally)


def instructions(feed: Callable[[Fed, Any, float], Fed], before: Fed, message: object) -> tuple[int, Fed]:
    """Number of Python's own instructions that a message takes, and what comes of it."""
    count = 0

    def counted(frame: FrameType, event: str, argument: object) -> Callable[..., object]:
        nonlocal count
        frame.f_trace_opcodes = True
        count += event == "opcode"
        return counted

    tracing = sys.gettrace()
    sys.settrace(counted)
    try:
        after = feed(before, message, 1.5)
    finally:
        sys.settrace(tracing)
    return count, after


def test_an_action_costs_the_view_no_look_at_all_who_are_here() -> None:
    def work(people: int) -> int:
        scene = view.empty("robot", 0.0)
        for number in range(people):
            scene = view.feed(scene, ActorFound(actor=f"p{number}", at=at(0.0)), 0.0)
        count, scene = instructions(view.feed, scene, ActionBegan(actor="p7", action="nod", at=at(1.0)))
        assert [doing.action for doing in scene.actor("p7").doing] == ["nod"]
        assert len(scene.actors) == people
        return count

    assert work(1000) == work(10)


def test_a_decision_costs_the_tally_no_look_at_all_events_of_the_session() -> None:
    def work(events: int) -> int:
        told = tally.empty(0.0)
        for number in range(events):
            told = tally.feed(told, event(f"e{number}", "started", 0.0)[0], 0.0)
        decided = event("e7", "succeeded", 1.0)[0]
        count, told = instructions(tally.feed, told, decided)
        assert [event.state for event in told.events.values()][6:9] == ["started", "succeeded", "started"]
        return count

    assert work(1000) == work(10)


def test_what_people_do_is_drawn(scene: view.Scene) -> None:
    for message in (
        ActionBegan(actor="human", action="point", at=at(13.0), targets=("trapezoid",)),
        ActionBegan(actor="human", action="act", at=at(13.0), targets=("blue-square",)),
        ActionBegan(actor="human", action="nod", at=at(13.0)),
    ):
        scene = view.feed(scene, message, 13.0)
    text = " ".join(drawn(scene, width=240).split())

    assert "points at trapezoid" in text
    assert "moves blue-square" in text
    assert "nods" in text
    assert "has left" in drawn(view.feed(scene, ActorLost(actor="human", at=at(14.0)), 20.0))


def test_what_is_held_is_drawn_as_long_as_it_is(scene: view.Scene) -> None:
    holds = (Hold(since=at(12.0), until=at(72.0)), Hold(block="b", behavior="g", since=at(13.0), until=at(73.0)))

    held = view.feed(scene, Held(at=at(13.0), holds=holds), 13.0)
    later = view.feed(held, Held(at=at(14.0)), 14.0)

    assert "everything for 1.00 s, b: g for 0.00 s" in drawn(held)
    assert "everything for" not in drawn(later)


def test_who_waits_for_the_head_is_drawn(scene: view.Scene) -> None:
    owner = Claim(kind="fragment", priority=2, target="rectangle")
    waiting = (Claim(kind="hands", priority=5), Claim(kind="face", priority=6, target="human"))

    scene = view.feed(scene, HeadOwner(owner=owner, since=at(13.0), waiting=waiting), 13.0)

    assert "waiting: hands, face" in drawn(scene)
