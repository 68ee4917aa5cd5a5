"""The table of claims, row against row: who has the head when, and what waits, to the millisecond.

For each pair: the lower holds and the higher arrives, the higher holds and the lower arrives; then the higher ends.
"""

from collections.abc import Callable
from typing import NamedTuple

import pytest

from engage_hri.schemas.perception import ActorLost
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.world import Entity, World
from tests.generation.head_stories import check
from tests.generation.heads import AT, Stage, act, event, inhibition, on_the_face, statistics, world
from tests.stories import Story, each

Change = Callable[[Stage], None]
DWELL = 0.3


class Row(NamedTuple):
    """begins, ends: what brings and takes the claim. comes_after, goes_after: how long it takes to follow."""

    priority: int
    target: str
    begins: Change
    ends: Change
    comes_after: float = 0.0
    goes_after: float = 0.0


def nothing(stage: Stage) -> None:
    """Time alone does it."""


ROWS = {
    "inhibition": Row(
        1,
        "piece",
        lambda stage: stage.do(lambda arbiter: arbiter.inhibit(inhibition("target", "piece"))),
        lambda stage: stage.do(lambda arbiter: arbiter.inhibit(None)),
    ),
    "fragment": Row(
        2,
        "piece",
        lambda stage: stage.do(lambda arbiter: arbiter.fragment_gazes("piece")),
        lambda stage: stage.do(lambda arbiter: arbiter.fragment_lets_go()),
    ),
    "glance": Row(3, "human", nothing, nothing, comes_after=5.7, goes_after=0.9),
    "response": Row(
        4,
        "piece",
        lambda stage: stage.feed(event("e", "started")),
        lambda stage: stage.feed(event("e", "failed")),
    ),
    "hands": Row(
        5,
        "hand",
        lambda stage: stage.feed(world(speed=0.3)),
        lambda stage: stage.feed(world(speed=0.0)),
        comes_after=0.2,
        goes_after=0.8,
    ),
    "face": Row(6, "human", nothing, nothing),
}
PAIRS = [(high, low) for high in ROWS for low in ROWS if ROWS[high].priority < ROWS[low].priority]
COMMANDED = [pair for pair in PAIRS if "glance" not in pair]


def since(at: float, kind: str) -> tuple[float, str, str]:
    return round(at, 6), kind, ROWS[kind].target


def owned(stage: Stage) -> list[tuple[float, str, str]]:
    """Who has had the head since the face, which has it first."""
    first, *later = stage.owners
    return later if first[1] == "face" else stage.owners


@pytest.mark.parametrize(("high", "low"), COMMANDED)
def test_the_higher_takes_over_at_once_and_the_lower_has_the_head_back_after_the_dwell(high: str, low: str) -> None:
    stage = on_the_face(glance_factor=100.0)
    ROWS[low].begins(stage)
    stage.until(12.0)
    ROWS[high].begins(stage)
    stage.until(13.0)
    waiting = stage.waiting
    ROWS[high].ends(stage)
    stage.until(20.0)

    taken, ended = 12.0 + ROWS[high].comes_after, 13.0 + ROWS[high].goes_after
    first = [since(10.0 + ROWS[low].comes_after, low)] if low != "face" else []
    assert owned(stage) == [*first, since(taken, high), since(ended + DWELL, low)]
    assert low in waiting


@pytest.mark.parametrize(("high", "low"), COMMANDED)
def test_the_lower_waits_until_the_higher_has_ended_and_the_dwell_is_over(high: str, low: str) -> None:
    stage = on_the_face(glance_factor=100.0)
    ROWS[high].begins(stage)
    stage.until(12.0)
    ROWS[low].begins(stage)
    stage.until(13.0)
    waiting = stage.waiting
    ROWS[high].ends(stage)
    stage.until(20.0)

    ended = 13.0 + ROWS[high].goes_after
    assert owned(stage) == [since(10.0 + ROWS[high].comes_after, high), since(ended + DWELL, low)]
    assert low in waiting


@pytest.mark.parametrize("low", ["response", "hands"])
def test_a_glance_takes_over_at_once_and_gives_back_after_its_time_and_the_dwell(low: str) -> None:
    stage = on_the_face()
    ROWS[low].begins(stage)
    left = 10.0 + ROWS[low].comes_after
    stage.until(left + 6.0)
    waiting = stage.waiting
    stage.until(left + 8.0)

    assert owned(stage) == [since(left, low), since(left + 5.7, "glance"), since(left + 5.7 + 0.9 + DWELL, low)]
    assert low in waiting


@pytest.mark.parametrize("low", ["response", "hands"])
def test_what_comes_during_a_glance_waits_for_its_end_and_the_dwell(low: str) -> None:
    other = "hands" if low == "response" else "response"
    stage = on_the_face()
    ROWS[other].begins(stage)
    glance = 10.0 + ROWS[other].comes_after + 5.7
    stage.until(glance + 0.1)
    ROWS[low].begins(stage)
    ROWS[other].ends(stage)
    stage.until(glance + 0.5)
    waiting = stage.waiting
    stage.until(glance + 3.0)

    assert since(glance + 0.9 + DWELL, low) in stage.owners
    assert low in waiting


@pytest.mark.parametrize("high", ["inhibition", "fragment"])
def test_a_glance_that_is_due_waits_for_what_is_higher(high: str) -> None:
    stage = on_the_face()
    ROWS[high].begins(stage)
    stage.until(20.0)
    waiting = stage.waiting
    ROWS[high].ends(stage)
    stage.until(20.0 + DWELL + 0.9 + DWELL)

    assert stage.owners == [
        since(10.0, high),
        since(20.0 + DWELL, "glance"),
        since(20.0 + DWELL + 0.9 + DWELL, "face"),
    ]
    assert waiting == ["glance", "face"]


@pytest.mark.parametrize("high", ["inhibition", "fragment"])
def test_a_glance_that_is_cut_short_is_over(high: str) -> None:
    stage = on_the_face()
    ROWS["hands"].begins(stage)
    glance = 10.2 + 5.7
    stage.until(glance + 0.4)
    ROWS[high].begins(stage)
    stage.until(glance + 1.0)
    ROWS[high].ends(stage)
    stage.until(glance + 5.0)

    assert owned(stage)[1:] == [
        since(glance, "glance"),
        since(glance + 0.4, high),
        since(glance + 1.0 + DWELL, "hands"),
    ]


def test_what_waits_is_told_from_the_highest_to_the_lowest_with_its_reason() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.inhibit(inhibition()))
    stage.feed(world(speed=0.3), event("e", "started"))
    stage.until(10.2)
    stage.do(lambda arbiter: arbiter.fragment_gazes("other", "look"))

    ruling = stage.rulings[-1]
    assert ruling.changed
    assert ruling.since == 10.0
    claims = (ruling.owner, *ruling.waiting)
    assert [(claim.kind, claim.target, claim.reason) for claim in claims] == [
        ("inhibition", "", "manager: hold"),
        ("fragment", "other", "look"),
        ("response", "piece", "directed gaze of human"),
        ("hands", "hand", "moves"),
        ("face", "human", "nearest when it came"),
    ]
    assert sorted(claim.priority for claim in claims) == [claim.priority for claim in claims]


def test_the_first_ruling_is_news_even_if_nobody_is_there() -> None:
    stage = Stage()
    stage.rule()
    stage.rule()

    assert [(ruling.owner.kind, ruling.changed) for ruling in stage.rulings] == [("none", True), ("none", False)]


# -- inhibition by mode -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "target", "shifts"),
    [
        ("release", "", []),  # the fragment's gaze is aborted, and the head free
        ("hold", "", [(11.0, "maintenance", "piece")]),  # the base gaze goes to where the aborted one was
        ("target", "other", [(11.0, "maintenance", "other")]),
    ],
)
def test_an_inhibition_during_a_fragments_gaze(mode: str, target: str, shifts: list[tuple[float, str, str]]) -> None:
    stage = on_the_face(glance_factor=100.0)
    ROWS["fragment"].begins(stage)
    stage.until(11.0)
    stage.do(lambda arbiter: arbiter.inhibit(inhibition(mode, target)))
    stage.do(lambda arbiter: arbiter.fragment_rests())  # aborted
    stage.until(14.0)
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    stage.do(lambda arbiter: arbiter.inhibit(None))
    stage.until(20.0)

    back = [(14.3, "maintenance", "human")] if shifts else []
    assert stage.shifts == shifts + back
    assert stage.owners[1:] == [(11.0, "inhibition", target), (14.3, "face", "human")]


# -- people and hands ---------------------------------------------------------------------------------------------


def people(**distances: float) -> World:
    faces = [Entity(id=id, kind="person", position=(x, 0.0, 1.2)) for id, x in distances.items()]
    return World(entities=tuple(faces))


def test_of_several_people_the_head_stays_with_one_while_they_move_about() -> None:
    stage = Stage()
    stage.feed(people(ann=1.0, bob=2.0))
    stage.feed(people(ann=2.1, bob=2.0))
    stage.until(5.0)
    stage.feed(people(bob=2.0))
    stage.until(10.0)
    stage.feed(people(ann=1.0, bob=2.0))

    assert stage.owners == [(0.0, "face", "ann"), (7.0, "face", "bob")]


def test_the_partner_is_left_when_lost_and_found_again() -> None:
    stage = Stage()
    stage.do(lambda arbiter: arbiter.speak_to("bob"))
    stage.owners.clear()
    stage.feed(people(ann=1.0, bob=2.0))
    stage.until(1.0)
    stage.feed(people(ann=1.0))
    stage.until(9.0)
    stage.feed(people(ann=1.0, bob=2.0))

    assert stage.owners == [(0.0, "face", "bob"), (3.0, "face", "ann"), (9.0, "face", "bob")]


def test_of_several_who_were_asked_each_is_looked_at_in_turn_until_one_is_left() -> None:
    def asked(who: str, state: str = "started") -> ConnectionEvent:
        return event(who, state, kind="adjacency_pair", initiator="robot", responder=who, objects=())

    stage = Stage()
    stage.feed(people(ann=1.0, bob=1.1, cy=1.2))
    stage.do(lambda arbiter: arbiter.speak_to("ann"))
    stage.feed(asked("ann"), asked("bob"), asked("cy"))
    stage.do(lambda arbiter: arbiter.wait_for_answers())
    stage.until(4.0)
    stage.feed(asked("bob", "failed"), asked("cy", "failed"))
    stage.until(5.0)

    assert stage.owners == [
        (0.0, "face", "ann"), (0.8, "face", "bob"), (1.6, "face", "cy"),
        (2.4, "face", "ann"), (3.6, "face", "bob"), (4.4, "face", "ann"),
    ]  # fmt: skip


def test_whose_other_id_becomes_known_is_looked_at_on() -> None:
    """By the face, by a fragment, and by a look away to think: none of them aims at an id that is in no world."""
    stage = Stage()
    stage.do(lambda arbiter: arbiter.speak_to("bob2"))
    stage.feed(people(bob2=1.0))
    stage.do(lambda arbiter: arbiter.think("bob2"))
    stage.do(lambda arbiter: arbiter.fragment_gazes("bob2"))
    stage.do(lambda arbiter: arbiter.join("bob2", "bob"))
    stage.feed(people(bob=1.0))
    owners = [stage.owners[-1]]
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    owners.append(stage.owners[-1])
    stage.do(lambda arbiter: arbiter.stop_thinking())
    stage.until(1.0)
    stage.do(lambda arbiter: arbiter.join("eve", "ann"))  # nobody's order holds the head

    assert [target for _, _, target in (*owners, stage.owners[-1])] == ["bob"] * 3


def test_the_robots_own_hand_and_face_are_not_followed() -> None:
    stage = Stage()
    hand = Entity(id="arm", kind="hand", owner="robot", position=(0.3, 0.0, 0.8), velocity=(0.5, 0.0, 0.0))
    stage.feed(World(entities=(Entity(id="robot", kind="person", position=(0.0, 0.0, 1.2)), hand)))
    stage.until(5.0)

    assert stage.owners == [(0.0, "none", "")]


def test_two_manipulations_of_one_person_end_one_by_one() -> None:
    stage = on_the_face(glance_factor=100.0)
    other = {"actor": "human", "action": "act", "targets": ("other",), "at": AT}
    stage.feed(act(), type(act())(**other))  # type: ignore[arg-type]
    stage.until(11.0)
    stage.feed(act(ends=True))
    stage.until(14.0)
    assert stage.owner == "hands"
    stage.feed(ActorLost(actor="human", at=AT))
    stage.until(16.0)

    assert owned(stage)[1] == (15.1, "face", "human")


def test_five_events_are_five_without_our_own_glances() -> None:
    stage = on_the_face()
    for number in range(3):
        stage.feed(event(f"s-{number}", "started", cause="maintenance", initiator="robot", responder="human"))
    stage.feed(statistics(3.0, events=7), act())
    stage.until(20.0)

    assert owned(stage)[1] == (15.7, "glance", "human")


# -- as stories: `head_stories.py` --------------------------------------------------------------------------------

STORIES = """
on a face there is no glance whoever has it there
    10 fragment gazes human; 60 inhibit target human; 120 time
    owners: 10 fragment human, 60 inhibition human
    shifts: none

hold after target stays with the target
    10 fragment gazes piece; 10 inhibit target other; 10 inhibit hold; 20 time
    owners: 10 fragment piece, 10 inhibition other, 10 inhibition
    shifts: 10 maintenance other

between the gazes of a block the head is the fragment's and on the base gaze
    with glance_factor=100
    10 fragment gazes piece; 11 fragment rests; 11 hand 0.3; 14 fragment gazes other; 15 fragment over; 16 time
    owners: 10 fragment piece, 11 fragment human, 14 fragment other, 15.3 hands hand
    shifts: 15.3 maintenance hand

a target out of reach keeps no other waiting
    10 event e started; 10 unreached response-2; 10.4 inhibit target other; 10.6 inhibit over; 12 time
    owners: 10 response piece, 10.4 inhibition other, 10.9 response piece
    shifts: 10 response piece, 10.4 maintenance other, 11 response piece

an outcome of a shift that another has followed says nothing
    10 event e started; 10.1 inhibit target other; 10.1 unreached response-2; 15 time
    owners: 10 response piece, 10.1 inhibition other
    shifts: 10 response piece, 10.1 maintenance other

another body is told where to look
    10 body lost
    owners: 10 face human
    shifts: 10 maintenance human

without recognition no response lasts
    10 event e started; 11 recognition lost; 12 time
    owners: 10 response piece, 11.3 face human
    shifts: 10 response piece, 11.3 maintenance human
"""


@each(STORIES)
def test_the_head(story: Story) -> None:
    check(story)
