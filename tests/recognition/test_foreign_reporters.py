"""Programs of others that tell what people do: by events alone, or by states, too."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message, encode_json
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.units import Stamp
from engage_hri.services.reports.ongoing_actions import MOST
from tests.recognition.observations import ROBOT
from tests.recognition.reporting import Actor, Belief, Running, Stage, all_of


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
        await asyncio.sleep(1.9)
        assert stage.believed(carl) == Belief(True)
        await asyncio.sleep(0.2)

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


async def test_a_state_that_is_too_long_to_be_true_is_none(monkeypatch: pytest.MonkeyPatch):
    async with Running(monkeypatch, "recognition", "control") as stage:
        foreign, at = Foreign(stage), Foreign(stage).stamp
        foreign.goes_on(
            *(ActionBegan(actor="carl", action="point", at=at, targets=(f"t{n}",)) for n in range(MOST + 1))
        )
        await asyncio.sleep(1.0)

        assert stage.believed(Actor("carl")) == Belief(False)
