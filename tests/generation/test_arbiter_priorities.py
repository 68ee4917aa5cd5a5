"""Claims against each other in virtual time: every one wins and loses as specified, and one owns the head."""

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.head.arbiter import LEAST_FIXATION, ON_THE_WAY
from tests.generation.head_stories import check
from tests.generation.heads import (
    INHIBITED,
    Stage,
    act,
    event,
    looking_at,
    on_the_face,
    statistics,
    world,
)
from tests.stories import Story, each

# -- what is sent -------------------------------------------------------------------------------------------------


def test_the_person_spoken_to_goes_before_the_one_who_is_nearer() -> None:
    stage = Stage()
    people = tuple(
        Entity(id=id, kind="person", position=place)
        for id, place in [("near", (1.0, 0.0, 1.2)), ("far", (3.0, 0.0, 1.2))]
    )
    stage.feed(World(entities=people))
    stage.until(1.0)
    stage.do(lambda arbiter: arbiter.speak_to("far"))

    assert stage.owners == [(0.0, "face", "near"), (1.0, "face", "far")]


# -- whatever happens ---------------------------------------------------------------------------------------------

happenings = st.sampled_from(
    [
        lambda stage: stage.feed(world(speed=0.4)),
        lambda stage: stage.feed(world(speed=0.0)),
        lambda stage: stage.feed(world(person=False)),
        lambda stage: stage.feed(act()),
        lambda stage: stage.feed(act(ends=True)),
        lambda stage: stage.feed(event("e", "started")),
        lambda stage: stage.feed(event("e", "succeeded")),
        lambda stage: stage.feed(event("f", "started", objects=("piece", "other"))),
        lambda stage: stage.feed(event("f", "failed")),
        lambda stage: stage.feed(looking_at((0.6, 0.0, 0.7), "table")),
        lambda stage: stage.feed(statistics(2.0)),
        lambda stage: stage.do(lambda arbiter: arbiter.fragment_gazes("other")),
        lambda stage: stage.do(lambda arbiter: arbiter.fragment_lets_go()),
        lambda stage: stage.do(lambda arbiter: arbiter.inhibit(INHIBITED)),
        lambda stage: stage.do(lambda arbiter: arbiter.inhibit(None)),
        lambda stage: stage.do(lambda arbiter: arbiter.think("piece")),
        lambda stage: stage.do(lambda arbiter: arbiter.stop_thinking()),
    ]
)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(happenings, st.floats(0.0, 3.0)), max_size=25))
def test_the_head_has_one_owner_and_it_is_below_a_waiting_claim_only_while_its_look_is_too_brief(
    story: list[tuple[Callable[[Stage], None], float]],
) -> None:
    stage = Stage()
    for happening, pause in story:
        happening(stage)
        stage.until(stage.now + pause)

    began, target = 0.0, ""
    for now, ruling in stage.timed:
        if ruling.owner.target != target:
            began, target = now, ruling.owner.target
        assert ruling.owner.kind not in {claim.kind for claim in ruling.waiting}
        above = [claim for claim in ruling.waiting if claim.priority < ruling.owner.priority]
        assert not above or (now < began + ON_THE_WAY and above[0].kind not in ("inhibition", "fragment"))
        if ruling.shift:
            assert ruling.shift.target == (ruling.owner.target or "other")  # held where the fragment had it
            assert ruling.owner.kind != "none"


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(happenings, st.floats(0.0, 3.0)), max_size=25))
def test_no_look_is_brief_but_by_an_order(story: list[tuple[Callable[[Stage], None], float]]) -> None:
    """There is no body here: the eyes are on what is to be looked at from the order on."""
    stage = Stage()
    for happening, pause in story:
        if "looking_at" not in happening.__code__.co_names:
            happening(stage)
        stage.until(stage.now + pause)

    began, target = -1.0, ""
    for now, ruling in stage.timed:
        if ruling.owner.target != target:
            is_ordered = ruling.owner.kind in ("inhibition", "fragment") or not target
            assert is_ordered or now >= began + LEAST_FIXATION - 1e-9
            began, target = now, ruling.owner.target


def test_a_look_that_is_on_its_way_arrives_and_lasts_though_the_claim_is_gone() -> None:
    stage = on_the_face()
    stage.feed(looking_at((1.3, 0.0, 1.2), "human"))
    stage.feed(act())
    stage.until(10.1)
    stage.feed(act(ends=True), event("e", "started", kind="mutual_facial_gaze", objects=()))
    stage.feed(looking_at((0.9, 0.0, 0.9)))
    stage.until(10.4)
    stage.feed(looking_at((0.8, 0.0, 0.7), "hand"))
    stage.until(12.0)

    assert stage.shifts == [(10.0, "maintenance", "hand"), (10.7, "response", "human")]


def test_a_response_elsewhere_than_a_fragment_looks_does_not_even_wait() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.fragment_gazes("other"))
    stage.feed(event("e", "started"))

    assert (stage.owner, stage.waiting) == ("fragment", ["face"])


# -- as stories: `head_stories.py` --------------------------------------------------------------------------------

STORIES = """
a claim that comes back within the dwell has never left
    10 event a started; 11 event a completed; 11.2 event b started; 12 time
    owners: 10 response piece
    shifts: 10 response piece

a fragment's gaze is never fought
    10 fragment gazes piece; 10 hand 0.5; 14 fragment over; 15 time
    owners: 10 fragment piece, 14.3 hands hand
    shifts: 14.3 maintenance hand

where a fragment looks at a face the base follows so that its end is no look away
    10 act; 10 fragment gazes human; 10 act over; 14 fragment over; 15 time
    owners: 10 hands hand, 10 fragment human, 14.3 face human
    shifts: 10 maintenance hand, 10 maintenance human

beneath a fragment's look at the face the base gaze goes there too
    with glance_factor=100
    10 act; 11 fragment gazes human; 12 time
    owners: 10 hands hand, 11 fragment human
    shifts: 10 maintenance hand, 11 maintenance human

an event that a fragment's gaze kept from being answered stays unanswered
    10 fragment gazes other; 10 event e started; 10 fragment over; 20 time
    owners: 10 fragment other, 10.3 face human
    shifts: none

an event about what the fragment looks at is shared and then held
    10 fragment gazes piece; 10 event e started; 10 event e succeeded; 10 fragment over; 20 time
    owners: 10 fragment piece, 10.3 response piece, 11.1 face human
    shifts: 10.3 response piece, 11.1 maintenance human

thinking averts the gaze until the next fragment
    10 think piece; 15 thought; 16 time
    owners: 10 fragment piece, 15.3 face human
    shifts: 10 maintenance piece, 15.3 maintenance human

an inhibition with a target moves the head there and one without leaves it
    10 inhibit target piece; 10 inhibit hold; 10 hand 0.5; 20 time
    owners: 10 inhibition piece, 10 inhibition
    shifts: 10 maintenance piece

a shift that failed is tried again after a pause
    10 event e started; 10.4 unreached response-2; 12 time
    owners: 10 response piece
    shifts: 10 response piece, 11.4 response piece
"""


@each(STORIES)
def test_what_is_sent(story: Story) -> None:
    check(story)
