"""After any cuts, restarts and losses, recognition believes what is true: against who knows the truth."""

import asyncio
import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.services.recognition.events import person
from tests.bus.cuttable import CuttableHub
from tests.conftest import virtual_loop
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT
from tests.recognition.reporting import GRACE, SERVICES, SPEECH, Actor, Running, Stage

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
        names = chance.sample(SERVICES, 2)
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
                stage.hub.cut(*SERVICES)
                await asyncio.sleep(chance.choice((0.05, 2.0)))
                stage.hub.join_up(*SERVICES)
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
        self.stage.start(*SERVICES)
        self.stage.hub.join_up(*SERVICES)
        await asyncio.sleep(GRACE + 2.0)


def believed_wrongly(seed: int, steps: int, **faults: Any) -> list[str]:
    """What recognition has wrong after a play of so many steps, and healing; the play before that."""

    async def play() -> list[str]:
        with pytest.MonkeyPatch.context() as monkeypatch:
            hub = CuttableHub(seed=seed, **faults)
            monkeypatch.setattr(person, "LONGEST", {"speak": 1e6, "act": 1e6})
            async with Running(monkeypatch, hub=hub) as stage:
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


@settings(max_examples=share_of(200))
@given(st.integers(0, 10**6), st.integers(1, 40), FAULTS)
def test_after_healing_recognition_believes_what_is_true(seed: int, steps: int, faults: dict[str, Any]):
    assert believed_wrongly(seed, steps, **faults) == []
