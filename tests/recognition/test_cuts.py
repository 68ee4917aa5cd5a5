"""What robot and people do survives links that are cut, and services that are restarted."""

import asyncio
import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.behaviors import Event, TurnSignal
from engage_hri.schemas.messages import Message, encode_json
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent, SignalTurn
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Subscription
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.requests.ends import Requester
from tests.bus.cuttable import CuttableHub
from tests.conftest import virtual_loop
from tests.recognition.observations import ROBOT
from tests.recognition.reporting import Actor, Belief, Stage

GRACE = RecognitionConfig().report_grace
EVERYBODY = ("recognition", "control", "cameras", "others", "realizer")
SPEECH = "block-1:speech-1"


class Running:
    """A stage with all on it, and a realizer that asks."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *names: str, hub: CuttableHub | None = None, **config: Any
    ) -> None:
        self.hub = hub or CuttableHub()
        self.stage = Stage(self.hub, monkeypatch, **config)
        self._names = names or EVERYBODY[:-1]

    async def __aenter__(self) -> Stage:
        self.stage.start(*self._names)
        await asyncio.sleep(0.1)
        return self.stage

    async def __aexit__(self, *raised: object) -> None:
        await self.stage.kill("recognition")
        await self.hub.close()


async def ask(stage: Stage, kind: str, person: str, *objects: str, **event: Any) -> "asyncio.Task[EventOutcome]":
    """Ask for an event; returns the task that has its outcome."""
    realizer = stage.hub._buses.get("realizer") or stage.hub.join("realizer")
    realizer.declare_alive()
    asked = Event(id=f"{kind}-1", kind=kind, responder=person, objects=objects, **event)  # type: ignore[arg-type]

    async def outcome() -> EventOutcome:
        async with Requester(realizer) as requests:
            request = RequestEvent(id="r", requester="realizer", block="block-1", at=realizer.stamp(), event=asked)
            decided = await requests.send(keys.EVENT, request).outcome
        assert isinstance(decided, EventOutcome)
        return decided

    task = asyncio.create_task(outcome(), name="realizer")
    await asyncio.sleep(0.05)
    return task


async def all_of(inbox: Subscription) -> list[ConnectionEvent]:
    """The events that have come."""
    received = [await inbox.next() for _ in range(len(inbox))]
    return [each.message for each in received if each is not None and isinstance(each.message, ConnectionEvent)]


async def turn_ends(stage: Stage) -> None:
    realizer = stage.hub._buses["realizer"]
    signal = TurnSignal(id="turn", turn="turn-1", signal="ended", actor="ann")
    async with Requester(realizer) as requests:
        await requests.send(
            keys.TURN, SignalTurn(id="s", requester="realizer", signal=signal, at=realizer.stamp())
        ).outcome


# -- the robot speaks ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [0.05, 3.0, GRACE + 2.0])
@pytest.mark.parametrize("tokens_first", [True, False])
async def test_a_pair_is_not_withdrawn_because_a_link_was_cut_while_the_robot_speaks(
    monkeypatch: pytest.MonkeyPatch, seconds: float, tokens_first: bool
):
    """A router that dies cuts all links. The pair fails or succeeds as the person answers, once the turn has ended."""
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

    assert (outcome.state, outcome.at.seconds) == ("withdrawn", last_word + RecognitionConfig().turn_patience)


async def test_a_body_that_stays_away_has_fallen_silent_when_it_went(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch) as stage:
        stage.comes(stage.ann)
        stage.begins(stage.robot, "speak", SPEECH)
        pair = await ask(stage, "adjacency_pair", "ann", turn="turn-1")
        gone = stage.now
        await stage.kill("control")
        outcome = await pair

    assert (outcome.state, outcome.at.seconds) == ("withdrawn", gone + RecognitionConfig().turn_patience)


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


async def test_a_recognition_that_is_restarted_knows_who_has_been_looking_at_the_robot(monkeypatch: pytest.MonkeyPatch):
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
        wrong = {id: stage.believed(actor) for id, actor in stage.actors.items() if stage.believed(actor) != actor.truth}

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
        await asyncio.sleep(1.0)

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


# -- programs of others -------------------------------------------------------------------------------------------


class Foreign:
    """A program that knows Zenoh and JSON: no envelope, no token, no history."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def says(self, message: Message, key: str = keys.PERCEIVED_ACTION) -> None:
        self._stage.hub.inject(key, encode_json(message), "application/json", life="zid")

    def goes_on(self, *actions: ActionBegan) -> None:
        state = OngoingActions(actor="carl", at=self.stamp, actions=actions, seen=True)
        self.says(state, keys.perceived_ongoing("tracker", "carl"))

    @property
    def stamp(self) -> Stamp:
        return self._stage.world.stamp()


async def test_a_program_that_only_sends_events_works_as_ever(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch, "recognition", "control") as stage:
        carl, foreign = Actor("carl"), Foreign(stage)
        foreign.says(ActorFound(actor="carl", at=foreign.stamp))
        foreign.says(ActionBegan(actor="carl", action="look", at=foreign.stamp, targets=(ROBOT,)))
        foreign.says(ActionBegan(actor="carl", action="speak", at=foreign.stamp))
        await asyncio.sleep(30.0)
        assert stage.believed(carl) == Belief(True, looks=ROBOT, speaks=True)
        foreign.says(ActionEnded(actor="carl", action="speak", at=foreign.stamp))
        foreign.says(ActionEnded(actor="carl", action="look", at=foreign.stamp))
        await asyncio.sleep(1.0)
        assert stage.believed(carl) == Belief(True)
        foreign.says(ActorLost(actor="carl", at=foreign.stamp))
        await asyncio.sleep(1.0)

        assert stage.believed(carl) == Belief(False)


async def test_a_program_that_tells_states_makes_up_for_lost_events(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch, "recognition", "control") as stage:
        carl, foreign = Actor("carl"), Foreign(stage)
        look = ActionBegan(actor="carl", action="look", at=foreign.stamp, targets=(ROBOT,))
        speech = ActionBegan(actor="carl", action="speak", at=foreign.stamp)
        foreign.goes_on(look, speech)
        await asyncio.sleep(1.0)
        assert stage.believed(carl) == Belief(True, looks=ROBOT, speaks=True)
        foreign.goes_on(speech)
        await asyncio.sleep(1.0)

        assert stage.believed(carl) == Belief(True, speaks=True)


async def test_a_short_break_in_a_look_is_none_also_for_one_who_tells_states(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch, "recognition", "control") as stage:
        foreign = Foreign(stage)
        look = ActionBegan(actor="carl", action="look", at=foreign.stamp, targets=(ROBOT,))
        for _ in range(2):
            foreign.says(look)
            foreign.goes_on(look)
        with stage.world.subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            await asyncio.sleep(0.5)
            foreign.says(ActionEnded(actor="carl", action="look", at=foreign.stamp, targets=(ROBOT,)))
            foreign.goes_on()
            await asyncio.sleep(0.1)
            again = ActionBegan(actor="carl", action="look", at=foreign.stamp, targets=(ROBOT,))
            foreign.says(again)
            foreign.goes_on(again)
            await asyncio.sleep(0.5)
            told = [(event.kind, event.state) for event in await all_of(inbox)]

    assert told == [("mutual_facial_gaze", "started")]


@pytest.mark.parametrize("reporter", ["others", "cameras"])
async def test_nobody_tells_the_state_of_another_reporter(monkeypatch: pytest.MonkeyPatch, reporter: str):
    async with Running(monkeypatch, "recognition", "control", "cameras") as stage:
        stage.comes(stage.ann)
        stage.looks(stage.ann, ROBOT)
        liar = stage.hub.join("others")
        state = OngoingActions(actor="ann", at=liar.stamp(), seen=False)
        liar.publish(keys.perceived_ongoing(reporter, "ann"), state)
        await asyncio.sleep(1.0)

        assert stage.believed(stage.ann) == Belief(True, looks=ROBOT)


# -- anything, against who knows the truth ------------------------------------------------------------------------

PLACES = ("blue-square", "rectangle", ROBOT, "ann", "")
PAUSES = (0.01, 0.01, 0.05, 0.3, 0.3, 1.0, 1.0, 3.0, 6.0, 30.0)
DOES = ("looks", "looks", "looks", "speaks", "acts", "moves", "moves")
BREAKS = ("cut", "cut", "joins", "blinks", "blinks", "router", "kills", "starts", "starts")


class Play:
    """Random steps on a stage. chance: draws them."""

    def __init__(self, stage: Stage, chance: random.Random) -> None:
        self.stage = stage
        self.log: list[str] = []
        self._chance = chance

    async def step(self) -> None:
        stage, chance = self.stage, self._chance
        actor = chance.choice(list(stage.actors.values()))
        what = chance.choice((*DOES, *DOES, *BREAKS))
        names = chance.sample(EVERYBODY[:-1], 2)
        self.log.append(f"{stage.now:g} {what} {actor.id} {names}")
        match what:
            case "blinks":
                stage.hub.cut("recognition", *names)
                for _ in range(chance.randint(1, 3)):
                    await asyncio.sleep(chance.choice((0.01, 0.5, 2.0)))
                    self._does(chance.choice(DOES), chance.choice(list(stage.actors.values())))
                stage.hub.join_up("recognition", *names)
            case "cut":
                stage.hub.cut(*names)
            case "joins":
                stage.hub.join_up(*names)
            case "router":
                stage.hub.cut(*EVERYBODY)
                await asyncio.sleep(chance.choice((0.05, 2.0)))
                stage.hub.join_up(*EVERYBODY)
            case "kills":
                await stage.kill(names[0])
            case "starts":
                stage.start(names[0])
            case _:
                self._does(what, actor)
        await asyncio.sleep(chance.choice(PAUSES))

    def _does(self, what: str, actor: Actor) -> None:
        stage = self.stage
        match what:
            case "looks" if actor.is_here:
                stage.looks(actor, self._chance.choice([place for place in PLACES if place != actor.id]))
            case "speaks" if actor.is_here:
                self._toggle(actor, "speak", SPEECH if actor is stage.robot else "")
            case "acts" if actor.is_here and actor is not stage.robot:
                self._toggle(actor, "act", "rectangle")
            case "moves" if actor is not stage.robot:
                (stage.goes if actor.is_here else stage.comes)(actor)

    def _toggle(self, actor: Actor, action: Any, about: str) -> None:
        if (action, about) in actor.doing:
            self.stage.ends(actor, action, about)
        else:
            self.stage.begins(actor, action, about)

    async def heal(self) -> None:
        """Everything is there and joined, and has caught up."""
        self.stage.start(*EVERYBODY[:-1])
        self.stage.hub.join_up(*EVERYBODY)
        await asyncio.sleep(GRACE + 2.0)


def believed_wrongly(seed: int, steps: int, **faults: Any) -> list[str]:
    """What recognition has wrong after a play of so many steps, and healing; the play before that."""

    async def play() -> list[str]:
        with pytest.MonkeyPatch.context() as monkeypatch:
            hub = CuttableHub(seed=seed, **faults)
            async with Running(monkeypatch, hub=hub, longest_speech=1e6, longest_manipulation=1e6) as stage:
                play = Play(stage, random.Random(seed))
                for _ in range(steps):
                    await play.step()
                await play.heal()
                beliefs = [(actor, stage.believed(actor)) for actor in stage.actors.values()]
        wrong = [f"{actor.id}: {belief}, not {actor.truth}" for actor, belief in beliefs if belief != actor.truth]
        return [*play.log, *wrong] if wrong else []

    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        return runner.run(play())


FAULTS = st.fixed_dictionaries(
    {"kept": st.sampled_from((0, 1, 4096)), "tokens_first": st.booleans(), "loss": st.sampled_from((0.0, 0.3))}
)


@settings(max_examples=200)
@given(st.integers(0, 10**6), st.integers(1, 40), FAULTS)
def test_after_healing_recognition_believes_what_is_true(seed: int, steps: int, faults: dict[str, Any]):
    assert believed_wrongly(seed, steps, **faults) == []
