"""Claims against each other in virtual time: every one wins and loses as specified, and one owns the head."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.world import Entity, World
from tests.generation.heads import (
    INHIBITED,
    Stage,
    act,
    event,
    inhibition,
    looking_at,
    on_the_face,
    statistics,
    world,
)

# -- priorities -------------------------------------------------------------------------------------------------

CLAIMS: dict[str, tuple[Callable[[Stage], None], Callable[[Stage], None]]] = {
    "inhibition": (
        lambda stage: stage.do(lambda arbiter: arbiter.inhibit(INHIBITED)),
        lambda stage: stage.do(lambda arbiter: arbiter.inhibit(None)),
    ),
    "fragment": (
        lambda stage: stage.do(lambda arbiter: arbiter.fragment_gazes("other")),
        lambda stage: stage.do(lambda arbiter: arbiter.fragment_lets_go()),
    ),
    "response": (
        lambda stage: stage.feed(event("e", "started")),
        lambda stage: stage.feed(event("e", "failed")),
    ),
    "hands": (
        lambda stage: stage.feed(act()),
        lambda stage: (stage.feed(act(ends=True)), stage.until(stage.now + 0.8))[0],  # type: ignore[func-returns-value]
    ),
}
ORDER = ("inhibition", "fragment", "response", "hands", "face")
PAIRS = [(high, low) for index, high in enumerate(ORDER) for low in ORDER[index + 1 :]]


@pytest.mark.parametrize(("high", "low"), PAIRS)
def test_a_higher_claim_takes_over_at_once_and_gives_back_after_a_dwell(high: str, low: str) -> None:
    stage = on_the_face(glance_factor=100.0)
    if low != "face":
        CLAIMS[low][0](stage)
    assert stage.owner == low

    stage.until(11.0)
    CLAIMS[high][0](stage)
    taken = stage.owner, low in stage.waiting
    stage.until(12.0)
    CLAIMS[high][1](stage)
    let_go = stage.now
    held = stage.owner
    stage.until(let_go + 0.29)
    still_held = stage.owner
    stage.until(let_go + 0.3)

    assert taken == (high, True)
    assert held == still_held == high
    assert stage.owner == low


@pytest.mark.parametrize(("high", "low"), [pair for pair in PAIRS if pair[1] != "face"])
def test_a_lower_claim_waits(high: str, low: str) -> None:
    stage = on_the_face(glance_factor=100.0)
    CLAIMS[high][0](stage)
    owned = len(stage.owners)
    CLAIMS[low][0](stage)

    assert stage.owner == high
    assert len(stage.owners) == owned
    # A response that comes while a fragment holds the head elsewhere is not even waiting: it is preempted.
    assert (low in stage.waiting) == ((high, low) != ("fragment", "response"))


@pytest.mark.parametrize("higher", ["inhibition", "fragment", "response"])
def test_a_glance_against_the_others(higher: str) -> None:
    stage = on_the_face()
    stage.feed(act())
    stage.until(15.8)
    assert stage.owner == "glance"

    if higher == "response":
        CLAIMS["response"][0](stage)
        assert stage.owner == "glance"  # lower: it waits
        assert "response" in stage.waiting
        stage.until(16.9)
        assert stage.owner == "response"
    else:
        CLAIMS[higher][0](stage)
        assert stage.owner == higher


def test_a_claim_that_comes_back_within_the_dwell_has_never_left() -> None:
    stage = on_the_face()
    stage.feed(event("a", "started"))
    stage.until(11.0)
    stage.feed(event("a", "completed"))
    stage.until(11.2)
    stage.feed(event("b", "started"))
    stage.until(12.0)

    assert stage.owners == [(10.0, "response", "piece")]


# -- what is sent -------------------------------------------------------------------------------------------------


def test_a_fragments_gaze_is_never_fought() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.fragment_gazes("piece"))
    stage.feed(world(speed=0.5))
    stage.until(14.0)
    assert stage.shifts == []
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    stage.until(15.0)

    assert stage.shifts == [(14.3, "maintenance", "hand")]


def test_where_a_fragment_looks_at_a_face_the_base_follows_so_that_its_end_is_no_look_away() -> None:
    stage = on_the_face()
    stage.feed(act())  # the base is on the hand
    stage.do(lambda arbiter: arbiter.fragment_gazes("human"))
    stage.feed(act(ends=True))
    stage.until(14.0)
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    stage.until(15.0)

    assert stage.shifts == [(10.0, "maintenance", "hand"), (10.0, "maintenance", "human")]


def test_beneath_a_fragments_look_at_the_face_the_base_gaze_goes_there_too() -> None:
    stage = on_the_face(glance_factor=100.0)
    stage.feed(act())
    stage.until(11.0)
    stage.do(lambda arbiter: arbiter.fragment_gazes("human"))
    stage.until(12.0)

    assert stage.shifts == [(10.0, "maintenance", "hand"), (11.0, "maintenance", "human")]


def test_an_event_that_a_fragments_gaze_kept_from_being_answered_stays_unanswered() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.fragment_gazes("other"))
    stage.feed(event("e", "started"))
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    stage.until(20.0)

    assert [owner for _, owner, _ in stage.owners] == ["fragment", "face"]


def test_an_event_about_what_the_fragment_looks_at_is_shared_and_then_held() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.fragment_gazes("piece"))
    stage.feed(event("e", "started"), event("e", "succeeded"))
    stage.do(lambda arbiter: arbiter.fragment_lets_go())
    stage.until(20.0)

    assert stage.owners == [(10.0, "fragment", "piece"), (10.3, "response", "piece"), (11.1, "face", "human")]


def test_thinking_averts_the_gaze_until_the_next_fragment() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.think("piece"))
    stage.until(15.0)
    stage.do(lambda arbiter: arbiter.stop_thinking())
    stage.until(16.0)

    assert stage.owners == [(10.0, "fragment", "piece"), (15.3, "face", "human")]
    assert stage.shifts == [(10.0, "maintenance", "piece"), (15.3, "maintenance", "human")]


def test_an_inhibition_with_a_target_moves_the_head_there_and_one_without_leaves_it() -> None:
    stage = on_the_face()
    stage.do(lambda arbiter: arbiter.inhibit(inhibition("target", "piece")))
    stage.do(lambda arbiter: arbiter.inhibit(INHIBITED))
    stage.feed(world(speed=0.5))
    stage.until(20.0)

    assert stage.shifts == [(10.0, "maintenance", "piece")]


def test_a_shift_that_failed_is_tried_again_after_a_pause() -> None:
    stage = on_the_face()
    stage.feed(event("e", "started"))
    stage.until(10.4)
    stage.do(lambda arbiter: arbiter.shift_failed("response-2", 10.4))
    stage.until(12.0)

    assert stage.shifts == [(10.0, "response", "piece"), (11.4, "response", "piece")]


def test_the_person_spoken_to_goes_before_the_one_who_is_nearer() -> None:
    stage = Stage()
    people = tuple(
        Entity(id=id, kind="person", position=place)
        for id, place in [("near", (1.0, 0.0, 1.2)), ("far", (3.0, 0.0, 1.2))]
    )
    stage.feed(World(entities=people))
    stage.do(lambda arbiter: arbiter.speak_to("far"))

    assert stage.owners == [(0.0, "face", "near"), (0.0, "face", "far")]


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
def test_the_head_has_one_owner_and_it_is_never_below_a_waiting_claim(
    story: list[tuple[Callable[[Stage], None], float]],
) -> None:
    stage = Stage()
    for happening, pause in story:
        happening(stage)
        stage.until(stage.now + pause)

    for ruling in stage.rulings:
        priorities = [claim.priority for claim in ruling.waiting]
        assert ruling.owner.kind not in {claim.kind for claim in ruling.waiting}
        assert all(ruling.owner.priority < priority for priority in priorities)
        if ruling.shift:
            assert ruling.shift.target == (ruling.owner.target or "other")  # held where the fragment had it
            assert ruling.owner.kind != "none"
