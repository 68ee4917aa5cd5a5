"""Questions of the realizer to the body: none twice in one planning, and each anew in the next."""

from collections.abc import Sequence
from functools import partial

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Constraint, Gaze, GazeShift, Pointing, Speech, Synchronize
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from tests.random_cases import share_of
from tests.realizer.exact_blocks import WORLD, random_block

POINTED_OUT = Block(
    id="ask",
    behaviors=(
        Speech(id="please", text="Please move"),
        Gaze(id="look", target="box"),
        Pointing(id="point", target="box", mode="RIGHT_HAND"),
        Speech(id="phrase", text="the blue piece"),
        Gaze(id="back", target="human"),
    ),
    constraints=(
        Constraint(
            operators=(
                Synchronize(ref="please:end", syncs=("look:start", "point:start")),
                Synchronize(ref="point:stroke", syncs=("phrase:start",)),
                Synchronize(ref="phrase:end", syncs=("back:start", "point:stroke_end")),
            )
        ),
    ),
)
LOOK = Block(id="look", behaviors=(Gaze(id="g", target="ball"),))


class Asked(SimulatedBody):
    """A body that notes what it was asked, and what it said."""

    def __init__(self) -> None:
        super().__init__()
        self.questions: list[tuple[EstimateItem, ...]] = []
        self.answers: list[tuple[Estimate, ...]] = []

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        answer = tuple(super().rehearse(items, world, others))
        self.questions.append(tuple(items))
        self.answers.append(answer)
        return answer


async def perform(*blocks: Block, worlds: Sequence[World] = ()) -> Asked:
    """What the body was asked, for blocks one after the other. worlds: what it sees before each, else as before."""
    body = Asked()
    async with MemoryHub() as hub:
        eyes, bus = hub.join("simulation"), hub.join("test")
        services = {
            "control": partial(embody, config=ControlConfig(), body=body),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        eyes.publish(keys.WORLD, WORLD)
        async with running(hub, services), Requester(bus) as requests:
            for number, block in enumerate(blocks):
                if number < len(worlds):
                    eyes.publish(keys.WORLD, worlds[number])
                request = PerformBlock(id=f"r{number}", requester="test", block=block)
                outcome = await requests.send(keys.BLOCK, request).outcome
                assert isinstance(outcome, BlockOutcome)
        await bus.leave()
        await eyes.leave()
    return body


async def test_a_plan_about_which_the_body_was_asked_already_is_not_asked_about_again() -> None:
    body = await perform(POINTED_OUT)

    first, *about_plans = body.questions
    assert not any(item.times for item in first)
    assert all(any(item.times for item in question) for question in about_plans)
    assert 1 <= len(about_plans) <= 2
    assert not any(question in body.questions[:number] for number, question in enumerate(body.questions))


@pytest.mark.parametrize("seed", range(200, 200 + share_of(40)))
async def test_no_question_follows_itself(seed: int) -> None:
    body = await perform(replace(random_block(seed, shifts=True), constraints=()))

    assert body.questions
    assert not any(one == other for one, other in zip(body.questions, body.questions[1:], strict=False))


async def test_the_same_block_again_is_asked_about_again() -> None:
    body = await perform(LOOK, LOOK)

    assert body.questions == [body.questions[0]] * 2


async def test_what_was_said_before_an_entity_moved_is_not_used_after_it() -> None:
    ball, *others = (each for each in sorted(WORLD.entities, key=lambda each: each.id != "ball"))
    moved = World(entities=(replace(ball, position=(0.6, -0.4, 0.75)), *others))
    before, after = await perform(LOOK), await perform(LOOK, LOOK, worlds=(WORLD, moved))

    assert after.answers[0] == before.answers[0]
    assert after.questions[1] == after.questions[0]
    assert after.answers[1] != after.answers[0]


async def test_what_was_said_before_the_body_moved_is_not_used_after_it() -> None:
    turned = Block(id="turned", behaviors=(GazeShift(id="s", target="box"),))
    at_rest, moved = await perform(LOOK), await perform(turned, LOOK)

    assert moved.questions[-1] == at_rest.questions[0]
    assert moved.answers[-1] != at_rest.answers[0]
