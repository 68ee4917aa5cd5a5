"""Generation that stood still itself: it hears what came meanwhile before it gives up others, and blames nobody."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import session_of
from engage_hri.services.bus.deadlines import LATE, Sight
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns import endings
from engage_hri.services.generation.turns.robot_turns import RobotTurns
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.requests.serving import GRACE
from tests.generation.partners import TABLE, stage
from tests.generation.test_service import refers, says
from tests.generation.test_turn_endings import into
from tests.generation.test_turn_policy import fragment
from tests.generation.turns import robot_turns, seen
from tests.standing_still import stand_still

CONFIG = GenerationConfig(decision_patience=3.0)
SOON, TOO_LATE = 0.5 * LATE, 2.0 * LATE


def silent(sight: Sight) -> RobotTurns:
    """An open turn whose speaker has said nothing since 3.0; it has ten seconds, until 13.0."""
    turns = robot_turns(sight)
    turns.accept(fragment("a", "beginning"), "human", "manager", "1")
    turns.fragment_ended("a", complete=True, now=3.0)
    assert turns.tick(3.0) is None
    return turns


@pytest.mark.parametrize("woke", [13.06, 13.5, 15.0, 60.0])
def test_a_speaker_whose_words_came_while_generation_stood_still_goes_on_with_its_turn(woke: float) -> None:
    turns = silent(Sight("generation"))

    assert turns.tick(woke) is None
    assert turns.accept(fragment("b", "middle"), "", "manager", "1").turn == "a"


def test_the_silence_of_a_speaker_is_counted_without_the_time_for_which_generation_stood_still() -> None:
    """Another deadline of the process has told that it stood still from 5 to 8."""
    turns = silent(sight := Sight("generation"))
    sight.look(8.0, 5.0)

    assert turns.tick(13.0) is None
    assert turns.deadline == 16.0
    assert turns.tick(15.99) is None
    assert turns.tick(16.0) is not None


@pytest.mark.parametrize(
    ("unlinked_at", "slept", "cause", "whose"),
    [
        (float("-inf"), 0.0, "late", "manager"),
        (2.0, 0.0, "late", "manager"),
        (5.0, 0.0, "unlinked", "router"),
        (float("-inf"), 2.0, "frozen", "generation"),
    ],
)
def test_a_silence_is_a_speakers_unless_generation_stood_still_or_had_no_router(
    unlinked_at: float, slept: float, cause: str, whose: str
) -> None:
    turns = silent(Sight("generation", lambda: unlinked_at))
    if slept:
        assert turns.tick(13.0 + slept) is None
    aborted = turns.tick(13.0 + slept + (LATE if slept else 0.0))

    assert aborted is not None
    assert (aborted.why.cause, aborted.why.whose) == (cause, whose)
    assert aborted.why.reason.startswith("silence for 10 s")


@pytest.mark.parametrize("is_back", [True, False])
def test_a_person_who_came_back_while_generation_stood_still_has_not_left(is_back: bool) -> None:
    turns = robot_turns()
    turns.accept(fragment("a", "beginning"), "human", "manager", "1")
    turns.feed(seen(), 1.0)
    assert turns.tick(1.0) is None
    assert turns.tick(4.5) is None
    if is_back:
        turns.feed(seen("human"), 4.51)

    assert (turns.tick(4.5 + LATE) is None) == is_back


@pytest.mark.parametrize("has_ended", [True, False])
def test_a_person_who_fell_silent_while_generation_stood_still_has_not_taken_the_floor(has_ended: bool) -> None:
    turns = robot_turns(barge_in=0.8)
    turns.accept(fragment("a", "full"), "human", "manager", "1")
    turns.fragment_begins("a")
    turns.feed(into("open"), 2.0)
    assert turns.tick(2.0) is None
    assert turns.tick(5.0) is None
    if has_ended:
        turns.feed(into("backchannel"), 5.01)

    assert (turns.tick(5.0 + LATE) is None) == has_ended


@pytest.mark.parametrize(("came", "is_decided"), [(SOON, True), (TOO_LATE, False)])
async def test_a_decision_that_came_while_generation_stood_still_is_heard_first(
    hub: MemoryHub, came: float, is_decided: bool
) -> None:
    async with stage(hub, CONFIG) as partners:
        pending = partners.send(refers())
        await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.event("e", "started", block="show", behavior="ref-event")
        partners.end(partners.request("show"))
        loop = asyncio.get_running_loop()
        loop.call_at(2.9, stand_still, 3.5)
        loop.call_at(3.5 + came, lambda: partners.event("e", "succeeded", block="show", behavior="ref-event"))
        outcome = await pending.outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.warnings == (() if is_decided else ("ref-event was never decided",))


@pytest.mark.parametrize(("came", "is_known"), [(SOON, True), (TOO_LATE, False)])
async def test_an_answer_that_came_while_generation_stood_still_is_in_the_outcome_of_its_turn(
    hub: MemoryHub, came: float, is_known: bool
) -> None:
    closed: list[TurnClosed] = []
    watcher = hub.join("watcher")
    with watcher.subscribe(keys.TURN_CLOSED) as inbox:
        async with stage(hub, CONFIG) as partners:
            pending = partners.send(says("f"))
            await partners.fragment_block("f")
            pair = {"kind": "adjacency_pair", "block": "f", "behavior": "end", "limit": 1.0}
            partners.event("e", "started", **pair)
            partners.end(partners.request("f"))
            await pending.outcome
            due = asyncio.get_running_loop().time() + 1.0 + CONFIG.decision_patience
            loop = asyncio.get_running_loop()
            loop.call_at(due - 0.1, stand_still, due + 0.5)
            loop.call_at(due + 0.5 + came, lambda: partners.event("e", "succeeded", **pair))
            received = await inbox.next(due + 5.0)
            assert received is not None
            assert isinstance(received.message, TurnClosed)
            closed.append(received.message)

    assert [event.state for event in closed[0].events] == ["succeeded" if is_known else "started"]


@pytest.mark.parametrize(("came", "is_lost"), [(SOON, False), (TOO_LATE, True)])
async def test_recognition_that_came_back_while_generation_stood_still_has_lost_no_event(
    hub: MemoryHub, came: float, is_lost: bool
) -> None:
    async with stage(hub, GenerationConfig(decision_patience=30.0)) as partners:
        run = hub.join("recognition").run
        event = f"{session_of(run)}-1"
        pending = partners.send(refers())
        await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.event(event, "started", block="show", behavior="ref-event")
        partners.end(partners.request("show"))
        await asyncio.sleep(1.0)
        loop = asyncio.get_running_loop()
        due = loop.time() + GRACE
        hub.announce(PeerGone(participant="recognition"))
        loop.call_at(due - 0.1, stand_still, due + 0.5)
        loop.call_at(due + 0.5 + came, hub.announce, PeerAlive(participant="recognition", run=run))
        await asyncio.sleep(GRACE + 2.0)

        assert pending.outcome.done() == is_lost
        partners.event(event, "succeeded", block="show", behavior="ref-event")
        await pending.outcome


# -- a rest that is refused since somebody is gone ----------------------------------------------------------------


@pytest.mark.parametrize("status", ["middle", "end"])
async def test_a_rest_that_is_refused_since_the_body_is_gone_ends_its_turn_and_its_cause_is_told(
    hub: MemoryHub, status: str
) -> None:
    async with stage(hub) as partners:
        first = partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        partners.end(partners.request("a"))
        await first.outcome
        partners.refusal = Fault(reason="no body performs it", cause="gone", whose="control", service="realizer")
        with pytest.raises(RequestRefused, match="no body performs it"):
            await partners.send(says("b", status)).outcome
        partners.refusal = None
        with pytest.raises(RequestRefused, match="b was refused: no body performs it") as refused:
            await partners.send(says("c", "end")).outcome
        following = partners.send(says("d"))
        await partners.fragment_block("d")
        partners.end(partners.request("d"))
        await following.outcome

    assert (refused.value.fault.cause, refused.value.fault.whose) == ("gone", "control")


async def test_a_rest_that_waits_in_vain_for_the_world_ends_its_turn(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(endings, "TURN_SILENCE", 100.0)
    async with stage(hub) as partners:
        first = partners.send(says("a", "beginning"))
        await partners.fragment_block("a")
        partners.end(partners.request("a"))
        await first.outcome
        eyes = hub.join("eyes")
        eyes.declare_alive()
        eyes.publish(keys.WORLD, TABLE)
        await asyncio.sleep(0.1)
        hub.kill("eyes")
        with pytest.raises(RequestRefused, match="the world is unknown") as unknown:
            await partners.send(says("b", "end")).outcome
        partners.see(TABLE)
        with pytest.raises(RequestRefused, match="b was refused") as refused:
            await partners.send(says("c", "end")).outcome

    assert refused.value.fault.cause == unknown.value.fault.cause == "gone"
