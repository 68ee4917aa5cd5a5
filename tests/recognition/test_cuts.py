"""What robot and people do survives links that are cut, and services that are restarted."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActorFound, ActorLost
from engage_hri.services.recognition.events.exchange import TURN_PATIENCE
from tests.bus.cuttable import CuttableHub
from tests.recognition.observations import ROBOT
from tests.recognition.reporting import GRACE, SPEECH, Belief, Running, all_of, ask, turn_ends

# -- the robot speaks ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [0.05, 3.0, GRACE + 2.0])
@pytest.mark.parametrize("tokens_first", [True, False])
async def test_a_pair_is_not_withdrawn_because_a_link_was_cut_while_the_robot_speaks(
    monkeypatch: pytest.MonkeyPatch, seconds: float, tokens_first: bool
):
    """A router that dies cuts all links. The pair is decided once the turn has ended."""
    async with Running(monkeypatch, hub=CuttableHub(tokens_first=tokens_first)) as stage:
        stage.comes(stage.ann)
        stage.begins(stage.robot, "speak", SPEECH)
        pair = await ask(stage, "adjacency_pair", "ann", turn="turn-1")
        stage.hub.cut("recognition", "control")
        await asyncio.sleep(seconds)
        stage.hub.join_up("recognition", "control")
        await asyncio.sleep(20.0)
        assert not pair.done()
        stage.ends(stage.robot, "speak", SPEECH)
        await turn_ends(stage)
        await asyncio.sleep(0.4)
        stage.begins(stage.ann, "nod")
        outcome = await pair

    assert (outcome.state, outcome.response) == ("succeeded", "nod")
    assert outcome.delay == pytest.approx(0.4)


async def test_words_that_end_during_a_cut_have_ended_when_they_did(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch) as stage:
        stage.comes(stage.ann)
        stage.begins(stage.robot, "speak", SPEECH)
        pair = await ask(stage, "adjacency_pair", "ann", turn="turn-1")
        stage.hub.cut("recognition", "control")
        await asyncio.sleep(1.0)
        stage.ends(stage.robot, "speak", SPEECH)
        last_word = stage.now
        await asyncio.sleep(1.0)
        stage.hub.join_up("recognition", "control")
        outcome = await pair

    assert (outcome.state, outcome.at.seconds) == ("withdrawn", last_word + TURN_PATIENCE)


async def test_a_body_that_stays_away_has_fallen_silent_when_it_went(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch) as stage:
        stage.comes(stage.ann)
        stage.begins(stage.robot, "speak", SPEECH)
        pair = await ask(stage, "adjacency_pair", "ann", turn="turn-1")
        gone = stage.now
        await stage.kill("control")
        outcome = await pair

    assert (outcome.state, outcome.at.seconds) == ("withdrawn", gone + TURN_PATIENCE)


async def test_what_the_former_life_of_a_body_did_has_ended_when_it_went(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch) as stage:
        stage.comes(stage.ann)
        stage.looks(stage.robot, "ann")
        stage.begins(stage.robot, "speak", SPEECH)
        stage.looks(stage.ann, ROBOT)
        gaze = await ask(stage, "mutual_facial_gaze", "ann")
        assert (await gaze).state == "succeeded"
        with stage.world.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            await asyncio.sleep(1.0)
            gone = stage.now
            await stage.kill("control")
            stage.robot.doing.clear()
            await asyncio.sleep(0.5)
            stage.start("control")
            await asyncio.sleep(0.5)
            ended = await all_of(inbox)

        assert stage.believed(stage.robot) == Belief(True)
    [completed] = [each for each in ended if each.state == "completed" and each.at.seconds >= gone]
    assert completed.started.seconds + (completed.duration or 0.0) == pytest.approx(gone)


# -- people look --------------------------------------------------------------------------------------------------


async def test_a_recognition_that_is_restarted_knows_who_has_been_looking_at_the_robot(
    monkeypatch: pytest.MonkeyPatch,
):
    async with Running(monkeypatch) as stage:
        stage.comes(stage.ann)
        stage.looks(stage.ann, ROBOT)
        await asyncio.sleep(20.0)
        await stage.kill("recognition")
        await asyncio.sleep(3.0)
        with stage.world.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            stage.start("recognition")
            await asyncio.sleep(1.0)
            told = await all_of(inbox)
            outcome = await (await ask(stage, "mutual_facial_gaze", "ann"))

    assert told == [], "what began in a former life of recognition was told then"
    assert (outcome.state, outcome.delay) == ("succeeded", 0.0)


async def test_a_look_that_ended_during_a_cut_is_over(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch, "recognition", "control", "cameras") as stage:
        stage.comes(stage.ann)
        stage.looks(stage.ann, "blue-square")
        await asyncio.sleep(5.0)
        stage.hub.cut("recognition", "cameras")
        await asyncio.sleep(1.0)
        stage.looks(stage.ann, "")
        await asyncio.sleep(1.0)
        stage.hub.join_up("recognition", "cameras")
        await asyncio.sleep(1.0)
        outcome = await (await ask(stage, "directed_gaze", "ann", "blue-square"))

    assert outcome.state == "failed"


@pytest.mark.parametrize("seconds", [1.0, 30.0])
async def test_a_cut_longer_than_the_history_costs_events_and_no_truth(
    monkeypatch: pytest.MonkeyPatch, seconds: float
):
    """Of what happened meanwhile only the last event and the states are left."""
    async with Running(monkeypatch, "recognition", "control", "cameras", hub=CuttableHub(kept=1)) as stage:
        stage.comes(stage.ann)
        stage.looks(stage.ann, "blue-square")
        stage.begins(stage.ann, "speak")
        await asyncio.sleep(5.0)
        stage.hub.cut("recognition", "cameras", "control")
        await asyncio.sleep(seconds / 2)
        stage.looks(stage.ann, ROBOT)
        stage.ends(stage.ann, "speak")
        stage.begins(stage.ann, "act", "rectangle")
        stage.comes(stage.bob)
        stage.looks(stage.bob, "rectangle")
        stage.looks(stage.robot, "bob")
        stage.begins(stage.robot, "speak", SPEECH)
        await asyncio.sleep(seconds / 2)
        stage.hub.join_up("recognition", "cameras", "control")
        await asyncio.sleep(1.0)
        wrong = {
            id: stage.believed(actor) for id, actor in stage.actors.items() if stage.believed(actor) != actor.truth
        }

    assert wrong == {}


async def test_what_is_older_than_anything_believed_keeps_its_order(monkeypatch: pytest.MonkeyPatch):
    """Its times are all cut to the oldest, but it does not become one instant."""
    async with Running(monkeypatch, "recognition", "control", "cameras") as stage:
        stage.comes(stage.ann)
        stage.hub.cut("recognition", "cameras")
        for target in (ROBOT, "", ROBOT, "blue-square", ROBOT):
            await asyncio.sleep(1.0)
            stage.looks(stage.ann, target)
        await asyncio.sleep(100.0)
        stage.hub.join_up("recognition", "cameras")
        await asyncio.sleep(0.2)

        assert stage.believed(stage.ann) == Belief(True, looks=ROBOT)


async def test_a_reporter_that_is_restarted_tells_anew_what_it_sees(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch, "recognition", "control", "cameras") as stage:
        for person in (stage.ann, stage.bob):
            stage.comes(person)
        stage.looks(stage.ann, "blue-square")
        stage.begins(stage.bob, "speak")
        await asyncio.sleep(5.0)
        await stage.kill("cameras")
        stage.looks(stage.ann, ROBOT)
        stage.goes(stage.bob)
        await asyncio.sleep(0.7)
        stage.start("cameras")
        await asyncio.sleep(2.1)

        assert stage.believed(stage.ann) == Belief(True, looks=ROBOT)
        assert stage.believed(stage.bob) == Belief(False)


async def test_with_two_reporters_of_one_person_each_may_vanish(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch) as stage:
        stage.comes(stage.ann)
        stage.looks(stage.ann, ROBOT)
        await asyncio.sleep(5.0)
        for name in ("cameras", "others"):
            await stage.kill(name)
            await asyncio.sleep(20.0)
            assert stage.believed(stage.ann) == Belief(True, looks=ROBOT)
            stage.start(name)
            await asyncio.sleep(20.0)
            assert stage.believed(stage.ann) == Belief(True, looks=ROBOT)
        await stage.kill("cameras", "others")
        await asyncio.sleep(GRACE + 0.1)

        assert stage.believed(stage.ann) == Belief(False)


async def test_a_face_that_was_lost_for_long_looks_where_it_looked(monkeypatch: pytest.MonkeyPatch):
    """The camera says once that a look has begun; the person left for recognition, and was found again."""
    async with Running(monkeypatch, "recognition", "control", "cameras") as stage:
        stage.comes(stage.ann)
        stage.looks(stage.ann, ROBOT)
        await asyncio.sleep(5.0)
        cameras = stage.reporters["cameras"]
        cameras.tell(stage.ann, ActorLost, stage.now)
        await asyncio.sleep(3.0)
        assert stage.believed(stage.ann) == Belief(False)
        cameras.tell(stage.ann, ActorFound, stage.now)
        await asyncio.sleep(1.0)

        assert stage.believed(stage.ann) == Belief(True, looks=ROBOT)
